//! One grid of the gel, and what is done to it: shapes laid over it, sweeps over its rows, sums of what the springs carry.

use crate::membrane::MAX_INDENTERS;
use crate::plane::{CACHE_LINE, Plane};
use crate::shape::CLEAR;

/// Picture's pixels a millimetre.
pub const PX_PER_MM: f64 = 18.68;
/// The skin's length l, millimetres: 20 pixels of the sensor that the light field was fitted on.
pub const LENGTH_MM: f64 = 20.0 / PX_PER_MM;
/// The springs' stiffness k, newtons per cubic millimetre; see `docs/sim-touch.md` for where it comes from.
pub const STIFFNESS_N_MM3: f64 = 0.225;
/// Cells of the finest grid: the picture and 72 pixels (across) or 64 (along) around it, 20.6 mm x 24 mm.
pub(crate) const CELL_PX: usize = 4;
pub(crate) const COLS: usize = 96;
pub(crate) const ROWS: usize = 112;
/// Cells of the finest grid that lie outside the picture on each side.
pub(crate) const MARGIN_COLS: usize = 18;
pub(crate) const MARGIN_ROWS: usize = 16;

/// Displacement that is not worth a cell's work, millimetres: the picture would change by a count at most.
const NEGLIGIBLE_MM: f32 = 0.004;
/// Columns are worked on so many at a time, and sums kept in so many lanes, whatever the instruction set.
pub(crate) const LANES: usize = 8;
/// The same where a sum runs over all of the coarsest grid: sums that do not wait for each other.
const MANY: usize = 4 * LANES;
const _: () = assert!((ROWS / 4 * (COLS / 4)).is_multiple_of(MANY));

/// Rows and columns of cells, ends excluded; columns are multiples of [`LANES`], on all grids but the coarsest of
/// [`CACHE_LINE`].
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
    /// Of that, what those carry that the grid does not reach, by the coarser grid's answer.
    pub(crate) beyond: f32,
    /// Depth up to which the grid's box holds, millimetres.
    pub(crate) limit: f32,
}

/// A grid. `height` has a still row before and after it and still cells between its rows: cell (r, c) is at
/// (r + 1) * stride + [`CACHE_LINE`] + c. `floor` and `gaps` have not: r * cols + c.
#[derive(Debug, Clone)]
pub(crate) struct Level {
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
    /// Level of each shape's foremost cell in its gaps.
    pub(crate) tops: [f32; MAX_INDENTERS],
    /// Where each shape may touch: no deeper than it is taken for, it does not outside.
    pub(crate) boxes: [Window; MAX_INDENTERS],
}

impl Level {
    pub(crate) fn new(shrink: usize) -> Self {
        let (rows, cols) = (ROWS / shrink, COLS / shrink);
        let cell_mm = ((shrink * CELL_PX) as f64 / PX_PER_MM) as f32;
        let length = LENGTH_MM as f32 / cell_mm;
        let stride = cols + CACHE_LINE;
        let still = Plane::new((rows + 2) * stride + CACHE_LINE, 0.0);
        Self {
            rows,
            cols,
            cell_mm,
            square: length * length,
            window: Window::default(),
            stride,
            next: still.clone(),
            height: still,
            floor: Plane::new(rows * cols, 0.0),
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
    fn around_in(&self, row: usize, [from, to]: [usize; 2]) -> [&[f32]; 3] {
        let (zero, stride) = ((row + 1) * self.stride + CACHE_LINE, self.stride);
        let here = zero + from..zero + to;
        [
            &self.height[here.start - 1..=here.end],
            &self.height[here.start - stride..here.end - stride],
            &self.height[here.start + stride..here.end + stride],
        ]
    }
}

/// Raises the highest gaps so far, a few columns apart, by those of a row.
#[inline(always)]
pub(crate) fn raise(tops: &mut [f32; LANES], gaps: &[f32]) {
    for lanes in chunks(gaps) {
        for k in 0..LANES {
            tops[k] = if lanes[k] > tops[k] { lanes[k] } else { tops[k] };
        }
    }
}

pub(crate) fn highest(tops: [f32; LANES]) -> f32 {
    tops.into_iter().fold(CLEAR, |top, gap| if gap > top { gap } else { top })
}

/// A depth to start from, rather too small: a skin is soon up but slow to come down. Springs carry the volume that lies
/// inside the shape and, about, what the skin pulls down beside it.
#[inline(always)]
pub(crate) fn guess(grid: &Level, i: usize, force: f32) -> f32 {
    let cell = grid.cell_mm * grid.cell_mm;
    let top = grid.tops[i];
    let mut depth = (force / 80.0).sqrt();
    for _ in 0..6 {
        let (mut inside, mut over) = ([0.0f32; MANY], [0.0f32; MANY]);
        for lanes in grid.gaps[i].as_chunks::<MANY>().0 {
            for k in 0..MANY {
                let h = lanes[k] + (depth - top);
                inside[k] += if h > 0.0 { h } else { 0.0 };
                over[k] += if h > 0.0 { 1.0 } else { 0.0 };
            }
        }
        let (inside, over) = (inside.iter().sum::<f32>() * cell, over.iter().sum::<f32>() * cell);
        let length = LENGTH_MM as f32;
        let beside = depth * length * (over.sqrt() + 2.0 * length);
        let change = (force / (STIFFNESS_N_MM3 as f32 * (inside + beside))).clamp(0.25, 4.0).sqrt();
        depth *= change;
        if (0.95..1.05).contains(&change) {
            break;
        }
    }
    depth
}

/// Whether a cell's gel lies on a shape: at its height, and pressed by it about as its own springs alone need. Under a
/// shape that is not hollow the pressure is at least that; a cell that the contact only borders on has less.
#[inline(always)]
pub(crate) fn rests(h: f32, floor: f32, around: f32, square: f32) -> bool {
    h <= floor && floor > 0.0 && (1.0 + 4.0 * square) * h - square * around > 0.75 * h
}

/// A window's columns, a few at a time.
#[inline(always)]
pub(crate) fn chunks(line: &[f32]) -> &[[f32; LANES]] {
    chunks_of(line)
}

#[inline(always)]
fn chunks_of<const N: usize>(line: &[f32]) -> &[[f32; N]] {
    line.as_chunks().0
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

/// A coarse window with a cell around it, in a grid twice as fine.
pub(crate) fn wider(coarse: Window, fine: &Level) -> Window {
    let both = |[from, to]: [usize; 2], whole: usize, limit: usize| {
        let end = (2 * to + 2).next_multiple_of(whole).min(limit);
        [(2 * from.saturating_sub(1) / whole * whole).min(end), end]
    };
    Window { rows: both(coarse.rows, 1, fine.rows), cols: both(coarse.cols, CACHE_LINE, fine.cols) }
}

/// The highest shape over each cell, at least the still gel.
#[inline(always)]
pub(crate) fn raise_floor(grid: &mut Level, pressed: &[Pressed]) {
    for r in grid.window.rows[0]..grid.window.rows[1] {
        let at = grid.flat(r);
        grid.floor[at].fill(0.0);
    }
    for (i, pressed) in pressed.iter().enumerate() {
        let Window { rows: [first, last], cols: [from, to] } = grid.boxes[i];
        let lift = pressed.depth - grid.tops[i];
        for r in first..last {
            let at = r * grid.cols + from..r * grid.cols + to;
            for (floor, gap) in grid.floor[at.clone()].iter_mut().zip(&grid.gaps[i][at]) {
                let inside = gap + lift;
                *floor = if inside > *floor { inside } else { *floor };
            }
        }
    }
}

/// Lowers the skin by a share, but not into the shapes.
#[inline(always)]
pub(crate) fn settle(grid: &mut Level, share: f32) {
    for r in grid.window.rows[0]..grid.window.rows[1] {
        let (tall, flat) = (grid.tall(r), grid.flat(r));
        for (h, floor) in grid.height[tall].iter_mut().zip(&grid.floor[flat]) {
            let lower = *h * share;
            *h = if lower > *floor { lower } else { *floor };
        }
    }
}

/// Starts the fine grid's window, and what lies around it and stays, from the coarse grid; straight lines between cells.
#[inline(always)]
pub(crate) fn refine(coarse: &Level, fine: &mut Level, line: &mut [f32]) {
    let Window { rows: [first, last], cols: [c0, c1] } = fine.window;
    // Two columns, as a coarse cell has two.
    let (from, to) = (c0.saturating_sub(2), (c1 + 2).min(fine.cols));
    for r in first.saturating_sub(1)..(last + 1).min(fine.rows) {
        // Coarse rows around this one, counted with the still one before the first; the nearer has 3/4.
        let near = r / 2 + 1;
        let far = if r.is_multiple_of(2) { near - 1 } else { near + 1 };
        // line[m + 1] is coarse column m.
        let [m0, m1] = [from / 2, to / 2];
        let rows = coarse.row(near)[m0..m1 + 2].iter().zip(&coarse.row(far)[m0..m1 + 2]);
        for (line, (near, far)) in line[m0..m1 + 2].iter_mut().zip(rows) {
            *line = 0.75 * near + 0.25 * far;
        }
        let (before, here, after) = (&line[m0..m1], &line[m0 + 1..=m1], &line[m0 + 2..m1 + 2]);
        let zero = (r + 1) * fine.stride + CACHE_LINE;
        let cells = fine.height[zero + from..zero + to].as_chunks_mut::<2>().0.iter_mut();
        for (height, ((before, here), after)) in cells.zip(before.iter().zip(here).zip(after)) {
            *height = [0.75 * here + 0.25 * before, 0.75 * here + 0.25 * after];
        }
        let inside = (first..last).contains(&r);
        for part in if inside { [from..c0, c1..to] } else { [from..to, 0..0] } {
            let part = zero + part.start..zero + part.end;
            fine.next[part.clone()].copy_from_slice(&fine.height[part]);
        }
        if inside {
            let flat = fine.flat(r);
            for (height, floor) in fine.height[zero + c0..zero + c1].iter_mut().zip(&fine.floor[flat]) {
                *height = if *height > *floor { *height } else { *floor };
            }
        }
    }
}

/// Relaxes every cell of the window once: even rows from what all were, then odd ones from the new even ones.
#[inline(always)]
pub(crate) fn sweep(grid: &mut Level, relax: f32) {
    let shares = [relax * grid.square / (1.0 + 4.0 * grid.square), 1.0 - relax];
    let (stride, [first, last]) = (grid.stride, grid.window.rows);
    let mut next = std::mem::take(&mut grid.next);
    // An odd row follows as soon as the even ones beside it are there, while they are at hand.
    for even in (first.next_multiple_of(2)..last + 2).step_by(2) {
        if even < last {
            let [here, up, down] = grid.around(even);
            relax_row(&mut next[grid.tall(even)], &grid.floor[grid.flat(even)], here, up, down, shares);
        }
        let odd = even.wrapping_sub(1);
        if (first..last).contains(&odd) {
            let (at, [here, ..]) = (grid.tall(odd), grid.around(odd));
            let (before, rest) = next.split_at_mut(at.start);
            let (own, after) = rest.split_at_mut(at.len());
            let up = &before[at.start - stride..][..at.len()];
            let down = &after[stride - at.len()..][..at.len()];
            relax_row(own, &grid.floor[grid.flat(odd)], here, up, down, shares);
        }
    }
    grid.next = std::mem::replace(&mut grid.height, next);
}

/// Relaxes a row; a function of its own, so that the compiler knows that its arguments do not overlap.
#[inline(always)]
fn relax_row(
    out: &mut [f32],
    floor: &[f32],
    here: &[f32],
    up: &[f32],
    down: &[f32],
    [share, keep]: [f32; 2],
) {
    let n = out.len();
    let (left, here, right) = (&here[..n], &here[1..=n], &here[2..n + 2]);
    let (floor, up, down) = (&floor[..n], &up[..n], &down[..n]);
    for c in 0..n {
        let h = here[c] * keep + ((up[c] + down[c]) + (left[c] + right[c])) * share;
        out[c] = if h > floor[c] { h } else { floor[c] };
    }
}

/// What the springs under each shape carry; a cell belongs to the shape that lies highest over it.
#[inline(always)]
pub(crate) fn carry(grid: &Level, pressed: &mut [Pressed]) {
    for i in 0..pressed.len() {
        pressed[i].force = pressed[i].beyond + carried(grid, i, pressed, grid.boxes[i]);
    }
}

/// What a part's springs under a shape carry, newtons.
#[inline(always)]
fn carried(grid: &Level, i: usize, pressed: &[Pressed], part: Window) -> f32 {
    let alone = pressed.len() == 1;
    let lift = pressed[i].depth - grid.tops[i];
    let sum = if (part.cols[1] - part.cols[0]).is_multiple_of(2 * LANES) {
        carried_by::<{ 2 * LANES }>(grid, i, alone, lift, part)
    } else {
        carried_by::<LANES>(grid, i, alone, lift, part)
    };
    STIFFNESS_N_MM3 as f32 * grid.cell_mm * grid.cell_mm * sum
}

/// The sum of its pressures, in so many lanes.
#[inline(always)]
fn carried_by<const N: usize>(grid: &Level, i: usize, alone: bool, lift: f32, part: Window) -> f32 {
    let mut sums = [0.0f32; N];
    let Window { rows: [first, last], cols: [from, to] } = part;
    for r in first..last {
        let at = r * grid.cols + from..r * grid.cols + to;
        let shape = if alone { None } else { Some((&grid.gaps[i][at.clone()], lift)) };
        carry_row(&grid.floor[at], grid.around_in(r, part.cols), grid.square, shape, &mut sums);
    }
    sums.iter().sum()
}

/// Notes what the springs outside a part of the grid carry, for a finer one that reaches no further.
#[inline(always)]
pub(crate) fn carry_beyond(grid: &Level, part: Window, pressed: &mut [Pressed]) {
    for i in 0..pressed.len() {
        let (whole, inner) = (grid.boxes[i], shared(grid.boxes[i], part));
        if inner != whole {
            pressed[i].beyond = carried(grid, i, pressed, whole) - carried(grid, i, pressed, inner);
        }
    }
}

/// Adds a row's pressures; of one shape's cells only where its gaps and how far it is lifted are given.
#[inline(always)]
fn carry_row<const N: usize>(
    floor: &[f32],
    around: [&[f32]; 3],
    square: f32,
    shape: Option<(&[f32], f32)>,
    sums: &mut [f32; N],
) {
    let n = floor.len();
    let some = |line| chunks_of::<N>(line);
    let [here, up, down] = around;
    let (left, here, right) = (some(&here[..n]), some(&here[1..=n]), some(&here[2..n + 2]));
    let (floor, up, down) = (some(floor), some(&up[..n]), some(&down[..n]));
    let gaps = shape.map(|(gaps, lift)| (some(gaps), lift));
    for at in 0..floor.len() {
        for k in 0..N {
            let (h, floor) = (here[at][k], floor[at][k]);
            let sum = (up[at][k] + down[at][k]) + (left[at][k] + right[at][k]);
            let pressure = (1.0 + 4.0 * square) * h - square * sum;
            let touches = h <= floor && floor > 0.0 && pressure > 0.0;
            let mine = gaps.is_none_or(|(gaps, lift)| gaps[at][k] + lift >= floor);
            sums[k] += if touches && mine { pressure } else { 0.0 };
        }
    }
}
