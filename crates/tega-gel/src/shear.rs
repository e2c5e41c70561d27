//! The gel's shear: how far what it touches pulls its surface sideways, and where that slips.
//!
//! As under the normal press the surface is a skin on springs: a displacement u needs the traction q = kₜ(u - l²∇²u), none
//! where nothing touches. Where something does, the surface is carried along with it as long as |q| ≤ μ p (Coulomb), and
//! slips at that traction. The way of the object against the gel is found such that the tractions carry its tangential
//! force. Both directions obey the same operator as the press, so that Ciavarella and Jäger hold: what still sticks under a
//! pull Q is what would touch under the force P - Q/μ, which for a ball on a half-space is Cattaneo and Mindlin's
//! (1 - Q/μP)^(1/3).

use crate::grid::{CELL_PX, Grid, LANES, LENGTH_MM, MARGIN_COLS, MARGIN_ROWS, PX_PER_MM};
use crate::picture::{HEIGHT, WIDTH};
use crate::springs::STIFFNESS_N_MM3;

/// Traction a sideways displacement, over pressure a displacement; `docs/evidence/sim-touch.md` says where it comes from.
pub const SHEAR_STIFFNESS_N_MM3: f64 = 0.3 * STIFFNESS_N_MM3;

/// Two of the finest grid's cells on either side: 8 pixels.
pub(crate) const WIDE_PX: usize = 2 * CELL_PX;
/// Cells of the picture, and one more on each side.
pub(crate) const WIDE_ROWS: usize = HEIGHT / WIDE_PX + 2;
pub(crate) const WIDE_COLS: usize = WIDTH / WIDE_PX + 2;
/// A row with the cell before and after it.
const STRIDE: usize = WIDE_COLS + 2;
const CELLS: usize = (WIDE_ROWS + 2) * STRIDE;
const _: () = assert!(WIDE_COLS.is_multiple_of(LANES));

/// The skin's length in cells, squared; what a cell's displacement needs, and gets of its neighbours'.
const SQUARE: f32 = {
    let cells = LENGTH_MM * PX_PER_MM / WIDE_PX as f64;
    (cells * cells) as f32
};
const STIFF: f32 = 1.0 + 4.0 * SQUARE;
/// A cell's gel, square millimetres: that of a flat gel, so that what the springs carry is the sum of the displacements.
const CELL_MM2: f32 = ((WIDE_PX as f64 / PX_PER_MM) * (WIDE_PX as f64 / PX_PER_MM)) as f32;
/// Columns of either colour of the chessboard.
const CHESSBOARD: [[bool; WIDE_COLS]; 2] = {
    let mut board = [[false; WIDE_COLS]; 2];
    let mut c = 0;
    while c < WIDE_COLS {
        board[c % 2][c] = true;
        c += 1;
    }
    board
};

/// Sweeps a frame: at most, and at least.
const MOST: usize = 40;
const LEAST: usize = 8;
/// Over-relaxation, and how much of a missing force is made up for at once; less each time that goes too far.
const RELAX: f32 = 1.5;
const EAGER: f32 = 0.5;
const CALMER: f32 = 0.6;
/// Longest step of the object's way, over the way at which all of a contact that sticks would be at its limit. Where little sticks a missing
/// force says nothing of how far there is to go: without a bound the way goes to and fro from frame to frame under a pull that does not change.
const STRIDE_SHARE: f32 = 0.25;
/// What lies this far from where the object would have it has slid, millimetres.
const SLID_MM: f32 = 1e-5;
/// A force that misses by this share of the limit is met.
const MET: f32 = 0.002;
/// No pull goes beyond this share of the limit: something always sticks, so that the object's way stays finite.
const HOLDS: f32 = 0.995;
/// A traction from this share of the limit on is at it.
const AT_LIMIT: f32 = 0.97;
/// Least number of cells that is taken to stick.
const LEAST_CELLS: f32 = 2.0;

/// What is true of a contact's shear.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shear {
    /// Mean displacement of the touching gel, to the right and down the picture, millimetres.
    pub mean_mm: [f64; 2],
    /// Largest length of a cell's displacement, millimetres.
    pub peak_mm: f64,
    /// Share of the touching area whose traction is at the limit of friction, 0 to 1; 0 without contact.
    pub slid: f64,
}

/// How what touches a gel pulls it sideways.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pull {
    /// Tangential force on the gel, to the right and down the picture, newtons.
    pub force_n: [f64; 2],
    /// Coefficient of friction μ.
    pub friction: f64,
    /// Normal force of all that touches, newtons.
    pub load_n: f64,
}

/// One direction's number for every cell, with a row and a column around.
type Field = Vec<f32>;

/// The state of the gel's shear.
#[derive(Debug, Clone)]
pub(crate) struct ShearField {
    /// Displacement to the right and down, millimetres.
    u: [Field; 2],
    /// Where the gel lies against the object, over the object's way.
    anchor: [Field; 2],
    /// Largest traction, over the stiffness: millimetres.
    limit: Field,
    /// Area of the cell's gel, square millimetres, and how much of it touches, as a share of a cell.
    area: Field,
    touching: Field,
    /// The object's way since the gel was untouched, millimetres.
    way: [f32; 2],
    /// Whether anything is displaced.
    moved: bool,
}

impl ShearField {
    pub(crate) fn new() -> Self {
        let field = || vec![0.0; CELLS];
        Self {
            u: [field(), field()],
            anchor: [field(), field()],
            limit: field(),
            area: field(),
            touching: field(),
            way: [0.0; 2],
            moved: false,
        }
    }

    /// Whether any gel is displaced.
    pub(crate) fn moved(&self) -> bool {
        self.moved
    }

    /// Lets go of everything.
    pub(crate) fn forget(&mut self) {
        if self.moved {
            for field in self.u.iter_mut().chain(&mut self.anchor) {
                field.fill(0.0);
            }
        }
        (self.way, self.moved) = ([0.0; 2], false);
    }

    /// Pulls what touches the gel sideways.
    #[inline(always)]
    pub(crate) fn pull(&mut self, grid: &Grid, by: Pull) {
        let [x, y, friction, load] = [by.force_n[0], by.force_n[1], by.friction, by.load_n].map(|v| v as f32);
        if !self.moved && [x, y] == [0.0; 2] {
            return;
        }
        let (most, cells) = self.take_in(grid, friction);
        if most <= 0.0 || load <= 0.0 {
            self.forget();
            return;
        }
        self.moved = true;
        // All in displacement times cells: traction over stiffness. The picture's part of the contact bears its part of the pull.
        let per = most / (friction * load);
        let mut wanted = [x * per, y * per];
        let length = (wanted[0] * wanted[0] + wanted[1] * wanted[1]).sqrt();
        if length > HOLDS * most {
            wanted = wanted.map(|f| f * (HOLDS * most / length));
        }
        let longest = STRIDE_SHARE * most / edged(cells);
        let (mut eager, mut before) = (EAGER, [0.0f32; 2]);
        for sweep in 1..=MOST {
            self.sweep();
            let ([carried_x, carried_y], stuck) = self.carried();
            let off = [wanted[0] - carried_x, wanted[1] - carried_y];
            let far = off[0] * off[0] + off[1] * off[1];
            if sweep == MOST || sweep >= LEAST && far < MET * MET * most * most {
                break;
            }
            let stuck = if stuck > LEAST_CELLS { stuck } else { LEAST_CELLS };
            if off[0] * before[0] + off[1] * before[1] < 0.0 {
                eager *= CALMER;
            }
            before = off;
            let step = eager * far.sqrt() / edged(stuck);
            let share = if step > longest { longest / step } else { 1.0 } * eager / edged(stuck);
            for (way, off) in self.way.iter_mut().zip(off) {
                *way += share * off;
            }
        }
        for k in 0..2 {
            for (anchor, u) in self.anchor[k].iter_mut().zip(&self.u[k]) {
                *anchor = u - self.way[k];
            }
        }
    }

    /// Takes in what presses; returns the sum of the limits, and how many cells have one.
    #[inline(always)]
    fn take_in(&mut self, grid: &Grid, friction: f32) -> (f32, f32) {
        let ratio = friction * (STIFFNESS_N_MM3 / SHEAR_STIFFNESS_N_MM3) as f32;
        let (mut most, mut cells) = (0.0, 0.0);
        let window = grid.window;
        for r in 0..WIDE_ROWS {
            for c in 0..WIDE_COLS {
                let (mut area, mut touching, mut load) = (0.0f32, 0u8, 0.0f32);
                for i in 0..2 {
                    let row = MARGIN_ROWS - 2 + 2 * r + i;
                    let [above, here, below] = [0, 1, 2].map(|k| grid.row(row + k));
                    for j in 0..2 {
                        let col = MARGIN_COLS - 2 + 2 * c + j;
                        let own = grid.area[row * grid.cols + col];
                        area += own;
                        if !((window.rows[0]..window.rows[1]).contains(&row)
                            && (window.cols[0]..window.cols[1]).contains(&col))
                        {
                            continue;
                        }
                        let (h, floor) = (here[col + 1], grid.floor[row * grid.cols + col]);
                        let around = (above[col + 1] + below[col + 1]) + (here[col] + here[col + 2]);
                        let pressure = (1.0 + 4.0 * grid.square) * h - grid.square * around;
                        if h <= floor && floor > 0.0 && pressure > 0.0 {
                            load += pressure * own;
                            touching += 1;
                        }
                    }
                }
                let k = (r + 1) * STRIDE + c + 1;
                self.area[k] = area;
                self.touching[k] = f32::from(touching) / 4.0;
                self.limit[k] = ratio * load / CELL_MM2;
                most += self.limit[k];
                cells += if load > 0.0 { 1.0 } else { 0.0 };
            }
        }
        (most, cells)
    }

    /// Relaxes every cell once: those of one colour of a chessboard, then those of the other.
    #[inline(always)]
    fn sweep(&mut self) {
        for colour in 0..2 {
            self.mirror();
            for r in 0..WIDE_ROWS {
                self.relax_row(r + 1, colour);
            }
        }
    }

    /// Relaxes a row's cells of one colour; their neighbours are of the other.
    #[inline(always)]
    fn relax_row(&mut self, row: usize, colour: usize) {
        let at = row * STRIDE + 1;
        let cells = at..at + WIDE_COLS;
        let (mut x, mut y) = (line(&self.u[0], at), line(&self.u[1], at));
        let [beside_x, beside_y] = self.u.each_ref().map(|u| {
            let [up, down, left, right] = [at - STRIDE, at + STRIDE, at - 1, at + 1].map(|at| line(u, at));
            let mut sum = [0.0f32; WIDE_COLS];
            for c in 0..WIDE_COLS {
                sum[c] = SQUARE * ((up[c] + down[c]) + (left[c] + right[c]));
            }
            sum
        });
        let (anchor_x, anchor_y) = (line(&self.anchor[0], at), line(&self.anchor[1], at));
        let (limit, [way_x, way_y]) = (line(&self.limit, at), self.way);
        let mine = CHESSBOARD[(row + colour) % 2];
        for c in 0..WIDE_COLS {
            let (with_x, with_y) = (way_x + anchor_x[c], way_y + anchor_y[c]);
            // What it takes to carry the cell along with the object, and what friction has of it.
            let (need_x, need_y) = (STIFF * with_x - beside_x[c], STIFF * with_y - beside_y[c]);
            let need = (need_x * need_x + need_y * need_y).sqrt();
            let sticks = need <= limit[c] && limit[c] > 0.0;
            let share = limit[c] / if need > limit[c] { need } else { 1.0 };
            let (to_x, to_y) =
                ((need_x * share + beside_x[c]) / STIFF, (need_y * share + beside_y[c]) / STIFF);
            let (soft_x, soft_y) = (x[c] + RELAX * (to_x - x[c]), y[c] + RELAX * (to_y - y[c]));
            let (new_x, new_y) = if sticks { (with_x, with_y) } else { (soft_x, soft_y) };
            x[c] = if mine[c] { new_x } else { x[c] };
            y[c] = if mine[c] { new_y } else { y[c] };
        }
        self.u[0][cells.clone()].copy_from_slice(&x);
        self.u[1][cells].copy_from_slice(&y);
    }

    /// Sums what the springs carry, and how many cells stick.
    #[inline(always)]
    fn carried(&self) -> ([f32; 2], f32) {
        let mut sums = [[0.0f32; LANES]; 3];
        for r in 1..=WIDE_ROWS {
            let at = r * STRIDE + 1;
            let [x, y, limit] = [&self.u[0], &self.u[1], &self.limit].map(|field| line(field, at));
            let (anchor_x, anchor_y) = (line(&self.anchor[0], at), line(&self.anchor[1], at));
            for c in 0..WIDE_COLS {
                let (off_x, off_y) = (x[c] - anchor_x[c] - self.way[0], y[c] - anchor_y[c] - self.way[1]);
                let sticks = off_x * off_x + off_y * off_y <= SLID_MM * SLID_MM && limit[c] > 0.0;
                sums[0][c % LANES] += x[c];
                sums[1][c % LANES] += y[c];
                sums[2][c % LANES] += if sticks { 1.0 } else { 0.0 };
            }
        }
        let [x, y, stuck] = sums.map(|lanes| lanes.iter().sum::<f32>());
        ([x, y], stuck)
    }

    /// Cells around the grid go with their neighbours: the gel goes on beyond the picture.
    #[inline(always)]
    fn mirror(&mut self) {
        for field in &mut self.u {
            for r in 1..=WIDE_ROWS {
                let row = &mut field[r * STRIDE..][..STRIDE];
                (row[0], row[STRIDE - 1]) = (row[1], row[STRIDE - 2]);
            }
            field.copy_within(STRIDE..2 * STRIDE, 0);
            field.copy_within(WIDE_ROWS * STRIDE..(WIDE_ROWS + 1) * STRIDE, (WIDE_ROWS + 1) * STRIDE);
        }
    }

    /// What is true of it.
    pub(crate) fn measure(&self) -> Shear {
        if !self.moved {
            return Shear::default();
        }
        let (mut sums, mut all, mut slid, mut peak) = ([0.0f64; 2], 0.0f64, 0.0f64, 0.0f64);
        for r in 1..=WIDE_ROWS {
            for k in r * STRIDE + 1..=r * STRIDE + WIDE_COLS {
                let [x, y] = [0, 1].map(|axis| f64::from(self.u[axis][k]));
                let [pull_x, pull_y] = self.u.each_ref().map(|u| {
                    STIFF * u[k] - SQUARE * ((u[k - STRIDE] + u[k + STRIDE]) + (u[k - 1] + u[k + 1]))
                });
                let touching = f64::from(self.touching[k]);
                sums = [sums[0] + touching * x, sums[1] + touching * y];
                all += touching;
                if (pull_x * pull_x + pull_y * pull_y).sqrt() >= AT_LIMIT * self.limit[k] {
                    slid += touching;
                }
                peak = peak.max(x * x + y * y);
            }
        }
        Shear { mean_mm: sums.map(|sum| sum / all), peak_mm: peak.sqrt(), slid: slid / all }
    }

    /// A cell's displacement, millimetres; of the picture's cells and one around.
    pub(crate) fn at(&self, row: usize, col: usize) -> [f32; 2] {
        let k = (row + 1) * STRIDE + col + 1;
        [self.u[0][k], self.u[1][k]]
    }

    /// How many pixels a millimetre of a cell's gel is long in the picture.
    pub(crate) fn px_per_mm(&self, row: usize, col: usize) -> f32 {
        WIDE_PX as f32 / self.area[(row + 1) * STRIDE + col + 1].sqrt()
    }
}

/// Stiffness of a disc of so many cells that is moved: it pulls the skin around it along, its edge times the skin's length.
#[inline(always)]
fn edged(cells: f32) -> f32 {
    cells + (4.0 * std::f32::consts::PI * SQUARE * cells).sqrt()
}

/// A row of cells.
#[inline(always)]
fn line(field: &[f32], at: usize) -> [f32; WIDE_COLS] {
    let mut line = [0.0; WIDE_COLS];
    line.copy_from_slice(&field[at..at + WIDE_COLS]);
    line
}

#[inline(always)]
fn pull_plain(field: &mut ShearField, grid: &Grid, by: Pull) {
    field.pull(grid, by);
}

tega_simd::dispatched! {
    /// See [`ShearField::pull`].
    pull = pull_plain, (field: &mut ShearField, grid: &Grid, by: Pull) -> ()
}
