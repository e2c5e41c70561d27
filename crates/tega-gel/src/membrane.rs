//! The gel: a skin on springs, and shapes that it may not enter.
//!
//! The displacement `h` minimises the sum of h² + l²|∇h|² over all that lie above the shapes. It is found on three
//! grids, each started from the coarser one's answer, by a fixed number of red and black over-relaxed sweeps, so that
//! an answer depends on what presses now and on nothing before. A shape goes in until the springs under it carry its
//! force: with `k` the springs' stiffness, the pressure is p = k(h - l²∇²h) where it touches and 0 elsewhere.

use crate::shape::{CLEAR, Indenter};

/// Picture's pixels a millimetre.
pub const PX_PER_MM: f64 = 18.68;
/// The skin's length l, millimetres: 20 pixels of the sensor that the light field was fitted on.
pub const LENGTH_MM: f64 = 20.0 / PX_PER_MM;
/// The springs' stiffness k, newtons per cubic millimetre; see `docs/sim-touch.md` for where it comes from.
pub const STIFFNESS_N_MM3: f64 = 0.2;
/// Radius of the gel's dome, millimetres.
pub const DOME_MM: f64 = 100.0;
/// Shapes that may press at once.
pub const MAX_INDENTERS: usize = 8;

/// Cells of the finest grid and of the gel: the picture and 40 (across) or 64 (along) pixels around it.
pub(crate) const CELL_PX: usize = 4;
pub(crate) const COLS: usize = 80;
pub(crate) const ROWS: usize = 112;
/// Cells of the finest grid that lie outside the picture on each side.
pub(crate) const MARGIN_COLS: usize = 10;
pub(crate) const MARGIN_ROWS: usize = 16;

/// Displacement that is not worth a cell's work, millimetres: the picture would change by half a count.
const NEGLIGIBLE_MM: f32 = 0.002;
/// Sums are kept in so many lanes, in this order, whatever the instruction set.
const LANES: usize = 8;

/// Rows and columns of cells, ends excluded; columns are multiples of 16, so that half of them fill vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Window {
    pub(crate) rows: [usize; 2],
    pub(crate) cols: [usize; 2],
}

/// What one shape does.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Pressed {
    /// How far its foremost point is in, millimetres.
    pub(crate) depth: f32,
    /// What the springs carry, newtons.
    pub(crate) force: f32,
}

/// A grid. Cells of one colour lie together: cell (r, 2j + (r + colour) % 2) at (r + 1, j + 1) of that colour's plane.
#[derive(Debug, Clone)]
struct Level {
    rows: usize,
    half: usize,
    cell_mm: f32,
    window: Window,
    height: [Vec<f32>; 2],
    floor: [Vec<f32>; 2],
    gaps: Vec<Vec<f32>>,
}

impl Level {
    fn new(shrink: usize) -> Self {
        let (rows, half) = (ROWS / shrink, COLS / shrink / 2);
        let plane = vec![0.0; (rows + 2) * (half + 2)];
        Self {
            rows,
            half,
            cell_mm: ((shrink * CELL_PX) as f64 / PX_PER_MM) as f32,
            window: Window::default(),
            height: [plane.clone(), plane.clone()],
            floor: [plane.clone(), plane],
            gaps: vec![vec![CLEAR; rows * half * 2]; MAX_INDENTERS],
        }
    }

    #[inline(always)]
    fn stride(&self) -> usize {
        self.half + 2
    }

    /// l² in cells, squared.
    #[inline(always)]
    fn square(&self) -> f32 {
        let l = LENGTH_MM as f32 / self.cell_mm;
        l * l
    }
}

/// The gel's grids.
#[derive(Debug, Clone)]
pub(crate) struct Membrane {
    levels: [Level; 3],
    pub(crate) pressed: [Pressed; MAX_INDENTERS],
    row: Vec<f32>,
    pub(crate) schedule: [Steps; 3],
}

/// How often a grid matches the forces, and its sweeps each time and after.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Steps {
    pub(crate) matches: usize,
    pub(crate) sweeps: usize,
    pub(crate) last: usize,
    pub(crate) relax: f32,
}

const SCHEDULE: [Steps; 3] = [
    Steps { matches: 8, sweeps: 3, last: 2, relax: 1.3 },
    Steps { matches: 3, sweeps: 3, last: 2, relax: 1.3 },
    Steps { matches: 2, sweeps: 2, last: 3, relax: 1.3 },
];

impl Membrane {
    pub(crate) fn new() -> Self {
        Self {
            levels: [4, 2, 1].map(Level::new),
            pressed: [Pressed::default(); MAX_INDENTERS],
            row: vec![0.0; COLS + 2],
            schedule: SCHEDULE,
        }
    }

    /// Presses the shapes in; false where none of them lies over the gel.
    #[inline(always)]
    pub(crate) fn solve(&mut self, indenters: &[Indenter]) -> bool {
        let n = indenters.len();
        let mut any = false;
        for (i, indenter) in indenters.iter().enumerate() {
            let over = indenter.force_n > 0.0 && self.lay_over(i, indenter);
            // A ball of 10 mm needs about this much; the first matches find the rest.
            let depth =
                if over { (indenter.force_n / (62.8 * STIFFNESS_N_MM3)).sqrt() as f32 } else { CLEAR };
            self.pressed[i] = Pressed { depth, force: 0.0 };
            any |= over;
        }
        if !any {
            return false;
        }
        for level in 0..3 {
            if level == 0 {
                let grid = &mut self.levels[0];
                grid.window = Window { rows: [0, grid.rows], cols: [0, 2 * grid.half] };
                grid.height.iter_mut().for_each(|plane| plane.fill(0.0));
                raise_floor(grid, &self.pressed[..n]);
            } else {
                let [coarse, fine] = &mut self.levels[level - 1..=level] else { continue };
                fine.window = wider(reach(coarse), fine);
                raise_floor(fine, &self.pressed[..n]);
                refine(coarse, fine, &mut self.row);
            }
            let grid = &mut self.levels[level];
            let steps = self.schedule[level];
            for _ in 0..steps.matches {
                for _ in 0..steps.sweeps {
                    sweep(grid, steps.relax);
                }
                carry(grid, &mut self.pressed[..n]);
                for (pressed, indenter) in self.pressed.iter_mut().zip(indenters) {
                    // Force goes with depth to the power 1.9 for a ball, 1 for a flat face.
                    let ratio =
                        if pressed.force > 0.0 { indenter.force_n as f32 / pressed.force } else { 4.0 };
                    pressed.depth *= ratio.clamp(0.25, 4.0).sqrt();
                }
                raise_floor(grid, &self.pressed[..n]);
            }
            for _ in 0..steps.last {
                sweep(grid, steps.relax);
            }
        }
        carry(&self.levels[2], &mut self.pressed[..n]);
        true
    }

    /// The finest grid's window.
    pub(crate) fn window(&self) -> Window {
        self.levels[2].window
    }

    /// Writes a row of displacements of the finest grid, millimetres, and whether each cell touches; `heights` and
    /// `touching` are [`COLS`] long, row -1 and [`ROWS`] are still.
    #[inline(always)]
    pub(crate) fn read_row(&self, row: usize, heights: &mut [f32], touching: Option<&mut [bool]>) {
        let grid = &self.levels[2];
        let start = (row + 1) * grid.stride() + 1;
        let (first, second) = if row.is_multiple_of(2) { (0, 1) } else { (1, 0) };
        let a = &grid.height[first][start..start + grid.half];
        let b = &grid.height[second][start..start + grid.half];
        for ((pair, a), b) in heights.chunks_exact_mut(2).zip(a).zip(b) {
            pair[0] = *a;
            pair[1] = *b;
        }
        if let Some(touching) = touching {
            let fa = &grid.floor[first][start..start + grid.half];
            let fb = &grid.floor[second][start..start + grid.half];
            for (j, pair) in touching.chunks_exact_mut(2).enumerate() {
                pair[0] = fa[j] > 0.0 && a[j] <= fa[j];
                pair[1] = fb[j] > 0.0 && b[j] <= fb[j];
            }
        }
    }

    /// Lays a shape over the grids, its foremost point on the still gel; false where it lies beside it.
    #[inline(always)]
    fn lay_over(&mut self, i: usize, indenter: &Indenter) -> bool {
        let step = (CELL_PX as f64 / PX_PER_MM) as f32;
        let at = |cells: usize, c: usize| (c as f32 - (cells as f32 - 1.0) / 2.0) * step;
        let curve = (0.5 / DOME_MM) as f32;
        let gap = &mut self.levels[2].gaps[i];
        let mut tops = [CLEAR; LANES];
        for (r, row) in gap.chunks_exact_mut(COLS).enumerate() {
            let y = at(ROWS, r);
            indenter.lowest(at(COLS, 0), step, y, row);
            for (c, low) in row.iter_mut().enumerate() {
                let x = at(COLS, 0) + c as i32 as f32 * step;
                *low -= (x * x + y * y) * curve;
            }
            for lanes in row.chunks_exact(LANES) {
                tops.iter_mut()
                    .zip(lanes)
                    .for_each(|(top, low)| *top = if *low > *top { *low } else { *top });
            }
        }
        let top = tops.iter().fold(CLEAR, |top, low| if *low > top { *low } else { top });
        if top <= CLEAR / 2.0 {
            return false;
        }
        gap.iter_mut().for_each(|low| *low -= top);
        for level in [1, 0] {
            let [coarse, fine] = &mut self.levels[level..=level + 1] else { continue };
            pool(&fine.gaps[i], &mut coarse.gaps[i], 4 * coarse.half);
        }
        true
    }
}

/// Means of four cells, or the nearest of them where the shape does not lie over all.
#[inline(always)]
fn pool(fine: &[f32], coarse: &mut [f32], cols: usize) {
    for (two, out) in fine.chunks_exact(2 * cols).zip(coarse.chunks_exact_mut(cols / 2)) {
        let (upper, lower) = two.split_at(cols);
        for ((out, a), b) in out.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
            let (low0, high0) = if a[0] < a[1] { (a[0], a[1]) } else { (a[1], a[0]) };
            let (low1, high1) = if b[0] < b[1] { (b[0], b[1]) } else { (b[1], b[0]) };
            let low = if low0 < low1 { low0 } else { low1 };
            let high = if high0 > high1 { high0 } else { high1 };
            *out = if low > CLEAR / 2.0 { 0.25 * ((a[0] + a[1]) + (b[0] + b[1])) } else { high };
        }
    }
}

/// Where the coarse grid is displaced at all.
#[inline(always)]
fn reach(grid: &Level) -> Window {
    let mut found = Window { rows: [grid.rows, 0], cols: [2 * grid.half, 0] };
    for r in 0..grid.rows {
        let start = (r + 1) * grid.stride() + 1;
        for plane in &grid.height {
            for (j, h) in plane[start..start + grid.half].iter().enumerate() {
                if *h > NEGLIGIBLE_MM {
                    found.rows = [found.rows[0].min(r), r + 1];
                    found.cols = [found.cols[0].min(2 * j), found.cols[1].max(2 * j + 2)];
                }
            }
        }
    }
    found
}

/// A coarse window with a cell around it, in a grid twice as fine.
fn wider(coarse: Window, fine: &Level) -> Window {
    let cols = 2 * fine.half;
    let (r0, r1) = (2 * coarse.rows[0].saturating_sub(1), (2 * coarse.rows[1] + 2).min(fine.rows));
    let (c0, c1) = (2 * coarse.cols[0].saturating_sub(1), (2 * coarse.cols[1] + 2).min(cols));
    let whole = 2 * LANES;
    let end = c1.next_multiple_of(whole).min(cols);
    Window { rows: [r0.min(r1), r1], cols: [(c0 / whole * whole).min(end), end] }
}

/// The highest shape over each cell, at least the still gel.
#[inline(always)]
fn raise_floor(grid: &mut Level, pressed: &[Pressed]) {
    let (stride, cols) = (grid.stride(), 2 * grid.half);
    let [j0, j1] = grid.window.cols.map(|c| c / 2);
    for r in grid.window.rows[0]..grid.window.rows[1] {
        for colour in 0..2 {
            let parity = (r + colour) % 2;
            let start = (r + 1) * stride + 1;
            let floor = &mut grid.floor[colour][start + j0..start + j1];
            for (i, pressed) in pressed.iter().enumerate() {
                let gaps = &grid.gaps[i][r * cols + 2 * j0..r * cols + 2 * j1];
                for (floor, pair) in floor.iter_mut().zip(gaps.chunks_exact(2)) {
                    let inside = pair[parity] + pressed.depth;
                    let under = if i == 0 { 0.0 } else { *floor };
                    *floor = if inside > under { inside } else { under };
                }
            }
        }
    }
}

/// Starts the fine grid from the coarse one, straight lines between cells; all outside the window is still.
#[inline(always)]
fn refine(coarse: &Level, fine: &mut Level, row: &mut [f32]) {
    fine.height.iter_mut().for_each(|plane| plane.fill(0.0));
    let [j0, j1] = fine.window.cols.map(|c| c / 2);
    let cs = coarse.stride();
    for r in fine.window.rows[0]..fine.window.rows[1] {
        // Coarse rows around this one; the one nearer has 3/4.
        let near = r / 2 + 1;
        let far = if r.is_multiple_of(2) { near - 1 } else { near + 1 };
        // row[m + 1] is coarse column m; beyond the gel it is still.
        row.fill(0.0);
        for (line, share) in [(near, 0.75), (far, 0.25)] {
            // A line's first column is of colour 0 in even rows (lines are rows + 1).
            let (first, second) = if line % 2 == 1 { (0, 1) } else { (1, 0) };
            let a = &coarse.height[first][line * cs + 1..=line * cs + coarse.half];
            let b = &coarse.height[second][line * cs + 1..=line * cs + coarse.half];
            for ((pair, a), b) in row[1..].chunks_exact_mut(2).zip(a).zip(b) {
                pair[0] += share * a;
                pair[1] += share * b;
            }
        }
        for colour in 0..2 {
            let parity = (r + colour) % 2;
            let start = (r + 1) * fine.stride() + 1;
            let height = &mut fine.height[colour][start + j0..start + j1];
            let floor = &fine.floor[colour][start + j0..start + j1];
            let (near, far) = (&row[1 + j0..1 + j1], &row[2 * parity + j0..2 * parity + j1]);
            for (((h, floor), near), far) in height.iter_mut().zip(floor).zip(near).zip(far) {
                let start = 0.75 * near + 0.25 * far;
                *h = if start > *floor { start } else { *floor };
            }
        }
    }
}

/// Relaxes every cell of the window once, one colour after the other.
#[inline(always)]
fn sweep(grid: &mut Level, relax: f32) {
    let square = grid.square();
    let share = square / (1.0 + 4.0 * square);
    let stride = grid.stride();
    let [j0, j1] = grid.window.cols.map(|c| c / 2);
    let n = j1 - j0;
    for colour in 0..2 {
        let (own, other) = {
            let [a, b] = &mut grid.height;
            if colour == 0 { (a, &*b) } else { (b, &*a) }
        };
        for r in grid.window.rows[0]..grid.window.rows[1] {
            let parity = (r + colour) % 2;
            let start = (r + 1) * stride + 1 + j0;
            let side = start + 2 * parity - 1;
            let own = &mut own[start..start + n];
            let floor = &grid.floor[colour][start..start + n];
            let (up, down) = (&other[start - stride..][..n], &other[start + stride..][..n]);
            let (mid, side) = (&other[start..start + n], &other[side..side + n]);
            relax_row(own, floor, [up, down], [mid, side], [share, relax]);
        }
    }
}

/// Relaxes cells of one colour in a row; a function of its own, so that the compiler knows that its arguments do not
/// overlap.
#[inline(always)]
fn relax_row(
    own: &mut [f32],
    floor: &[f32],
    rows: [&[f32]; 2],
    sides: [&[f32]; 2],
    [share, relax]: [f32; 2],
) {
    let ([up, down], [mid, side]) = (rows, sides);
    let cells = own.iter_mut().zip(floor).zip(up.iter().zip(down)).zip(mid.iter().zip(side));
    for (((own, floor), (up, down)), (mid, side)) in cells {
        let around = (up + down) + (mid + side);
        let h = *own + relax * (around * share - *own);
        *own = if h > *floor { h } else { *floor };
    }
}

/// What the springs under each shape carry; a cell belongs to the shape that lies highest over it.
#[inline(always)]
fn carry(grid: &Level, pressed: &mut [Pressed]) {
    let square = grid.square();
    let stride = grid.stride();
    let [j0, j1] = grid.window.cols.map(|c| c / 2);
    let n = j1 - j0;
    let scale = STIFFNESS_N_MM3 as f32 * grid.cell_mm * grid.cell_mm;
    let cols = 2 * grid.half;
    let alone = pressed.len() == 1;
    for (i, pressed) in pressed.iter_mut().enumerate() {
        let mut sums = [0.0f32; LANES];
        for colour in 0..2 {
            let (own, other) = (&grid.height[colour], &grid.height[1 - colour]);
            for r in grid.window.rows[0]..grid.window.rows[1] {
                let parity = (r + colour) % 2;
                let start = (r + 1) * stride + 1 + j0;
                let side = start + 2 * parity - 1;
                let cells = Cells {
                    own: &own[start..start + n],
                    floor: &grid.floor[colour][start..start + n],
                    around: [
                        &other[start - stride..][..n],
                        &other[start + stride..][..n],
                        &other[start..start + n],
                        &other[side..side + n],
                    ],
                };
                if alone {
                    carry_row(&cells, square, None, &mut sums);
                } else {
                    let gaps = &grid.gaps[i][r * cols + 2 * j0 + parity..r * cols + 2 * j1];
                    carry_row(&cells, square, Some((gaps, pressed.depth)), &mut sums);
                }
            }
        }
        pressed.force = scale * sums.iter().sum::<f32>();
    }
}

/// Cells of one colour in a row, and their neighbours.
struct Cells<'a> {
    own: &'a [f32],
    floor: &'a [f32],
    around: [&'a [f32]; 4],
}

/// Adds a row's pressures; of one shape's cells only where its gaps (every other one) and depth are given.
#[inline(always)]
fn carry_row(cells: &Cells<'_>, square: f32, shape: Option<(&[f32], f32)>, sums: &mut [f32; LANES]) {
    let n = cells.own.len();
    let mut at = 0;
    while at < n {
        let (own, floor) = (lanes(cells.own, at), lanes(cells.floor, at));
        let [up, down, mid, side] = cells.around.map(|line| lanes(line, at));
        let mut mine = [true; LANES];
        if let Some((gaps, depth)) = shape {
            for (k, mine) in mine.iter_mut().enumerate() {
                *mine = gaps.get(2 * (at + k)).is_some_and(|gap| gap + depth >= floor[k]);
            }
        }
        for k in 0..LANES {
            let around = (up[k] + down[k]) + (mid[k] + side[k]);
            let p = (1.0 + 4.0 * square) * own[k] - square * around;
            let touches = (own[k] <= floor[k]) & (floor[k] > 0.0) & mine[k] & (p > 0.0);
            sums[k] += if touches { p } else { 0.0 };
        }
        at += LANES;
    }
}

/// Some cells of a line from one on; beyond its end 0.
#[inline(always)]
fn lanes(line: &[f32], at: usize) -> [f32; LANES] {
    if let Some(whole) = line.get(at..).and_then(<[f32]>::first_chunk) {
        return *whole;
    }
    let mut some = [0.0; LANES];
    some.iter_mut().zip(&line[at..]).for_each(|(to, from)| *to = *from);
    some
}

/// Sums over the touching cells of the picture, and the largest displacement in it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Measured {
    pub(crate) cells: usize,
    pub(crate) depth: f32,
    /// Of displacement, and of it times column and row; millimetres, cells of the picture.
    pub(crate) sum: f32,
    pub(crate) right: f32,
    pub(crate) down: f32,
}

/// Measures the part of the gel that is in the picture.
#[inline(always)]
pub(crate) fn measure(membrane: &Membrane) -> Measured {
    let grid = &membrane.levels[2];
    let window = grid.window;
    let (first, last) = (window.rows[0].max(MARGIN_ROWS), window.rows[1].min(ROWS - MARGIN_ROWS));
    let (j0, j1) = (MARGIN_COLS / 2, (COLS - MARGIN_COLS) / 2);
    let mut cells = [0u32; LANES];
    let mut deepest = [0.0f32; LANES];
    let (mut sum, mut right, mut down) = ([0.0f32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
    for r in first..last {
        for colour in 0..2 {
            let parity = (r + colour) % 2;
            let start = (r + 1) * grid.stride() + 1;
            let line = start + j0..start + j1;
            let (heights, floors) = (&grid.height[colour][line.clone()], &grid.floor[colour][line]);
            let mut at = 0;
            while at < heights.len() {
                let (h, floor) = (lanes(heights, at), lanes(floors, at));
                for k in 0..LANES {
                    let touches = (h[k] <= floor[k]) & (floor[k] > 0.0);
                    let held = if touches { h[k] } else { 0.0 };
                    cells[k] += u32::from(touches);
                    deepest[k] = if h[k] > deepest[k] { h[k] } else { deepest[k] };
                    sum[k] += held;
                    right[k] += held * (2 * (at + k) + parity) as i32 as f32;
                    down[k] += held * (r - MARGIN_ROWS) as i32 as f32;
                }
                at += LANES;
            }
        }
    }
    Measured {
        cells: cells.iter().sum::<u32>() as usize,
        depth: deepest.iter().fold(0.0, |top, h| if *h > top { *h } else { top }),
        sum: sum.iter().sum(),
        right: right.iter().sum(),
        down: down.iter().sum(),
    }
}
