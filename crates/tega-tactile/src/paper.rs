//! The `paper` preset: the printed law and the least that keeps it from breaking on real frames.
//!
//! Absolute differences, weighted (Eq 1), 5×5 box blur, pixels under the noise floor set to 0, then Eq 2 to 6 with the
//! threshold not below the noise floor, and no contact under 30 pixels above it (readings A1, A4, A5).

use num_bigint::BigInt;

use crate::exact::{Exact, Sums, Threshold};
use crate::frame::{Order, Pair};
use crate::grey::{ColumnSums, moments};
use crate::kernel::Row;
use crate::metrics::ContactMetrics;

/// Noise floor, grey values: a still pair differs by 2.4 on average after weighting and blurring, and 99 % of the
/// pixels far from a real press, drift included, by less than 5.7 (measured on a DIGIT at full light).
pub const NOISE_FLOOR: i32 = 6;
/// Fewer pixels than this above the noise floor are no contact.
pub const MIN_PIXELS: u32 = 30;

/// ω red, green, blue in thousandths.
const LUMA: [i32; 3] = [299, 587, 114];
/// Levels per grey value of the blurred map: thousandths, 25 pixels a box.
const DENOMINATOR: i32 = 1000 * 25;
const RADIUS: usize = 2;

/// Buffers that are reused from frame to frame; each is sized once.
#[derive(Debug, Default)]
pub struct PaperScratch {
    /// |frame − baseline|, interleaved bytes of the whole image.
    difference: Vec<u8>,
    /// Sums of five rows, interleaved, with `RADIUS` mirrored pixels on both sides.
    columns: Vec<i16>,
    /// Sums of five of those side by side.
    boxes: Vec<i16>,
    /// Levels of the blurred, masked grey map.
    map: Vec<i32>,
    /// Sums of the map's columns since they were last taken.
    column_sums: Vec<i32>,
    /// Sums and ranges of the map's rows.
    rows: Vec<Row>,
    /// Lowest level that counts as contact.
    first_counted: i32,
}

impl PaperScratch {
    /// The pressure map of the last frame read: grey values, row by row, after blur and noise floor.
    pub fn pressure_map(&self) -> impl Iterator<Item = f32> {
        self.map.iter().map(|&level| level as f32 / DENOMINATOR as f32)
    }

    /// The pixels that the last frame's EDA counts, row by row.
    pub fn mask(&self) -> impl Iterator<Item = bool> {
        self.map.iter().map(|&level| level >= self.first_counted)
    }
}

/// Equations 1 to 6 under the `paper` preset. Exact but for the final rounding of each number.
pub fn read_paper(pair: &Pair<'_>, order: Order, scratch: &mut PaperScratch) -> ContactMetrics {
    let (width, height) = (pair.width(), pair.height());
    scratch.difference.clear();
    pair.for_each_row(|_, frame, baseline| {
        scratch.difference.extend(frame.iter().zip(baseline).map(|(f, b)| f.abs_diff(*b)));
    });
    blur_and_weigh(width, height, order.arrange(LUMA), scratch);
    let summary = mask_and_sum(width, scratch);
    let size = (width, height);
    let resolved = resolve::<i128>(&summary, &summary.sums, size, scratch)
        .or_else(|| resolve::<BigInt>(&summary, &summary.sums.widened(), size, scratch));
    // Big integers do not overflow; kept total so that no input can panic.
    let (metrics, first_counted) =
        resolved.unwrap_or_else(|| (ContactMetrics::none(f64::NAN, f64::NAN, summary.peak_xy), i32::MAX));
    scratch.first_counted = first_counted;
    metrics
}

/// Mirrors an index without repeating the border pixel (the usual image border).
fn mirror(i: isize, side: usize) -> usize {
    if side == 1 {
        return 0;
    }
    let period = 2 * (side as isize - 1);
    let i = i.rem_euclid(period) as usize;
    i.min(period as usize - i)
}

/// 5×5 box sums per channel (no division: it is left to the denominator), then Eq 1 on them.
///
/// Sums of 25 bytes fit 16 bits, so the blur runs on interleaved bytes and only its result is weighted.
#[inline(always)]
fn blur_and_weigh_plain(width: usize, height: usize, weights: [i32; 3], scratch: &mut PaperScratch) {
    let PaperScratch { difference, columns, boxes, map, .. } = scratch;
    let row = |y: isize| {
        let start = mirror(y, height) * width * 3;
        &difference[start..start + width * 3]
    };
    let margin = RADIUS * 3;
    columns.clear();
    columns.resize(width * 3 + 2 * margin, 0);
    for y in -(RADIUS as isize)..=RADIUS as isize {
        columns[margin..].iter_mut().zip(row(y)).for_each(|(sum, v)| *sum += i16::from(*v));
    }
    boxes.resize(width * 3, 0);
    map.resize(width * height, 0);
    for (y, levels) in map.chunks_exact_mut(width).enumerate() {
        for i in 1..=RADIUS as isize {
            for (outside, inside) in
                [(-i, mirror(-i, width)), (width as isize + i - 1, mirror(width as isize + i - 1, width))]
            {
                let to = (outside + RADIUS as isize) as usize * 3;
                columns.copy_within((inside + RADIUS) * 3..(inside + RADIUS + 1) * 3, to);
            }
        }
        weigh_boxes(columns, boxes, weights, levels);
        let y = y as isize;
        let (leaving, entering) = (row(y - RADIUS as isize), row(y + RADIUS as isize + 1));
        for ((sum, old), new) in columns[margin..].iter_mut().zip(leaving).zip(entering) {
            *sum += i16::from(*new) - i16::from(*old);
        }
    }
}

tega_simd::dispatched! {
    /// See [`blur_and_weigh_plain`].
    blur_and_weigh = blur_and_weigh_plain,
    (width: usize, height: usize, weights: [i32; 3], scratch: &mut PaperScratch) -> ()
}

/// Sums of five neighbouring pixels in a row of column sums, weighted per channel.
#[inline(always)]
fn weigh_boxes(columns: &[i16], boxes: &mut [i16], weights: [i32; 3], levels: &mut [i32]) {
    let shifted = |pixels: usize| &columns[3 * pixels..3 * pixels + boxes.len()];
    let (a, b, c, d, e) = (shifted(0), shifted(1), shifted(2), shifted(3), shifted(4));
    for (i, sum) in boxes.iter_mut().enumerate() {
        *sum = a[i] + b[i] + c[i] + d[i] + e[i];
    }
    for (level, sums) in levels.iter_mut().zip(boxes.as_chunks::<3>().0) {
        let part = |c: usize| weights[c] * i32::from(sums[c]);
        *level = part(0) + part(1) + part(2);
    }
}

/// Sums over the masked map.
struct Summary {
    sums: Sums<i128>,
    above_floor: u32,
    peak: i32,
    peak_xy: (usize, usize),
}

/// Rows after which a column sum of levels (at most 255 grey values each) could leave `i32`.
const FLUSH_EVERY: usize = (i32::MAX / (255 * DENOMINATOR)) as usize;
/// Pixels whose levels add up within `i32`.
const RUN: usize = 256;

/// Sets levels under the noise floor to 0 and sums what is left.
fn mask_and_sum(width: usize, scratch: &mut PaperScratch) -> Summary {
    let PaperScratch { map, column_sums, rows, .. } = scratch;
    column_sums.clear();
    column_sums.resize(width, 0);
    rows.clear();
    let mut sums = ColumnSums::default();
    let mut above_floor = 0;
    for (y, levels) in map.chunks_exact_mut(width).enumerate() {
        let (row, above) = mask_row(levels, column_sums);
        above_floor += above;
        rows.push(row);
        if (y + 1) % FLUSH_EVERY == 0 {
            sums.take(column_sums);
        }
    }
    sums.take(column_sums);
    let peak = rows.iter().map(|row| row.max).max().unwrap_or_default();
    let peak_y = rows.iter().position(|row| row.max == peak).unwrap_or_default();
    let row = map.chunks_exact(width).nth(peak_y).unwrap_or_default();
    let peak_x = row.iter().position(|&n| n == peak).unwrap_or_default();
    let sums = moments(rows, sums, width, false, 255 * DENOMINATOR, DENOMINATOR);
    Summary { sums, above_floor, peak, peak_xy: (peak_x, peak_y) }
}

/// Masks one row and adds it to the columns; also the number of levels above the floor.
#[inline(always)]
fn mask_row_plain(levels: &mut [i32], columns: &mut [i32]) -> (Row, u32) {
    const FLOOR: i32 = NOISE_FLOOR * DENOMINATOR;
    let (mut above_floor, mut max) = (0, 0);
    for (level, column) in levels.iter_mut().zip(columns) {
        above_floor += i32::from(*level > FLOOR);
        *level = if *level < FLOOR { 0 } else { *level };
        *column += *level;
        max = max.max(*level);
    }
    let sum = levels.chunks(RUN).map(|run| i64::from(run.iter().sum::<i32>())).sum();
    (Row { sum, squares: 0, min: 0, max }, above_floor as u32)
}

tega_simd::dispatched! {
    /// See [`mask_row_plain`].
    mask_row = mask_row_plain, (levels: &mut [i32], columns: &mut [i32]) -> (Row, u32)
}

/// Number of levels at or above `first`.
#[inline(always)]
fn count_from_plain(levels: &[i32], first: i32) -> u32 {
    levels.iter().map(|&n| u32::from(n >= first)).sum()
}

tega_simd::dispatched! {
    /// See [`count_from_plain`].
    count_from = count_from_plain, (levels: &[i32], first: i32) -> u32
}

/// Equations 2 to 6 on the masked map, and the lowest level that counts; `None` on overflow of `I`.
fn resolve<I>(
    summary: &Summary,
    sums: &Sums<I>,
    (width, height): (usize, usize),
    scratch: &PaperScratch,
) -> Option<(ContactMetrics, i32)>
where
    I: Exact + From<i32>,
    i32: TryFrom<I>,
{
    let denominator = I::from(DENOMINATOR);
    let peak = I::from(summary.peak);
    let none = ContactMetrics::none(
        I::ratio(&sums.mass, &denominator),
        I::ratio(&peak, &denominator),
        summary.peak_xy,
    );
    let (true, Some([x, y])) = (summary.above_floor >= MIN_PIXELS, sums.centroid()) else {
        return Some((none, i32::MAX));
    };
    let (column, row) = sums.nearest_pixel(width, height)?;
    let threshold = Threshold {
        value: I::from(*scratch.map.get(row * width + column)?),
        value_denominator: denominator.clone(),
        variance: sums.spatial_variance()?,
        factor: [I::from(32), I::from(25)],
        denominator: denominator.clone(),
    };
    let spread = threshold.spread();
    let value = threshold.to_f64(spread)?;
    let first_above_floor = NOISE_FLOOR * DENOMINATOR + 1;
    let first = i32::try_from(threshold.first_level_above(value)?)
        .map_or(first_above_floor, |n| n.max(first_above_floor));
    let rows = scratch.map.chunks_exact(width).zip(&scratch.rows);
    let eda = rows.filter(|(_, row)| row.max >= first).map(|(levels, _)| count_from(levels, first)).sum();
    let cci = if eda == 0 { 0.0 } else { I::ratio(&peak, &denominator.checked_mul(&I::from_u32(eda)?)?) };
    let metrics = ContactMetrics {
        centroid_xy: (x, y),
        spread,
        threshold: value.max(f64::from(NOISE_FLOOR)),
        eda,
        cci,
        in_contact: true,
        ..none
    };
    Some((metrics, first))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    fn read(frame: &Array3<u8>, baseline: &Array3<u8>) -> ContactMetrics {
        read_paper(
            &Pair::new(frame.view(), baseline.view()).unwrap(),
            Order::Bgr,
            &mut PaperScratch::default(),
        )
    }

    #[test]
    fn borders_mirror_without_repeating() {
        let seen: Vec<_> = (-3..7).map(|i| mirror(i, 4)).collect();
        assert_eq!(seen, [3, 2, 1, 0, 1, 2, 3, 2, 1, 0]);
        assert_eq!(mirror(-2, 1), 0);
        assert_eq!((mirror(-2, 2), mirror(3, 2)), (0, 1));
    }

    #[test]
    fn a_uniform_step_blurs_to_itself() {
        let baseline = Array3::<u8>::from_elem((6, 9, 3), 100);
        let m = read(&Array3::from_elem((6, 9, 3), 80), &baseline);
        assert_eq!((m.peak, m.eda, m.in_contact), (20.0, 54, true));
        assert_eq!(m.centroid_xy, (4.0, 2.5));
    }

    #[test]
    fn under_the_noise_floor_is_no_contact() {
        let baseline = Array3::<u8>::from_elem((20, 20, 3), 100);
        let m = read(&Array3::from_elem((20, 20, 3), 105), &baseline);
        assert!(!m.in_contact);
        assert_eq!((m.eda, m.cci, m.peak), (0, 0.0, 0.0));
    }

    #[test]
    fn any_size_from_one_pixel_on_is_read() {
        for (h, w) in [(1, 1), (1, 7), (7, 1), (2, 3), (5, 4)] {
            let baseline = Array3::<u8>::zeros((h, w, 3));
            let m = read(&Array3::from_elem((h, w, 3), 50), &baseline);
            assert_eq!(m.peak, 50.0, "{h}x{w}");
        }
    }
}
