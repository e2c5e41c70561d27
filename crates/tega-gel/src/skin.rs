//! The skin: held up by the shapes, carried over to a finer grid, and relaxed by sweeps over its rows.

use crate::grid::Grid;
use crate::plane::CACHE_LINE;
use crate::springs::Pressed;
use crate::window::Window;

/// The highest shape over each cell, at least the still gel.
#[inline(always)]
fn raise_floor_plain(grid: &mut Grid, pressed: &[Pressed]) {
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
pub(crate) fn settle(grid: &mut Grid, share: f32) {
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
pub(crate) fn refine(coarse: &Grid, fine: &mut Grid, line: &mut [f32]) {
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
fn sweep_plain(grid: &mut Grid, relax: f32) {
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

// Called in several places each: inlined they would take twice the room, and no less time.
tega_simd::dispatched! {
    /// See [`raise_floor_plain`].
    raise_floor = raise_floor_plain, (grid: &mut Grid, pressed: &[Pressed]) -> ()
}

tega_simd::dispatched! {
    /// See [`sweep_plain`].
    sweep = sweep_plain, (grid: &mut Grid, relax: f32) -> ()
}
