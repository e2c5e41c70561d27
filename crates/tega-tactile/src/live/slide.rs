//! Slide: how fast what touches moves over the gel, by the motion of what is seen in the contact.
//!
//! An object's relief (print, ribs, fibre) is seen in the contact and goes with the object. The contact's fine contrast is averaged over some
//! frames, each moved to where the newest has it, and the next frame is compared with that mean: by their correlation at whole steps around
//! where the latest speed has it, and between these by a parabola. Noise of two frames has nothing in common, so that it makes the peak
//! uncertain but does not move it; and as the mean is some frames old, errors of single steps do not add up. The gel's own grain, which stays
//! with the gel, is taken off first, and what the gel has moved meanwhile ([`super::shear`]) afterwards. The rest is only told where it stands
//! out of the noise: a smooth object shows none.

use super::cells::Grid;

/// Cells that are shallower than this share of the deepest are left out: a contact's rim moves with its size.
pub(super) const INNER: f32 = 0.5;
/// What is compared has four points a side of a cell: two pixels of a picture of 320 x 240, which loses next to nothing of what is not noise.
const PER_CELL: usize = 4;
/// From a point to its neighbours whose mean is taken off, points; units a count, and where contrast is cut off: at four counts, so that no
/// edge or speck outweighs all.
const STEP: usize = 3;
const UNITS: i32 = 16;
const MOST: i32 = 4 * UNITS;
/// Parts of a point that the gel is moved by.
const PARTS: i32 = 16;
/// Shifts that are tried around where it is expected, and around the best of them; where it is not found there but was in the frame before, the
/// wide ones and then the near ones around the best of those. And the farthest that it is expected, points.
const NEAR: [i32; 3] = [-1, 0, 1];
const WIDE: [i32; 5] = [-4, -2, 0, 2, 4];
const FARTHEST: i32 = 3;
/// Room for all of that and a neighbour, points: so much around the picture there is nothing.
const ROOM: usize = FARTHEST as usize + 1 + 1 + 4 + 1 + 1;
/// The mean is kept in eighths, and a frame has a share of 1, 1/2, 1/4 and then 1/8 of it.
const EIGHTHS: u32 = 3;
/// A speed is told over so many frames.
const OVER: usize = 2;
/// Deviation of a correlation of noise: times the root of the squares and of the number of points.
const ALIKE: f32 = 2.2;
/// So many of these deviations a peak stands out by at least, where none was found in the frame before and where one was; and the deviation of
/// the speed that halves how sure it is, millimetres a second.
const STANDS_OUT: [f32; 2] = [6.0, 4.0];
/// And so much of the gel's own grain beyond that, as it is not taken off to the last: a grain that stays is no object that rests.
const LEFT: f32 = 0.5 * UNITS_OF_MEAN;
const UNITS_OF_MEAN: f32 = (1 << EIGHTHS) as f32;
const DOUBT_MM_S: f32 = 1.0;

/// What one frame says of a contact's slide.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Slid {
    /// How fast what touches slides over the gel, to the right and down the picture, millimetres a second.
    pub velocity_mm_s: [f64; 2],
    /// How sure that is, 0 to 1; 0 where nothing is seen that could slide.
    pub sure: f64,
}

/// Where something was in a frame.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Of what is seen in the contact, points since it was first seen.
    seen: [f32; 2],
    /// Of the gel, points; `None` where that was not found.
    gel: Option<[f32; 2]>,
    /// Time from the frame before, seconds.
    dt_s: f64,
}

/// Points beside each other: the first, and how many.
type Run = [usize; 2];

/// Reads the slide of one fingertip.
#[derive(Debug, Clone)]
pub(super) struct SlideReader {
    /// Of the pictures' cells.
    cells: Grid,
    /// Pixels a side of a point, rows and columns of points, and points from a row to the next.
    pixels: usize,
    rows: usize,
    cols: usize,
    stride: usize,
    mm_per_point: f64,
    mean: Vec<i16>,
    now: Vec<i16>,
    folded: Vec<i16>,
    untouched: Vec<i16>,
    /// For how many frames each cell has been inside the contact; how many the mean is of.
    inside: Vec<u8>,
    n_mean: u32,
    runs: Vec<Run>,
    /// How far the mean has been moved, where what is seen lies now against it, points, and how fast it goes, points a second.
    way: [i32; 2],
    off: [f32; 2],
    velocity: [f32; 2],
    /// The newest frames in which it was found, the newest last.
    places: Vec<Place>,
}

impl SlideReader {
    /// Makes one from the untouched gel's grey picture, quarters of a count, and the scale of a pixel.
    pub fn new(cells: Grid, grey: &[i16], mm_per_px: f64) -> Self {
        let pixels = (cells.side / PER_CELL).max(1);
        let (rows, cols) = (cells.height / pixels, cells.width / pixels);
        let stride = cols + 2 * ROOM;
        let plane = vec![0; (rows + 2 * ROOM) * stride];
        let mut reader = Self {
            cells,
            pixels,
            rows,
            cols,
            stride,
            mm_per_point: mm_per_px * pixels as f64,
            mean: plane.clone(),
            now: plane.clone(),
            folded: plane.clone(),
            untouched: plane,
            inside: vec![0; cells.cells()],
            n_mean: 0,
            runs: Vec::new(),
            way: [0; 2],
            off: [0.0; 2],
            velocity: [0.0; 2],
            places: Vec::new(),
        };
        reader.take(grey, [[0, rows], [0, cols]], [0.0; 2]);
        std::mem::swap(&mut reader.now, &mut reader.untouched);
        reader
    }

    /// Pixels around the contact's cells whose grey has to be known.
    pub fn room(&self) -> usize {
        (ROOM + STEP) * self.pixels
    }

    /// Forgets what was seen.
    pub fn forget(&mut self) {
        if self.n_mean > 0 {
            self.inside.fill(0);
            self.places.clear();
            (self.n_mean, self.way, self.off, self.velocity) = (0, [0; 2], [0.0; 2], [0.0; 2]);
        }
    }

    /// Reads the next frame: its grey picture, the cells inside the contact, how far the gel is moved there, pixels, and whether that was found;
    /// and the time since the frame before.
    pub fn update(
        &mut self,
        grey: &[i16],
        cells: &[usize],
        (gel, found): ([f32; 2], bool),
        dt_s: f64,
    ) -> Slid {
        let gel = gel.map(|px| px / self.pixels as f32);
        let Some(part) = self.choose(cells) else {
            self.forget();
            return Slid::default();
        };
        self.take(grey, part, gel);
        let seen = if self.n_mean > 0 && !self.runs.is_empty() { self.seek(dt_s) } else { None };
        let mut told = Slid::default();
        if let Some(deviation) = seen {
            if self.places.len() > OVER {
                self.places.remove(0);
            }
            let seen = [0, 1].map(|k| self.way[k] as f32 + self.off[k]);
            self.places.push(Place { seen, gel: found.then_some(gel), dt_s });
            told = self.told(deviation);
            self.follow();
        } else {
            self.places.clear();
            (self.off, self.velocity) = ([0.0; 2], [0.0; 2]);
        }
        self.n_mean = (self.n_mean + 1).min(1 << EIGHTHS);
        let [rows, cols] = part;
        for row in rows[0]..rows[1] {
            let line = self.at(row, cols[0])..self.at(row, cols[1]);
            average(&mut self.mean[line.clone()], &self.now[line], self.n_mean.ilog2());
        }
        told
    }

    /// Chooses the points of the cells that have been in the contact before; returns rows and columns of points that have to be known.
    fn choose(&mut self, cells: &[usize]) -> Option<[[usize; 2]; 2]> {
        let (mut rows, mut cols) = ([usize::MAX, 0], [usize::MAX, 0]);
        let (mut inside, per) = (vec![0u8; self.inside.len()], self.cells.side / self.pixels);
        self.runs.clear();
        for &cell in cells {
            let (y, x) = (cell / self.cells.cols * per, cell % self.cells.cols * per);
            if y + per > self.rows || x + per > self.cols {
                continue;
            }
            let (Some(now), Some(before)) = (inside.get_mut(cell), self.inside.get(cell)) else { continue };
            *now = before.saturating_add(1);
            (rows, cols) = ([rows[0].min(y), rows[1].max(y + per)], [cols[0].min(x), cols[1].max(x + per)]);
            if *now > OVER as u8 {
                let at = self.at(y, x);
                match self.runs.last_mut() {
                    Some([first, length]) if *first + *length == at => *length += per,
                    _ => self.runs.push([at, per]),
                }
            }
        }
        self.inside = inside;
        let wider = |[from, to]: [usize; 2], size: usize| [from.saturating_sub(ROOM), (to + ROOM).min(size)];
        (rows[0] < rows[1]).then(|| [wider(rows, self.rows), wider(cols, self.cols)])
    }

    /// Where a point is in a plane.
    fn at(&self, row: usize, col: usize) -> usize {
        (row + ROOM) * self.stride + col + ROOM
    }

    /// Takes the fine contrast of a part of a grey picture, less that of the untouched gel moved by so many points.
    fn take(&mut self, grey: &[i16], [rows, cols]: [[usize; 2]; 2], gel: [f32; 2]) {
        let wider = |[from, to]: [usize; 2], size: usize| [from.saturating_sub(STEP), (to + STEP).min(size)];
        let (high, wide) = (wider(rows, self.rows), wider(cols, self.cols));
        for row in high[0]..high[1] {
            let out = self.at(row, wide[0])..self.at(row, wide[1]);
            let from = [row * self.pixels, wide[0] * self.pixels];
            fold(grey, self.cells.width, self.pixels, from, &mut self.folded[out]);
        }
        let cols = [cols[0].max(STEP), cols[1].min(self.cols.saturating_sub(STEP))];
        if cols[0] >= cols[1] {
            return;
        }
        let (far, near) = (STEP * self.stride, STEP);
        // What has been moved here lay between four points.
        let from = gel.map(|points| (-points).floor());
        let shares = [0, 1].map(|k| (PARTS as f32 * (-gel[k] - from[k])) as i32);
        let shift = from[1] as isize * self.stride as isize + from[0] as isize;
        let wide = cols[1] - cols[0];
        for row in rows[0]..rows[1] {
            // At the upper and the lower border only what is beside a point is known.
            let along = if row < STEP || row + STEP >= self.rows { near } else { far };
            let at = self.at(row, cols[0]);
            let last = self.untouched.len() - wide - 1 - self.stride;
            let own = (at as isize + shift).clamp(0, last as isize) as usize;
            let own = [0, self.stride].map(|down| &self.untouched[own + down..=own + down + wide]);
            contrast(&self.folded, at, [near, along], own, shares, &mut self.now[at..at + wide]);
        }
    }

    /// Seeks the newest frame in the mean; returns the deviation of where it is found, points; `None` where it does not stand out.
    fn seek(&mut self, dt_s: f64) -> Option<f32> {
        let size = [self.cells.side / self.pixels, self.stride];
        let with = |[x, y]: [i32; 2]| {
            let shift = y as isize * self.stride as isize + x as isize;
            correlate(&self.mean, &self.now, &self.runs, size, shift) as f32
        };
        let mut at = [0, 1].map(|k| {
            let expected = self.off[k] + self.velocity[k] * dt_s as f32;
            (expected.round() as i32).clamp(-FARTHEST, FARTHEST)
        });
        let squares =
            [&self.mean, &self.now].map(|plane| correlate(plane, plane, &self.runs, size, 0) as f32);
        let points = (self.runs.iter().map(|[_, length]| length).sum::<usize>() * size[0]) as f32;
        let noise = ALIKE * (squares[0] * squares[1] / points).sqrt();
        let own = correlate(&self.untouched, &self.untouched, &self.runs, size, 0) as f32;
        let least = LEFT * own + noise * STANDS_OUT[usize::from(!self.places.is_empty())];
        let mut top = f32::MIN;
        for (n, around) in [&NEAR[..], &NEAR, &WIDE, &NEAR].into_iter().enumerate() {
            if n > 1 && (self.places.is_empty() || top > least) {
                break;
            }
            let middle = at;
            for dy in around {
                for dx in around {
                    let there = [middle[0] + dx, middle[1] + dy];
                    let found = with(there);
                    if found > top {
                        (top, at) = (found, there);
                    }
                }
            }
        }
        let sides =
            [[1, 0], [0, 1]].map(|[x, y]| [with([at[0] - x, at[1] - y]), with([at[0] + x, at[1] + y])]);
        let bends = sides.map(|[less, more]| 2.0 * top - less - more);
        if !(top > least && bends[0] > 0.0 && bends[1] > 0.0) {
            return None;
        }
        for k in 0..2 {
            let before = self.off[k];
            let between = ((sides[k][1] - sides[k][0]) / (2.0 * bends[k])).clamp(-1.0, 1.0);
            self.off[k] = at[k] as f32 + between;
            self.velocity[k] = if dt_s > 0.0 { (self.off[k] - before) / dt_s as f32 } else { 0.0 };
        }
        Some(noise / if bends[0] < bends[1] { bends[0] } else { bends[1] })
    }

    /// What the newest places say of the speed.
    fn told(&self, deviation: f32) -> Slid {
        let ([first, ..], [.., last]) = (&self.places[..], &self.places[..]) else { return Slid::default() };
        let s: f64 = self.places.iter().skip(1).map(|place| place.dt_s).sum();
        if self.places.len() <= OVER || s <= 0.0 {
            return Slid::default();
        }
        let gel = match [first.gel, last.gel] {
            [Some(before), Some(now)] => [0, 1].map(|k| now[k] - before[k]),
            _ => [0.0; 2],
        };
        let moved = [0, 1].map(|k| last.seen[k] - first.seen[k] - gel[k]);
        let per = (self.mm_per_point / s) as f32;
        let doubt = std::f32::consts::SQRT_2 * deviation * per / DOUBT_MM_S;
        Slid {
            velocity_mm_s: moved.map(|points| f64::from(points * per)),
            sure: f64::from(1.0 / (1.0 + doubt * doubt)),
        }
    }

    /// Moves the mean to where the newest frame has what is seen, by whole points.
    fn follow(&mut self) {
        let by = self.off.map(|off| off.round() as i32);
        let shift = by[1] as isize * self.stride as isize + by[0] as isize;
        let (n, far) = (self.mean.len(), shift.unsigned_abs());
        if shift > 0 && far < n {
            self.mean.copy_within(..n - far, far);
        } else if far < n {
            self.mean.copy_within(far.., 0);
        }
        for (k, by) in by.into_iter().enumerate() {
            self.way[k] += by;
            self.off[k] -= by as f32;
        }
    }
}

/// Sums a row of points of a grey picture in quarters of a count, from a pixel on, to units.
#[inline(always)]
fn fold_plain(grey: &[i16], width: usize, pixels: usize, [y, x]: [usize; 2], out: &mut [i16]) {
    if pixels == 2 {
        let rows = [0, 1].map(|k| &grey[(y + k) * width + x..][..2 * out.len()]);
        let pairs = rows[0].as_chunks::<2>().0.iter().zip(rows[1].as_chunks::<2>().0);
        for (out, (upper, lower)) in out.iter_mut().zip(pairs) {
            *out = (upper[0] + lower[0]) + (upper[1] + lower[1]);
        }
        return;
    }
    let all = (pixels * pixels) as i32;
    for (k, out) in out.iter_mut().enumerate() {
        let rows = (0..pixels).map(|row| &grey[(y + row) * width + x + k * pixels..][..pixels]);
        let sum: i32 = rows.flatten().map(|g| i32::from(*g)).sum();
        *out = (sum * UNITS / 4 / all) as i16;
    }
}

/// A row's points less the mean of their neighbours some steps away, less the untouched gel's, cut off.
#[inline(always)]
fn contrast_plain(
    folded: &[i16],
    at: usize,
    [near, far]: [usize; 2],
    own: [&[i16]; 2],
    [fx, fy]: [i32; 2],
    out: &mut [i16],
) {
    let line = |at: usize| &folded[at..at + out.len()];
    let (up, down, left, right) = (line(at - far), line(at + far), line(at - near), line(at + near));
    let here = line(at);
    let [upper, lower] = own.map(|own| &own[..=out.len()]);
    for k in 0..out.len() {
        let around = (i32::from(up[k]) + i32::from(down[k])) + (i32::from(left[k]) + i32::from(right[k]));
        let across = |own: &[i16]| i32::from(own[k]) * (PARTS - fx) + i32::from(own[k + 1]) * fx;
        let own =
            (across(upper) * (PARTS - fy) + across(lower) * fy + PARTS * PARTS / 2) >> (2 * PARTS.ilog2());
        let found = i32::from(here[k]) - (around >> 2) - own;
        out[k] = found.clamp(-MOST, MOST) as i16;
    }
}

/// Sum of the products of the mean with a frame so far on, over runs of cells.
#[inline(always)]
fn correlate_plain(mean: &[i16], now: &[i16], runs: &[Run], [rows, cols]: [usize; 2], shift: isize) -> i64 {
    let mut sum = 0;
    for [at, length] in runs {
        let mut part = 0i32;
        for row in 0..rows {
            let at = at + row * cols;
            let (mean, now) = (&mean[at..at + length], &now[at.wrapping_add_signed(shift)..][..*length]);
            part += mean.iter().zip(now).map(|(a, b)| i32::from(*a) * i32::from(*b)).sum::<i32>();
        }
        sum += i64::from(part);
    }
    sum
}

/// Gives a frame a share of 1, 1/2, 1/4 or 1/8 of the mean.
#[inline(always)]
fn average_plain(mean: &mut [i16], now: &[i16], halvings: u32) {
    let half = (1 << halvings) >> 1;
    for (mean, now) in mean.iter_mut().zip(now) {
        *mean += ((now << EIGHTHS) - *mean + half) >> halvings;
    }
}

tega_simd::dispatched! {
    /// See [`fold_plain`].
    fold = fold_plain, (grey: &[i16], width: usize, pixels: usize, at: [usize; 2], out: &mut [i16]) -> ()
}

tega_simd::dispatched! {
    /// See [`contrast_plain`].
    contrast = contrast_plain,
    (folded: &[i16], at: usize, steps: [usize; 2], own: [&[i16]; 2], shares: [i32; 2], out: &mut [i16]) -> ()
}

tega_simd::dispatched! {
    /// See [`correlate_plain`].
    correlate = correlate_plain,
    (mean: &[i16], now: &[i16], runs: &[Run], size: [usize; 2], shift: isize) -> i64
}

tega_simd::dispatched! {
    /// See [`average_plain`].
    average = average_plain, (mean: &mut [i16], now: &[i16], halvings: u32) -> ()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn pictures_of_any_size_that_jump_at_a_border_are_read(
            (height, width) in (1usize..70, 1usize..90),
            scale in 1usize..5,
            frames in prop::collection::vec((any::<u64>(), -60i32..60, -60i32..60, 0.0f64..0.5), 6..14),
        ) {
            let cells = Grid::of(height * scale, width * scale);
            let noise = |seed: u64, k: usize| {
                let drawn = (k as u64 + 1).wrapping_mul(seed | 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
                (drawn >> 54) as i16
            };
            let picture = |seed: u64, right: i32, down: i32| -> Vec<i16> {
                (0..cells.height * cells.width)
                    .map(|k| {
                        let (y, x) = ((k / cells.width) as i32 - down, (k % cells.width) as i32 - right);
                        noise(seed, (y.rem_euclid(97) * 89 + x.rem_euclid(89)) as usize)
                    })
                    .collect()
            };
            let mut reader = SlideReader::new(cells, &picture(1, 0, 0), 0.05);
            let all: Vec<usize> = (0..cells.cells()).collect();
            let pattern = frames[0].0;
            for (seed, right, down, dt_s) in frames {
                // Seen at first, then gone or somewhere else, so that it is sought as far as it can be.
                let seed = if seed % 4 == 0 { seed } else { pattern };
                let gel = [right as f32, down as f32];
                let slid = reader.update(&picture(seed, right / 16, down / 16), &all, (gel, true), dt_s);
                prop_assert!((0.0..=1.0).contains(&slid.sure));
                prop_assert!(slid.velocity_mm_s.iter().all(|v| v.is_finite()));
            }
        }
    }
}
