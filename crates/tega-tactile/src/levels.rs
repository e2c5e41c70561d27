//! The fast way through the images, for weights of practical size: each pixel's grey level is an `i32`.
//!
//! One reading yields the sum of every row and of every column and the range of levels in every row. The moments follow
//! from those few numbers, and the threshold count reads a row again only where its range straddles the threshold.

use crate::exact::Sums;
use crate::frame::{Difference, Pair};
use crate::simd;

/// Largest Σ|weight| for which no row sum of levels overflows an `i32` lane (512 pixels a lane in the widest row).
pub(crate) const MAX_WEIGHT_SUM: i32 = 16_000;
/// Largest |weight|: its two 7-bit halves stay in the range of 8-bit multiplication.
pub(crate) const MAX_WEIGHT: i32 = 8_191;

/// What one row says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Row {
    /// Σ n.
    pub sum: i64,
    /// Σ n², where asked for.
    pub squares: i64,
    /// Smallest and largest n.
    pub min: i32,
    pub max: i32,
}

/// Buffers that are reused from frame to frame.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Sums of the columns since the last flush.
    columns: Vec<i32>,
    /// Sums of the columns.
    totals: Vec<i64>,
    /// One entry a row.
    rows: Vec<Row>,
}

/// Levels of one pair of images, summed up.
pub(crate) struct Levels<'s> {
    pub sums: Sums<i128>,
    pub peak: i32,
    pub peak_xy: (usize, usize),
    rows: &'s [Row],
}

/// Weights, difference and whether squares are wanted: what a row kernel needs to know.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kernel {
    pub weights: [i32; 3],
    pub difference: Difference,
    pub squares: bool,
}

impl Kernel {
    /// The level of one pixel.
    #[inline(always)]
    pub(crate) fn level(&self, frame: [u8; 3], baseline: [u8; 3]) -> i32 {
        let d = |c: usize| i32::from(self.difference.of(frame[c], baseline[c]));
        self.weights[0] * d(0) + self.weights[1] * d(1) + self.weights[2] * d(2)
    }

    /// Sums one row and adds it to the columns; the plain form that the vector forms are tested against.
    pub(crate) fn row(&self, frame: &[u8], baseline: &[u8], columns: &mut [i32]) -> Row {
        let mut row = Row { sum: 0, squares: 0, min: i32::MAX, max: i32::MIN };
        let pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
        for ((f, b), column) in pixels.zip(columns) {
            let n = self.level(*f, *b);
            *column += n;
            row.sum += i64::from(n);
            if self.squares {
                row.squares += i64::from(n) * i64::from(n);
            }
            row.min = row.min.min(n);
            row.max = row.max.max(n);
        }
        row
    }

    /// The same for as many rows as the slices hold, `columns.len()` pixels each.
    pub(crate) fn rows(&self, frame: &[u8], baseline: &[u8], columns: &mut [i32], rows: &mut Vec<Row>) {
        let bytes = 3 * columns.len();
        for (frame, baseline) in frame.chunks_exact(bytes).zip(baseline.chunks_exact(bytes)) {
            rows.push(self.row(frame, baseline, columns));
        }
    }

    /// Number of pixels of a row at or above level `first`; the plain form.
    pub(crate) fn count(&self, frame: &[u8], baseline: &[u8], first: i32) -> u32 {
        let pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
        pixels.map(|(f, b)| u32::from(self.level(*f, *b) >= first)).sum()
    }

    /// Reads both images once.
    pub(crate) fn read<'s>(&self, pair: &Pair<'_>, denominator: i32, scratch: &'s mut Scratch) -> Levels<'s> {
        let width = pair.width();
        let Scratch { columns, totals, rows } = scratch;
        rows.clear();
        columns.clear();
        columns.resize(width, 0);
        totals.clear();
        totals.resize(width, 0);
        let flush_every = self.rows_until_overflow();
        if let Some((frame, baseline)) = pair.contiguous() {
            let bytes = 3 * width * flush_every;
            for (frame, baseline) in frame.chunks(bytes).zip(baseline.chunks(bytes)) {
                simd::rows(self, frame, baseline, columns, rows);
                flush(columns, totals);
            }
        } else {
            pair.for_each_row(|y, frame, baseline| {
                simd::rows(self, frame, baseline, columns, rows);
                if (y + 1) % flush_every == 0 {
                    flush(columns, totals);
                }
            });
            flush(columns, totals);
        }
        let sums = moments(rows, totals, self.squares, denominator);
        let peak = rows.iter().map(|row| row.max).max().unwrap_or_default();
        let peak_y = rows.iter().position(|row| row.max == peak).unwrap_or_default();
        let mut peak_x = 0;
        pair.with_row(peak_y, |frame, baseline| {
            let mut pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
            peak_x = pixels.position(|(f, b)| self.level(*f, *b) == peak).unwrap_or_default();
        });
        Levels { sums, peak, peak_xy: (peak_x, peak_y), rows }
    }

    fn rows_until_overflow(&self) -> usize {
        let reach: i32 = self.weights.iter().map(|w| w.abs()).sum();
        (i32::MAX / (255 * reach.max(1))).max(1) as usize
    }
}

pub(crate) fn flush(columns: &mut [i32], totals: &mut [i64]) {
    for (total, column) in totals.iter_mut().zip(columns) {
        *total += i64::from(std::mem::take(column));
    }
}

/// Moments from the sums of rows and columns: Σ x·n needs the columns only, Σ y·n the rows only.
pub(crate) fn moments(rows: &[Row], columns: &[i64], squares: bool, denominator: i32) -> Sums<i128> {
    let weighed = |sums: &mut dyn Iterator<Item = i64>| {
        let (mut first, mut second) = (0_i128, 0_i128);
        for (position, sum) in sums.enumerate() {
            // |sum| < 2^45 and position < 2^12: the products stay far below 2^127.
            let moment = position as i128 * i128::from(sum);
            first += moment;
            second += position as i128 * moment;
        }
        (first, second)
    };
    let (first_x, second_x) = weighed(&mut columns.iter().copied());
    let (first_y, second_y) = weighed(&mut rows.iter().map(|row| row.sum));
    Sums {
        mass: rows.iter().map(|row| i128::from(row.sum)).sum(),
        first: [first_x, first_y],
        second: second_x + second_y,
        squares: squares.then(|| rows.iter().map(|row| i128::from(row.squares)).sum()),
        denominator: i128::from(denominator),
    }
}

impl Levels<'_> {
    /// Number of pixels at or above level `first`; reads only rows whose range straddles it.
    pub fn count_from(&self, pair: &Pair<'_>, kernel: &Kernel, first: i32) -> u32 {
        let mut count = 0;
        for (y, row) in self.rows.iter().enumerate() {
            if row.min >= first {
                count += pair.width() as u32;
            } else if row.max >= first {
                pair.with_row(y, |frame, baseline| count += simd::count(kernel, frame, baseline, first));
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, Axis};
    use proptest::prelude::*;

    fn differences() -> impl Strategy<Value = Difference> {
        prop_oneof![Just(Difference::Signed), Just(Difference::Rectified), Just(Difference::Absolute)]
    }

    fn weights() -> impl Strategy<Value = [i32; 3]> {
        prop_oneof![
            Just([114, 587, 299]),
            Just([MAX_WEIGHT, -MAX_WEIGHT / 2, -MAX_WEIGHT / 3]),
            [-5000_i32..5000, -5000_i32..5000, -5000_i32..5000],
        ]
    }

    proptest! {
        #[test]
        fn the_dispatched_kernels_equal_the_plain_ones(
            pixels in prop::collection::vec(any::<([u8; 3], [u8; 3])>(), 1..120),
            weights in weights(),
            difference in differences(),
            squares in any::<bool>(),
            first in -3_000_000_i32..3_000_000,
        ) {
            let (frame, baseline): (Vec<_>, Vec<_>) = pixels.into_iter().unzip();
            let (frame, baseline) = (frame.as_flattened(), baseline.as_flattened());
            let kernel = Kernel { weights, difference, squares };
            let mut plain = vec![7; frame.len() / 3];
            let mut fast = plain.clone();
            let wanted = kernel.row(frame, baseline, &mut plain);
            let mut rows = Vec::new();
            simd::rows(&kernel, frame, baseline, &mut fast, &mut rows);
            prop_assert_eq!(rows, [wanted]);
            prop_assert_eq!(fast, plain);
            prop_assert_eq!(
                simd::count(&kernel, frame, baseline, first),
                kernel.count(frame, baseline, first)
            );
        }
    }

    #[test]
    fn extreme_rows_do_not_overflow() {
        let (frame, baseline) = (vec![255; 3 * 4096], vec![0; 3 * 4096]);
        let kernel = Kernel { weights: [5334, 5333, 5333], difference: Difference::Signed, squares: true };
        let mut rows = Vec::new();
        simd::rows(&kernel, &frame, &baseline, &mut vec![0; 4096], &mut rows);
        assert_eq!(rows, [kernel.row(&frame, &baseline, &mut vec![0; 4096])]);
        assert_eq!(rows[0].sum, 4096 * 255 * 16_000);
    }

    #[test]
    fn only_straddling_rows_are_counted_again() {
        let baseline = Array3::<u8>::zeros((3, 40, 3));
        let mut frame = baseline.clone();
        frame.index_axis_mut(Axis(0), 0).fill(200);
        frame[[2, 5, 0]] = 9;
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let kernel = Kernel { weights: [1, 1, 1], difference: Difference::Signed, squares: false };
        let mut scratch = Scratch::default();
        let levels = kernel.read(&pair, 3, &mut scratch);
        assert_eq!(levels.count_from(&pair, &kernel, 0), 120);
        assert_eq!(levels.count_from(&pair, &kernel, 9), 41);
        assert_eq!(levels.count_from(&pair, &kernel, 601), 0);
        assert_eq!((levels.peak, levels.peak_xy), (600, (0, 0)));
    }
}
