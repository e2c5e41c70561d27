//! Shapes laid over a grid: how near to the gel each cell of a shape is.

use crate::grid::{Grid, LANES, chunks};
use crate::shape::{CLEAR, Indenter};
use crate::window::Window;

/// Lays a shape over a part of a grid, its foremost point on the still gel.
#[inline(always)]
fn lay_plain(grid: &mut Grid, part: Window, i: usize, indenter: &Indenter) {
    let ([c0, c1], cols) = (part.cols, grid.cols);
    let mut tops = [CLEAR; LANES];
    for r in part.rows[0]..part.rows[1] {
        let at = r * cols + c0..r * cols + c1;
        let row = &mut grid.gaps[i][at.clone()];
        indenter.lowest(&grid.x[at.clone()], &grid.y[at.clone()], row);
        // The gel drops away from its top, and more where it has not come back yet.
        for ((low, drop), lag) in row.iter_mut().zip(&grid.drop[at.clone()]).zip(&grid.lag[at]) {
            *low -= drop + lag;
        }
        raise(&mut tops, row);
    }
    grid.tops[i] = highest(tops);
}

tega_simd::dispatched! {
    /// See [`lay_plain`].
    lay = lay_plain, (grid: &mut Grid, part: Window, i: usize, indenter: &Indenter) -> ()
}

/// Lays a shape over its box in the finest grid; its foremost point is known to lie at least so far down.
#[inline(always)]
pub(crate) fn lay_below(grid: &mut Grid, i: usize, indenter: &Indenter, top: f32) {
    lay(grid, grid.boxes[i], i, indenter);
    grid.tops[i] = grid.tops[i].max(top);
}

/// Means of four cells, or the nearest of them where the shape does not lie over all; returns the highest of them.
#[inline(always)]
pub(crate) fn pool(fine: &[f32], coarse: &mut [f32], cols: usize) -> f32 {
    for (two, out) in fine.chunks_exact(2 * cols).zip(coarse.chunks_exact_mut(cols / 2)) {
        let (upper, lower) = two.split_at(cols);
        for ((out, a), b) in out.iter_mut().zip(upper.as_chunks::<2>().0).zip(lower.as_chunks::<2>().0) {
            let (low0, high0) = if a[0] < a[1] { (a[0], a[1]) } else { (a[1], a[0]) };
            let (low1, high1) = if b[0] < b[1] { (b[0], b[1]) } else { (b[1], b[0]) };
            let low = if low0 < low1 { low0 } else { low1 };
            let high = if high0 > high1 { high0 } else { high1 };
            *out = if low > CLEAR / 2.0 { 0.25 * ((a[0] + a[1]) + (b[0] + b[1])) } else { high };
        }
    }
    let mut tops = [CLEAR; LANES];
    raise(&mut tops, coarse);
    highest(tops)
}

/// Raises the highest gaps so far, a few columns apart, by those of a row.
#[inline(always)]
fn raise(tops: &mut [f32; LANES], gaps: &[f32]) {
    for lanes in chunks(gaps) {
        for k in 0..LANES {
            tops[k] = if lanes[k] > tops[k] { lanes[k] } else { tops[k] };
        }
    }
}

fn highest(tops: [f32; LANES]) -> f32 {
    tops.into_iter().fold(CLEAR, |top, gap| if gap > top { gap } else { top })
}
