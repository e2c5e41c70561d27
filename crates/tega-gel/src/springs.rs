//! The springs under the gel: what they carry of each shape, and how deep a shape goes for a force.

use crate::grid::{COLS, Grid, LANES, LENGTH_MM, ROWS, chunks_of};
use crate::window::{Window, shared};

/// The springs' stiffness k, newtons per cubic millimetre; see `docs/evidence/sim-touch.md` for where it comes from.
pub const STIFFNESS_N_MM3: f64 = 0.218;
/// Lanes where a sum runs over all of the coarsest grid: sums that do not wait for each other.
const MANY: usize = 4 * LANES;
const _: () = assert!((ROWS / 4 * (COLS / 4)).is_multiple_of(MANY));

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

/// A depth to start from, rather too small: a skin is soon up but slow to come down. Springs carry the volume that lies
/// inside the shape and, about, what the skin pulls down beside it.
#[inline(always)]
pub(crate) fn guess(grid: &Grid, i: usize, force: f32) -> f32 {
    let top = grid.tops[i];
    let mut depth = (force / 80.0).sqrt();
    for _ in 0..6 {
        let (mut inside, mut over) = ([0.0f32; MANY], [0.0f32; MANY]);
        for (lanes, area) in grid.gaps[i].as_chunks::<MANY>().0.iter().zip(grid.area.as_chunks::<MANY>().0) {
            for k in 0..MANY {
                let h = lanes[k] + (depth - top);
                inside[k] += if h > 0.0 { h * area[k] } else { 0.0 };
                over[k] += if h > 0.0 { area[k] } else { 0.0 };
            }
        }
        let (inside, over) = (inside.iter().sum::<f32>(), over.iter().sum::<f32>());
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

/// What the springs under each shape carry; a cell belongs to the shape that lies highest over it.
#[inline(always)]
pub(crate) fn carry(grid: &Grid, pressed: &mut [Pressed]) {
    for i in 0..pressed.len() {
        pressed[i].force = pressed[i].beyond + carried(grid, i, pressed, grid.boxes[i]);
    }
}

/// What a part's springs under a shape carry, newtons.
#[inline(always)]
fn carried(grid: &Grid, i: usize, pressed: &[Pressed], part: Window) -> f32 {
    let alone = pressed.len() == 1;
    let lift = pressed[i].depth - grid.tops[i];
    let sum = if (part.cols[1] - part.cols[0]).is_multiple_of(2 * LANES) {
        carried_by::<{ 2 * LANES }>(grid, i, alone, lift, part)
    } else {
        carried_by::<LANES>(grid, i, alone, lift, part)
    };
    STIFFNESS_N_MM3 as f32 * sum
}

/// The sum of its pressures times areas, in so many lanes.
#[inline(always)]
fn carried_by<const N: usize>(grid: &Grid, i: usize, alone: bool, lift: f32, part: Window) -> f32 {
    let mut sums = [0.0f32; N];
    let Window { rows: [first, last], cols: [from, to] } = part;
    for r in first..last {
        let at = r * grid.cols + from..r * grid.cols + to;
        let shape = if alone { None } else { Some((&grid.gaps[i][at.clone()], lift)) };
        let under = (&grid.floor[at.clone()], &grid.area[at]);
        carry_row(under, grid.around_in(r, part.cols), grid.square, shape, &mut sums);
    }
    sums.iter().sum()
}

/// Notes what the springs outside a part of the grid carry, for a finer one that reaches no further.
#[inline(always)]
pub(crate) fn carry_beyond(grid: &Grid, part: Window, pressed: &mut [Pressed]) {
    for i in 0..pressed.len() {
        let (whole, inner) = (grid.boxes[i], shared(grid.boxes[i], part));
        if inner != whole {
            pressed[i].beyond = carried(grid, i, pressed, whole) - carried(grid, i, pressed, inner);
        }
    }
}

/// Adds a row's pressures times areas; of one shape's cells only where its gaps and how far it is lifted are given.
#[inline(always)]
fn carry_row<const N: usize>(
    (floor, area): (&[f32], &[f32]),
    around: [&[f32]; 3],
    square: f32,
    shape: Option<(&[f32], f32)>,
    sums: &mut [f32; N],
) {
    let n = floor.len();
    let some = |line| chunks_of::<N>(line);
    let [here, up, down] = around;
    let (left, here, right) = (some(&here[..n]), some(&here[1..=n]), some(&here[2..n + 2]));
    let (floor, area, up, down) = (some(floor), some(&area[..n]), some(&up[..n]), some(&down[..n]));
    let gaps = shape.map(|(gaps, lift)| (some(gaps), lift));
    for at in 0..floor.len() {
        for k in 0..N {
            let (h, floor) = (here[at][k], floor[at][k]);
            let sum = (up[at][k] + down[at][k]) + (left[at][k] + right[at][k]);
            let pressure = (1.0 + 4.0 * square) * h - square * sum;
            let touches = h <= floor && floor > 0.0 && pressure > 0.0;
            let mine = gaps.is_none_or(|(gaps, lift)| gaps[at][k] + lift >= floor);
            sums[k] += if touches && mine { pressure * area[at][k] } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_rests_where_it_is_at_the_height_of_a_shape_that_presses_it() {
        assert!(rests(1.0, 1.0, 0.0, 1.0));
        assert!(!rests(1.0, 0.5, 0.0, 1.0), "above the shape");
        assert!(!rests(-0.5, -0.4, 0.0, 1.0), "no shape");
        assert!(!rests(0.5, 1.0, 10.0, 1.0), "held by its neighbours alone");
    }
}
