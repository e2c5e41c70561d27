//! Printed marker dots: dark spots that move with the gel and would drown the shading.
//!
//! A grey closing fills dark spots narrower than three cells, in the baseline and in the frame alike, before they are
//! compared. Whether a sensor has dots is read from its baseline; without dots nothing is touched.

use super::cells::{Grid, Planes, UNITS_PER_COUNT};
use crate::simd;

/// A cell is part of a dot where the closing lifts the brightest channel by more than this many counts.
const DEPTH: f32 = 20.0;
/// A baseline with a greater share of such cells has dots: 0.1 to 0.2 of a dotted gel, under 0.01 of five plain ones.
const SHARE: f64 = 0.04;

/// Buffers of the closing.
#[derive(Debug, Default)]
pub(super) struct Closing {
    /// The frame without its dots, then its difference to the baseline.
    pub difference: Planes,
    open: Vec<i16>,
    closed: Vec<i16>,
    across: Vec<i16>,
    dilated: Vec<i16>,
}

impl Closing {
    /// Fills the baseline's dots into `out`; false where it has none.
    pub fn baseline_has_dots(&mut self, baseline: &Planes, grid: &Grid, out: &mut Planes) -> bool {
        // Dots are dark in the brightest channel too: one plane tells.
        let [b0, b1, b2] = baseline;
        self.open.clear();
        self.open.extend(b0.iter().zip(b1).zip(b2).map(|((a, b), c)| *a.max(b).max(c)));
        closed(&self.open, grid, &mut self.across, &mut self.dilated, &mut self.closed);
        let depth = (DEPTH * UNITS_PER_COUNT) as i16;
        let dots: usize = self.closed.iter().zip(&self.open).map(|(c, o)| usize::from(c - o > depth)).sum();
        if dots as f64 <= SHARE * grid.cells() as f64 {
            return false;
        }
        for (plane, out) in baseline.iter().zip(out) {
            closed(plane, grid, &mut self.across, &mut self.dilated, out);
        }
        true
    }

    /// The difference of frame and baseline, both without dots; `dotless` is the baseline without its own.
    pub fn without_dots(&mut self, difference: &Planes, baseline: &Planes, dotless: &Planes, grid: &Grid) {
        for c in 0..3 {
            self.open.clear();
            self.open.extend(difference[c].iter().zip(&baseline[c]).map(|(d, b)| d + b));
            closed(&self.open, grid, &mut self.across, &mut self.dilated, &mut self.difference[c]);
            for (d, b) in self.difference[c].iter_mut().zip(&dotless[c]) {
                *d -= b;
            }
        }
    }
}

/// Grey closing by a square of three cells; border cells repeat. `across` and `dilated` are buffers.
fn closed(plane: &[i16], grid: &Grid, across: &mut Vec<i16>, dilated: &mut Vec<i16>, out: &mut Vec<i16>) {
    for buffer in [&mut *across, &mut *dilated, out] {
        buffer.resize(grid.cells(), 0);
    }
    simd::close(plane, grid.cols, across, dilated, out);
}

/// Largest of three by three, then smallest of three by three; all planes are of one length.
#[inline(always)]
pub(crate) fn close(plane: &[i16], cols: usize, across: &mut [i16], dilated: &mut [i16], out: &mut [i16]) {
    filter(plane, cols, i16::max, across, dilated);
    filter(dilated, cols, i16::min, across, out);
}

#[inline(always)]
fn filter(
    plane: &[i16],
    cols: usize,
    extreme: impl Fn(i16, i16) -> i16,
    across: &mut [i16],
    out: &mut [i16],
) {
    let (one, two) = (plane.get(1..).unwrap_or_default(), plane.get(2..).unwrap_or_default());
    // One run over all rows; then the ends of the rows, which have a neighbour on one side only.
    for (((out, &l), &h), &r) in across.iter_mut().skip(1).zip(plane).zip(one).zip(two) {
        *out = extreme(extreme(l, h), r);
    }
    for (row, out) in plane.chunks_exact(cols).zip(across.chunks_exact_mut(cols)) {
        let second = cols.min(2) - 1;
        out[0] = extreme(row[0], row[second]);
        out[cols - 1] = extreme(row[cols - 1 - second], row[cols - 1]);
    }
    let last = across.len().saturating_sub(cols);
    let (below, far) = (across.get(cols..).unwrap_or_default(), across.get(2 * cols..).unwrap_or_default());
    for (((out, &a), &h), &b) in out.iter_mut().skip(cols).zip(&*across).zip(below).zip(far) {
        *out = extreme(extreme(a, h), b);
    }
    let beside = cols.min(last);
    for ((out, &h), &b) in
        out.iter_mut().take(cols).zip(&*across).zip(across.get(beside..).unwrap_or_default())
    {
        *out = extreme(h, b);
    }
    let tail = across.get(last..).unwrap_or_default();
    let before = across.get(last.saturating_sub(cols)..).unwrap_or_default();
    for ((out, &h), &a) in out.iter_mut().skip(last).zip(tail).zip(before) {
        *out = extreme(h, a);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn slow(plane: &[i16], rows: usize, cols: usize, largest: bool) -> Vec<i16> {
        let around = |at: usize, side: usize| at.saturating_sub(1)..(at + 2).min(side);
        let mut out = Vec::new();
        for y in 0..rows {
            for x in 0..cols {
                let cells = around(y, rows).flat_map(|y| around(x, cols).map(move |x| plane[y * cols + x]));
                out.push(if largest { cells.max() } else { cells.min() }.unwrap());
            }
        }
        out
    }

    proptest! {
        #[test]
        fn closing_is_the_largest_then_the_smallest_around(rows in 1usize..7, cols in 1usize..7, seed in any::<u64>()) {
            let value = |i: usize| (seed.rotate_left(i as u32 * 7 % 64) % 4080) as i16;
            let plane: Vec<i16> = (0..rows * cols).map(value).collect();
            let (mut across, mut dilated, mut out) = (plane.clone(), plane.clone(), plane.clone());
            close(&plane, cols, &mut across, &mut dilated, &mut out);
            let wanted = slow(&slow(&plane, rows, cols, true), rows, cols, false);
            prop_assert_eq!(out, wanted);
        }
    }
}
