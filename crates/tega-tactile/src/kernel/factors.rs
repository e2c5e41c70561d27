//! Write integer weights as products of a byte and a word, so that one multiplication of bytes and one of words weigh a pixel.
//!
//! A pixel's three bytes become four, one of them twice: two pairs, each weighed and added by `pmaddubsw`, and the two
//! sums weighed and added by `pmaddwd`. The level is exact, since no pair's byte factors add up to more than 128 and
//! 128 · 255 fits into a signed word.

use std::array::from_fn;

/// Largest sum of one pair's |byte factors|.
const MOST: i32 = 128;
/// Largest |byte factor|.
const LARGEST: i32 = i8::MAX as i32;

/// Weights as products.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Factors {
    /// Which channel each of the four bytes is.
    pub channels: [u8; 4],
    /// What each byte is multiplied by.
    pub bytes: [i8; 4],
    /// What each pair's sum is multiplied by.
    pub words: [i16; 2],
}

impl Factors {
    /// One set of factors whose products are the weights, where there is one: for every usual kind of grey.
    pub fn of(weights: [i32; 3]) -> Option<Self> {
        // Whichever channel stands twice gets its weight from both pairs.
        [[0, 1, 2], [0, 2, 1], [1, 0, 2]].into_iter().find_map(|[first, twice, second]| {
            let [a, b, c] = [first, twice, second].map(|channel: usize| weights[channel]);
            divisors(a).find_map(|[byte_a, word_0]| {
                divisors(c).find_map(|[byte_c, word_1]| {
                    let reach = (MOST - byte_a).min(LARGEST);
                    (-reach..=reach).find_map(|byte_0| {
                        let byte_1 = quotient(b - word_0 * byte_0, word_1)?;
                        (byte_1.abs() <= (MOST - byte_c).min(LARGEST)).then(|| Self {
                            channels: [first, twice, second, twice].map(|channel| channel as u8),
                            bytes: [byte_a, byte_0, byte_c, byte_1].map(|byte| byte as i8),
                            words: [word_0 as i16, word_1 as i16],
                        })
                    })
                })
            })
        })
    }

    /// Two sets whose products add up to the weights, for any weights up to [`MAX_WEIGHT`](super::MAX_WEIGHT).
    pub fn both(weights: [i32; 3]) -> [Self; 2] {
        let high = weights.map(|weight| (weight + MOST / 2).div_euclid(MOST));
        let low: [i32; 3] = from_fn(|c| weights[c] - MOST * high[c]);
        [(high, MOST), (low, 1)].map(|(part, word)| Self {
            channels: [0, 1, 2, 1],
            bytes: [part[0], part[1], part[2], 0].map(|byte| byte as i8),
            words: [word as i16; 2],
        })
    }
}

/// Ways to write a number as a byte of 1 or more times a word.
fn divisors(n: i32) -> impl Iterator<Item = [i32; 2]> {
    (1..=LARGEST).filter(move |byte| n % byte == 0).map(move |byte| [byte, n / byte])
}

/// `n / divisor` where that is whole; 0 is 0 times 0.
fn quotient(n: i32, divisor: i32) -> Option<i32> {
    if divisor == 0 { (n == 0).then_some(0) } else { (n % divisor == 0).then(|| n / divisor) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{MAX_WEIGHT, MAX_WEIGHT_SUM};
    use proptest::prelude::*;

    fn products(sets: &[Factors]) -> [i32; 3] {
        let mut weights = [0; 3];
        for set in sets {
            for k in 0..4 {
                weights[usize::from(set.channels[k])] +=
                    i32::from(set.bytes[k]) * i32::from(set.words[k / 2]);
            }
        }
        weights
    }

    fn fits(set: &Factors) -> bool {
        set.bytes
            .as_chunks::<2>()
            .0
            .iter()
            .all(|pair| pair.iter().map(|byte| i32::from(*byte).abs()).sum::<i32>() <= MOST)
    }

    #[test]
    fn usual_greys_take_one_set() {
        for weights in
            [[114, 587, 299], [299, 587, 114], [722, 7152, 2126], [1, 1, 1], [0, 1, 0], [0, 0, 0], [1, 2, 1]]
        {
            let set = Factors::of(weights).unwrap();
            assert_eq!((products(&[set]), fits(&set)), (weights, true));
        }
        // Not every weight can be written so.
        assert_eq!(Factors::of([974, 3205, 5821]), None);
        assert_eq!(Factors::of([433, 1, 566]), None);
    }

    proptest! {
        #[test]
        fn products_are_the_weights(weights in [-MAX_WEIGHT..=MAX_WEIGHT, -MAX_WEIGHT..=MAX_WEIGHT, -MAX_WEIGHT..=MAX_WEIGHT]) {
            prop_assume!(weights.iter().map(|weight| weight.abs()).sum::<i32>() <= MAX_WEIGHT_SUM);
            let sets = Factors::both(weights);
            prop_assert_eq!(products(&sets), weights);
            prop_assert!(sets.iter().all(fits));
            if let Some(set) = Factors::of(weights) {
                prop_assert_eq!(products(&[set]), weights);
                prop_assert!(fits(&set));
            }
        }
    }
}
