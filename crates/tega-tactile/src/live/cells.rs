//! Average a picture over about 1,200 square cells, per colour channel.
//!
//! The mean of a cell is also the smoothing that the touch reading needs, so both cost one read of the picture.

use std::array::from_fn;

use ndarray::ArrayView3;

use crate::frame::{lines, whole_rows};

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

/// Buffers of a picture.
#[derive(Debug, Clone, Default)]
pub(super) struct Strip {
    /// Sums down the columns of bytes, and zeros past the last one.
    sums: Vec<u16>,
    /// Of all cells, part by part: the sums of a pixel's bytes, 16 bits each, and 16 bits of no meaning.
    parts: Vec<u64>,
    /// Sums over all cells, of each of a pixel's bytes.
    cells: [Vec<i32>; 3],
    copy: Vec<u8>,
}

/// Sums of a pixel's bytes, and one more.
const PIXEL: usize = 4;
/// Sums that are added up at once.
const VECTOR: usize = 16;
/// Bytes whose sum fits 16 bits.
const TOGETHER: usize = 256;
/// Rows that are summed at a time, at most.
const MOST_ROWS: usize = 16;

tega_simd::dispatched! {
    /// Averages an image of the grid's size over each cell.
    average = average_plain,
    (image: ArrayView3<'_, u8>, grid: &Grid, strip: &mut Strip, planes: &mut Planes) -> ()
}

#[inline(always)]
fn average_plain(image: ArrayView3<'_, u8>, grid: &Grid, strip: &mut Strip, planes: &mut Planes) {
    let Strip { sums, parts, cells, copy } = strip;
    // The sums of higher cells need more bits: they are those of parts, which are added up.
    let most = MOST_ROWS.min(TOGETHER / grid.side);
    let in_cell = grid.side.div_ceil(most);
    sums.clear();
    sums.resize(3 * grid.side * grid.cols + 1, 0);
    parts.resize(in_cell * grid.cells(), 0);
    for cells in &mut *cells {
        cells.resize(grid.cells(), 0);
    }
    let lines = lines(whole_rows(image, copy));
    let mut lines = lines.outer_iter();
    for row in 0..grid.rows {
        let height = grid.side.min(grid.height - row * grid.side);
        for part in 0..in_cell {
            let mut rows = [&[][..]; MOST_ROWS];
            let n = most.min(height.saturating_sub(part * most));
            for (row, line) in rows.iter_mut().zip(lines.by_ref().take(n)) {
                *row = line.to_slice().unwrap_or_default();
            }
            let width = sums.get_mut(..3 * grid.width).unwrap_or_default();
            sum_rows(rows.get(..n).unwrap_or_default(), width);
            let first = (part * grid.rows + row) * grid.cols;
            let cells = parts.get_mut(first..first + grid.cols).unwrap_or_default();
            // Of a known side the loop is unrolled: small cells are as many as large ones.
            match grid.side {
                3 => sum_cells(sums, 3, cells),
                4 => sum_cells(sums, 4, cells),
                5 => sum_cells(sums, 5, cells),
                6 => sum_cells(sums, 6, cells),
                7 => sum_cells(sums, 7, cells),
                8 => sum_cells(sums, 8, cells),
                9 => sum_cells(sums, 9, cells),
                10 => sum_cells(sums, 10, cells),
                side => sum_cells(sums, side, cells),
            }
        }
    }
    for (part, sums) in parts.chunks_exact(grid.cells()).enumerate() {
        // What the buffers held before is no part of the sum.
        let kept = if part == 0 { 0 } else { -1 };
        for (byte, cells) in cells.iter_mut().enumerate() {
            for (cell, sum) in cells.iter_mut().zip(sums) {
                *cell = (*cell & kept) + i32::from((sum >> (u16::BITS * byte as u32)) as u16);
            }
        }
    }
    for (plane, sums) in planes.iter_mut().zip(&*cells) {
        plane.resize(grid.cells(), 0);
        average_cells(sums, grid, plane);
    }
}

/// Sums rows down their columns.
#[inline(always)]
fn sum_rows(rows: &[&[u8]], sums: &mut [u16]) {
    if rows.is_empty() {
        sums.fill(0);
    }
    // All bits, or none for the first rows: what was there is no part of their sum.
    let mut kept = 0;
    let (eights, rows) = rows.as_chunks::<8>();
    for rows in eights {
        add_rows::<8>(rows, sums, std::mem::replace(&mut kept, u16::MAX));
    }
    match rows.len() {
        0 => {}
        1 => add_rows::<1>(rows, sums, kept),
        2 => add_rows::<2>(rows, sums, kept),
        3 => add_rows::<3>(rows, sums, kept),
        4 => add_rows::<4>(rows, sums, kept),
        5 => add_rows::<5>(rows, sums, kept),
        6 => add_rows::<6>(rows, sums, kept),
        _ => add_rows::<7>(rows, sums, kept),
    }
}

/// Adds as many rows, at once, to the kept bits of their columns' sums.
#[inline(always)]
fn add_rows<const N: usize>(rows: &[&[u8]], sums: &mut [u16], kept: u16) {
    let rows: [&[u8]; N] = from_fn(|row| rows.get(row).copied().unwrap_or_default());
    let n = rows.iter().map(|row| row.len()).min().unwrap_or_default().min(sums.len());
    let (rows, sums) = (rows.map(|row| &row[..n]), &mut sums[..n]);
    let Some(end) = sums.last_chunk().copied() else {
        for k in 0..n {
            sums[k] = (sums[k] & kept) + rows.iter().map(|row| u16::from(row[k])).sum::<u16>();
        }
        return;
    };
    // The last vector overlaps the one before it, so both add to what was there.
    let end = added(end, kept, rows.map(|row| row.last_chunk().unwrap_or(&[0; VECTOR])));
    let vectors = sums.as_chunks_mut().0;
    let bytes = rows.map(|row| &row.as_chunks().0[..vectors.len()]);
    for (k, sums) in vectors.iter_mut().enumerate() {
        *sums = added(*sums, kept, bytes.map(|row| &row[k]));
    }
    if let Some(last) = sums.last_chunk_mut() {
        *last = end;
    }
}

/// Bytes of rows, added to the kept bits of their sums.
#[inline(always)]
fn added<const N: usize>(sums: [u16; VECTOR], kept: u16, rows: [&[u8; VECTOR]; N]) -> [u16; VECTOR] {
    let mut total = sums.map(|sum| sum & kept);
    for row in rows {
        (0..VECTOR).for_each(|lane| total[lane] += u16::from(row[lane]));
    }
    total
}

/// Sums the columns' sums over each cell: the pixels' numbers, four at a time. No sum overflows, and what comes
/// behind them in the number means nothing.
#[inline(always)]
fn sum_cells(sums: &[u16], side: usize, cells: &mut [u64]) {
    let pixels = |columns: &[u16]| columns.windows(PIXEL).step_by(3).map(number).sum::<u64>();
    for (cell, columns) in cells.iter_mut().zip(sums.windows(3 * side + 1).step_by(3 * side)) {
        let fours = columns.windows(13).step_by(12).map(pixels).sum::<u64>();
        *cell = fours + columns.get(12 * (side / 4)..).map_or(0, pixels);
    }
}

/// A pixel's sums as one number.
fn number(sums: &[u16]) -> u64 {
    let sums: &[u16; PIXEL] = sums.first_chunk().unwrap_or(&[0; PIXEL]);
    sums.iter().rev().fold(0, |number, sum| (number << u16::BITS) | u64::from(*sum))
}

/// Means of cells from their sums, halves rounded up.
#[inline(always)]
fn average_cells(sums: &[i32], grid: &Grid, means: &mut [i16]) {
    let mean = |sum: &i32, pixels: usize| whole(*sum as f32 * (UNITS_PER_COUNT / pixels as f32) + 0.5) as i16;
    for (of, sum) in means.iter_mut().zip(sums) {
        *of = mean(sum, grid.side * grid.side);
    }
    // Those that the border cuts.
    let [height, width] = [(grid.height, grid.rows), (grid.width, grid.cols)]
        .map(|(length, cells)| length - (cells - 1) * grid.side);
    if width < grid.side {
        for (of, sum) in means.iter_mut().zip(sums).skip(grid.cols - 1).step_by(grid.cols) {
            *of = mean(sum, width * grid.side);
        }
    }
    if height < grid.side {
        let last = means.iter_mut().zip(sums).skip((grid.rows - 1) * grid.cols);
        for (col, (of, sum)) in last.enumerate() {
            *of = mean(sum, height * if col + 1 == grid.cols { width } else { grid.side });
        }
    }
}

/// The whole part of a number from 0 to 2²², in what vectors compute side by side.
#[inline(always)]
fn whole(value: f32) -> i32 {
    const WHOLE: f32 = (1 << 23) as f32;
    let nearest = value + WHOLE;
    nearest.to_bits() as i32 - WHOLE.to_bits() as i32 - i32::from(nearest - WHOLE > value)
}

/// A sum of 64 pixels as their mean, in sixteenths of a count, halves rounded up.
#[inline(always)]
pub(super) fn octet_mean(sum: i16) -> i16 {
    (sum + 2) >> 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn cell_means_are_those_of_the_pixels() {
        let sizes = [(1, 1), (1, 9), (7, 5), (100, 75), (239, 322), (430, 500), (960, 720), (1100, 2500)];
        // Cells of 4 to 10 pixels.
        for (height, width) in sizes.into_iter().chain((4..=10).map(|side| (40 * side - 1, 30 * side))) {
            let image = Array3::from_shape_fn((height, width, 3), |(y, x, c)| {
                // As bright as can be in one corner.
                if y + x < 200 { 255 } else { ((y * 7 + x * 13 + c * 50) % 251) as u8 }
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
                        let wanted = (sum as f32 * (UNITS_PER_COUNT / n as f32) + 0.5) as i16;
                        let got = plane[row * grid.cols + col];
                        assert_eq!(got, wanted, "{height}x{width} cell {row},{col}");
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
