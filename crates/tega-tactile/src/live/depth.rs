//! Depth from shading: slopes of the gel from its colours, and the surface whose slopes they are.
//!
//! Per cell two slopes come from three colours by least squares with a light field ([`light`](super::light)); the depth h is the surface
//! that minimises Σ |∇h - slope|² + μ h², solved exactly by cosine transforms over the cells.

use super::cells::Grid;
use super::colour::LANES;
use super::trig::cos_of_turn;

/// How strongly depth is held at zero; keeps what the colours say nothing about from piling up over the picture.
const HOLD: f64 = 0.005;

/// Cosine transforms over the cells and what divides the coefficients between them; buffers.
#[derive(Debug, Clone, Default)]
pub(super) struct Solver {
    /// Rows of the transform along columns of cells, (rows, rows), and its transpose.
    down: [Vec<f32>; 2],
    /// The same along rows of cells, (cols, cols), and its transpose.
    across: [Vec<f32>; 2],
    inverse: Vec<f32>,
    slopes: [Vec<f32>; 2],
    downward: Vec<f32>,
    field: Vec<f32>,
    spare: Vec<f32>,
    /// The depth of the last call in cells (a slope of 1 over the width of a cell).
    pub depth: Vec<f32>,
}

/// A cosine transform of `n` values and its transpose, rows `stride` apart.
fn transform(n: usize, stride: usize) -> [Vec<f32>; 2] {
    let value = |k: usize, x: usize| {
        let scale = if k == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 };
        (scale.sqrt() * cos_of_turn(k * (2 * x + 1), 2 * n)) as f32
    };
    let matrix = |of: &dyn Fn(usize, usize) -> f32| {
        let mut m = vec![0.0; n * stride];
        for (row, line) in m.chunks_exact_mut(stride).enumerate() {
            line.iter_mut().take(n).enumerate().for_each(|(col, v)| *v = of(row, col));
        }
        m
    };
    [matrix(&|k, x| value(k, x)), matrix(&|x, k| value(k, x))]
}

impl Solver {
    pub fn of(grid: &Grid) -> Self {
        let bend = |k: usize, n: usize| 2.0 - 2.0 * cos_of_turn(k, n);
        let inverse = |row: usize, col: usize| {
            // The mean of the surface is not seen in its slopes: it is 0 here, and what is untouched is set to 0 later.
            let known = row + col > 0;
            if known { (1.0 / (bend(row, grid.rows) + bend(col, grid.cols) + HOLD)) as f32 } else { 0.0 }
        };
        let (n, stride) = (grid.cells(), grid.cols.next_multiple_of(LANES));
        let padded = grid.rows * stride;
        let mut divide = vec![0.0; padded];
        for (row, line) in divide.chunks_exact_mut(stride).enumerate() {
            line.iter_mut().take(grid.cols).enumerate().for_each(|(col, v)| *v = inverse(row, col));
        }
        Self {
            down: transform(grid.rows, grid.rows),
            across: transform(grid.cols, stride),
            inverse: divide,
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
        let (rows, cols) = (grid.rows, grid.cols);
        let stride = cols.next_multiple_of(LANES);
        divergence(&self.slopes, grid, &mut self.downward, &mut self.depth);
        for (field, depth) in self.field.chunks_exact_mut(stride).zip(self.depth.chunks_exact(cols)) {
            field.split_at_mut(cols).0.copy_from_slice(depth);
        }
        for (there, back) in [(0, 1), (1, 0)] {
            multiply(&self.down[there], &self.field, rows, [rows, stride], &mut self.spare);
            multiply(&self.spare, &self.across[back], cols, [stride, stride], &mut self.field);
            if there == 0 {
                multiply_each(&mut self.field, &self.inverse);
            }
        }
        for (depth, field) in self.depth.chunks_exact_mut(cols).zip(self.field.chunks_exact(stride)) {
            depth.copy_from_slice(field.split_at(cols).0);
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

/// Matrix product of (n, k) and (k, m) into (n, m); rows lie `strides` values apart in the first and in the other two, the latter a multiple of
/// [`LANES`]. Every sum runs in one order, so that all processors give the same bits.
#[inline(always)]
fn multiply(a: &[f32], b: &[f32], k: usize, strides: [usize; 2], out: &mut [f32]) {
    let [a_stride, stride] = strides;
    // As many sums as fit into registers, and about as many each time: few of them would wait for each other.
    let vectors = stride / LANES;
    let at_once = vectors.div_ceil(vectors.div_ceil(4).max(1)).max(1);
    for (a, out) in a.chunks(2 * a_stride).zip(out.chunks_mut(2 * stride)) {
        // Two rows at a time: what is loaded of the other matrix is for both. An odd last one stands for both.
        let (upper, lower) = a.split_at(a_stride);
        let both =
            [upper, if lower.is_empty() { upper } else { lower }].map(|a| a.get(..k).unwrap_or_default());
        let (upper, lower) = out.split_at_mut(stride);
        let mut first = 0;
        while first < stride {
            let out = [&mut *upper, &mut *lower];
            let vectors = at_once.min((stride - first) / LANES);
            match vectors {
                4.. => columns::<4>(both, b, stride, first, out),
                3 => columns::<3>(both, b, stride, first, out),
                2 => columns::<2>(both, b, stride, first, out),
                _ => columns::<1>(both, b, stride, first, out),
            }
            first += LANES * vectors;
        }
    }
}

#[inline(always)]
fn columns<const N: usize>(
    [upper, lower]: [&[f32]; 2],
    b: &[f32],
    stride: usize,
    first: usize,
    out: [&mut [f32]; 2],
) {
    let mut sums = [[0f32; LANES]; N];
    let mut below = sums;
    for ((upper, lower), b) in upper.iter().zip(lower).zip(b.chunks_exact(stride)) {
        let Some(b) = b.get(first..first + N * LANES) else { return };
        for ((sums, below), b) in sums.iter_mut().zip(&mut below).zip(b.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                sums[lane] += upper * b[lane];
                below[lane] += lower * b[lane];
            }
        }
    }
    for (out, sums) in out.into_iter().zip([sums, below]) {
        if let Some(out) = out.get_mut(first..first + N * LANES) {
            out.copy_from_slice(sums.as_flattened());
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
}
