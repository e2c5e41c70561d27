//! The image reduced to some 1,200 square cells: mean difference per cell and channel.
//!
//! Averaging over a cell is also the smoothing that the response needs, so both cost one read of the images.

use super::basins::Cell;
use crate::frame::Pair;
use crate::simd;

/// Cells along the image's diagonal: 8 pixels a cell at 240 x 320, the same picture at any resolution. Cells of half
/// that size outline real presses no better and cost four times as much.
const CELLS_PER_DIAGONAL: f64 = 50.0;
/// Cell values are kept in sixteenths of a count.
pub(super) const UNITS_PER_COUNT: f32 = 16.0;

/// How an image is divided into cells; those of the last row and column may be cut by the image's border.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Grid {
    pub height: usize,
    pub width: usize,
    /// Side of a cell in pixels.
    pub side: usize,
    pub rows: usize,
    pub cols: usize,
}

impl Grid {
    pub fn of(height: usize, width: usize) -> Self {
        let diagonal = ((height * height + width * width) as f64).sqrt();
        let side = ((diagonal / CELLS_PER_DIAGONAL).round() as usize).max(1);
        Self { height, width, side, rows: height.div_ceil(side), cols: width.div_ceil(side) }
    }

    pub fn cells(&self) -> usize {
        self.rows * self.cols
    }

    /// Width of a row of cells with one more at either end.
    pub fn stride(&self) -> usize {
        self.cols + 2
    }

    /// Cells with a border of one around them.
    pub fn padded_cells(&self) -> usize {
        self.stride() * (self.rows + 2)
    }

    pub fn index(&self, cell: Cell) -> usize {
        usize::from(cell.y) * self.cols + usize::from(cell.x)
    }

    pub fn padded_index(&self, cell: Cell) -> usize {
        (usize::from(cell.y) + 1) * self.stride() + usize::from(cell.x) + 1
    }

    /// Length of the diagonal in cells.
    pub fn diagonal(&self) -> f32 {
        ((self.rows * self.rows + self.cols * self.cols) as f32).sqrt()
    }
}

/// What is averaged over the cells.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source<'a> {
    /// Frame less baseline.
    Difference,
    /// The same, of a baseline whose sums over whole cells are known: it is not read again.
    Since(&'a Planes),
    Baseline,
    /// The sums over whole cells themselves; without whole cells there are none.
    BaselineSums,
}

/// Three planes of cell means, in sixteenths of a count, in the order of the pixel's bytes.
pub(super) type Planes = [Vec<i16>; 3];

/// Buffers of one row of cells.
#[derive(Debug, Default)]
pub(super) struct Strip {
    /// Sums down the columns, and zeros for the last cell's neighbours on the right.
    sums: Vec<i16>,
    folded: Vec<i16>,
}

impl Strip {
    /// Sizes the buffers and clears the sums.
    pub fn clear(&mut self, grid: &Grid) {
        let length = 3 * grid.side * grid.cols;
        self.sums.clear();
        self.sums.resize(length + OCTET, 0);
        self.folded.resize(length, 0);
    }

    /// Sums down the columns of whole cells.
    pub fn sums(&mut self) -> &mut [i16] {
        let length = self.sums.len().saturating_sub(OCTET);
        self.sums.get_mut(..length).unwrap_or_default()
    }
}

/// Least and greatest of some values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range {
    least: i32,
    most: i32,
}

impl Default for Range {
    fn default() -> Self {
        Self { least: i32::MAX, most: i32::MIN }
    }
}

impl Range {
    fn add(&mut self, value: i32) {
        self.least = self.least.min(value);
        self.most = self.most.max(value);
    }

    pub fn width(self) -> i32 {
        self.most - self.least
    }
}

/// Bytes of eight pixels.
const OCTET: usize = 24;

/// Averages `source` over each cell.
pub(super) fn average(
    pair: &Pair<'_>,
    grid: &Grid,
    source: Source<'_>,
    strip: &mut Strip,
    planes: &mut Planes,
) {
    for plane in planes.iter_mut() {
        plane.resize(grid.cells(), 0);
    }
    strip.clear(grid);
    let whole = grid.side == 8 && grid.width.is_multiple_of(8) && grid.height.is_multiple_of(8);
    match (pair.contiguous(), source) {
        (Some((frame, baseline)), _) if whole => average_octets(frame, baseline, grid, source, strip, planes),
        (_, Source::BaselineSums) => planes.iter_mut().for_each(Vec::clear),
        _ => average_rows(pair, grid, source, strip, planes),
    }
}

/// Whole cells of 8 x 8 pixels: four rows of bytes a time.
fn average_octets(
    frame: &[u8],
    baseline: &[u8],
    grid: &Grid,
    source: Source<'_>,
    strip: &mut Strip,
    planes: &mut Planes,
) {
    let stride = 3 * grid.width;
    let rows = frame.chunks_exact(8 * stride).zip(baseline.chunks_exact(8 * stride));
    let [p0, p1, p2] = planes;
    let cells = p0
        .chunks_exact_mut(grid.cols)
        .zip(p1.chunks_exact_mut(grid.cols))
        .zip(p2.chunks_exact_mut(grid.cols));
    for ((frame, baseline), ((p0, p1), p2)) in rows.zip(cells) {
        let sums = strip.sums.get_mut(..stride).unwrap_or_default();
        sums.fill(0);
        for (frame, baseline) in frame.chunks_exact(4 * stride).zip(baseline.chunks_exact(4 * stride)) {
            match source {
                Source::Difference => simd::add_four_differences(sums, frame, baseline),
                Source::Since(_) => simd::add_four_rows(sums, frame),
                Source::Baseline | Source::BaselineSums => simd::add_four_rows(sums, baseline),
            }
        }
        // A sum over 64 pixels, or that in sixteenths of a count.
        let shift = if matches!(source, Source::Since(_) | Source::BaselineSums) { 0 } else { 2 };
        simd::fold_octets(&strip.sums, shift, &mut strip.folded);
        for (((octet, a), b), c) in strip.folded.as_chunks::<OCTET>().0.iter().zip(p0).zip(p1).zip(p2) {
            (*a, *b, *c) = (octet[0], octet[1], octet[2]);
        }
    }
    if let Source::Since(known) = source {
        for (plane, known) in planes.iter_mut().zip(known) {
            for (mean, known) in plane.iter_mut().zip(known) {
                *mean = (*mean - known + 2) >> 2;
            }
        }
    }
}

/// Any cells, any strides: a row at a time.
fn average_rows(pair: &Pair<'_>, grid: &Grid, source: Source<'_>, strip: &mut Strip, planes: &mut Planes) {
    pair.for_each_row(|y, frame, baseline| {
        match source {
            Source::Difference | Source::Since(_) => {
                simd::add_difference(&mut strip.sums, frame, baseline);
            }
            Source::Baseline | Source::BaselineSums => simd::add_row(&mut strip.sums, baseline),
        }
        let row = y / grid.side;
        let first = row * grid.side;
        let end = (first + grid.side).min(grid.height);
        if y + 1 == end {
            fold(&strip.sums, grid, row, end - first, planes);
            strip.sums.fill(0);
        }
    });
}

/// Adds four rows of `frame - baseline` to the column sums.
#[inline(always)]
pub(crate) fn add_four_differences(sums: &mut [i16], frame: &[u8], baseline: &[u8]) {
    let n = sums.len();
    let (Some([f0, f1, f2, f3]), Some([b0, b1, b2, b3])) = (four_rows(frame, n), four_rows(baseline, n))
    else {
        return;
    };
    let frame = f0.iter().zip(f1).zip(f2).zip(f3);
    let baseline = b0.iter().zip(b1).zip(b2).zip(b3);
    for ((sum, (((f0, f1), f2), f3)), (((b0, b1), b2), b3)) in sums.iter_mut().zip(frame).zip(baseline) {
        let frame = i16::from(*f0) + i16::from(*f1) + i16::from(*f2) + i16::from(*f3);
        let baseline = i16::from(*b0) + i16::from(*b1) + i16::from(*b2) + i16::from(*b3);
        *sum += frame - baseline;
    }
}

/// Adds four rows to the column sums.
#[inline(always)]
pub(crate) fn add_four_rows(sums: &mut [i16], rows: &[u8]) {
    let Some([r0, r1, r2, r3]) = four_rows(rows, sums.len()) else { return };
    for ((((sum, r0), r1), r2), r3) in sums.iter_mut().zip(r0).zip(r1).zip(r2).zip(r3) {
        *sum += i16::from(*r0) + i16::from(*r1) + i16::from(*r2) + i16::from(*r3);
    }
}

/// The first four rows of `n` bytes.
#[inline(always)]
fn four_rows(bytes: &[u8], n: usize) -> Option<[&[u8]; 4]> {
    let (a, rest) = bytes.split_at_checked(n)?;
    let (b, rest) = rest.split_at_checked(n)?;
    let (c, rest) = rest.split_at_checked(n)?;
    Some([a, b, c, rest.get(..n)?])
}

/// Adds `frame - baseline` to the column sums. At most 116 rows are added (images up to 4096 pixels): 29,580 fits.
#[inline(always)]
pub(crate) fn add_difference(sums: &mut [i16], frame: &[u8], baseline: &[u8]) {
    for ((sum, &f), &b) in sums.iter_mut().zip(frame).zip(baseline) {
        *sum += i16::from(f) - i16::from(b);
    }
}

/// Adds a row to the column sums.
#[inline(always)]
pub(crate) fn add_row(sums: &mut [i16], row: &[u8]) {
    for (sum, &value) in sums.iter_mut().zip(row) {
        *sum += i16::from(value);
    }
}

/// Turns column sums into sums of eight neighbouring pixels from every byte on, over `2^shift`, halves rounded up. `sums` has an
/// octet more than `folded`.
#[inline(always)]
pub(crate) fn fold_octets(sums: &[i16], shift: u32, folded: &mut [i16]) {
    let n = folded.len();
    let from = |pixel: usize| sums.get(3 * pixel..3 * pixel + n).unwrap_or_default();
    let half = (1 << shift) >> 1;
    let left = from(0).iter().zip(from(1)).zip(from(2)).zip(from(3));
    let right = from(4).iter().zip(from(5)).zip(from(6)).zip(from(7));
    for ((out, (((a, b), c), d)), (((e, f), g), h)) in folded.iter_mut().zip(left).zip(right) {
        *out = (a + b + c + d + e + f + g + h + half) >> shift;
    }
}

/// Widens the ranges by the strip's cells, as sums over their pixels; a cell that the border cuts counts as if whole.
pub(super) fn widen(strip: &mut Strip, grid: &Grid, ranges: &mut [Range; 3]) {
    if grid.side == 8 && grid.width.is_multiple_of(8) {
        simd::fold_octets(&strip.sums, 0, &mut strip.folded);
        for octet in strip.folded.as_chunks::<OCTET>().0 {
            for (range, &sum) in ranges.iter_mut().zip(octet) {
                range.add(i32::from(sum));
            }
        }
        return;
    }
    let cells = strip.sums.chunks_exact(3 * grid.side).take(grid.cols);
    for (col, pixels) in cells.enumerate() {
        let width = grid.side.min(grid.width - col * grid.side);
        for (c, range) in ranges.iter_mut().enumerate() {
            let sum: i32 = pixels.iter().skip(c).step_by(3).map(|&v| i32::from(v)).sum();
            range.add(sum * grid.side as i32 / width as i32);
        }
    }
}

/// Column sums of `height` rows to cell means, for any side and for cells cut by the border.
fn fold(sums: &[i16], grid: &Grid, row: usize, height: usize, planes: &mut Planes) {
    for (c, plane) in planes.iter_mut().enumerate() {
        let cells = plane.iter_mut().skip(row * grid.cols).take(grid.cols);
        for ((col, mean), pixels) in cells.enumerate().zip(sums.chunks_exact(3 * grid.side)) {
            let sum: i32 = pixels.iter().skip(c).step_by(3).map(|&v| i32::from(v)).sum();
            let width = grid.side.min(grid.width - col * grid.side);
            let exact = sum as f32 * (UNITS_PER_COUNT / (width * height) as f32);
            // Shifted to positive numbers, where truncation rounds down.
            *mean = ((exact + 4096.5) as i32 - 4096) as i16;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    fn means(height: usize, width: usize) -> (Planes, Grid, Array3<u8>, Array3<u8>) {
        let frame =
            Array3::from_shape_fn((height, width, 3), |(y, x, c)| ((y * 7 + x * 13 + c * 50) % 251) as u8);
        let baseline = Array3::from_shape_fn((height, width, 3), |(y, x, c)| ((y * x + c * 31) % 241) as u8);
        let pair = Pair::new(frame.view(), baseline.view()).unwrap();
        let grid = Grid::of(height, width);
        let mut planes = Planes::default();
        average(&pair, &grid, Source::Difference, &mut Strip::default(), &mut planes);
        (planes, grid, frame, baseline)
    }

    #[test]
    fn cell_means_are_those_of_the_pixels() {
        for (height, width) in
            [(1, 1), (1, 9), (7, 5), (120, 160), (320, 240), (240, 320), (239, 322), (430, 500)]
        {
            let (planes, grid, frame, baseline) = means(height, width);
            for row in 0..grid.rows {
                for col in 0..grid.cols {
                    for (c, plane) in planes.iter().enumerate() {
                        let (mut sum, mut n) = (0i32, 0);
                        for y in row * grid.side..((row + 1) * grid.side).min(height) {
                            for x in col * grid.side..((col + 1) * grid.side).min(width) {
                                sum += i32::from(frame[[y, x, c]]) - i32::from(baseline[[y, x, c]]);
                                n += 1;
                            }
                        }
                        let wanted = f64::from(sum) * 16.0 / f64::from(n);
                        let got = f64::from(plane[row * grid.cols + col]);
                        assert!(
                            (got - wanted).abs() <= 0.51,
                            "{height}x{width} cell {row},{col}: {got} {wanted}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn cells_follow_the_scale_of_the_image() {
        assert_eq!(Grid::of(240, 320).side, 8);
        assert_eq!(Grid::of(480, 640).side, 16);
        assert_eq!(Grid::of(2464, 3280).side, 82);
        assert_eq!(Grid::of(1, 1).side, 1);
    }
}
