//! Shear and incipient slip: how far the gel's surface is pulled sideways, by what is printed on it.
//!
//! The grain ([`super::grain`]) of each cell of the untouched gel is sought again in the frame, by Gauss and Newton's steps on the squared
//! difference, from where it was in the frame before (Lucas and Kanade). What is printed on a plain gel is fainter than the noise, so that all
//! cells of a contact are sought together: their displacement is u = a f + b g. Where the whole contact slips, traction follows pressure and u
//! the gel's depth: f is the depth over its largest. Where all of it sticks, u is the same all over: g is 1 inside the contact. A share a
//! of both is what has slid. What single cells show beyond that is added as far as their grain stands out of the noise.

use ndarray::ArrayView3;
use tega_error::OutOfRange;

use super::cells::Grid;
use super::grain::{Grain, Part, UNITS_PER_COUNT};
use crate::error::TactileError;
use crate::frame::{MAX_SIDE, Order};

/// Cells that are shallower than this share of the deepest are left out.
const SHALLOW: f32 = 0.15;
/// The rim of a contact is at about this share of its largest depth: a ball's.
const RIM: f32 = 0.5;
/// Gauss and Newton's steps a frame: no more where the last one was this short; the longest of them, and the farthest displacement, pixels of a picture of 320 x 240.
const STEPS: usize = 2;
const SETTLED_PX: f32 = 0.15;
const LONGEST_PX: f32 = 3.0;
const FARTHEST_PX: f32 = 40.0;
/// Noise of the grain, units, and over how many pixels it is alike; of a DIGIT.
const NOISE: f32 = 0.85 * 1.25 * UNITS_PER_COUNT;
const ALIKE_PX: f32 = 4.0;
/// How far from each other a, b and single cells may be without telling, pixels: standard deviations.
const APART_PX: f32 = 3.0;
const ALONE_PX: f32 = 0.3;
/// A share that has slid is told by half where it is this many of its standard deviations.
const DOUBT: f32 = 2.0;
/// How single cells and the slip's way are smoothed, seconds.
const ALONE_S: f64 = 0.05;
const SMOOTH_S: f64 = 0.04;
/// Shorter shears are in no direction and have no slip, pixels of a picture of 320 x 240.
const LEAST_PX: f32 = 0.6;
/// Pixels of the diagonal that lengths above are for.
const DIAGONAL_PX: f64 = 400.0;

/// How the reader of a fingertip's shear is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShearOptions {
    /// Order of the colour bytes.
    pub order: Order,
    /// Scale of a picture of 320 x 240 pixels.
    pub mm_per_px: f64,
}

/// What one frame says of a contact's shear.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sheared {
    /// How far the middle of the contact is pulled sideways, millimetres.
    pub shear_mm: f64,
    /// In which direction: 0 to the right in the picture, π/2 down; from -π to π.
    pub direction_rad: f64,
    /// Share of the contact that has slid against the rest, 0 to 1.
    pub incipient: f64,
    /// How fast the contact's rim slides against its middle, millimetres a second.
    pub slip_mm_s: f64,
    /// How well the grain is found again: its correlation with the untouched gel's, -1 to 1.
    pub sure: f64,
}

/// A cell that is sought.
#[derive(Debug, Clone, Copy)]
struct Sought {
    cell: usize,
    /// Its shares of a and b.
    shares: [f32; 2],
}

/// Reads the shear of one fingertip.
#[derive(Debug, Clone)]
pub struct ShearReader {
    options: ShearOptions,
    grid: Grid,
    /// Pixels over those of a picture of 320 x 240.
    scale: f32,
    grain: Grain,
    /// The untouched gel's grain and its gradient.
    untouched: Vec<i16>,
    slopes: [Vec<i16>; 2],
    /// Sums of the gradient's products over each cell: xx, xy, yy; and of the grain's squares.
    tensors: Vec<[f32; 3]>,
    squares: Vec<f32>,
    /// a and b, to the right and down, pixels.
    shapes: [[f32; 2]; 2],
    /// What single cells have beyond that.
    alone: Vec<[f32; 2]>,
    sought: Vec<Sought>,
    /// What each sought cell's difference says: gradient times it, and whether it was in the picture.
    told: Vec<Option<[f32; 2]>>,
    /// What the newest frame's cells said of a and b together: the equations that were solved.
    normal: [[f64; 5]; 4],
    slid_mm: f64,
    latest: Sheared,
}

impl ShearReader {
    /// Makes one from a picture of the untouched gel; the mean of some frames is better than one.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::Size`] for the picture, [`TactileError::OutOfRange`] for the scale.
    pub fn new(baseline: ArrayView3<'_, u8>, options: ShearOptions) -> Result<Self, TactileError> {
        let (height, width, channels) = baseline.dim();
        if channels != 3 {
            return Err(TactileError::Channels { name: "baseline", channels });
        }
        if height == 0 || width == 0 || height > MAX_SIDE || width > MAX_SIDE {
            return Err(TactileError::Size { height, width, max: MAX_SIDE });
        }
        if !(options.mm_per_px > 1e-3 && options.mm_per_px < 1.0) {
            return Err(OutOfRange::new("mm_per_px", options.mm_per_px, "mm", "0.001 to 1").into());
        }
        let grid = Grid::of(height, width);
        let scale = ((height * height + width * width) as f64).sqrt() / DIAGONAL_PX;
        let mut grain = Grain::new(height, width, (3 * grid.side).div_ceil(8).max(1));
        grain.take(baseline, options.order, Part { rows: [0, height], cols: [0, width] });
        let untouched = grain.twice.clone();
        let mut slopes = [vec![0i16; height * width], vec![0i16; height * width]];
        for y in 1..height.saturating_sub(1) {
            for x in 1..width.saturating_sub(1) {
                let k = y * width + x;
                let half = |before: i16, after: i16| ((i32::from(after) - i32::from(before)) / 2) as i16;
                slopes[0][k] = half(untouched[k - 1], untouched[k + 1]);
                slopes[1][k] = half(untouched[k - width], untouched[k + width]);
            }
        }
        let mut tensors = vec![[0.0; 3]; grid.cells()];
        let mut squares = vec![0.0; grid.cells()];
        for y in 0..height {
            for x in 0..width {
                let [gx, gy] = [0, 1].map(|k| f32::from(slopes[k][y * width + x]));
                let cell = y / grid.side * grid.cols + x / grid.side;
                let (tensor, old) = (&mut tensors[cell], f32::from(untouched[y * width + x]));
                squares[cell] += old * old;
                *tensor = [tensor[0] + gx * gx, tensor[1] + gx * gy, tensor[2] + gy * gy];
            }
        }
        Ok(Self {
            options,
            grid,
            scale: scale as f32,
            grain,
            untouched,
            slopes,
            tensors,
            squares,
            shapes: [[0.0; 2]; 2],
            alone: vec![[0.0; 2]; grid.cells()],
            sought: Vec::new(),
            told: Vec::new(),
            normal: [[0.0; 5]; 4],
            slid_mm: 0.0,
            latest: Sheared::default(),
        })
    }

    /// Reads the next frame.
    ///
    /// `depth` is the contact's depth, a value a cell, as [`super::TouchTracker::depth_map`] has it; without contact it is 0 all over. `dt_s` is
    /// the time since the frame before, seconds.
    ///
    /// # Errors
    /// [`TactileError::Channels`] or [`TactileError::ShapeMismatch`] for the frame, [`TactileError::OutOfRange`] for a time that is not from
    /// 0 to 1e6 s; the reader is then as before.
    pub fn update(
        &mut self,
        frame: ArrayView3<'_, u8>,
        depth: &[f32],
        dt_s: f64,
    ) -> Result<Sheared, TactileError> {
        let Grid { height, width, .. } = self.grid;
        let (frame_h, frame_w, channels) = frame.dim();
        if channels != 3 {
            return Err(TactileError::Channels { name: "frame", channels });
        }
        if (frame_h, frame_w) != (height, width) {
            return Err(TactileError::ShapeMismatch {
                frame_h,
                frame_w,
                baseline_h: height,
                baseline_w: width,
            });
        }
        if !(0.0..=1e6).contains(&dt_s) {
            return Err(OutOfRange::new("dt_s", dt_s, "s", "0 to 1e6").into());
        }
        let Some(part) = self.seek(depth) else {
            self.forget();
            return Ok(self.latest);
        };
        self.grain.take(frame, self.options.order, part);
        let mut sure = 0.0;
        for _ in 0..STEPS {
            sure = self.compare();
            if self.step_together() < SETTLED_PX * self.scale {
                break;
            }
        }
        self.step_alone((dt_s / (ALONE_S + dt_s)) as f32);
        self.latest = self.told_of(sure, dt_s);
        Ok(self.latest)
    }

    /// What the latest frame said.
    pub fn latest(&self) -> Sheared {
        self.latest
    }

    /// The latest displacement of each cell, to the right and down, pixels, and the numbers of rows and columns; 0 outside the contact.
    pub fn flow(&self) -> (Vec<[f32; 2]>, [usize; 2]) {
        let mut flow = vec![[0.0; 2]; self.grid.cells()];
        for sought in &self.sought {
            if let Some(out) = flow.get_mut(sought.cell) {
                *out = self.displacement(sought);
            }
        }
        (flow, [self.grid.rows, self.grid.cols])
    }

    fn forget(&mut self) {
        if !self.sought.is_empty() {
            self.sought.clear();
            self.alone.fill([0.0; 2]);
        }
        (self.shapes, self.slid_mm, self.latest) = ([[0.0; 2]; 2], 0.0, Sheared::default());
    }

    /// Chooses the cells of the contact; returns where their grain may be now.
    fn seek(&mut self, depth: &[f32]) -> Option<Part> {
        let deepest = depth.iter().fold(0.0f32, |most, d| if *d > most { *d } else { most });
        self.sought.clear();
        if deepest <= 0.0 || depth.len() != self.grid.cells() {
            return None;
        }
        let Grid { height, width, side, cols, .. } = self.grid;
        let (mut rows, mut columns) = ([height, 0], [width, 0]);
        for (cell, d) in depth.iter().enumerate() {
            let f = d / deepest;
            if f < SHALLOW {
                continue;
            }
            let g = if f < RIM { f / RIM } else { 1.0 };
            self.sought.push(Sought { cell, shares: [f, g] });
            let (y, x) = (cell / cols * side, cell % cols * side);
            (rows, columns) =
                ([rows[0].min(y), rows[1].max(y + side)], [columns[0].min(x), columns[1].max(x + side)]);
        }
        self.told.clear();
        self.told.resize(self.sought.len(), None);
        let [x, y] = [0, 1].map(|k| (self.shapes[0][k] + self.shapes[1][k]).abs());
        let moved = if x > y { x } else { y };
        let room = (moved + (STEPS as f32 + 2.0) * LONGEST_PX * self.scale) as usize + 2;
        let wider = |[from, to]: [usize; 2], size: usize| [from.saturating_sub(room), (to + room).min(size)];
        Some(Part { rows: wider(rows, height), cols: wider(columns, width) })
    }

    fn displacement(&self, sought: &Sought) -> [f32; 2] {
        let [f, g] = sought.shares;
        let alone = self.alone[sought.cell];
        [0, 1].map(|k| self.shapes[0][k] * f + self.shapes[1][k] * g + alone[k])
    }

    /// Compares each sought cell with the frame where it is taken to be; returns the correlation of all.
    fn compare(&mut self) -> f64 {
        let Grid { height, width, side, cols, .. } = self.grid;
        let (mut product, mut squares) = (0.0f32, [0.0f32; 2]);
        let places: Vec<_> =
            self.sought.iter().map(|sought| (sought.cell, self.displacement(sought))).collect();
        for ((cell, [dx, dy]), told) in places.into_iter().zip(&mut self.told) {
            let (y, x) = (cell / cols * side, cell % cols * side);
            let (left, top) = (dx.floor(), dy.floor());
            let (from_x, from_y) = (x as i64 + left as i64, y as i64 + top as i64);
            let fits = |from: i64, at: usize, size: usize| {
                from >= 0 && from + (side as i64) < size as i64 && at + side <= size
            };
            if !(fits(from_x, x, width) && fits(from_y, y, height)) {
                *told = None;
                continue;
            }
            let found = compare_cell(
                &self.grain.twice,
                [&self.untouched, &self.slopes[0], &self.slopes[1]],
                width,
                side,
                [from_y as usize * width + from_x as usize, y * width + x],
                [dx - left, dy - top],
            );
            *told = Some([found[0], found[1]]);
            product += found[2];
            squares = [squares[0] + found[3], squares[1] + self.squares[cell]];
        }
        let both = f64::from(squares[0]) * f64::from(squares[1]);
        if both > 0.0 { f64::from(product) / both.sqrt() } else { 0.0 }
    }

    /// Moves all cells together: the step of a and b that lessens the difference most; returns its length, pixels.
    fn step_together(&mut self) -> f32 {
        let mut normal = [[0.0f64; 5]; 4];
        for (sought, told) in self.sought.iter().zip(&self.told) {
            let Some(told) = told else { continue };
            let [xx, xy, yy] = self.tensors[sought.cell];
            let matrix = [[xx, xy], [xy, yy]];
            for i in 0..4 {
                let share = sought.shares[i / 2];
                for j in 0..4 {
                    normal[i][j] += f64::from(share * sought.shares[j / 2] * matrix[i % 2][j % 2]);
                }
                normal[i][4] -= f64::from(share * told[i % 2]);
            }
        }
        // Without a grain that tells the two shapes apart, the contact is taken for sticking: a stays small.
        let apart = APART_PX * self.scale;
        let prior = f64::from(NOISE * NOISE * ALIKE_PX / (apart * apart));
        for k in 0..2 {
            normal[k][k] += prior;
            normal[k][4] -= prior * f64::from(self.shapes[0][k]);
            normal[k + 2][k + 2] += 1e-3 * prior;
        }
        self.normal = normal;
        let mut step = solve(normal);
        let length = |k: usize| step[k] + step[k + 2];
        let long = (length(0) * length(0) + length(1) * length(1)).sqrt();
        let most = f64::from(LONGEST_PX * self.scale);
        if long > most {
            step = step.map(|s| s * most / long);
        }
        let far = FARTHEST_PX * self.scale;
        for k in 0..2 {
            self.shapes[0][k] = (self.shapes[0][k] + step[k] as f32).clamp(-far, far);
            self.shapes[1][k] = (self.shapes[1][k] + step[k + 2] as f32).clamp(-far, far);
        }
        // What single cells say is beyond that step.
        for (sought, told) in self.sought.iter().zip(&mut self.told) {
            let Some(told) = told else { continue };
            let ([xx, xy, yy], [f, g]) = (self.tensors[sought.cell], sought.shares);
            let [x, y] = [0, 1].map(|k| f * step[k] as f32 + g * step[k + 2] as f32);
            *told = [told[0] + xx * x + xy * y, told[1] + xy * x + yy * y];
        }
        long as f32
    }

    /// Moves single cells, with their neighbours, as far as their grain stands out of the noise.
    fn step_alone(&mut self, share: f32) {
        let Grid { rows, cols, .. } = self.grid;
        let alone = ALONE_PX * self.scale;
        let prior = NOISE * NOISE * ALIKE_PX / (alone * alone);
        let mut sums = vec![[0.0f32; 5]; rows * cols];
        for (sought, told) in self.sought.iter().zip(&self.told) {
            if let Some([bx, by]) = told {
                let [xx, xy, yy] = self.tensors[sought.cell];
                sums[sought.cell] = [xx, xy, yy, *bx, *by];
            }
        }
        for sought in &self.sought {
            let (r, c) = (sought.cell / cols, sought.cell % cols);
            let mut sum = [0.0f32; 5];
            for row in r.saturating_sub(1)..(r + 2).min(rows) {
                for near in &sums[row * cols + c.saturating_sub(1)..row * cols + (c + 2).min(cols)] {
                    for (sum, near) in sum.iter_mut().zip(near) {
                        *sum += near;
                    }
                }
            }
            let [xx, xy, yy, bx, by] = sum;
            let (xx, yy) = (xx + prior, yy + prior);
            let before = self.alone[sought.cell];
            // The prior pulls back to where all cells together have it.
            let (bx, by) = (bx + prior * before[0], by + prior * before[1]);
            let det = xx * yy - xy * xy;
            let step = [(xy * by - yy * bx) / det, (xy * bx - xx * by) / det];
            self.alone[sought.cell] = [0, 1].map(|k| {
                let next = before[k] + share * step[k];
                next.clamp(-LONGEST_PX * self.scale, LONGEST_PX * self.scale)
            });
        }
    }

    /// The share that has slid, less what noise alone would show of one: short pulls of small contacts tell little of it.
    fn believed(&self, slid: f32, [x, y]: [f32; 2], length: f32) -> f32 {
        // How the share goes with a and b, and what the noise makes of that.
        let (of_a, of_b) = (f64::from((1.0 - slid) / length), -f64::from(slid / length));
        let (x, y) = (f64::from(x), f64::from(y));
        let slope = [of_a * x, of_a * y, of_b * x, of_b * y];
        let mut rows = self.normal;
        for (row, slope) in rows.iter_mut().zip(slope) {
            row[4] = slope;
        }
        let noise: f64 = solve(rows).iter().zip(slope).map(|(a, b)| a * b).sum();
        let (square, noise) = (slid * slid, DOUBT * DOUBT * NOISE * NOISE * ALIKE_PX * noise as f32);
        if square > 0.0 { slid * square / (square + noise) } else { 0.0 }
    }

    fn told_of(&mut self, sure: f64, dt_s: f64) -> Sheared {
        let mm_per_px = self.options.mm_per_px / f64::from(self.scale);
        let [a, b] = self.shapes;
        let [x, y] = [0, 1].map(|k| a[k] + b[k]);
        let length = (x * x + y * y).sqrt();
        if length < LEAST_PX * self.scale {
            self.slid_mm -= self.slid_mm * dt_s / (SMOOTH_S + dt_s);
            return Sheared { shear_mm: f64::from(length) * mm_per_px, sure, ..Sheared::default() };
        }
        let slid = ((a[0] * x + a[1] * y) / (length * length)).clamp(0.0, 1.0);
        let slid = self.believed(slid, [x, y].map(|k| k / length), length);
        // The rim, where f is a half, lags behind the middle by half of a.
        let way_mm = f64::from(slid * length * (1.0 - RIM)) * mm_per_px;
        let lag_mm = way_mm - self.slid_mm;
        self.slid_mm += lag_mm * dt_s / (SMOOTH_S + dt_s);
        Sheared {
            shear_mm: f64::from(length) * mm_per_px,
            direction_rad: f64::from(y).atan2(f64::from(x)),
            incipient: f64::from(slid),
            slip_mm_s: (lag_mm / (SMOOTH_S + dt_s)).max(0.0),
            sure,
        }
    }
}

/// Lanes of a cell's sums.
const SOME: usize = 8;

/// Some pixels of a row, each between itself and the next.
#[inline(always)]
fn across(row: &[i16], share: f32) -> [f32; SOME] {
    let (here, next) = (&row[..SOME], &row[1..=SOME]);
    let mut out = [0.0; SOME];
    for k in 0..SOME {
        let left = f32::from(here[k]);
        out[k] = left + share * (f32::from(next[k]) - left);
    }
    out
}

/// Gradient times difference (across, along), product of grains, and squares of the found one, over a cell.
#[inline(always)]
fn compare_plain(
    now: &[i16],
    [before, slope_x, slope_y]: [&[i16]; 3],
    width: usize,
    side: usize,
    [from, at]: [usize; 2],
    [fx, fy]: [f32; 2],
) -> [f32; 4] {
    let mut sums = [[0.0f32; SOME]; 4];
    // As many columns at a time as there are lanes, each row between it and the next; then what is left.
    let whole = side / SOME * SOME;
    for x in (0..whole).step_by(SOME) {
        let mut upper = across(&now[from + x..][..=SOME], fx);
        for y in 0..side {
            let lower = across(&now[from + (y + 1) * width + x..][..=SOME], fx);
            let row = at + y * width + x;
            let (old, gx, gy) = (&before[row..][..SOME], &slope_x[row..][..SOME], &slope_y[row..][..SOME]);
            for k in 0..SOME {
                let (found, old) = (upper[k] + fy * (lower[k] - upper[k]), f32::from(old[k]));
                let off = found - old;
                sums[0][k] += f32::from(gx[k]) * off;
                sums[1][k] += f32::from(gy[k]) * off;
                sums[2][k] += found * old;
                sums[3][k] += found * found;
            }
            upper = lower;
        }
    }
    for y in 0..side {
        for x in whole..side {
            let (k, here) = (x - whole, from + y * width + x);
            let along = |here: usize| {
                let left = f32::from(now[here]);
                left + fx * (f32::from(now[here + 1]) - left)
            };
            let (top, bottom) = (along(here), along(here + width));
            let row = at + y * width + x;
            let (found, old) = (top + fy * (bottom - top), f32::from(before[row]));
            let off = found - old;
            sums[0][k] += f32::from(slope_x[row]) * off;
            sums[1][k] += f32::from(slope_y[row]) * off;
            sums[2][k] += found * old;
            sums[3][k] += found * found;
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

tega_simd::dispatched! {
    /// See [`compare_plain`].
    compare_cell = compare_plain,
    (now: &[i16], untouched: [&[i16]; 3], width: usize, side: usize, at: [usize; 2], shares: [f32; 2]) -> [f32; 4]
}

/// Solves four equations whose matrix is symmetric and positive: elimination without exchange; 0 where it is not positive.
fn solve(mut rows: [[f64; 5]; 4]) -> [f64; 4] {
    for k in 0..4 {
        if rows[k][k] <= 0.0 || !rows[k][k].is_finite() {
            return [0.0; 4];
        }
        let pivot = rows[k];
        for below in rows.iter_mut().skip(k + 1) {
            let by = below[k] / pivot[k];
            for (value, above) in below.iter_mut().zip(&pivot).skip(k) {
                *value -= by * above;
            }
        }
    }
    let mut x = [0.0; 4];
    for k in (0..4).rev() {
        let known: f64 = (k + 1..4).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (rows[k][4] - known) / rows[k][k];
    }
    x
}
