//! How strongly each cell differs from the baseline, in standard deviations of the sensor's noise.
//!
//! A change of the whole picture's colour (an offset and a gain per channel) is not contact and is taken out.

use super::cells::{Grid, Planes, UNITS_PER_COUNT};
use crate::frame::Order;
use crate::simd;

/// Temporal noise of one pixel in counts, blue, green, red: measured on a DIGIT at full light. Weighing the channels
/// by it keeps the noisiest one from deciding alone; other sensors of the kind are read with the same numbers.
pub(super) const NOISE: [f32; 3] = [3.17, 1.65, 2.74];
/// Root mean square of `NOISE`: turns a response in noise units into counts of an average channel.
pub(super) const COUNTS_PER_UNIT: f32 = 2.6;

/// Cells under this response carry no contact: the colour of the whole picture is fitted on them.
const QUIET: f32 = 4.0;
/// With no more than this share of quiet cells the fit takes all.
const QUIET_SHARE: f32 = 0.1;
const FITS: usize = 2;

/// Whitened difference per channel and its length, per cell.
#[derive(Debug, Default)]
pub(super) struct Response {
    /// Three planes, in noise units.
    pub white: [Vec<f32>; 3],
    /// Their length.
    pub length: Vec<f32>,
    smooth: Vec<i16>,
    quiet: Vec<f32>,
}

impl Response {
    /// Smooths `planes` by 1-2-1 both ways, takes out each channel's median and scales by the noise.
    pub fn whiten(&mut self, planes: &Planes, grid: &Grid, order: Order) {
        for ((plane, white), noise) in blue_first(planes, order).zip(&mut self.white).zip(NOISE) {
            white.resize(grid.cells(), 0.0);
            let middle = simd::median(plane);
            let scale = 1.0 / (16.0 * UNITS_PER_COUNT * noise);
            self.smooth.resize(grid.cells(), 0);
            simd::smooth(plane, grid.cols, 16 * i32::from(middle), scale, &mut self.smooth, white);
        }
        self.measure(grid);
    }

    fn measure(&mut self, grid: &Grid) {
        self.length.resize(grid.cells(), 0.0);
        let [a, b, c] = &self.white;
        simd::lengths(a, b, c, &mut self.length);
    }

    /// Takes out an offset and a gain (against the smoothed baseline, in counts) per channel, fitted on quiet cells, or
    /// on all where hardly any is quiet: the light may have changed so much.
    pub fn take_out_colour(&mut self, baseline: &[Vec<f32>; 3], grid: &Grid) {
        for _ in 0..FITS {
            let quiet = grid.cells() - self.count_above(QUIET);
            let level = if quiet as f32 > QUIET_SHARE * grid.cells() as f32 { QUIET } else { f32::MAX };
            self.quiet.resize(grid.cells(), 0.0);
            simd::mark_quiet(level, &self.length, &mut self.quiet);
            for (white, base) in self.white.iter_mut().zip(baseline) {
                let [n, b, d, bb, bd] = quiet_sums(&self.quiet, base, white);
                if n < 1.0 {
                    return;
                }
                let (mean_b, mean_d) = (b / n, d / n);
                // A flat baseline says nothing about the gain: the second term keeps it at zero there.
                let variance = (bb / n - mean_b * mean_b).max(0.0) + 1.0;
                let gain = (bd / n - mean_b * mean_d) / variance;
                let offset = mean_d - gain * mean_b;
                simd::take_out(offset, gain, base, white);
            }
            self.measure(grid);
        }
    }

    /// Cells with a response above `level`.
    pub fn count_above(&self, level: f32) -> usize {
        simd::count_above(level, &self.length) as usize
    }
}

/// The planes with blue first, so that the order of the bytes changes nothing that follows.
fn blue_first(planes: &Planes, order: Order) -> impl Iterator<Item = &Vec<i16>> {
    let [a, b, c] = planes;
    match order {
        Order::Bgr => [a, b, c],
        Order::Rgb => [c, b, a],
    }
    .into_iter()
}

/// The same smoothing for the baseline, in counts.
pub(super) fn smooth_counts(
    planes: &Planes,
    grid: &Grid,
    order: Order,
    column: &mut Vec<i16>,
    out: &mut [Vec<f32>; 3],
) {
    column.resize(grid.cells(), 0);
    for (plane, out) in blue_first(planes, order).zip(out) {
        out.resize(grid.cells(), 0.0);
        simd::smooth(plane, grid.cols, 0, 1.0 / (16.0 * UNITS_PER_COUNT), column, out);
    }
}

/// 1-2-1 both ways, border cells repeated: `out = (16 * smoothed - middle) * scale`. Cell values are within 255 * 16,
/// so four of them fit 16 bits. `column` holds the sums down the columns; all planes are of one length.
#[inline(always)]
pub(crate) fn smooth(
    plane: &[i16],
    cols: usize,
    middle: i32,
    scale: f32,
    column: &mut [i16],
    out: &mut [f32],
) {
    let n = plane.len();
    let down = |a: &[i16], h: &[i16], b: &[i16], out: &mut [i16]| {
        for (((sum, a), h), b) in out.iter_mut().zip(a).zip(h).zip(b) {
            *sum = a + 2 * h + b;
        }
    };
    let (last, cut) = (n.saturating_sub(cols), n.saturating_sub(2 * cols));
    // First row, rows between, last row: one long run each.
    down(
        plane,
        plane,
        plane.get(cols.min(last)..).unwrap_or_default(),
        column.get_mut(..cols).unwrap_or_default(),
    );
    down(
        plane,
        plane.get(cols..).unwrap_or_default(),
        plane.get(2 * cols..).unwrap_or_default(),
        column.get_mut(cols..last).unwrap_or_default(),
    );
    if last > 0 {
        let tail = plane.get(last..).unwrap_or_default();
        down(plane.get(cut..).unwrap_or_default(), tail, tail, column.get_mut(last..).unwrap_or_default());
    }
    let level =
        |l: i16, h: i16, r: i16| (i32::from(l) + 2 * i32::from(h) + i32::from(r) - middle) as f32 * scale;
    let (left, right) = (column.get(1..).unwrap_or_default(), column.get(2..).unwrap_or_default());
    for (((out, &l), &h), &r) in out.iter_mut().skip(1).zip(&*column).zip(left).zip(right) {
        *out = level(l, h, r);
    }
    for (row, out) in column.chunks_exact(cols).zip(out.chunks_exact_mut(cols)) {
        let second = cols.min(2) - 1;
        out[0] = level(row[0], row[0], row[second]);
        out[cols - 1] = level(row[cols - 1 - second], row[cols - 1], row[cols - 1]);
    }
}

/// The lower median: the smallest value that at least half of the cells do not exceed.
#[inline(always)]
pub(crate) fn median(plane: &[i16]) -> i16 {
    let (mut low, mut high) = (-4096i16, 4095i16);
    let half = plane.len().div_ceil(2);
    while low < high {
        let middle = (low + high) >> 1;
        let mut below = 0usize;
        // 16-bit counters, so that the compiler compares and counts whole vectors.
        for chunk in plane.chunks(1 << 14) {
            below += usize::from(chunk.iter().map(|&v| u16::from(v <= middle)).sum::<u16>());
        }
        if below >= half {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

/// Length of the whitened difference.
#[inline(always)]
pub(crate) fn lengths(a: &[f32], b: &[f32], c: &[f32], out: &mut [f32]) {
    for (((out, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *out = (a * a + b * b + c * c).sqrt();
    }
}

/// Takes `offset + gain * base` from every cell.
#[inline(always)]
pub(crate) fn take_out(offset: f32, gain: f32, base: &[f32], white: &mut [f32]) {
    for (white, base) in white.iter_mut().zip(base) {
        *white -= offset + gain * base;
    }
}

/// Values above `level`.
#[inline(always)]
pub(crate) fn count_above(level: f32, values: &[f32]) -> u32 {
    values.iter().map(|&value| u32::from(value > level)).sum()
}

/// Running sums kept side by side.
pub(crate) const LANES: usize = 8;

/// 1 for a response under `level`, else 0.
#[inline(always)]
pub(crate) fn mark_quiet(level: f32, length: &[f32], quiet: &mut [f32]) {
    for (quiet, &e) in quiet.iter_mut().zip(length) {
        *quiet = f32::from(u8::from(e < level));
    }
}

/// Over the quiet cells: their number, sums of baseline, difference, baseline squared and the product. Eight running sums in
/// a fixed order, so that every instruction set gives the same bits.
fn quiet_sums(quiet: &[f32], base: &[f32], white: &[f32]) -> [f32; 5] {
    let lanes = simd::quiet_lanes(quiet, base, white);
    let mut sums = lanes.map(|lanes| lanes.iter().sum::<f32>());
    let whole = quiet.len() / LANES * LANES;
    let rest = quiet.iter().zip(base).zip(white).skip(whole).filter(|((on, _), _)| **on > 0.0);
    for ((_, &b), &d) in rest {
        sums.iter_mut().zip([1.0, b, d, b * b, d * b]).for_each(|(sum, term)| *sum += term);
    }
    sums
}

/// The running sums of [`quiet_sums`]. Adding them up is left to the caller: within one function it keeps the compiler from
/// using vectors for the loop.
#[inline(always)]
pub(crate) fn quiet_lanes(quiet: &[f32], base: &[f32], white: &[f32]) -> [[f32; LANES]; 5] {
    let zero = [0f32; LANES];
    let (mut n, mut sb, mut sd, mut sbb, mut sbd) = (zero, zero, zero, zero, zero);
    let chunks = quiet.as_chunks::<LANES>().0.iter().zip(base.as_chunks::<LANES>().0);
    for ((quiet, base), white) in chunks.zip(white.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            let (b, d) = (base[lane] * quiet[lane], white[lane] * quiet[lane]);
            n[lane] += quiet[lane];
            sb[lane] += b;
            sd[lane] += d;
            sbb[lane] += b * base[lane];
            sbd[lane] += d * base[lane];
        }
    }
    [n, sb, sd, sbb, sbd]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn median_is_the_middle_of_the_sorted_cells(mut cells in prop::collection::vec(-4080i16..=4080, 1..300)) {
            let got = median(&cells);
            cells.sort_unstable();
            prop_assert_eq!(got, cells[(cells.len() - 1) / 2]);
        }
    }

    #[test]
    fn noise_in_counts_is_the_mean_of_the_channels() {
        let square: f32 = NOISE.iter().map(|s| s * s).sum::<f32>() / 3.0;
        assert!((square.sqrt() - COUNTS_PER_UNIT).abs() < 1e-3);
    }

    #[test]
    fn an_offset_and_a_gain_leave_nothing() {
        let grid = Grid::of(240, 320);
        let base: Planes =
            [0, 1, 2].map(|c| (0..grid.cells()).map(|i| ((i * (7 + c)) % 3000) as i16).collect());
        let diff: Planes = [0, 1, 2].map(|c| base[c].iter().map(|b| b / 16 + 100 * (c as i16 + 1)).collect());
        let (mut response, mut counts) = (Response::default(), Default::default());
        response.whiten(&diff, &grid, Order::Bgr);
        smooth_counts(&base, &grid, Order::Bgr, &mut Vec::new(), &mut counts);
        response.take_out_colour(&counts, &grid);
        let largest = response.length.iter().fold(0f32, |a, &b| a.max(b));
        assert!(largest < 0.2, "{largest}");
    }
}
