//! Depth from shading: slopes of the gel from its colours, and the surface whose slopes they are.
//!
//! Per cell two slopes come from three colours by least squares with a light field ([`light`](super::light)); the depth h is the surface
//! that minimises Σ |∇h - slope|² + μ h². A cosine transform along the rows of cells turns its equations into one chain down the rows for
//! each coefficient, which one pass down and one up solve. Every other cosine is the same from both ends of a row, and those between
//! change their sign: the transform takes sums and differences of both ends, and has a quarter of the work twice.

use std::array::from_fn;

use super::cells::Grid;
use super::colour::LANES;
use super::trig::cos_of_turn;

/// How strongly depth is held at zero; keeps what the colours say nothing about from piling up over the picture.
const HOLD: f64 = 0.005;

/// Rows that are transformed at a time: what is loaded of the matrix is for all.
const ROWS: usize = 4;

/// Cosine transforms along rows of cells and the chains between them; buffers.
#[derive(Debug, Clone, Default)]
pub(super) struct Solver {
    /// Values a row of half a transform: coefficients of even or of odd number, or sums or differences of both ends of a row.
    half: usize,
    /// From sums and differences, (`half`, `half`) each, to coefficients; and back.
    there: [Vec<f32>; 2],
    back: [Vec<f32>; 2],
    /// What a chain's value is multiplied by, (rows, 2 · `half`).
    shares: Vec<f32>,
    slopes: [Vec<f32>; 2],
    downward: Vec<f32>,
    field: Vec<f32>,
    spare: Vec<f32>,
    /// The depth of the last call in cells (a slope of 1 over the width of a cell).
    pub depth: Vec<f32>,
}

/// One half of a cosine transform of `n` values, of even (0) or odd (1) coefficients, `half` values a row; and its transpose.
fn transform(n: usize, odd: usize, half: usize) -> [Vec<f32>; 2] {
    let mut matrices = [vec![0.0; half * half], vec![0.0; half * half]];
    for (x, i) in (0..n.div_ceil(2)).flat_map(|x| (0..(n + 1 - odd) / 2).map(move |i| (x, i))) {
        let k = 2 * i + odd;
        let scale = if k == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 };
        let value = scale.sqrt() * cos_of_turn(k * (2 * x + 1), 2 * n);
        // The middle of an odd row is both of its ends.
        let ends = if 2 * x + 1 == n { 0.5 } else { 1.0 };
        matrices[0][x * half + i] = (ends * value) as f32;
        matrices[1][i * half + x] = value as f32;
    }
    matrices
}

/// What each value of a chain down the rows is multiplied by: the elimination of its three diagonals.
fn shares(grid: &Grid, half: usize) -> Vec<f32> {
    let mut shares = vec![0.0; grid.rows * 2 * half];
    for k in 0..grid.cols {
        let bend = 2.0 - 2.0 * cos_of_turn(k, grid.cols);
        let mut before = 0.0;
        for row in 0..grid.rows {
            let neighbours = f64::from(u8::from(row > 0)) + f64::from(u8::from(row + 1 < grid.rows));
            before = 1.0 / (neighbours + bend + HOLD - before);
            shares[row * 2 * half + k % 2 * half + k / 2] = before as f32;
        }
    }
    shares
}

impl Solver {
    pub fn of(grid: &Grid) -> Self {
        let (n, half) = (grid.cells(), grid.cols.div_ceil(2).next_multiple_of(LANES));
        let padded = grid.rows.next_multiple_of(ROWS) * 2 * half;
        let [[even, from_even], [odd, from_odd]] = [0, 1].map(|odd| transform(grid.cols, odd, half));
        Self {
            half,
            there: [even, odd],
            back: [from_even, from_odd],
            shares: shares(grid, half),
            slopes: [vec![0.0; n], vec![0.0; n]],
            downward: vec![0.0; n],
            field: vec![0.0; padded],
            spare: vec![0.0; padded],
            depth: vec![0.0; n],
        }
    }

    /// Solves for the depth that these colours show; `white` is the difference to the untouched gel in noise units.
    #[inline(always)]
    pub fn solve(&mut self, white: &[Vec<f32>; 3], weights: &[[Vec<f32>; 3]; 2], grid: &Grid) {
        let [a, b, c] = white;
        for (slope, [wa, wb, wc]) in self.slopes.iter_mut().zip(weights) {
            weigh_three([a, b, c], [wa, wb, wc], slope);
        }
        let (cols, half) = (grid.cols, self.half);
        divergence(&self.slopes, grid, &mut self.downward, &mut self.depth);
        for (field, row) in self.field.chunks_exact_mut(2 * half).zip(self.depth.chunks_exact(cols)) {
            fold(row, field.split_at_mut(half));
        }
        multiply(&self.field, &self.there, half, cols.div_ceil(2), &mut self.spare);
        chains(&mut self.spare, &self.shares, 2 * half);
        multiply(&self.spare, &self.back, half, cols.div_ceil(2), &mut self.field);
        for (field, row) in self.field.chunks_exact(2 * half).zip(self.depth.chunks_exact_mut(cols)) {
            unfold(field.split_at(half), row);
        }
    }
}

/// Sums and differences of both ends of a row, from the ends to the middle.
#[inline(always)]
fn fold(row: &[f32], (sums, differences): (&mut [f32], &mut [f32])) {
    let n = row.len().div_ceil(2).min(sums.len()).min(differences.len());
    let (first, last) = (&row[..n], &row[row.len() - n..]);
    let (sums, differences) = (&mut sums[..n], &mut differences[..n]);
    for k in 0..n {
        let (a, b) = (first[k], last[n - 1 - k]);
        (sums[k], differences[k]) = (a + b, a - b);
    }
}

/// Both ends of a row from what its even and its odd cosines add up to.
#[inline(always)]
fn unfold((even, odd): (&[f32], &[f32]), row: &mut [f32]) {
    let n = row.len().div_ceil(2).min(even.len()).min(odd.len());
    let (even, odd) = (&even[..n], &odd[..n]);
    let from = row.len() - n;
    let last = &mut row[from..];
    for k in 0..n {
        last[n - 1 - k] = even[k] - odd[k];
    }
    let first = &mut row[..n];
    for k in 0..n {
        first[k] = even[k] + odd[k];
    }
}

/// Solves the chains down the columns: each value holds on to the one before it and the one after it.
#[inline(always)]
fn chains(values: &mut [f32], shares: &[f32], stride: usize) {
    let rows = shares.len() / stride;
    multiply_each(values.get_mut(..stride).unwrap_or_default(), shares);
    for row in 1..rows {
        let (before, here) = values.split_at_mut(row * stride);
        let before = before.get((row - 1) * stride..).unwrap_or_default();
        let shares = shares.get(row * stride..(row + 1) * stride).unwrap_or_default();
        for ((here, before), share) in here.iter_mut().zip(before).zip(shares) {
            *here = (*here + before) * share;
        }
    }
    for row in (1..rows).rev() {
        let (here, after) = values.split_at_mut(row * stride);
        let at = (row - 1) * stride;
        let here = here.get_mut(at..).unwrap_or_default();
        for ((here, after), share) in here.iter_mut().zip(after).zip(shares.get(at..).unwrap_or_default()) {
            *here += share * *after;
        }
    }
}

/// Multiplies value by value.
#[inline(always)]
fn multiply_each(values: &mut [f32], by: &[f32]) {
    values.iter_mut().zip(by).for_each(|(v, by)| *v *= by);
}

/// Minus the divergence of the slopes, each taken halfway between two cells; nothing flows over the picture's border. `downward` is what flows
/// from row to row.
#[inline(always)]
fn divergence([gx, gy]: &[Vec<f32>; 2], grid: &Grid, downward: &mut [f32], out: &mut [f32]) {
    let (rows, cols) = (grid.rows, grid.cols);
    let line = |row: usize| gy.get(row * cols..(row + 1) * cols).unwrap_or_default();
    half_difference(gy, gy.get(2 * cols..).unwrap_or_default(), downward.get_mut(cols..).unwrap_or_default());
    for row in [0, rows - 1] {
        let downward = downward.get_mut(row * cols..(row + 1) * cols).unwrap_or_default();
        half_difference(line(row.saturating_sub(1)), line((row + 1).min(rows - 1)), downward);
        // At the border a slope has no neighbour: what flows is its own half, over the other side alone.
        let missing = f32::from(u8::from(row + 1 == rows)) - f32::from(u8::from(row == 0));
        if missing != 0.0 {
            downward.iter_mut().zip(line(row)).for_each(|(out, here)| *out += missing * here);
        }
    }
    out.copy_from_slice(downward);
    if cols == 1 {
        return;
    }
    let (right, inner) = (gx.get(2..).unwrap_or_default(), out.get_mut(1..).unwrap_or_default());
    for ((out, left), right) in inner.iter_mut().zip(gx).zip(right) {
        *out += 0.5 * (left - right);
    }
    for ((out, downward), gx) in
        out.chunks_exact_mut(cols).zip(downward.chunks_exact(cols)).zip(gx.chunks_exact(cols))
    {
        out[0] = downward[0] - 0.5 * (gx[0] + gx[1]);
        out[cols - 1] = downward[cols - 1] + 0.5 * (gx[cols - 1] + gx[cols - 2]);
    }
}

/// Half of what one row has over the other.
#[inline(always)]
fn half_difference(a: &[f32], b: &[f32], out: &mut [f32]) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = 0.5 * (a - b);
    }
}

/// Sum over three colours of weight times change.
#[inline(always)]
fn weigh_three(white: [&[f32]; 3], weights: [&[f32]; 3], out: &mut [f32]) {
    let white = white[0].iter().zip(white[1]).zip(white[2]);
    let weights = weights[0].iter().zip(weights[1]).zip(weights[2]);
    for ((out, ((a, b), c)), ((wa, wb), wc)) in out.iter_mut().zip(white).zip(weights) {
        *out = (wa * a + wc * c) + wb * b;
    }
}

/// Multiplies both halves of each row, of `k` values and `half` with what is past them, by a matrix each. Every sum runs in one order, so
/// that all processors give the same bits.
#[inline(always)]
fn multiply(rows: &[f32], by: &[Vec<f32>; 2], half: usize, k: usize, out: &mut [f32]) {
    let stride = 2 * half;
    for (rows, out) in rows.chunks_exact(ROWS * stride).zip(out.chunks_exact_mut(ROWS * stride)) {
        for (odd, by) in by.iter().enumerate() {
            let rows: [&[f32]; ROWS] = from_fn(|row| {
                rows.get(row * stride + odd * half..).and_then(|row| row.get(..k)).unwrap_or_default()
            });
            let mut first = 0;
            while first < half {
                let at = odd * half + first;
                if first + 2 * LANES <= half {
                    columns::<2>(rows, by, half, first, at, out);
                    first += 2 * LANES;
                } else {
                    columns::<1>(rows, by, half, first, at, out);
                    first += LANES;
                }
            }
        }
    }
}

/// Columns from `first` on of rows times a matrix, which go to `at` in each row of what comes out.
#[inline(always)]
fn columns<const N: usize>(
    rows: [&[f32]; ROWS],
    by: &[f32],
    half: usize,
    first: usize,
    at: usize,
    out: &mut [f32],
) {
    let mut sums = [[[0f32; LANES]; ROWS]; N];
    let [a, b, c, d] = rows;
    for (((a, b), (c, d)), by) in a.iter().zip(b).zip(c.iter().zip(d)).zip(by.chunks_exact(half)) {
        let Some(by) = by.get(first..first + N * LANES) else { return };
        for ([x, y, z, w], by) in sums.iter_mut().zip(by.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                x[lane] += a * by[lane];
                y[lane] += b * by[lane];
                z[lane] += c * by[lane];
                w[lane] += d * by[lane];
            }
        }
    }
    for (row, out) in out.chunks_exact_mut(2 * half).enumerate().take(ROWS) {
        if let Some(out) = out.get_mut(at..at + N * LANES) {
            for (out, sums) in out.as_chunks_mut().0.iter_mut().zip(&sums) {
                *out = sums[row];
            }
        }
    }
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::light::{GelLight, Slopes};

    #[test]
    fn a_surface_is_found_again_from_its_own_slopes() {
        let grid = Grid::of(320, 240);
        let (light, noise) = (GelLight::default(), [1.32, 0.65, 1.17]);
        let slopes = Slopes::of(&light, noise, [0, 1, 2], &grid);
        let bump = |row: f32, col: f32| 2.0 * (-((row - 20.0).powi(2) + (col - 14.0).powi(2)) / 18.0).exp();
        let mut white: [Vec<f32>; 3] = Default::default();
        let mut wanted = Vec::new();
        for row in 0..grid.rows {
            for col in 0..grid.cols {
                let (r, c) = (row as f32, col as f32);
                let (gx, gy) = ((bump(r, c + 0.5) - bump(r, c - 0.5)), (bump(r + 0.5, c) - bump(r - 0.5, c)));
                let (x, y) = ((2 * col + 1) as f32 / 30.0 - 1.0, (2 * row + 1) as f32 / 40.0 - 1.0);
                let terms = [1.0, x, y, x * x, x * y, y * y];
                for (colour, white) in white.iter_mut().enumerate() {
                    let answer = |p: &[f32; 6]| p.iter().zip(terms).map(|(p, t)| p * t).sum::<f32>();
                    let [a, b] = &light.terms[colour];
                    white.push((answer(a) * gx + answer(b) * gy) / noise[colour]);
                }
                wanted.push(bump(r, c));
            }
        }
        let mut solver = Solver::of(&grid);
        solver.solve(&white, &slopes.weights, &grid);
        let floor = solver.depth[0];
        let most = solver.depth.iter().fold(0f32, |a, &b| a.max(b)) - floor;
        assert!((1.5..2.1).contains(&most), "{most}");
        let error: f32 =
            solver.depth.iter().zip(&wanted).map(|(a, b)| (a - floor - b).abs()).sum::<f32>() / 1200.0;
        assert!(error < 0.1, "{error}");
    }

    #[test]
    fn every_cell_of_the_surface_obeys_its_equation() {
        for (height, width) in [(1, 1), (8, 1), (1, 9), (120, 160), (213, 160), (150, 201), (320, 60)] {
            let grid = Grid::of(height, width);
            let slope =
                |by: usize| (0..grid.cells()).map(|k| (k * k * by % 17) as f32 / 17.0 - 0.5).collect();
            let white = [slope(3), slope(5), vec![0.0; grid.cells()]];
            let weights =
                [0, 1].map(|axis| from_fn(|colour| vec![f32::from(u8::from(axis == colour)); grid.cells()]));
            let mut solver = Solver::of(&grid);
            solver.solve(&white, &weights, &grid);
            let at = |row: usize, col: usize| row * grid.cols + col;
            let depth = |cell: usize| f64::from(solver.depth[cell]);
            for (row, col) in (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col))) {
                let here = at(row, col);
                let mut left = HOLD * depth(here);
                // What flows to and from each neighbour.
                let mut flow = |other: usize, axis: usize, sign: f64| {
                    let mean = 0.5 * (f64::from(white[axis][here]) + f64::from(white[axis][other]));
                    left += depth(here) - depth(other) + sign * mean;
                };
                if row > 0 {
                    flow(at(row - 1, col), 1, -1.0);
                }
                if row + 1 < grid.rows {
                    flow(at(row + 1, col), 1, 1.0);
                }
                if col > 0 {
                    flow(at(row, col - 1), 0, -1.0);
                }
                if col + 1 < grid.cols {
                    flow(at(row, col + 1), 0, 1.0);
                }
                assert!(left.abs() < 1e-5, "{height}x{width} {row},{col}: {left}");
            }
        }
    }
}
