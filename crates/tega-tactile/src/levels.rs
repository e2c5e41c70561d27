//! The fast way through the images, for weights of practical size: each pixel's grey level is an `i32`.
//!
//! One reading yields the sum of every row and of every column and the range of levels in every row. The moments follow
//! from those few numbers, and the threshold count reads a row again only where its range straddles the threshold.

use std::ops::AddAssign;

use num_traits::Num;

use crate::exact::Sums;
use crate::frame::{Difference, Pair};
use crate::simd;

/// Largest Σ|weight| for which no row sum of levels overflows an `i32` lane (512 pixels a lane in the widest row).
pub(crate) const MAX_WEIGHT_SUM: i32 = 16_000;
/// Largest |weight|: its two 7-bit halves stay in the range of 8-bit multiplication.
pub(crate) const MAX_WEIGHT: i32 = 8_191;

/// Columns in a cache line of 64 bytes.
const CACHE_LINE: usize = 16;

/// What one row says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Row {
    /// Σ n.
    pub sum: i64,
    /// Σ n², where asked for.
    pub squares: i64,
    /// What no n falls below: the smallest n where differences have a sign, else what the weights alone say.
    pub min: i32,
    /// Largest n.
    pub max: i32,
}

impl Row {
    /// Adds the pixels of another part of the same row.
    pub(crate) fn merge(&mut self, part: Row) {
        self.sum += part.sum;
        self.squares += part.squares;
        self.min = self.min.min(part.min);
        self.max = self.max.max(part.max);
    }
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

    /// What no level of a difference without sign falls below.
    pub(crate) fn least(&self) -> i32 {
        self.weights.iter().map(|weight| 255 * weight.min(&0)).sum()
    }

    /// Sums one row and adds it to the columns; the plain form that the vector forms are tested against.
    pub(crate) fn row(&self, frame: &[u8], baseline: &[u8], columns: &mut [i32]) -> Row {
        let signed = self.difference == Difference::Signed;
        let min = if signed { i32::MAX } else { self.least() };
        let mut row = Row { sum: 0, squares: 0, min, max: i32::MIN };
        let pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
        for ((f, b), column) in pixels.zip(columns) {
            let n = self.level(*f, *b);
            *column += n;
            row.sum += i64::from(n);
            if self.squares {
                row.squares += i64::from(n) * i64::from(n);
            }
            if signed {
                row.min = row.min.min(n);
            }
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
        columns.resize(width + CACHE_LINE, 0);
        // Steps that cross no cache line are faster; an address that cannot be aligned is used as it is.
        let aligned = columns.as_ptr().align_offset(CACHE_LINE * size_of::<i32>()).min(CACHE_LINE);
        let columns = &mut columns[aligned..aligned + width];
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
        let sums = moments(rows, totals, self.squares, 255 * self.reach(), denominator);
        let peak = rows.iter().map(|row| row.max).max().unwrap_or_default();
        let peak_y = rows.iter().position(|row| row.max == peak).unwrap_or_default();
        let mut peak_x = 0;
        pair.with_rows(peak_y..peak_y + 1, |frame, baseline| {
            let mut pixels = frame.as_chunks::<3>().0.iter().zip(baseline.as_chunks::<3>().0);
            peak_x = pixels.position(|(f, b)| self.level(*f, *b) == peak).unwrap_or_default();
        });
        Levels { sums, peak, peak_xy: (peak_x, peak_y), rows }
    }

    /// Σ |weight|.
    fn reach(&self) -> i32 {
        self.weights.iter().map(|weight| weight.abs()).sum()
    }

    fn rows_until_overflow(&self) -> usize {
        (i32::MAX / (255 * self.reach().max(1))).max(1) as usize
    }
}

pub(crate) fn flush(columns: &mut [i32], totals: &mut [i64]) {
    for (total, column) in totals.iter_mut().zip(columns) {
        *total += i64::from(std::mem::take(column));
    }
}

/// Moments from the sums of rows and columns: Σ x·n needs the columns only, Σ y·n the rows only.
///
/// `largest` is what no |n| passes.
pub(crate) fn moments(
    rows: &[Row],
    columns: &[i64],
    squares: bool,
    largest: i32,
    denominator: i32,
) -> Sums<i128> {
    let side = rows.len().max(columns.len()) as i128;
    // Σ |n|·side² bounds every sum below.
    let bound = (rows.len() * columns.len()) as i128 * i128::from(largest) * side * side;
    let narrow = bound <= i128::from(i64::MAX);
    let rows_sums = rows.iter().map(|row| row.sum);
    let ([mass, first_x, second_x], [_, first_y, second_y]) = if narrow {
        (weighed::<i64>(columns.iter().copied()).map(i128::from), weighed::<i64>(rows_sums).map(i128::from))
    } else {
        (weighed::<i128>(columns.iter().copied()), weighed::<i128>(rows_sums))
    };
    Sums {
        mass,
        first: [first_x, first_y],
        second: second_x + second_y,
        squares: squares.then(|| rows.iter().map(|row| i128::from(row.squares)).sum()),
        denominator: i128::from(denominator),
    }
}

/// Σ s, Σ p·s and Σ p²·s over sums s at positions p.
fn weighed<I: Num + From<i64> + Copy + AddAssign>(sums: impl Iterator<Item = i64>) -> [I; 3] {
    let mut total = [I::zero(); 3];
    let mut position = I::zero();
    for sum in sums {
        let sum = I::from(sum);
        let moment = position * sum;
        total[0] += sum;
        total[1] += moment;
        total[2] += position * moment;
        position += I::one();
    }
    total
}

impl Levels<'_> {
    /// Number of pixels at or above level `first`; reads only rows whose range straddles it, neighbours in one go.
    pub fn count_from(&self, pair: &Pair<'_>, kernel: &Kernel, first: i32) -> u32 {
        let straddles = |row: &Row| row.min < first && first <= row.max;
        let whole = self.rows.iter().filter(|row| row.min >= first).count() * pair.width();
        let mut count = whole as u32;
        let mut y = 0;
        for run in self.rows.chunk_by(|a, b| straddles(a) == straddles(b)) {
            if straddles(&run[0]) {
                pair.with_rows(y..y + run.len(), |frame, baseline| {
                    count += simd::count(kernel, frame, baseline, first);
                });
            }
            y += run.len();
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
            (width, pixels) in (1_usize..70, 1_usize..20).prop_flat_map(|(width, height)| {
                (Just(width), prop::collection::vec(any::<([u8; 3], [u8; 3])>(), width * height))
            }),
            weights in weights(),
            difference in differences(),
            squares in any::<bool>(),
            first in -3_000_000_i32..3_000_000,
        ) {
            let (frame, baseline): (Vec<_>, Vec<_>) = pixels.into_iter().unzip();
            let (frame, baseline) = (frame.as_flattened(), baseline.as_flattened());
            let kernel = Kernel { weights, difference, squares };
            let mut plain = vec![7; width];
            let mut fast = plain.clone();
            let (mut wanted, mut rows) = (Vec::new(), Vec::new());
            kernel.rows(frame, baseline, &mut plain, &mut wanted);
            simd::rows(&kernel, frame, baseline, &mut fast, &mut rows);
            prop_assert_eq!(rows, wanted);
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
