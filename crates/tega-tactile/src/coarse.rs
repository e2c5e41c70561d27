//! Decide a threshold on 16-bit sums: weights small enough for byte multiplication that sort pixels as the exact ones do.
//!
//! Grey values `n = Σ w·d` of three differences `d` from 0 to 255 take 18 bits and more. With weights `c` of 7 bits, nearly
//! proportional to `w`, `q = Σ c·d` fits 16 bits, and `n ≥ first` is the same as `q ≥ border` for most `first`. Whether it is the
//! same is found out by going through the few pixels whose `q` leaves it open; where it is not, the exact count is taken.

/// Largest coarse weight, the range of a signed byte.
const MAX_COARSE: i64 = 127;
/// Pixels to go through before the exact count costs less.
const MOST_TRIED: i64 = 2048;

/// Coarse weights of one set of exact ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Coarse {
    weights: [i64; 3],
    largest: i64,
    /// c, as the bytes of a pixel lie.
    coarse: [i64; 3],
    /// The c of the largest weight.
    scale: i64,
}

impl Coarse {
    /// The 7-bit weights closest to being proportional; `None` where a weight is negative or the fit is poor.
    pub(crate) fn of(weights: [i32; 3]) -> Option<Self> {
        let weights = weights.map(i64::from);
        let largest = *weights.iter().max()?;
        if largest <= 0 || weights.iter().any(|weight| *weight < 0) {
            return None;
        }
        let rounded = |scale: i64| weights.map(|weight| (2 * weight * scale + largest) / (2 * largest));
        let miss = |scale: i64| {
            let coarse = rounded(scale);
            let missed = (0..3).map(|i| (weights[i] * scale - coarse[i] * largest).abs()).max();
            missed.unwrap_or_default() as f64 / scale as f64
        };
        let scale = (1..=MAX_COARSE).min_by(|a, b| miss(*a).total_cmp(&miss(*b)))?;
        let found = Self { weights, largest, coarse: rounded(scale), scale };
        // Then k·n ≥ q·largest/2, so that a q beyond twice the border leaves nothing open (see `border`).
        let short: f64 = (0..3).map(|i| (-found.rest(i)).max(0) as f64 / found.coarse[i].max(1) as f64).sum();
        (2.0 * short <= largest as f64).then_some(found)
    }

    /// c as signed bytes.
    pub(crate) fn bytes(&self) -> [i8; 3] {
        self.coarse.map(|c| c as i8)
    }

    /// What is left of a channel's weight: `scale·n = largest·q + Σ rest·d`.
    fn rest(&self, channel: usize) -> i64 {
        self.weights[channel] * self.scale - self.coarse[channel] * self.largest
    }

    /// The `border` for which `q ≥ border` is `n ≥ first` for every pixel; `None` where there is none, or finding it is long.
    pub(crate) fn border(&self, first: i32) -> Option<i16> {
        let goal = self.scale * i64::from(first);
        if goal <= 0 {
            return None;
        }
        // Pixels up to `far` leave between `low` and `high` open; those beyond are at or above `first` (see `of`).
        let far = 2 * (goal / self.largest) + 256;
        let spread = |sign: i64| -> i64 {
            let most = |channel: usize| far.checked_div(self.coarse[channel]).unwrap_or(255).min(255);
            (0..3).map(|channel| (sign * self.rest(channel)).max(0) * most(channel)).sum()
        };
        let low = ceil_div(goal - spread(1), self.largest).max(0);
        let high = ceil_div(goal + spread(-1), self.largest);
        let [a, b, last] = self.by_size();
        let most = |channel: usize, left: i64| (left / self.coarse[channel].max(1)).min(255);
        if high > i64::from(i16::MAX) || (high - low) * (most(a, high) + 1) * (most(b, high) + 1) > MOST_TRIED
        {
            return None;
        }
        // Upwards: first the sums that lie below, then those that lie above.
        let mut border = high;
        for q in low..high {
            let (mut above, mut below) = (false, false);
            let mut tell = |n: i64| if n >= i64::from(first) { above = true } else { below = true };
            for d_a in 0..=most(a, q) {
                let left = q - d_a * self.coarse[a];
                for d_b in 0..=most(b, left) {
                    let left = left - d_b * self.coarse[b];
                    let n = d_a * self.weights[a] + d_b * self.weights[b];
                    let c = self.coarse[last];
                    if c == 0 && left == 0 {
                        tell(n);
                        tell(n + 255 * self.weights[last]);
                    } else if c > 0 && left % c == 0 && left / c <= 255 {
                        tell(n + left / c * self.weights[last]);
                    }
                }
            }
            if below && (above || border < high) {
                return None;
            }
            if above && border == high {
                border = q;
            }
        }
        i16::try_from(border).ok().filter(|border| *border > 0)
    }

    /// Channels by their coarse weight, largest first.
    fn by_size(&self) -> [usize; 3] {
        let mut order = [0, 1, 2];
        order.sort_by_key(|channel| -self.coarse[*channel]);
        order
    }
}

fn ceil_div(a: i64, b: i64) -> i64 {
    -(-a).div_euclid(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn luma_is_met_within_a_ten_thousandth() {
        let coarse = Coarse::of([114, 587, 299]).unwrap();
        assert_eq!(coarse.coarse, [21, 108, 55]);
        // 2.03 grey values: what the bench's picture asks for.
        assert_eq!(coarse.border(2034), Some(375));
    }

    #[test]
    fn a_weight_below_zero_has_none() {
        assert_eq!(Coarse::of([-100, 800, 300]), None);
        assert_eq!(Coarse::of([0, 0, 0]), None);
    }

    proptest! {
        #[test]
        fn a_border_sorts_every_pixel_as_the_exact_weights_do(
            weights in prop_oneof![
                Just([114, 587, 299]),
                [0_i32..8000, 0_i32..2000, 0_i32..20],
                [0_i32..700, 0_i32..700, 0_i32..700],
            ],
            grey in 0_i32..12,
            part in 0_i32..1000,
            pixels in prop::collection::vec([0_i64..256, 0_i64..30, 0_i64..30], 200),
        ) {
            let first = (grey * 1000 + part) * weights.iter().sum::<i32>() / 1000;
            if let Some(coarse) = Coarse::of(weights)
                && let Some(border) = coarse.border(first)
            {
                let sum = |by: [i64; 3], d: [i64; 3]| (0..3).map(|i| by[i] * d[i]).sum::<i64>();
                // Pixels near the border are the ones that could be sorted wrongly.
                let near = (0..40).flat_map(|a| (0..40).map(move |b| [a, b, 0])).flat_map(|[a, b, _]| {
                    [[a, b, 0], [a, 0, b], [0, a, b], [a, b, a]]
                });
                for d in pixels.into_iter().chain(near) {
                    prop_assert_eq!(
                        sum(coarse.coarse, d) >= i64::from(border),
                        sum(weights.map(i64::from), d) >= i64::from(first),
                        "{:?} {:?} {}", d, coarse, border
                    );
                }
            }
        }
    }
}
