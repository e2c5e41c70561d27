//! The image reduced to about 5,000 square cells: mean difference per cell and channel.
//!
//! Averaging over a cell is also the smoothing that the response needs, so both cost one read of the images.

use crate::frame::Pair;
use crate::simd;

/// Cells along the image's diagonal: 4 pixels a cell at 240 x 320, the same picture at any resolution.
const CELLS_PER_DIAGONAL: f64 = 100.0;
/// Cell values are kept in sixteenths of a count: exact for cells of 4 x 4 pixels.
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

    /// Length of the diagonal in cells.
    pub fn diagonal(&self) -> f32 {
        ((self.rows * self.rows + self.cols * self.cols) as f32).sqrt()
    }
}

/// What is averaged over the cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    Difference,
    Baseline,
}

/// Three planes of cell means, in sixteenths of a count, in the order of the pixel's bytes.
pub(super) type Planes = [Vec<i16>; 3];

/// Buffers of one row of cells.
#[derive(Debug, Default)]
pub(super) struct Strip {
    sums: Vec<i16>,
    pairs: Vec<i16>,
    quads: Vec<i16>,
}

/// Averages `source` over each cell.
pub(super) fn average(pair: &Pair<'_>, grid: &Grid, source: Source, strip: &mut Strip, planes: &mut Planes) {
    for plane in planes.iter_mut() {
        plane.resize(grid.cells(), 0);
    }
    let length = 3 * grid.side * grid.cols;
    for buffer in [&mut strip.sums, &mut strip.pairs, &mut strip.quads] {
        buffer.clear();
        buffer.resize(length, 0);
    }
    pair.for_each_row(|y, frame, baseline| {
        match source {
            Source::Difference => simd::add_difference(&mut strip.sums, frame, baseline),
            Source::Baseline => simd::add_row(&mut strip.sums, baseline),
        }
        let row = y / grid.side;
        let first = row * grid.side;
        let last = (first + grid.side).min(grid.height) - 1;
        if y == last {
            if grid.side == 4 && last - first == 3 && grid.width.is_multiple_of(4) {
                simd::fold_quads(&strip.sums, &mut strip.pairs, &mut strip.quads);
                scatter_quads(&strip.quads, row, grid.cols, planes);
            } else {
                fold(&strip.sums, grid, row, last + 1 - first, planes);
            }
            strip.sums.fill(0);
        }
    });
}

/// Adds `frame - baseline` to the column sums. At most 58 rows are added (images up to 4096 pixels): 14,790 fits.
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

/// Sums of four neighbouring pixels from every byte on, in two doublings; each twelfth is a cell's.
#[inline(always)]
pub(crate) fn fold_quads(sums: &[i16], pairs: &mut [i16], quads: &mut [i16]) {
    for ((out, a), b) in pairs.iter_mut().zip(sums).zip(sums.iter().skip(3)) {
        *out = a + b;
    }
    for ((out, a), b) in quads.iter_mut().zip(pairs.iter()).zip(pairs.iter().skip(6)) {
        *out = a + b;
    }
}

fn scatter_quads(quads: &[i16], row: usize, cols: usize, planes: &mut Planes) {
    let [p0, p1, p2] = planes;
    let cells = row * cols..(row + 1) * cols;
    if let (Some(p0), Some(p1), Some(p2)) =
        (p0.get_mut(cells.clone()), p1.get_mut(cells.clone()), p2.get_mut(cells))
    {
        for (((quad, a), b), c) in quads.chunks_exact(12).zip(p0).zip(p1).zip(p2) {
            *a = quad[0];
            *b = quad[1];
            *c = quad[2];
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
        for (height, width) in [(1, 1), (1, 9), (7, 5), (120, 160), (320, 240), (239, 322), (430, 500)] {
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
        assert_eq!(Grid::of(240, 320).side, 4);
        assert_eq!(Grid::of(480, 640).side, 8);
        assert_eq!(Grid::of(2464, 3280).side, 41);
        assert_eq!(Grid::of(1, 1).side, 1);
    }
}
