//! Parts of a grid: what they share, and where a grid is displaced or a shape would touch it.

use crate::grid::{COLS, Level};
use crate::plane::CACHE_LINE;
use crate::shape::CLEAR;

/// Displacement that is not worth a cell's work, millimetres: the picture would change by a count at most.
pub(crate) const NEGLIGIBLE_MM: f32 = 0.004;

/// Rows and columns of cells, ends excluded; columns are multiples of [`LANES`](crate::grid::LANES), on all grids but the
/// coarsest of [`CACHE_LINE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Window {
    pub(crate) rows: [usize; 2],
    pub(crate) cols: [usize; 2],
}

/// All of a grid.
pub(crate) fn whole(grid: &Level) -> Window {
    Window { rows: [0, grid.rows], cols: [0, grid.cols] }
}

/// What two windows share.
pub(crate) fn shared(a: Window, b: Window) -> Window {
    let both = |[a0, a1]: [usize; 2], [b0, b1]: [usize; 2]| {
        let to = a1.min(b1);
        [a0.max(b0).min(to), to]
    };
    Window { rows: both(a.rows, b.rows), cols: both(a.cols, b.cols) }
}

/// The least window that holds both; an empty one holds nothing.
pub(crate) fn joined(a: Window, b: Window) -> Window {
    let empty = |w: Window| w.rows[0] >= w.rows[1] || w.cols[0] >= w.cols[1];
    let both = |[a0, a1]: [usize; 2], [b0, b1]: [usize; 2]| [a0.min(b0), a1.max(b1)];
    match (empty(a), empty(b)) {
        (true, _) => b,
        (_, true) => a,
        _ => Window { rows: both(a.rows, b.rows), cols: both(a.cols, b.cols) },
    }
}

/// A coarse window with a cell around it, in a grid twice as fine.
pub(crate) fn wider(coarse: Window, fine: &Level) -> Window {
    let both = |[from, to]: [usize; 2], whole: usize, limit: usize| {
        let end = (2 * to + 2).next_multiple_of(whole).min(limit);
        [(2 * from.saturating_sub(1) / whole * whole).min(end), end]
    };
    Window { rows: both(coarse.rows, 1, fine.rows), cols: both(coarse.cols, CACHE_LINE, fine.cols) }
}

/// Where the coarse grid is displaced at all.
#[inline(always)]
pub(crate) fn reach(grid: &Level) -> Window {
    extent(grid, NEGLIGIBLE_MM, |r| &grid.height[grid.tall(r)])
}

/// Where a shape would touch the gel if nothing gave way to it, this deep.
#[inline(always)]
pub(crate) fn under(grid: &Level, i: usize, depth: f32) -> Window {
    extent(grid, grid.tops[i] - depth, |r| &grid.gaps[i][grid.flat(r)])
}

/// Where the window's rows are above a level.
#[inline(always)]
fn extent<'a>(grid: &Level, level: f32, row: impl Fn(usize) -> &'a [f32]) -> Window {
    let mut highest = [CLEAR; COLS];
    let mut rows = [grid.rows, 0];
    let [c0, c1] = grid.window.cols;
    for r in grid.window.rows[0]..grid.window.rows[1] {
        let mut any = false;
        for (high, value) in highest[c0..c1].iter_mut().zip(row(r)) {
            any |= *value > level;
            *high = if *value > *high { *value } else { *high };
        }
        if any {
            rows = [rows[0].min(r), r + 1];
        }
    }
    let first = highest.iter().position(|high| *high > level).unwrap_or(grid.cols);
    let last = highest.iter().rposition(|high| *high > level).map_or(0, |c| c + 1);
    Window { rows, cols: [first, last] }
}
