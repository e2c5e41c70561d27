//! Printed marker dots: dark spots that move with the gel and would drown the shading.
//!
//! A grey closing fills dark spots narrower than five cells, in the baseline and in the frame alike, before they are
//! compared. Whether a sensor has dots is read from its baseline; without dots nothing is touched.

use super::cells::{Grid, Planes, UNITS_PER_COUNT};
use crate::simd;

/// A cell is part of a dot where the closing lifts every channel by more than this many counts.
const DEPTH: f32 = 15.0;
/// A baseline with a greater share of such cells has dots.
const SHARE: f64 = 0.01;

/// Buffers of the closing.
#[derive(Debug, Default)]
pub(super) struct Closing {
    /// The baseline without its dots.
    pub baseline: Planes,
    /// The frame without its dots, then its difference to the baseline.
    pub difference: Planes,
    open: Vec<i16>,
    work: Work,
}

/// Buffers of one plane: rows already filtered, and a row with its borders repeated.
#[derive(Debug, Default)]
struct Work {
    across: Vec<i16>,
    dilated: Vec<i16>,
    padded: Vec<i16>,
}

impl Closing {
    /// Fills the baseline's dots; false where it has none.
    pub fn baseline_has_dots(&mut self, baseline: &Planes, grid: &Grid) -> bool {
        for (plane, out) in baseline.iter().zip(&mut self.baseline) {
            close(plane, grid, &mut self.work, out);
        }
        let depth = (DEPTH * UNITS_PER_COUNT) as i16;
        let lifted = |c: usize, i: usize| match (self.baseline[c].get(i), baseline[c].get(i)) {
            (Some(closed), Some(open)) => closed - open > depth,
            _ => false,
        };
        let dots = (0..grid.cells()).filter(|&i| lifted(0, i) && lifted(1, i) && lifted(2, i)).count();
        dots as f64 > SHARE * grid.cells() as f64
    }

    /// The difference of frame and baseline, both without dots; call after `baseline_has_dots`.
    pub fn without_dots(&mut self, difference: &Planes, baseline: &Planes, grid: &Grid) {
        for c in 0..3 {
            self.open.clear();
            self.open.extend(difference[c].iter().zip(&baseline[c]).map(|(d, b)| d + b));
            close(&self.open, grid, &mut self.work, &mut self.difference[c]);
            for (d, b) in self.difference[c].iter_mut().zip(&self.baseline[c]) {
                *d -= b;
            }
        }
    }
}

/// Grey closing by a square of five cells.
fn close(plane: &[i16], grid: &Grid, work: &mut Work, out: &mut Vec<i16>) {
    for buffer in [&mut work.across, &mut work.dilated, out] {
        buffer.resize(grid.cells(), 0);
    }
    work.padded.resize(grid.cols + 4, 0);
    filter(plane, grid, simd::maximum_of_five, &mut work.padded, &mut work.across, &mut work.dilated);
    filter(&work.dilated, grid, simd::minimum_of_five, &mut work.padded, &mut work.across, out);
}

type Extreme = fn([&[i16]; 5], &mut [i16]);

/// `extreme` of five cells across, then of five down; border cells repeat.
fn filter(
    plane: &[i16],
    grid: &Grid,
    extreme: Extreme,
    padded: &mut [i16],
    across: &mut [i16],
    out: &mut [i16],
) {
    let cols = grid.cols;
    for (row, out) in plane.chunks_exact(cols).zip(across.chunks_exact_mut(cols)) {
        let (Some(&first), Some(&last)) = (row.first(), row.last()) else { return };
        padded.fill(last);
        padded.iter_mut().take(2).for_each(|p| *p = first);
        padded.iter_mut().skip(2).zip(row).for_each(|(p, v)| *p = *v);
        extreme([0, 1, 2, 3, 4].map(|shift| padded.get(shift..shift + cols).unwrap_or_default()), out);
    }
    let last = grid.rows - 1;
    for (row, out) in out.chunks_exact_mut(cols).enumerate() {
        let rows =
            [row.saturating_sub(2), row.saturating_sub(1), row, (row + 1).min(last), (row + 2).min(last)];
        extreme(rows.map(|r| across.get(r * cols..(r + 1) * cols).unwrap_or_default()), out);
    }
}

#[inline(always)]
pub(crate) fn maximum_of_five(rows: [&[i16]; 5], out: &mut [i16]) {
    let [a, b, c, d, e] = rows;
    for (((((out, a), b), c), d), e) in out.iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e) {
        *out = *a.max(b).max(c).max(d).max(e);
    }
}

#[inline(always)]
pub(crate) fn minimum_of_five(rows: [&[i16]; 5], out: &mut [i16]) {
    let [a, b, c, d, e] = rows;
    for (((((out, a), b), c), d), e) in out.iter_mut().zip(a).zip(b).zip(c).zip(d).zip(e) {
        *out = *a.min(b).min(c).min(d).min(e);
    }
}
