//! Rectangles of cells: what two of them share, and what holds both.

/// Rows and columns of cells, ends excluded; columns are multiples of [`LANES`](crate::grid::LANES), on all grids but the
/// coarsest of [`CACHE_LINE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Window {
    pub(crate) rows: [usize; 2],
    pub(crate) cols: [usize; 2],
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
