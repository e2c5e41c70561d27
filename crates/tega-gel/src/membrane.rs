//! The gel: a skin on springs, and shapes that it may not enter.
//!
//! The displacement `h` minimises the sum of h² + l²|∇h|² over all that lie above the shapes. It is found on three
//! grids, each started from the coarser one's answer, by a bounded number of sweeps over even and odd rows, so that an
//! answer depends on what presses now and on nothing before. A shape goes in until the springs under it carry its force:
//! with `k` the springs' stiffness, the pressure is p = k(h - l²∇²h) where it touches and 0 elsewhere.

use crate::form::Surface;
use crate::grid::{COLS, Grid, LANES, MARGIN_COLS, MARGIN_ROWS, ROWS, chunks};
use crate::lay::{lay, lay_below, pool};
use crate::plane::{CACHE_LINE, Plane};
use crate::shape::{CLEAR, Indenter, MAX_INDENTERS};
use crate::skin::{raise_floor, refine, settle, sweep};
use crate::springs::{Pressed, carry, carry_beyond, guess, rests};
use crate::window::{Window, joined, shared};

/// How often a grid matches the forces, its sweeps before each match and after the last, and their over-relaxation.
#[derive(Debug, Clone, Copy)]
struct Steps {
    /// At least, and at most while a force is off by more than a seventh.
    matches: usize,
    most: usize,
    sweeps: usize,
    last: usize,
    relax: f32,
}

/// From the coarsest grid on; `docs/evidence/sim-touch.md` has the error that this leaves.
const SCHEDULE: [Steps; 3] = [
    Steps { matches: 2, most: 2, sweeps: 3, last: 1, relax: 1.4 },
    Steps { matches: 1, most: 2, sweeps: 2, last: 3, relax: 1.4 },
    Steps { matches: 1, most: 4, sweeps: 2, last: 2, relax: 1.45 },
];

/// How much deeper than the coarser grid found it a shape may go before more of it is laid over a grid: so many times, and
/// as its surface may lie between the middles of coarser cells, so many of their sizes.
const ROOM: f32 = 1.5;
const ROOM_CELLS: f32 = 0.5;

/// What the finest grid is asked for: the picture and two cells around it, as a slope needs one and a line between
/// slopes another. What is further out is left at the coarser answer.
const LOOK: Window = Window {
    rows: [MARGIN_ROWS - 2, ROWS - MARGIN_ROWS + 2],
    cols: [MARGIN_COLS - 2, COLS - MARGIN_COLS + 2],
};

/// Sums over the touching cells of the picture, and the largest displacement in it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Measured {
    pub(crate) cells: usize,
    /// Square millimetres.
    pub(crate) area: f32,
    pub(crate) depth: f32,
    /// Of displacement, and of it times column and row; millimetres, cells of the picture.
    pub(crate) sum: f32,
    pub(crate) right: f32,
    pub(crate) down: f32,
}

/// Displacements of the finest grid's cells, millimetres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Relief<'a> {
    pub(crate) cells: &'a [f32],
    pub(crate) stride: usize,
    /// Where it is not still.
    pub(crate) window: Window,
}

impl<'a> Relief<'a> {
    /// A row with a still cell before and after; 0 and `ROWS + 1` are still rows, `row` is one more than the grid's.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &'a [f32] {
        &self.cells[row * self.stride + CACHE_LINE - 1..][..COLS + 2]
    }
}

/// The gel's grids.
#[derive(Debug, Clone)]
pub(crate) struct Membrane {
    levels: [Grid; 3],
    pressed: [Pressed; MAX_INDENTERS],
    row: Vec<f32>,
    /// Where the finest grid's `lag` is set.
    lagging: Window,
}

impl Membrane {
    pub(crate) fn new(surface: &Surface) -> Self {
        Self {
            levels: [4, 2, 1].map(|shrink| Grid::new(shrink, surface)),
            pressed: [Pressed::default(); MAX_INDENTERS],
            row: vec![0.0; COLS + 2],
            lagging: Window::default(),
        }
    }

    /// Presses the shapes in; false where none of them lies over the gel.
    #[inline(always)]
    pub(crate) fn solve(&mut self, indenters: &[Indenter]) -> bool {
        self.solve_in(indenters, &SCHEDULE, LOOK, ROOM)
    }

    #[inline(always)]
    fn solve_in(&mut self, indenters: &[Indenter], schedule: &[Steps; 3], look: Window, room: f32) -> bool {
        let n = indenters.len();
        let mut any = false;
        for (i, indenter) in indenters.iter().enumerate() {
            let over = indenter.force_n > 0.0 && self.lay_over(i, indenter);
            let force = indenter.force_n as f32;
            let depth = if over { guess(&self.levels[0], i, force) } else { CLEAR };
            self.pressed[i] = Pressed { depth, force: 0.0, beyond: 0.0, limit: f32::INFINITY };
            let grid = &mut self.levels[0];
            grid.boxes[i] = if over { grid.whole() } else { Window::default() };
            any |= over;
        }
        if !any {
            return false;
        }
        for (level, steps) in schedule.iter().enumerate() {
            if level == 0 {
                let grid = &mut self.levels[0];
                grid.look_at(grid.whole());
                grid.height.fill(0.0);
                raise_floor(grid, &self.pressed[..n]);
            } else {
                let [coarse, fine] = &mut self.levels[level - 1..=level] else { continue };
                let reached = fine.wider(coarse.reach());
                fine.look_at(if level == 2 { shared(reached, look) } else { reached });
                if level == 2 {
                    let half = |[from, to]: [usize; 2]| [from / 2, to / 2];
                    let look = Window { rows: half(look.rows), cols: half(look.cols) };
                    carry_beyond(coarse, look, &mut self.pressed[..n]);
                }
                for (i, (pressed, indenter)) in self.pressed.iter_mut().zip(indenters).enumerate() {
                    fine.boxes[i] = Window::default();
                    if pressed.depth > 0.0 {
                        pressed.limit = room * pressed.depth;
                        let deep = pressed.limit + ROOM_CELLS * coarse.cell_mm;
                        // What may touch all of the middle grid may touch all of the finest; the coarsest does not ask.
                        fine.boxes[i] = if level == 2 && coarse.boxes[i] == coarse.window {
                            fine.window
                        } else {
                            shared(fine.wider(coarse.under(i, deep)), fine.window)
                        };
                        if level == 2 {
                            // Its foremost point may lie where this grid does not look.
                            lay_below(fine, i, indenter, coarse.tops[i]);
                        }
                    }
                }
                raise_floor(fine, &self.pressed[..n]);
                refine(coarse, fine, &mut self.row);
            }
            let grid = &mut self.levels[level];
            for done in 1..=steps.most {
                for _ in 0..steps.sweeps {
                    sweep(grid, steps.relax);
                }
                carry(grid, &mut self.pressed[..n]);
                let (mut most, mut off) = (0.0f32, false);
                for (i, (pressed, indenter)) in self.pressed.iter_mut().zip(indenters).enumerate() {
                    // Force goes with depth to the power 1.9 for a ball, 1 for a flat face.
                    let ratio =
                        if pressed.force > 0.0 { indenter.force_n as f32 / pressed.force } else { 4.0 };
                    let change = ratio.clamp(0.25, 4.0).sqrt();
                    off |= pressed.depth > 0.0 && !(0.93..1.07).contains(&change);
                    pressed.depth *= change;
                    pressed.beyond *= change * change;
                    most = if pressed.depth > 0.0 && change > most { change } else { most };
                    if pressed.depth > pressed.limit {
                        pressed.limit = f32::INFINITY;
                        grid.boxes[i] = grid.window;
                        if level == 2 {
                            lay_below(grid, i, indenter, grid.tops[i]);
                        }
                    }
                }
                raise_floor(grid, &self.pressed[..n]);
                if most < 1.0 {
                    // A skin is soon up but slow to come down.
                    settle(grid, most);
                }
                if done >= steps.matches && !off {
                    break;
                }
            }
            for _ in 0..steps.last {
                sweep(grid, steps.relax);
            }
        }
        true
    }

    /// The finest grid's window.
    pub(crate) fn window(&self) -> Window {
        self.levels[2].window
    }

    /// The finest grid's displacements.
    pub(crate) fn relief(&self) -> Relief<'_> {
        let grid = &self.levels[2];
        Relief { cells: &grid.height, stride: grid.stride, window: grid.window }
    }

    /// How far the finest grid's cells have given way for a time: row by row, no still ones around.
    pub(crate) fn lag(&self) -> &[f32] {
        &self.levels[2].lag
    }

    /// The finest grid: where its cells' gel lies.
    pub(crate) fn finest(&self) -> &Grid {
        &self.levels[2]
    }

    /// Sets how far the gel has given way for a time: so much of two displacements, inside a window of the finest grid.
    pub(crate) fn lag_behind(&mut self, slow: [&Plane; 2], shares: [f32; 2], window: Window) {
        let [coarse, middle, fine] = &mut self.levels;
        let even = |[from, to]: [usize; 2]| [from / 2 * 2, to.next_multiple_of(2)];
        // What the last call had set and this one may not.
        let all = joined(Window { rows: even(window.rows), cols: even(window.cols) }, self.lagging);
        if all == Window::default() {
            return;
        }
        weigh(&mut fine.lag, slow, shares, all);
        thin(&fine.lag, &mut middle.lag, fine.cols);
        thin(&middle.lag, &mut coarse.lag, middle.cols);
        self.lagging = if shares == [0.0; 2] { Window::default() } else { all };
    }

    /// Whether the gel touches something in a cell of the finest grid.
    pub(crate) fn touches(&self, row: usize, col: usize) -> bool {
        touches_in(&self.levels[2], row, col)
    }

    /// Share of the touching area that is in the picture, 0 to 1, on the middle grid, whose answer goes beyond the picture as far as the gel
    /// is known; NaN where no cell touches.
    pub(crate) fn in_view(&self) -> f64 {
        let grid = &self.levels[1];
        let inside = |k: usize, margin: usize, size: usize| (margin / 2..(size - margin) / 2).contains(&k);
        let (mut seen, mut all) = (0.0, 0.0);
        for row in grid.window.rows[0]..grid.window.rows[1] {
            for col in grid.window.cols[0]..grid.window.cols[1] {
                if touches_in(grid, row, col) {
                    let area = f64::from(grid.area[row * grid.cols + col]);
                    all += area;
                    if inside(row, MARGIN_ROWS, ROWS) && inside(col, MARGIN_COLS, COLS) {
                        seen += area;
                    }
                }
            }
        }
        seen / all
    }

    /// Measures the part of the gel that is in the picture.
    #[inline(always)]
    pub(crate) fn measure(&self) -> Measured {
        let grid = &self.levels[2];
        let [first, last] = grid.window.rows;
        let mut cells = [0u32; LANES];
        let mut deepest = [0.0f32; LANES];
        let (mut sum, mut right, mut down) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
        let mut area = [0.0f32; LANES];
        for r in first.max(MARGIN_ROWS)..last.min(ROWS - MARGIN_ROWS) {
            let ([here, up, below], floors) = (grid.around(r), chunks(&grid.floor[grid.flat(r)]));
            let (lags, areas) = (chunks(&grid.lag[grid.flat(r)]), chunks(&grid.area[grid.flat(r)]));
            let n = up.len();
            let (before, heights, after) =
                (chunks(&here[..n]), chunks(&here[1..=n]), chunks(&here[2..n + 2]));
            let (up, below) = (chunks(up), chunks(below));
            let y = (r - MARGIN_ROWS) as i32 as f32;
            for (at, (h, floor)) in heights.iter().zip(floors).enumerate() {
                for k in 0..LANES {
                    let around = (up[at][k] + below[at][k]) + (before[at][k] + after[at][k]);
                    let c = (grid.window.cols[0] + at * LANES + k) as i32 - MARGIN_COLS as i32;
                    let inside = c >= 0 && c < (COLS - 2 * MARGIN_COLS) as i32;
                    let seen = if inside { h[k] + lags[at][k] } else { 0.0 };
                    let touches = inside && h[k] > 0.0 && rests(h[k], floor[k], around, grid.square);
                    let held = if touches { seen } else { 0.0 };
                    cells[k] += u32::from(touches);
                    area[k] += if touches { areas[at][k] } else { 0.0 };
                    deepest[k] = if seen > deepest[k] { seen } else { deepest[k] };
                    sum[k] += held;
                    right[k] += held * c as f32;
                    down[k] += held * y;
                }
            }
        }
        Measured {
            cells: cells.iter().sum::<u32>() as usize,
            area: area.iter().sum(),
            depth: deepest.iter().fold(0.0, |top, h| if *h > top { *h } else { top }),
            sum: sum.iter().sum(),
            right: right.iter().sum(),
            down: down.iter().sum(),
        }
    }

    /// Lays a shape over the two coarser grids; false where it lies beside the gel.
    #[inline(always)]
    fn lay_over(&mut self, i: usize, indenter: &Indenter) -> bool {
        let [coarse, middle, fine] = &mut self.levels;
        lay(middle, middle.whole(), i, indenter);
        if middle.tops[i] < CLEAR / 2.0 {
            // Perhaps so thin that it lies between the middles of these cells.
            lay(fine, fine.whole(), i, indenter);
            middle.tops[i] = pool(&fine.gaps[i], &mut middle.gaps[i], fine.cols);
        }
        coarse.tops[i] = pool(&middle.gaps[i], &mut coarse.gaps[i], middle.cols);
        coarse.tops[i] > CLEAR / 2.0
    }
}

/// Whether the gel touches something in a cell of a grid.
fn touches_in(grid: &Grid, row: usize, col: usize) -> bool {
    let Window { rows, cols } = grid.window;
    let inside = (rows[0]..rows[1]).contains(&row) && (cols[0]..cols[1]).contains(&col);
    let [above, here, below] = [0, 1, 2].map(|k| grid.row(row + k));
    let around = (above[col + 1] + below[col + 1]) + (here[col] + here[col + 2]);
    inside && rests(here[col + 1], grid.floor[row * grid.cols + col], around, grid.square)
}

/// So much of each of two displacements.
#[inline(always)]
fn weigh_plain(out: &mut [f32], slow: [&Plane; 2], [first, second]: [f32; 2], part: Window) {
    for r in part.rows[0]..part.rows[1] {
        let at = r * COLS + part.cols[0]..r * COLS + part.cols[1];
        let both = slow[0][at.clone()].iter().zip(&slow[1][at.clone()]);
        for (out, (a, b)) in out[at].iter_mut().zip(both) {
            *out = first * a + second * b;
        }
    }
}

/// Means of four cells.
#[inline(always)]
fn thin(fine: &[f32], coarse: &mut [f32], cols: usize) {
    for (two, out) in fine.chunks_exact(2 * cols).zip(coarse.chunks_exact_mut(cols / 2)) {
        let (upper, lower) = two.split_at(cols);
        for ((out, a), b) in out.iter_mut().zip(upper.as_chunks::<2>().0).zip(lower.as_chunks::<2>().0) {
            *out = 0.25 * ((a[0] + a[1]) + (b[0] + b[1]));
        }
    }
}

tega_simd::dispatched! {
    /// See [`Membrane::solve`].
    solve = Membrane::solve, (membrane: &mut Membrane, indenters: &[Indenter]) -> bool
}

tega_simd::dispatched! {
    /// See [`Membrane::measure`].
    measure = Membrane::measure, (membrane: &Membrane) -> Measured
}

tega_simd::dispatched! {
    /// See [`weigh_plain`].
    weigh = weigh_plain, (out: &mut [f32], slow: [&Plane; 2], shares: [f32; 2], part: Window) -> ()
}

#[cfg(test)]
mod tests;
