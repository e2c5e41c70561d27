//! One grid of the gel: its cells' displacement, and the shapes over them.

use crate::form::Surface;
use crate::plane::{CACHE_LINE, Plane};
use crate::shape::{CLEAR, MAX_INDENTERS};
use crate::window::Window;

/// Picture's pixels a millimetre.
pub const PX_PER_MM: f64 = 18.68;
/// The skin's length l, millimetres: 20 pixels of the sensor that the light field was fitted on.
pub const LENGTH_MM: f64 = 20.0 / PX_PER_MM;
/// Cells of the finest grid: the picture and 72 pixels (across) or 64 (along) around it, 20.6 mm x 24 mm.
pub(crate) const CELL_PX: usize = 4;
pub(crate) const COLS: usize = 96;
pub(crate) const ROWS: usize = 112;
/// Cells of the finest grid that lie outside the picture on each side.
pub(crate) const MARGIN_COLS: usize = 18;
pub(crate) const MARGIN_ROWS: usize = 16;

/// Displacement that is not worth a cell's work, millimetres: the picture would change by a count at most.
pub(crate) const NEGLIGIBLE_MM: f32 = 0.004;

/// Columns are worked on so many at a time, and sums kept in so many lanes, whatever the instruction set.
pub(crate) const LANES: usize = 8;

/// A grid. `height` has a still row before and after it and still cells between its rows: cell (r, c) is at
/// (r + 1) * stride + [`CACHE_LINE`] + c. `floor` and `gaps` have not: r * cols + c.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    pub(crate) cell_mm: f32,
    /// l² in cells, squared.
    pub(crate) square: f32,
    pub(crate) window: Window,
    pub(crate) stride: usize,
    pub(crate) height: Plane,
    /// What the next sweep writes; still around the window like `height`.
    pub(crate) next: Plane,
    pub(crate) floor: Plane,
    pub(crate) gaps: Vec<Plane>,
    /// Where each cell's gel lies, millimetres: across, along, how far under the top while nothing touches, and how far
    /// that gel has given way for a time.
    pub(crate) x: Plane,
    pub(crate) y: Plane,
    pub(crate) drop: Plane,
    pub(crate) lag: Plane,
    /// Its area, square millimetres.
    pub(crate) area: Plane,
    /// Grid of each shape's foremost cell in its gaps.
    pub(crate) tops: [f32; MAX_INDENTERS],
    /// Where each shape may touch: no deeper than it is taken for, it does not outside.
    pub(crate) boxes: [Window; MAX_INDENTERS],
}

impl Grid {
    pub(crate) fn new(shrink: usize, surface: &Surface) -> Self {
        let (rows, cols) = (ROWS / shrink, COLS / shrink);
        let cell_mm = ((shrink * CELL_PX) as f64 / PX_PER_MM) as f32;
        let length = LENGTH_MM as f32 / cell_mm;
        let stride = cols + CACHE_LINE;
        let still = Plane::new((rows + 2) * stride + CACHE_LINE, 0.0);
        let flat = Plane::new(rows * cols, 0.0);
        let [mut x, mut y, mut drop, mut area] = [0; 4].map(|_| flat.clone());
        let at = |cells: usize, c: usize| (c as f64 - (cells as f64 - 1.0) / 2.0) * f64::from(cell_mm);
        for r in 0..rows {
            for c in 0..cols {
                let (seen, k) = (surface.seen(at(cols, c), at(rows, r)), r * cols + c);
                (x[k], y[k], drop[k]) = (seen.x as f32, seen.y as f32, seen.drop as f32);
                area[k] = (seen.area * f64::from(cell_mm * cell_mm)) as f32;
            }
        }
        Self {
            rows,
            cols,
            cell_mm,
            square: length * length,
            window: Window::default(),
            stride,
            next: still.clone(),
            height: still,
            floor: flat.clone(),
            x,
            y,
            drop,
            lag: flat,
            area,
            gaps: vec![Plane::new(rows * cols, CLEAR); MAX_INDENTERS],
            tops: [CLEAR; MAX_INDENTERS],
            boxes: [Window::default(); MAX_INDENTERS],
        }
    }

    /// Where a row's window lies in `height`.
    #[inline(always)]
    pub(crate) fn tall(&self, row: usize) -> std::ops::Range<usize> {
        let start = (row + 1) * self.stride + CACHE_LINE;
        start + self.window.cols[0]..start + self.window.cols[1]
    }

    /// A row of `height` with a still cell before and after; `row` is one more than the grid's.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &[f32] {
        &self.height[row * self.stride + CACHE_LINE - 1..][..self.cols + 2]
    }

    /// Changes the window; all outside it is still.
    pub(crate) fn look_at(&mut self, window: Window) {
        let had = std::mem::replace(&mut self.window, window);
        let inside = |[from, to]: [usize; 2], [first, last]: [usize; 2]| from >= first && to <= last;
        // What lies inside is written before it is read.
        if !(inside(had.rows, window.rows) && inside(had.cols, window.cols)) {
            self.height.fill(0.0);
            self.next.fill(0.0);
        }
    }

    /// Where a row's window lies in `floor` and `gaps`.
    #[inline(always)]
    pub(crate) fn flat(&self, row: usize) -> std::ops::Range<usize> {
        row * self.cols + self.window.cols[0]..row * self.cols + self.window.cols[1]
    }

    /// A row of the window with a cell before and after, and the rows above and below it.
    #[inline(always)]
    pub(crate) fn around(&self, row: usize) -> [&[f32]; 3] {
        self.around_in(row, self.window.cols)
    }

    /// The same of some columns.
    #[inline(always)]
    pub(crate) fn around_in(&self, row: usize, [from, to]: [usize; 2]) -> [&[f32]; 3] {
        let (zero, stride) = ((row + 1) * self.stride + CACHE_LINE, self.stride);
        let here = zero + from..zero + to;
        [
            &self.height[here.start - 1..=here.end],
            &self.height[here.start - stride..here.end - stride],
            &self.height[here.start + stride..here.end + stride],
        ]
    }

    /// All of the grid.
    pub(crate) fn whole(&self) -> Window {
        Window { rows: [0, self.rows], cols: [0, self.cols] }
    }

    /// A window of a grid half as fine, with a cell around it, in this one.
    pub(crate) fn wider(&self, coarse: Window) -> Window {
        let both = |[from, to]: [usize; 2], whole: usize, limit: usize| {
            let end = (2 * to + 2).next_multiple_of(whole).min(limit);
            [(2 * from.saturating_sub(1) / whole * whole).min(end), end]
        };
        Window { rows: both(coarse.rows, 1, self.rows), cols: both(coarse.cols, CACHE_LINE, self.cols) }
    }

    /// Where the grid is displaced at all.
    #[inline(always)]
    pub(crate) fn reach(&self) -> Window {
        self.extent(NEGLIGIBLE_MM, |r| &self.height[self.tall(r)])
    }

    /// Where a shape would touch the gel if nothing gave way to it, this deep.
    #[inline(always)]
    pub(crate) fn under(&self, i: usize, depth: f32) -> Window {
        self.extent(self.tops[i] - depth, |r| &self.gaps[i][self.flat(r)])
    }

    /// Where the window's rows are above a level.
    #[inline(always)]
    fn extent<'a>(&self, level: f32, row: impl Fn(usize) -> &'a [f32]) -> Window {
        let mut highest = [CLEAR; COLS];
        let mut rows = [self.rows, 0];
        let [c0, c1] = self.window.cols;
        for r in self.window.rows[0]..self.window.rows[1] {
            let mut any = false;
            for (high, value) in highest[c0..c1].iter_mut().zip(row(r)) {
                any |= *value > level;
                *high = if *value > *high { *value } else { *high };
            }
            if any {
                rows = [rows[0].min(r), r + 1];
            }
        }
        let first = highest.iter().position(|high| *high > level).unwrap_or(self.cols);
        let last = highest.iter().rposition(|high| *high > level).map_or(0, |c| c + 1);
        Window { rows, cols: [first, last] }
    }
}

/// A window's columns, a few at a time.
#[inline(always)]
pub(crate) fn chunks(line: &[f32]) -> &[[f32; LANES]] {
    chunks_of(line)
}

/// The same, so many at a time.
#[inline(always)]
pub(crate) fn chunks_of<const N: usize>(line: &[f32]) -> &[[f32; N]] {
    line.as_chunks().0
}
