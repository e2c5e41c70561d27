//! The fast way through the images, for weights of practical size: each pixel's grey value is an `i32`.
//!
//! One reading yields the sum of every row and of every column and the range of grey values in every row. The moments follow
//! from those few numbers, and the threshold count reads a row again only where its range straddles the threshold. With AVX2,
//! differences without sign are read in bands of rows instead, which yields the same sums sooner.

use std::ops::AddAssign;

use num_traits::Num;

#[cfg(target_arch = "x86_64")]
use crate::bands::{BandScratch, Bands};
use crate::exact::Sums;
use crate::frame::Pair;
use crate::kernel::{Kernel, Row};

/// Columns in a cache line of 64 bytes.
const CACHE_LINE: usize = 16;

/// Buffers that are reused from frame to frame.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Sums of the columns since the last flush.
    columns: Vec<i32>,
    /// Sums of the columns.
    totals: Vec<i64>,
    /// One entry a row.
    rows: Vec<Row>,
    #[cfg(target_arch = "x86_64")]
    bands: BandScratch,
}

/// Greys of one pair of images, summed up.
pub(crate) struct Greys<'s> {
    pub sums: Sums<i128>,
    pub peak: i32,
    pub peak_xy: (usize, usize),
    told: Told<'s>,
}

/// What is known of parts of the picture.
enum Told<'s> {
    Rows(&'s [Row]),
    #[cfg(target_arch = "x86_64")]
    Bands(Bands<'s>),
}

impl Kernel {
    /// Reads both images once.
    pub(crate) fn read<'s>(&self, pair: &Pair<'_>, denominator: i32, scratch: &'s mut Scratch) -> Greys<'s> {
        #[cfg(target_arch = "x86_64")]
        if BandScratch::suits(self, pair) {
            let Scratch { totals, bands, .. } = scratch;
            let mut bands = bands.read(self, pair, totals);
            let sums = moments(bands.rows(), totals, None, 255 * self.reach(), denominator);
            let (peak, peak_xy) = bands.peak(self, pair);
            return Greys { sums, peak, peak_xy, told: Told::Bands(bands) };
        }
        self.read_rows(pair, denominator, scratch)
    }

    /// The same row by row.
    fn read_rows<'s>(&self, pair: &Pair<'_>, denominator: i32, scratch: &'s mut Scratch) -> Greys<'s> {
        let width = pair.width();
        let Scratch { columns, totals, rows, .. } = scratch;
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
                self.rows(frame, baseline, columns, rows);
                flush(columns, totals);
            }
        } else {
            pair.for_each_row(|y, frame, baseline| {
                self.rows(frame, baseline, columns, rows);
                if (y + 1) % flush_every == 0 {
                    flush(columns, totals);
                }
            });
            flush(columns, totals);
        }
        let squares = self.squares.then(|| rows.iter().map(|row| i128::from(row.squares)).sum());
        let row_sums = rows.iter().map(|row| row.sum);
        let sums = moments(row_sums, totals, squares, 255 * self.reach(), denominator);
        let peak = rows.iter().map(|row| row.max).max().unwrap_or_default();
        let peak_y = rows.iter().position(|row| row.max == peak).unwrap_or_default();
        let mut peak_x = 0;
        pair.with_rows(peak_y..peak_y + 1, |frame, baseline| peak_x = self.first_of(frame, baseline, peak));
        Greys { sums, peak, peak_xy: (peak_x, peak_y), told: Told::Rows(rows) }
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
/// `largest` is what no |n| passes, `squares` is Σ n² where asked for.
pub(crate) fn moments(
    rows: impl ExactSizeIterator<Item = i64>,
    columns: &[i64],
    squares: Option<i128>,
    largest: i32,
    denominator: i32,
) -> Sums<i128> {
    let side = rows.len().max(columns.len()) as i128;
    // Σ |n|·side² bounds every sum below.
    let bound = (rows.len() * columns.len()) as i128 * i128::from(largest) * side * side;
    let narrow = bound <= i128::from(i64::MAX);
    let ([mass, first_x, second_x], [_, first_y, second_y]) = if narrow {
        (weighed::<i64>(columns.iter().copied()).map(i128::from), weighed::<i64>(rows).map(i128::from))
    } else {
        (weighed::<i128>(columns.iter().copied()), weighed::<i128>(rows))
    };
    Sums {
        mass,
        first: [first_x, first_y],
        second: second_x + second_y,
        squares,
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

impl Greys<'_> {
    /// Number of pixels at or above grey value `first`; reads only rows whose range straddles it, neighbours in one go.
    pub fn count_from(&self, pair: &Pair<'_>, kernel: &Kernel, first: i32) -> u32 {
        let rows = match &self.told {
            Told::Rows(rows) => rows,
            #[cfg(target_arch = "x86_64")]
            Told::Bands(bands) => return bands.count_from(pair, kernel, first),
        };
        let straddles = |row: &Row| row.min < first && first <= row.max;
        let whole = rows.iter().filter(|row| row.min >= first).count() * pair.width();
        let mut count = whole as u32;
        let mut y = 0;
        for run in rows.chunk_by(|a, b| straddles(a) == straddles(b)) {
            if straddles(&run[0]) {
                pair.with_rows(y..y + run.len(), |frame, baseline| {
                    count += kernel.count(frame, baseline, first);
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
    use crate::frame::Difference;
    use ndarray::{Array3, Axis};
    #[cfg(target_arch = "x86_64")]
    use proptest::prelude::*;

    #[test]
    fn only_straddling_rows_are_counted_again() {
        let baseline = Array3::<u8>::zeros((3, 40, 3));
        let mut frame = baseline.clone();
        frame.index_axis_mut(Axis(0), 0).fill(200);
        frame[[2, 5, 0]] = 9;
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let kernel = Kernel { weights: [1, 1, 1], difference: Difference::Signed, squares: false };
        let mut scratch = Scratch::default();
        let greys = kernel.read(&pair, 3, &mut scratch);
        assert_eq!(greys.count_from(&pair, &kernel, 0), 120);
        assert_eq!(greys.count_from(&pair, &kernel, 9), 41);
        assert_eq!(greys.count_from(&pair, &kernel, 601), 0);
        assert_eq!((greys.peak, greys.peak_xy), (600, (0, 0)));
    }

    #[cfg(target_arch = "x86_64")]
    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn bands_say_what_rows_say(
            (width, height) in prop_oneof![(32_usize..140, 1_usize..20), (32_usize..40, 250_usize..262)],
            seed in any::<u64>(),
            steepness in prop_oneof![Just(1_u64), Just(8), Just(64)],
            absolute in any::<bool>(),
            weights in prop_oneof![
                Just([114, 587, 299]),
                Just([5334, 5333, 5333]),
                Just([1, 1, 1]),
                [-5000_i32..5000, -5000_i32..5000, -5000_i32..5000],
            ],
            firsts in prop::collection::vec(-10_000_i32..300_000, 8),
        ) {
            let mut state = seed | 1;
            let mut images = [0, 1].map(|_| {
                Array3::from_shape_simple_fn((height, width, 3), || {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    // Bright pixels are rare where this is steep, and all alike are some.
                    let draw = (state >> 40) % (256 * steepness);
                    if draw < 256 { draw as u8 } else { 90 }
                })
            });
            if seed % 5 == 0 {
                images[0].fill(255);
                images[1].fill(0);
            }
            let pair = Pair::new(images[0].view(), images[1].view()).unwrap();
            let difference = if absolute { Difference::Absolute } else { Difference::Rectified };
            let kernel = Kernel { weights, difference, squares: false };
            let (mut one, mut other) = (Scratch::default(), Scratch::default());
            let wanted = kernel.read_rows(&pair, 1000, &mut one);
            let told = kernel.read(&pair, 1000, &mut other);
            prop_assert_eq!(format!("{:?}", told.sums), format!("{:?}", wanted.sums));
            prop_assert_eq!((told.peak, told.peak_xy), (wanted.peak, wanted.peak_xy));
            let near = [0, 1, told.peak, told.peak.saturating_add(1), told.peak / 2];
            for first in firsts.into_iter().flat_map(|first| [first, first / 100]).chain(near) {
                prop_assert_eq!(told.count_from(&pair, &kernel, first), wanted.count_from(&pair, &kernel, first));
            }
        }
    }
}
