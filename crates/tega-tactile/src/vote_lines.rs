//! Take the lines and the light by which a camera's pictures are judged: dark, torn or frozen.

use ndarray::{ArrayView1, ArrayView2, ArrayView3, Axis, s};

/// A line lies this part of a picture's size from an edge: whichever way a picture is turned, its end is beyond one.
const PARTS: usize = 16;
/// Rows whose light counts, evenly over the picture: they lie together in memory, and a new picture is in no cache.
const LIT_ROWS: usize = 8;
/// Of a column not every pixel is asked, each of which lies elsewhere in memory; so many at least.
const FEWEST_PIXELS: usize = 40;

/// What [`vote_lines`] takes of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct VoteLines {
    /// Mean of eight rows, 0 to 255.
    pub light: f64,
    /// The bytes of a row below the top, one above the bottom, and of a column from the left and from the right.
    pub lines: [Vec<u8>; 4],
}

/// Takes a row or column a sixteenth from each edge, and the mean of eight rows.
///
/// # Examples
/// ```
/// let grey = ndarray::Array3::from_elem((64, 48, 3), 7);
/// let taken = tega_tactile::vote_lines(grey.view());
/// assert_eq!((taken.light, taken.lines.map(|line| line.len())), (7.0, [144, 144, 192, 192]));
/// ```
pub fn vote_lines(image: ArrayView3<'_, u8>) -> VoteLines {
    let (rows, columns, channels) = image.dim();
    if rows * columns * channels == 0 {
        return VoteLines { light: 0.0, lines: Default::default() };
    }
    let (from_edge, from_side) = ((rows / PARTS).max(1), (columns / PARTS).max(1));
    let stride = (rows / FEWEST_PIXELS).max(1) as isize;
    let row = |k: usize| bytes(image.index_axis(Axis(0), k));
    let column = |k: usize| bytes(image.slice(s![..; stride, k, ..]));
    let lit = image.slice(s![rows / PARTS..; (rows / LIT_ROWS).max(1) as isize, .., ..]);
    let sum: u64 = lit.outer_iter().map(sum).sum();
    VoteLines {
        light: sum as f64 / lit.len() as f64,
        lines: [
            row(from_edge - 1),
            row(rows - from_edge),
            column(from_side - 1),
            column(columns - from_side),
        ],
    }
}

fn bytes(line: ArrayView2<'_, u8>) -> Vec<u8> {
    let mut taken = Vec::with_capacity(line.len());
    for pixel in line.outer_iter() {
        taken.extend(pixel);
    }
    taken
}

fn sum(row: ArrayView2<'_, u8>) -> u64 {
    let of = |values: ArrayView1<'_, u8>| values.iter().map(|&value| u64::from(value)).sum::<u64>();
    row.as_slice().map_or_else(|| row.outer_iter().map(of).sum(), |all| of(all.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;

    #[test]
    fn lines_and_light_are_those_of_the_picture_of_either_orientation() {
        for (rows, columns) in [(320, 240), (240, 320), (96, 500), (1, 9), (9, 1)] {
            let image =
                Array3::from_shape_fn((rows, columns, 3), |(r, c, k)| ((7 * r + 3 * c + 50 * k) % 251) as u8);
            let taken = vote_lines(image.view());
            let (edge, side) = ((rows / 16).max(1), (columns / 16).max(1));
            let row = |r: usize| image.index_axis(Axis(0), r).iter().copied().collect::<Vec<u8>>();
            let step = (rows / 40).max(1);
            let column = |c: usize| image.slice(s![..;step, c, ..]).iter().copied().collect::<Vec<u8>>();
            let lines = [row(edge - 1), row(rows - edge), column(side - 1), column(columns - side)];
            assert_eq!(taken.lines, lines);
            let lit: Vec<f64> = (rows / 16..rows)
                .step_by((rows / 8).max(1))
                .flat_map(|r| row(r).into_iter().map(f64::from))
                .collect();
            assert_eq!(taken.light, lit.iter().sum::<f64>() / lit.len() as f64);
        }
    }
}
