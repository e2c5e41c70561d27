//! Find the middle of a dent in a light that is not even.
//!
//! A gel's light answers several times as strongly to a slope in one part of the picture as in another, so that the outline of a long dent reaches too
//! far towards the stronger part. The middle is that of the same outline, drawn with each change of colour divided by what the light answers
//! there. Cells at the rim are counted by degrees, so that it moves smoothly.

use super::cells::Grid;
use super::colour::{LANES, total};
use super::peak::{half_share, peak};

/// Around the outline's level a cell is counted by degrees, over so much of the mean of both maps; half or twice as much moves the middle by a
/// hundredth of a millimetre.
pub(super) const RIM: f32 = 0.1;

/// Takes middles; made once for a sensor. Every buffer has a whole number of lanes.
#[derive(Debug, Clone, Default)]
pub(super) struct Middle {
    even: Vec<f32>,
    /// Pixels of a cell, and the sums of their columns and of their rows.
    pixels: [Vec<f32>; 3],
    counted: Vec<f32>,
}

impl Middle {
    /// `even` is what a change of colour is multiplied by so that a slope counts alike everywhere, a value a cell.
    pub fn of(mut even: Vec<f32>, grid: &Grid) -> Self {
        let padded = grid.cells().next_multiple_of(LANES);
        let cells = || (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
        // Pixels of a cell along one side of the picture and the mean of their numbers; the last cell may be cut.
        let along = |k: usize, length: usize| {
            let n = grid.side.min(length - k * grid.side);
            (n as f32, (2 * k * grid.side + n - 1) as f32 / 2.0)
        };
        let field = |of: &dyn Fn(usize, usize) -> f32| {
            let mut field: Vec<f32> = cells().map(|(row, col)| of(row, col)).collect();
            field.resize(padded, 0.0);
            field
        };
        let size = |row, col| along(row, grid.height).0 * along(col, grid.width).0;
        even.resize(padded, 0.0);
        Self {
            even,
            pixels: [
                field(&size),
                field(&|row, col| size(row, col) * along(col, grid.width).1),
                field(&|row, col| size(row, col) * along(row, grid.height).1),
            ],
            counted: vec![0.0; padded],
        }
    }

    /// Middle (column, row) of what change of colour and depth outline at a level; `peaks` are theirs. NaN where they outline nothing.
    pub fn find(&mut self, maps: [&[f32]; 2], peaks: [f32; 2], level: f32) -> (f64, f64) {
        let [n, x, y] = sums(self, maps, peaks, level).map(f64::from);
        (x / n, y / n)
    }

    #[inline(always)]
    fn sums(&mut self, [change, depth]: [&[f32]; 2], [strongest, deepest]: [f32; 2], level: f32) -> [f32; 3] {
        let counted = &mut self.counted;
        counted.iter_mut().zip(change).zip(&self.even).for_each(|((v, e), even)| *v = e * even);
        let strongest = if strongest > 0.0 { peak(counted) } else { 0.0 };
        let (per_change, per_depth) = (half_share(strongest) / RIM, half_share(deepest) / RIM);
        let from = level / RIM - 0.5;
        for (v, h) in counted.iter_mut().zip(depth) {
            *v = (*v * per_change + h * per_depth - from).clamp(0.0, 1.0);
        }
        let [n, x, y] = &self.pixels;
        products(counted, [n, x, y]).map(|lanes| total(&lanes))
    }
}

tega_simd::dispatched! {
    /// See [`Middle::sums`].
    sums = Middle::sums, (middle: &mut Middle, maps: [&[f32]; 2], peaks: [f32; 2], level: f32) -> [f32; 3]
}

/// Sums of values times each of three others.
#[inline(always)]
fn products(values: &[f32], others: [&[f32]; 3]) -> [[f32; LANES]; 3] {
    let mut sums = [[0f32; LANES]; 3];
    let [a, b, c] = others.map(|other| other.as_chunks::<LANES>().0);
    for (((v, a), b), c) in values.as_chunks::<LANES>().0.iter().zip(a).zip(b).zip(c) {
        for lane in 0..LANES {
            sums[0][lane] += v[lane] * a[lane];
            sums[1][lane] += v[lane] * b[lane];
            sums[2][lane] += v[lane] * c[lane];
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::dent::DENT_LEVEL;
    use crate::live::light::{GelLight, Slopes};
    use crate::live::shape::{Outliner, outline};

    fn middle_of(grid: &Grid) -> (Middle, Vec<f32>) {
        let even = Slopes::of(&GelLight::default(), [1.32, 0.65, 1.17], [0, 1, 2], grid).even;
        (Middle::of(even.clone(), grid), even)
    }

    #[test]
    fn a_dent_of_even_slopes_has_its_middle_where_it_is_in_a_light_that_is_not_even() {
        let grid = Grid::of(320, 240);
        let (mut middle, even) = middle_of(&grid);
        let (rows, cols) = (3..37, 24..30);
        let flat = vec![0.0; grid.cells()];
        let change: Vec<f32> = (0..grid.cells())
            .map(|k| if rows.contains(&(k / 30)) && cols.contains(&(k % 30)) { 1.0 / even[k] } else { 0.0 })
            .collect();
        let strongest = peak(&change);
        let (x, y) = middle.find([&change, &flat], [strongest, 0.0], DENT_LEVEL);
        assert!((x - 215.5).abs() < 1e-3 && (y - 159.5).abs() < 1e-3, "{x} {y}");
        // At this side the light answers most strongly at the bottom: the outline in the picture's own colours lies lower.
        let seen: Vec<f32> = change.iter().map(|e| 0.5 * e / strongest).collect();
        let (_, y) = outline(&Outliner::of(&grid), &seen, DENT_LEVEL).centroid();
        assert!(y > 159.5 + 18.0, "{y}");
    }

    #[test]
    fn cells_that_the_border_cuts_count_by_their_pixels() {
        for (height, width) in [(33, 41), (239, 323), (320, 240)] {
            let grid = Grid::of(height, width);
            let (mut middle, even) = middle_of(&grid);
            let change: Vec<f32> = even.iter().map(|even| 1.0 / even).collect();
            let (x, y) = middle.find([&change, &change], [peak(&change), 0.0], DENT_LEVEL);
            let wanted = [width, height].map(|n| (n - 1) as f64 / 2.0);
            assert!((x - wanted[0]).abs() < 1e-3 && (y - wanted[1]).abs() < 1e-3, "{x} {y}, {wanted:?}");
        }
    }

    #[test]
    fn nothing_outlined_has_no_middle() {
        let grid = Grid::of(48, 64);
        let (mut middle, even) = middle_of(&grid);
        let nothing = vec![0.0; even.len()];
        let (x, y) = middle.find([&nothing, &nothing], [0.0, 0.0], DENT_LEVEL);
        assert!(x.is_nan() && y.is_nan());
    }
}
