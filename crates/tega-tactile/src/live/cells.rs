//! Average a picture over about 1,200 square cells, per colour channel.
//!
//! The mean of a cell is also the smoothing that the touch reading needs, so both cost one read of the picture.

use ndarray::{ArrayView3, Axis};

use crate::frame::row_bytes;

/// Cells along the picture's diagonal: 8 pixels a cell at 240 x 320, the same cells of the gel at any resolution.
const CELLS_PER_DIAGONAL: f64 = 50.0;
/// Cell means are kept in sixteenths of a count.
pub(super) const UNITS_PER_COUNT: f32 = 16.0;

/// How a picture is divided into cells; those of the last row and column may be cut by the picture's border.
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

    /// Whether every cell is one of 8 x 8 pixels.
    pub fn octets(&self) -> bool {
        self.side == 8 && self.width.is_multiple_of(8) && self.height.is_multiple_of(8)
    }
}

/// Three planes of cell means, in sixteenths of a count, in the order of the pixel's bytes.
pub(super) type Planes = [Vec<i16>; 3];

/// Buffers of one row of cells.
#[derive(Debug, Clone, Default)]
pub(super) struct Strip {
    /// Sums down the columns, and zeros for the last cell's neighbours on the right.
    sums: Vec<i16>,
    folded: Vec<i16>,
    gathered: Vec<u8>,
}

impl Strip {
    /// Sizes the buffers and clears the sums.
    fn clear(&mut self, grid: &Grid) {
        let length = 3 * grid.side * grid.cols;
        self.sums.clear();
        self.sums.resize(length + OCTET, 0);
        self.folded.resize(length, 0);
    }
}

/// Bytes of eight pixels.
const OCTET: usize = 24;

tega_simd::dispatched! {
    /// Averages an image of the grid's size over each cell.
    average = average_plain,
    (image: ArrayView3<'_, u8>, grid: &Grid, strip: &mut Strip, planes: &mut Planes) -> ()
}

#[inline(always)]
fn average_plain(image: ArrayView3<'_, u8>, grid: &Grid, strip: &mut Strip, planes: &mut Planes) {
    for plane in planes.iter_mut() {
        plane.resize(grid.cells(), 0);
    }
    strip.clear(grid);
    match image.as_slice() {
        Some(bytes) if grid.octets() => average_octets(bytes, grid, strip, planes),
        _ => average_rows(image, grid, strip, planes),
    }
}

/// Whole cells of 8 x 8 pixels: four rows of bytes a time.
#[inline(always)]
fn average_octets(bytes: &[u8], grid: &Grid, strip: &mut Strip, planes: &mut Planes) {
    let stride = 3 * grid.width;
    let [p0, p1, p2] = planes;
    let cells = p0
        .chunks_exact_mut(grid.cols)
        .zip(p1.chunks_exact_mut(grid.cols))
        .zip(p2.chunks_exact_mut(grid.cols));
    for (rows, ((p0, p1), p2)) in bytes.chunks_exact(8 * stride).zip(cells) {
        let sums = strip.sums.get_mut(..stride).unwrap_or_default();
        sum_eight_rows(sums, rows);
        fold_octets(&strip.sums, &mut strip.folded);
        for (((octet, a), b), c) in strip.folded.as_chunks::<OCTET>().0.iter().zip(p0).zip(p1).zip(p2) {
            (*a, *b, *c) = (octet[0], octet[1], octet[2]);
        }
    }
}

/// Any cells, any strides: a row at a time.
#[inline(always)]
fn average_rows(image: ArrayView3<'_, u8>, grid: &Grid, strip: &mut Strip, planes: &mut Planes) {
    for (y, row) in image.axis_iter(Axis(0)).enumerate() {
        add_row(&mut strip.sums, row_bytes(&row, &mut strip.gathered));
        let row = y / grid.side;
        let first = row * grid.side;
        let end = (first + grid.side).min(grid.height);
        if y + 1 == end {
            fold(&strip.sums, grid, row, end - first, planes);
            strip.sums.fill(0);
        }
    }
}

/// Sums eight rows of bytes down their columns.
#[inline(always)]
fn sum_eight_rows(sums: &mut [i16], rows: &[u8]) {
    let n = sums.len();
    let row = |k: usize| rows.get(k * n..(k + 1) * n).unwrap_or_default();
    let upper = row(0).iter().zip(row(1)).zip(row(2)).zip(row(3));
    let lower = row(4).iter().zip(row(5)).zip(row(6)).zip(row(7));
    for ((sum, (((a, b), c), d)), (((e, f), g), h)) in sums.iter_mut().zip(upper).zip(lower) {
        let upper = i16::from(*a) + i16::from(*b) + i16::from(*c) + i16::from(*d);
        *sum = upper + i16::from(*e) + i16::from(*f) + i16::from(*g) + i16::from(*h);
    }
}

/// Adds a row to the column sums. At most 116 rows are added (images up to 4096 pixels): 29,580 fits.
#[inline(always)]
fn add_row(sums: &mut [i16], row: &[u8]) {
    for (sum, &value) in sums.iter_mut().zip(row) {
        *sum += i16::from(value);
    }
}

/// Turns sums of eight rows into means of 64 pixels from every byte on, in sixteenths of a count, halves rounded up. `sums` has an octet more
/// than `folded`.
#[inline(always)]
fn fold_octets(sums: &[i16], folded: &mut [i16]) {
    let n = folded.len();
    let from = |pixel: usize| sums.get(3 * pixel..3 * pixel + n).unwrap_or_default();
    let left = from(0).iter().zip(from(1)).zip(from(2)).zip(from(3));
    let right = from(4).iter().zip(from(5)).zip(from(6)).zip(from(7));
    for ((out, (((a, b), c), d)), (((e, f), g), h)) in folded.iter_mut().zip(left).zip(right) {
        *out = octet_mean(a + b + c + d + e + f + g + h);
    }
}

/// A sum of 64 pixels as their mean, in sixteenths of a count, halves rounded up.
#[inline(always)]
pub(super) fn octet_mean(sum: i16) -> i16 {
    (sum + 2) >> 2
}

/// Column sums of `height` rows to cell means, for any side and for cells cut by the border.
#[inline(always)]
fn fold(sums: &[i16], grid: &Grid, row: usize, height: usize, planes: &mut Planes) {
    for (c, plane) in planes.iter_mut().enumerate() {
        let cells = plane.iter_mut().skip(row * grid.cols).take(grid.cols);
        for ((col, mean), pixels) in cells.enumerate().zip(sums.chunks_exact(3 * grid.side)) {
            let sum: i32 = pixels.iter().skip(c).step_by(3).map(|&v| i32::from(v)).sum();
            let width = grid.side.min(grid.width - col * grid.side);
            *mean = (sum as f32 * (UNITS_PER_COUNT / (width * height) as f32) + 0.5) as i16;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn cell_means_are_those_of_the_pixels() {
        for (height, width) in
            [(1, 1), (1, 9), (7, 5), (120, 160), (320, 240), (240, 320), (239, 322), (430, 500)]
        {
            let image = Array3::from_shape_fn((height, width, 3), |(y, x, c)| {
                ((y * 7 + x * 13 + c * 50) % 251) as u8
            });
            let grid = Grid::of(height, width);
            let mut planes = Planes::default();
            average(image.view(), &grid, &mut Strip::default(), &mut planes);
            for row in 0..grid.rows {
                for col in 0..grid.cols {
                    for (c, plane) in planes.iter().enumerate() {
                        let (mut sum, mut n) = (0i32, 0);
                        for y in row * grid.side..((row + 1) * grid.side).min(height) {
                            for x in col * grid.side..((col + 1) * grid.side).min(width) {
                                sum += i32::from(image[[y, x, c]]);
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
    fn strides_do_not_matter() {
        let image = Array3::from_shape_fn((64, 80, 3), |(y, x, c)| ((y * 31 + x * 17 + c * 90) % 256) as u8);
        let mut turned = image.view();
        turned.invert_axis(Axis(0));
        let (grid, mut strip) = (Grid::of(64, 80), Strip::default());
        let (mut a, mut b) = (Planes::default(), Planes::default());
        average(turned, &grid, &mut strip, &mut a);
        average(turned.to_owned().view(), &grid, &mut strip, &mut b);
        assert_eq!(a, b);
    }

    #[test]
    fn cells_follow_the_scale_of_the_image() {
        assert_eq!(Grid::of(240, 320).side, 8);
        assert_eq!(Grid::of(480, 640).side, 16);
        assert_eq!(Grid::of(2464, 3280).side, 82);
        assert_eq!(Grid::of(1, 1).side, 1);
    }
}
