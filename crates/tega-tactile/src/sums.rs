//! The way through the images for weights of any size: exact sums per channel, weights last.
//!
//! The moments are linear in the channels, so the sums are plain integers whatever the weights are; only the peak and
//! the threshold count weigh every pixel, in big integers. Slow, exact, and rarely needed (see `levels`).

use num_bigint::BigInt;

use crate::exact::Sums;
use crate::frame::{Difference, Pair};

/// The grey level of a pixel: `Σ weight·difference`.
fn weigh(weights: &[BigInt; 3], d: [i16; 3]) -> BigInt {
    &weights[0] * d[0] + &weights[1] * d[1] + &weights[2] * d[2]
}

/// Sums over all pixels of one channel's difference `d`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct ChannelSums {
    /// Σ d.
    pub mass: i64,
    /// Σ x·d, Σ y·d.
    pub first: [i64; 2],
    /// Σ (x² + y²)·d.
    pub second: i64,
    /// Σ d·d′ with the three channels d′ of the same pixel.
    pub products: [i64; 3],
}

/// What one reading of frame and baseline yields.
pub(crate) struct Reading {
    pub channels: [ChannelSums; 3],
    /// Largest grey level and its first place in row order.
    pub peak: BigInt,
    pub peak_xy: (usize, usize),
}

/// Reads both images once. `squares` asks for the products that the intensity spread needs.
pub(crate) fn read(pair: &Pair<'_>, difference: Difference, weights: &[BigInt; 3], squares: bool) -> Reading {
    let mut channels = [ChannelSums::default(); 3];
    let mut peak: Option<(BigInt, (usize, usize))> = None;
    pair.for_each_row(|y, frame, baseline| {
        let mut row = [ChannelSums::default(); 3];
        let y = y as i64;
        for (x, (f, b)) in frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0).enumerate() {
            let d = [difference.of(f[0], b[0]), difference.of(f[1], b[1]), difference.of(f[2], b[2])];
            for (sums, d_c) in row.iter_mut().zip(d) {
                let (x, d_c) = (x as i64, i64::from(d_c));
                sums.mass += d_c;
                sums.first[0] += x * d_c;
                sums.second += x * x * d_c;
                if squares {
                    for (product, other) in sums.products.iter_mut().zip(d) {
                        *product += d_c * i64::from(other);
                    }
                }
            }
            let level = weigh(weights, d);
            if peak.as_ref().is_none_or(|(best, _)| level > *best) {
                peak = Some((level, (x, y as usize)));
            }
        }
        for (total, row) in channels.iter_mut().zip(row) {
            total.mass += row.mass;
            total.first[0] += row.first[0];
            total.first[1] += y * row.mass;
            total.second += row.second + y * y * row.mass;
            for (total, row) in total.products.iter_mut().zip(row.products) {
                *total += row;
            }
        }
    });
    let (peak, peak_xy) = peak.unwrap_or_else(|| (weigh(weights, [0; 3]), (0, 0)));
    Reading { channels, peak, peak_xy }
}

/// Number of pixels whose grey level is at least `first`.
pub(crate) fn count_from(
    pair: &Pair<'_>,
    difference: Difference,
    weights: &[BigInt; 3],
    first: &BigInt,
) -> u32 {
    let mut count = 0;
    pair.for_each_row(|_, frame, baseline| {
        for (f, b) in frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0) {
            let d = [difference.of(f[0], b[0]), difference.of(f[1], b[1]), difference.of(f[2], b[2])];
            count += u32::from(weigh(weights, d) >= *first);
        }
    });
    count
}

/// The channels' sums put together with integer weights.
pub(crate) fn weigh_sums(
    channels: &[ChannelSums; 3],
    weights: &[BigInt; 3],
    denominator: &BigInt,
    squares: bool,
) -> Sums<BigInt> {
    let combine = |part: &dyn Fn(&ChannelSums) -> i64| -> BigInt {
        channels.iter().zip(weights).map(|(sums, weight)| weight * part(sums)).sum()
    };
    let squares =
        squares.then(|| (0..3).map(|c| &weights[c] * combine(&|sums: &ChannelSums| sums.products[c])).sum());
    Sums {
        mass: combine(&|s| s.mass),
        first: [combine(&|s| s.first[0]), combine(&|s| s.first[1])],
        second: combine(&|s| s.second),
        squares,
        denominator: denominator.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn sums_of_one_bright_pixel() {
        let baseline = Array3::<u8>::zeros((3, 4, 3));
        let mut frame = baseline.clone();
        frame[[2, 3, 1]] = 10;
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let weights = [1, 2, 3].map(BigInt::from);
        let reading = read(&pair, Difference::Signed, &weights, true);
        assert_eq!(
            reading.channels[1],
            ChannelSums { mass: 10, first: [30, 20], second: 130, products: [0, 100, 0] }
        );
        assert_eq!((reading.peak, reading.peak_xy), (20.into(), (3, 2)));
        assert_eq!(count_from(&pair, Difference::Signed, &weights, &20.into()), 1);
    }

    #[test]
    fn the_first_of_equal_peaks_is_taken() {
        let baseline = Array3::<u8>::zeros((2, 2, 3));
        let frame = Array3::<u8>::from_elem((2, 2, 3), 7);
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let weights = [1, 1, 1].map(BigInt::from);
        assert_eq!(read(&pair, Difference::Signed, &weights, false).peak_xy, (0, 0));
    }
}
