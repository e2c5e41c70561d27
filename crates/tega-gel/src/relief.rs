//! The relief of what touches the gel: print, ribs, seams, fibre, whose imprint goes with the object and not with the gel.
//!
//! One pattern of a deviation of 1 is drawn once and wrapped around every shape: around its axis and along it for bars, square to its own z
//! for what has no axis. Its imprint grows with the root of the pressure, as that of a printed disc on a recorded DIGIT does, until the gel
//! lies in it altogether. The gel carries it along: it lies at R(x - o), with o the pressed gel's own displacement, while the shape's pose
//! has what slides.

use std::sync::OnceLock;

use tega_error::OutOfRange;

use crate::beside::{ACROSS, BESIDE, place};
use crate::error::GelError;
use crate::grid::{CELL_PX, Grid, MARGIN_COLS, MARGIN_ROWS};
use crate::picture::nearest;
use crate::rng::Stream;
use crate::shape::{Indenter, Shape};
use crate::shear::{WIDE_COLS, WIDE_PX, WIDE_ROWS};
use crate::springs::STIFFNESS_N_MM3;

/// Pressure from which a relief shows in full, newtons per square millimetre; `docs/evidence/sim-touch.md` says where it comes from.
pub const FULL_PRESSURE_N_MM2: f64 = 0.44;

/// The drawn pattern: pixels along a side, after which it repeats itself, and passes of the binomial filter of five taps that leave its
/// shortest and its longest waves out: what is left is strongest at [`DRAWN_PX`].
const SIDE: usize = 512;
const PASSES: [usize; 2] = [4, 8];
/// 2π σ/1.18 of the first filter's deviation σ, 2 pixels.
const DRAWN_PX: f64 = 10.7;
/// Parts that it is kept in.
const PARTS: f32 = 64.0;
const SEED: u64 = 0x7265_6C69;

/// A relief.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Relief {
    /// Deviation of its imprint's grey in full, counts; 0 is smooth.
    pub counts: f64,
    /// Its strongest wave, millimetres.
    pub length_mm: f64,
}

impl Relief {
    /// Refuses numbers that make no relief.
    pub(crate) fn check(&self) -> Result<(), GelError> {
        if !(0.0..=20.0).contains(&self.counts) {
            return Err(OutOfRange::new("relief_counts", self.counts, "counts", "0 to 20").into());
        }
        if !(0.1..=5.0).contains(&self.length_mm) {
            return Err(OutOfRange::new("relief_mm", self.length_mm, "mm", "0.1 to 5").into());
        }
        Ok(())
    }
}

/// What of a relief each cell shows.
#[derive(Debug, Clone)]
pub(crate) struct Imprint {
    /// Of each cell of 8 pixels and one around the picture: counts, and where on the pattern its middle is, drawn pixels.
    cells: Vec<[f32; 3]>,
    rows: [usize; 2],
    cols: [usize; 2],
}

impl Imprint {
    pub(crate) fn new() -> Self {
        Self { cells: vec![[0.0; 3]; WIDE_ROWS * WIDE_COLS], rows: [0; 2], cols: [0; 2] }
    }

    /// Nothing leaves one.
    pub(crate) fn forget(&mut self) {
        (self.rows, self.cols) = ([0; 2], [0; 2]);
    }

    /// Whether anything is imprinted.
    pub(crate) fn shows(&self) -> bool {
        self.rows[0] < self.rows[1]
    }

    /// Cells that show something, rows and columns.
    pub(crate) fn area(&self) -> [[usize; 2]; 2] {
        [self.rows, self.cols]
    }

    /// Takes in what lies against the gel and how far that has carried it, millimetres.
    pub(crate) fn take(&mut self, grid: &Grid, of: &Indenter, relief: Relief, carried: [f64; 2]) {
        let wrapped = Wrapped::new(of);
        let scale = DRAWN_PX / relief.length_mm;
        let (mut rows, mut cols) = ([WIDE_ROWS, 0], [WIDE_COLS, 0]);
        for r in 0..WIDE_ROWS {
            for c in 0..WIDE_COLS {
                let (load, [x, y]) = pressed(grid, r, c);
                let share = f64::from(load) * STIFFNESS_N_MM3 / FULL_PRESSURE_N_MM2;
                let counts = relief.counts * share.sqrt().min(1.0);
                if counts > 0.0 {
                    (rows, cols) =
                        ([rows[0].min(r), rows[1].max(r + 1)], [cols[0].min(c), cols[1].max(c + 1)]);
                }
                let [a, b] = wrapped.at([f64::from(x) - carried[0], f64::from(y) - carried[1]]);
                self.cells[r * WIDE_COLS + c] = [counts as f32, (scale * a) as f32, (scale * b) as f32];
            }
        }
        (self.rows, self.cols) = if rows[0] < rows[1] { (rows, cols) } else { ([0; 2], [0; 2]) };
    }

    /// Writes a row of the picture from some column on: counts, in `parts` of one.
    #[inline(always)]
    pub(crate) fn row(&self, y: usize, from: usize, parts: f32, out: &mut [i16]) {
        let (pattern, (row, down)) = (drawn(), place(y));
        let (upper, lower) = (&self.cells[row * WIDE_COLS..], &self.cells[(row + 1) * WIDE_COLS..]);
        let mut line = [[0.0f32; 3]; WIDE_COLS];
        for ((cell, upper), lower) in line.iter_mut().zip(upper).zip(lower) {
            *cell = [0, 1, 2].map(|k| upper[k] + down * (lower[k] - upper[k]));
        }
        for (x, out) in (from..).zip(out) {
            let (here, next, right) = (line[BESIDE[x]], line[BESIDE[x] + 1], ACROSS[x]);
            let [counts, a, b] = [0, 1, 2].map(|k| here[k] + right * (next[k] - here[k]));
            if counts <= 0.0 {
                *out = 0;
                continue;
            }
            let (left, top) = (a.floor(), b.floor());
            let (fx, fy) = (a - left, b - top);
            let [x, y] = [left, top].map(|v| (v as i32).rem_euclid(SIDE as i32) as usize);
            let level = |x: usize, y: usize| f32::from(pattern[y % SIDE * SIDE + x % SIDE]);
            let upper = level(x, y) + fx * (level(x + 1, y) - level(x, y));
            let lower = level(x, y + 1) + fx * (level(x + 1, y + 1) - level(x, y + 1));
            *out = nearest(parts / PARTS * counts * (upper + fy * (lower - upper)));
        }
    }
}

/// Displacement beyond what its neighbours hold up, of a wide cell: pressure over stiffness, millimetres; and where its gel lies.
fn pressed(grid: &Grid, r: usize, c: usize) -> (f32, [f32; 2]) {
    let (mut load, mut place) = (0.0, [0.0; 2]);
    for i in 0..WIDE_PX / CELL_PX {
        let row = MARGIN_ROWS - 2 + 2 * r + i;
        let [above, here, below] = [0, 1, 2].map(|k| grid.row(row + k));
        for j in 0..WIDE_PX / CELL_PX {
            let col = MARGIN_COLS - 2 + 2 * c + j;
            let k = row * grid.cols + col;
            place = [place[0] + grid.x[k] / 4.0, place[1] + grid.y[k] / 4.0];
            let inside = (grid.window.rows[0]..grid.window.rows[1]).contains(&row)
                && (grid.window.cols[0]..grid.window.cols[1]).contains(&col);
            let (h, floor) = (here[col + 1], grid.floor[k]);
            let around = (above[col + 1] + below[col + 1]) + (here[col] + here[col + 2]);
            let pressure = (1.0 + 4.0 * grid.square) * h - grid.square * around;
            if inside && h <= floor && floor > 0.0 && pressure > 0.0 {
                load += pressure / 4.0;
            }
        }
    }
    (load, place)
}

/// How the pattern is wrapped around a shape: from the pad frame to the pattern, millimetres.
struct Wrapped {
    middle: [f64; 2],
    across: [f64; 2],
    along: [f64; 2],
    /// Radius and how far the shape is turned about its axis; `None` where it has none.
    round: Option<(f64, f64)>,
}

impl Wrapped {
    fn new(of: &Indenter) -> Self {
        let p = &of.pose_mm;
        let (middle, column) = ([p[0][3], p[1][3]], |k: usize| [p[0][k], p[1][k]]);
        let radius = match of.shape {
            Shape::Cylinder { radius, .. } | Shape::Capsule { radius, .. } => Some(radius),
            Shape::Sphere { .. } | Shape::Box { .. } | Shape::Plane => None,
        };
        let [x, y] = column(2);
        let length = x.hypot(y);
        match radius {
            // A bar that stands on its end shows no side.
            Some(radius) if length > 1e-3 => {
                let along = [x / length, y / length];
                // The angle goes about the axis from its own x to its own y, and begins anew opposite to that y, where no fingertip is.
                let (below, across) = ([-p[2][0], -p[2][1]], [-along[1], along[0]]);
                let aside = [column(0), column(1)].map(|a| a[0] * across[0] + a[1] * across[1]);
                let rises = below[0] * aside[1] - below[1] * aside[0] >= 0.0;
                let across = if rises { across } else { across.map(|v| -v) };
                Self { middle, across, along, round: Some((radius, (-below[0]).atan2(below[1]))) }
            }
            _ => Self { middle, across: column(0), along: column(1), round: None },
        }
    }

    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x, y) = (x - self.middle[0], y - self.middle[1]);
        let (aside, along) = (x * self.across[0] + y * self.across[1], x * self.along[0] + y * self.along[1]);
        let aside = match self.round {
            Some((radius, turned)) => radius * (turned + (aside / radius).clamp(-1.0, 1.0).asin()),
            None => aside,
        };
        [aside, along]
    }
}

/// The pattern: white noise through one binomial filter less the same through a longer one, around and around.
fn drawn() -> &'static [i16] {
    static DRAWN: OnceLock<Vec<i16>> = OnceLock::new();
    DRAWN.get_or_init(|| {
        let white = Stream::new(SEED, 1);
        let mut fine: Vec<f32> = (0..(SIDE * SIDE) as u64).map(|k| white.normal(k)).collect();
        let smooth = |plane: &mut Vec<f32>, passes: usize| {
            for _ in 0..passes {
                for step in [1, SIDE] {
                    let before = plane.clone();
                    for (k, out) in plane.iter_mut().enumerate() {
                        let (x, y) = (k % SIDE, k / SIDE);
                        let at = |n: usize| {
                            // So many steps on, less two, around the border.
                            let (x, y) =
                                if step == 1 { (x + SIDE + n - 2, y) } else { (x, y + SIDE + n - 2) };
                            before[y % SIDE * SIDE + x % SIDE]
                        };
                        *out = ((at(0) + at(4)) + 4.0 * (at(1) + at(3)) + 6.0 * at(2)) / 16.0;
                    }
                }
            }
        };
        smooth(&mut fine, PASSES[0]);
        let mut long = fine.clone();
        smooth(&mut long, PASSES[1] - PASSES[0]);
        let band: Vec<f32> = fine.iter().zip(&long).map(|(a, b)| a - b).collect();
        let deviation = (band.iter().map(|v| v * v).sum::<f32>() / band.len() as f32).sqrt();
        band.iter().map(|v| (PARTS * v / deviation).round() as i16).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pattern_has_a_deviation_of_1_and_its_strongest_wave_where_it_is_said() {
        let pattern = drawn();
        let lag = |n: usize| {
            let sum: f64 = (0..SIDE * SIDE)
                .map(|k| {
                    let there = k / SIDE * SIDE + (k % SIDE + n) % SIDE;
                    f64::from(pattern[k]) * f64::from(pattern[there])
                })
                .sum();
            sum / (SIDE * SIDE) as f64 / f64::from(PARTS * PARTS)
        };
        assert!((lag(0) - 1.0).abs() < 0.01, "{}", lag(0));
        // Half a wave away it is opposite, and most so there.
        let most = (1..16).min_by(|a, b| lag(*a).total_cmp(&lag(*b))).expect("some");
        assert!((4..=8).contains(&most) && lag(most) < -0.1, "{most} {}", lag(most));
    }

    #[test]
    fn the_pattern_goes_with_a_bar_that_is_moved_and_lies_still_under_one_that_rolls() {
        // Axis along the pad's y; its own x to the right, its own y is then the pad's -z.
        let bar = |x: f64, y: f64, angle: f64| {
            let (sin, cos) = angle.sin_cos();
            let pose_mm = [[cos, -sin, 0.0, x], [0.0, 0.0, 1.0, y], [-sin, -cos, 0.0, 30.0]];
            Indenter { shape: Shape::Cylinder { radius: 30.0, half_length: 50.0 }, pose_mm, force_n: 1.0 }
        };
        let at = |of: &Indenter, x: f64| Wrapped::new(of).at([x, 0.0]);
        let still = bar(0.0, 0.0, 0.0);
        let [a, b] = at(&still, 1.0);
        // Moved by 2 mm to the right and 0.5 mm down, the same is found there.
        let [moved, down] = at(&bar(2.0, 0.5, 0.0), 3.0);
        assert!((moved - a).abs() < 1e-9 && (down - (b - 0.5)).abs() < 1e-9);
        // Rolled without a slide, what lies on the gel lies where it did.
        for angle in [0.05, -0.05] {
            let (x, rolled) = (30.0 * angle, bar(30.0 * angle, 0.0, angle));
            assert!((at(&rolled, x)[0] - at(&still, x)[0]).abs() < 2e-3);
            assert!((at(&rolled, x)[0] - at(&still, 0.0)[0]).abs() > 1.4);
        }
    }
}
