//! The fast way through the images, for weights of practical size: each pixel's grey value is an `i32`.
//!
//! One reading yields the sum of every row and of every column and the range of grey values in every row. The moments follow
//! from those few numbers, and the threshold count reads a row again only where its range straddles the threshold.

use std::cell::Cell;
use std::ops::{AddAssign, Range};

use num_traits::Num;

use crate::exact::Sums;
use crate::frame::{Difference, Pair};
use crate::kernel::{Kernel, Row};

/// Bytes of a cache line.
const CACHE_LINE: usize = 64;

/// Buffers that are reused from frame to frame.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Sums of the columns since they were last taken.
    columns: Vec<i32>,
    /// One entry a row.
    rows: Vec<Row>,
    /// The grey values as words, where the kernel keeps them.
    kept: Vec<u16>,
    /// Rows that the last frame's counts looked at: grey values are kept if they were most, as the next frame's will be.
    counted: Cell<usize>,
    /// Images whose rows do not lie contiguous in memory, copied.
    copies: [Vec<u8>; 2],
    /// The kernel of the last frame, whose weights' factors need not be sought again.
    kernel: Option<Kernel>,
}

impl Scratch {
    /// The kernel for these weights, difference and squares.
    pub(crate) fn kernel(&mut self, weights: [i32; 3], difference: Difference, squares: bool) -> Kernel {
        let kernel = match self.kernel {
            Some(kernel) if kernel.weights == weights => kernel.reading(difference, squares),
            _ => Kernel::new(weights, difference, squares),
        };
        self.kernel = Some(kernel);
        kernel
    }
}

/// Greys of one pair of images, summed up.
pub(crate) struct Greys<'s> {
    pub sums: Sums<i128>,
    pub peak: i32,
    pub peak_xy: (usize, usize),
    pair: Pair<'s>,
    rows: &'s [Row],
    kept: &'s [u16],
    counted: &'s Cell<usize>,
    /// Kept words a row.
    in_row: usize,
}

impl Kernel {
    /// Reads both images once.
    pub(crate) fn read<'s>(
        &self,
        pair: &'s Pair<'_>,
        denominator: i32,
        scratch: &'s mut Scratch,
    ) -> Greys<'s> {
        let (width, height) = (pair.width(), pair.height());
        let Scratch { columns, rows, kept, counted, copies, .. } = scratch;
        let pair = pair.with_whole_rows(copies);
        let in_row = if 2 * counted.take() > height { self.kept_in_row(width, height) } else { 0 };
        let kept = aligned(kept, in_row * height);
        rows.resize(height, Row::default());
        let columns = aligned(columns, width);
        columns.fill(0);
        let mut sums = ColumnSums::default();
        let flush_every = self.rows_until_overflow();
        let mut images = pair.rows(0..height);
        let mut kept_rows = kept.chunks_mut((in_row * flush_every).max(1));
        for rows in rows.chunks_mut(flush_every) {
            self.rows(&mut images, columns, rows, kept_rows.next().unwrap_or_default());
            sums.take(columns);
        }
        drop(images);
        let sums = moments(rows, sums, width, self.squares, 255 * self.reach(), denominator);
        let peak = rows.iter().map(|row| row.max).max().unwrap_or_default();
        let peak_y = rows.iter().position(|row| row.max == peak).unwrap_or_default();
        let peak_row = pair.rows(peak_y..peak_y + 1).next().unwrap_or_default();
        let peak_x = self.first_place(peak_row, peak).unwrap_or_default();
        Greys { sums, peak, peak_xy: (peak_x, peak_y), pair, rows, kept, counted, in_row }
    }

    fn rows_until_overflow(&self) -> usize {
        (i32::MAX / (255 * self.reach().max(1))).max(1) as usize
    }
}

/// So many numbers of a buffer, of any value, from the beginning of a cache line on: steps that cross no line are faster.
fn aligned<T: Copy + Default>(buffer: &mut Vec<T>, n: usize) -> &mut [T] {
    let line = CACHE_LINE / size_of::<T>();
    buffer.resize(n + line, T::default());
    // An address that cannot be aligned is used as it is.
    let from = buffer.as_ptr().align_offset(CACHE_LINE).min(line);
    &mut buffer[from..from + n]
}

/// Σ s, Σ x·s and Σ x²·s over the sums s of the columns x.
#[derive(Default)]
pub(crate) struct ColumnSums([i128; 3]);

impl ColumnSums {
    /// Takes what the columns hold, and leaves 0 there.
    pub(crate) fn take(&mut self, columns: &mut [i32]) {
        /// Columns whose Σ x²·s stays in 64 bits, whatever they hold.
        const NARROW: usize = 1 << 10;
        let sums = columns.iter().map(|column| i64::from(*column));
        let taken =
            if columns.len() <= NARROW { weighed::<i64>(sums).map(i128::from) } else { weighed(sums) };
        for (total, taken) in self.0.iter_mut().zip(taken) {
            *total += taken;
        }
        columns.fill(0);
    }
}

/// Moments from the sums of rows and columns: Σ x·n needs the columns only, Σ y·n the rows only.
///
/// `largest` is what no |n| passes.
pub(crate) fn moments(
    rows: &[Row],
    ColumnSums([mass, first_x, second_x]): ColumnSums,
    width: usize,
    squares: bool,
    largest: i32,
    denominator: i32,
) -> Sums<i128> {
    // Σ |n|·height² bounds every sum below.
    let height = rows.len() as i128;
    let narrow = width as i128 * i128::from(largest) * height.pow(3) <= i128::from(i64::MAX);
    let sums = rows.iter().map(|row| row.sum);
    let [_, first_y, second_y] = if narrow { weighed::<i64>(sums).map(i128::from) } else { weighed(sums) };
    Sums {
        mass,
        first: [first_x, first_y],
        second: second_x + second_y,
        squares: squares.then(|| rows.iter().map(|row| i128::from(row.squares)).sum()),
        denominator: i128::from(denominator),
    }
}

/// Σ s, Σ p·s and Σ p²·s over sums s at positions p, by additions alone: from the last position on, what has been summed
/// is summed again at every position but the first, and that once more.
fn weighed<I: Num + From<i64> + Copy + AddAssign>(sums: impl DoubleEndedIterator<Item = i64>) -> [I; 3] {
    let [mut once, mut twice, mut thrice] = [I::zero(); 3];
    let mut before = [I::zero(); 2];
    for sum in sums.rev() {
        [twice, thrice] = before;
        once += I::from(sum);
        // Σ p·s and Σ p(p + 1)/2·s, unless this was the first position.
        let more = twice + once;
        before = [more, thrice + more];
    }
    [once, twice, thrice + thrice - twice]
}

impl Greys<'_> {
    /// Number of pixels at or above grey value `first`; looks only at rows whose range straddles it, neighbours in one go.
    pub fn count_from(&self, kernel: &Kernel, first: i32) -> u32 {
        let mut count = 0;
        let mut rows = self.rows.iter().enumerate().peekable();
        while let Some((begin, row)) = rows.next() {
            let straddles = |row: &Row| row.min < first && first <= row.max;
            if straddles(row) {
                let mut end = begin + 1;
                while rows.next_if(|(_, row)| straddles(row)).is_some() {
                    end += 1;
                }
                count += self.count_within(begin..end, kernel, first);
            } else if row.min >= first {
                count += self.pair.width() as u32;
            }
        }
        count
    }

    /// The same of rows `ys` alone.
    fn count_within(&self, ys: Range<usize>, kernel: &Kernel, first: i32) -> u32 {
        self.counted.set(self.counted.get() + ys.len());
        let kept = self.kept.get(ys.start * self.in_row..ys.end * self.in_row).unwrap_or_default();
        match u16::try_from(first) {
            // A kept 65,535 may stand for more, and is not below it either way; 0 says nothing.
            Ok(first @ 1..) if !kept.is_empty() => Kernel::count_kept(kept, first),
            _ => kernel.count(self.pair.rows(ys), self.pair.width(), kept, first),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, Axis};

    #[test]
    fn only_straddling_rows_are_counted_again() {
        let baseline = Array3::<u8>::zeros((3, 40, 3));
        let mut frame = baseline.clone();
        frame.index_axis_mut(Axis(0), 0).fill(200);
        frame[[2, 5, 0]] = 9;
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let kernel = Kernel::new([1, 1, 1], Difference::Signed, false);
        let mut scratch = Scratch::default();
        // Most rows are counted in the first reading, so the second keeps them.
        for in_row in [0, kernel.kept_in_row(40, 3)] {
            let greys = kernel.read(&pair, 3, &mut scratch);
            assert_eq!(greys.in_row, in_row);
            assert_eq!(greys.count_from(&kernel, 0), 120);
            assert_eq!([greys.count_from(&kernel, 9), greys.count_from(&kernel, 8)], [41, 41]);
            assert_eq!(greys.count_from(&kernel, 601), 0);
            assert_eq!((greys.peak, greys.peak_xy), (600, (0, 0)));
        }
    }
}
