//! What is printed on the gel and moves with it: a faint texture, and dots on request.
//!
//! A pixel shows the pattern of the place that the shear has brought there: T(x - v(x)), with v the displacement of what
//! is at x now. The pattern is added to the picture of a plain gel.

use crate::beside::{ACROSS, BESIDE, place};
use crate::grid::PX_PER_MM;
use crate::picture::{HEIGHT, LINE, WIDTH, nearest};
use crate::rng::Stream;
use crate::shear::{ShearField, WIDE_COLS, WIDE_PX, WIDE_ROWS};

/// What a gel's surface shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Surface {
    /// Nothing: it has no shear either.
    #[default]
    Plain,
    /// The faint pattern that recorded gels without print have.
    Texture,
    /// That and dark dots, as some `GelSight` gels have.
    Dots,
}

/// Deviation of the texture, counts: a recorded DIGIT's, `python -m tega_figures.shear --recorded`.
const TEXTURE: f32 = 0.30;
/// Dots: apart and their radius, millimetres, and how dark, counts; as a recorded `GelSight` Mini's.
const PITCH_MM: f64 = 2.0;
const RADIUS_MM: f64 = 0.38;
const DARK: f32 = 60.0;
/// Pixels over which a dot's edge fades.
const EDGE_PX: f64 = 2.0;

/// Parts of a count that the pattern is kept in, and of a pixel that it is moved by.
const FINE: i32 = 1 << SHIFT;
const SHIFT: u32 = 4;
/// The pattern goes on beyond the picture: no shear brings more into view.
const ROOM: usize = 48;
const WIDE_LINE: usize = WIDTH + 2 * ROOM;
/// Displacements below this, pixels, are not shown.
const STILL_PX: f32 = 0.06;

/// Taps of the filter that gives the texture its grain; recorded texture is alike over two to three pixels.
const TAPS: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// Root of the sum of their squares over both directions.
const KEPT: f32 = 70.0 / 256.0;

/// Parts of a count, drawn once, of which each row of each frame takes its own.
const DRAWN: usize = 1 << 16;
/// What rounds to the nearest count.
const HALF: u8 = 8;

/// A unit's pattern.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    /// Sixteenths of a count, with room around.
    fine: Vec<i16>,
    /// What the plain picture lacks, as it is rounded, sixteenths of a count: without it that would be a grain of its own,
    /// as strong as the gel's, that nothing moves.
    pub(crate) lacking: Vec<i8>,
    /// Both, for each colour of the picture that nothing moves.
    still: Vec<i16>,
    /// Which part of a count makes it a whole one, so that what is fainter than a count is kept on average.
    dither: Vec<u8>,
    frames: Stream,
    /// Displacement of what is at each cell now, pixels.
    moved: Vec<[f32; 2]>,
}

impl Pattern {
    pub(crate) fn new(seed: u64, surface: Surface) -> Self {
        let (rows, cols) = (HEIGHT + 2 * ROOM, WIDE_LINE);
        let mut fine = texture(Stream::new(seed, 30), rows, cols);
        if surface == Surface::Dots {
            print(&mut fine, Stream::new(seed, 31), rows, cols);
        }
        let fine: Vec<i16> = fine.iter().map(|t| (t * FINE as f32).round() as i16).collect();
        let drawn = Stream::new(seed, 32);
        let words = (0..(DRAWN + LINE).div_ceil(8) as u64).map(|k| drawn.bits(k) & 0x0F0F_0F0F_0F0F_0F0F);
        let dither = words.flat_map(u64::to_le_bytes).collect();
        Self {
            fine,
            lacking: vec![0; HEIGHT * LINE],
            still: vec![0; HEIGHT * LINE],
            dither,
            frames: Stream::new(seed, 33),
            moved: vec![[0.0; 2]; WIDE_ROWS * WIDE_COLS],
        }
    }

    /// Takes note of what the plain picture lacks now.
    pub(crate) fn drifted(&mut self) {
        let lines = self.still.chunks_exact_mut(LINE).zip(self.lacking.chunks_exact(LINE));
        for (y, (still, lacking)) in lines.enumerate() {
            let fine = &self.fine[(y + ROOM) * WIDE_LINE + ROOM..][..WIDTH];
            let pixels = still.as_chunks_mut::<3>().0.iter_mut().zip(lacking.as_chunks::<3>().0);
            for ((still, lacking), fine) in pixels.zip(fine) {
                *still = lacking.map(|part| fine + i16::from(part));
            }
        }
    }

    /// Adds the pattern to the picture of a plain gel, moved as the gel is. A frame has its own rounding; without a number all
    /// is rounded to the nearest.
    #[inline(always)]
    pub(crate) fn add(&mut self, shear: Option<&ShearField>, index: Option<u64>, out: &mut [u8]) {
        let [rows, cols] = shear.map_or([[0; 2]; 2], |shear| self.settle(shear));
        let half = [HALF; LINE];
        for (y, (out, still)) in out.chunks_exact_mut(LINE).zip(self.still.chunks_exact(LINE)).enumerate() {
            let dither = index.map_or(&half[..], |index| {
                let bits = self.frames.bits(index.wrapping_mul(HEIGHT as u64).wrapping_add(y as u64));
                &self.dither[(bits % DRAWN as u64) as usize..][..LINE]
            });
            let [from, to] = if (rows[0]..rows[1]).contains(&y) { cols.map(|x| 3 * x) } else { [LINE; 2] };
            plain(&still[..from], &dither[..from], &mut out[..from]);
            plain(&still[to..], &dither[to..], &mut out[to..]);
            if from < to {
                self.warp(y, cols, &dither[from..to], &mut out[from..to]);
            }
        }
    }

    /// Finds what has moved to where each cell is, and which rows and columns of pixels that concerns.
    #[inline(always)]
    fn settle(&mut self, shear: &ShearField) -> [[usize; 2]; 2] {
        let (mut rows, mut cols) = ([WIDE_ROWS, 0], [WIDE_COLS, 0]);
        for r in 0..WIDE_ROWS {
            for c in 0..WIDE_COLS {
                let [mut x, mut y] = shear.at(r, c).map(|u| u * shear.px_per_mm(r, c));
                if x * x + y * y > STILL_PX * STILL_PX {
                    // v(x) = u(x - v): twice is enough, as neighbours differ little.
                    for _ in 0..2 {
                        let u = between(shear, r as f32 - y / WIDE_PX as f32, c as f32 - x / WIDE_PX as f32);
                        [x, y] = u.map(|u| u * shear.px_per_mm(r, c));
                    }
                    (rows, cols) =
                        ([rows[0].min(r), rows[1].max(r + 1)], [cols[0].min(c), cols[1].max(c + 1)]);
                }
                let most = (ROOM - 2) as f32;
                self.moved[r * WIDE_COLS + c] = [x.clamp(-most, most), y.clamp(-most, most)];
            }
        }
        let pixels = |[from, to]: [usize; 2], size: usize| {
            // Cell 0 lies before the picture; a cell reaches the middles of its neighbours.
            let (from, to) = ((WIDE_PX * from).saturating_sub(3 * WIDE_PX / 2), WIDE_PX * to);
            [from.min(size), to.min(size).max(from.min(size))]
        };
        if rows[0] >= rows[1] { [[0; 2]; 2] } else { [pixels(rows, HEIGHT), pixels(cols, WIDTH)] }
    }

    /// Adds a row of the moved pattern.
    #[inline(always)]
    fn warp(&self, y: usize, [from, to]: [usize; 2], dither: &[u8], out: &mut [u8]) {
        let (row, down) = place(y);
        let (upper, lower) = (&self.moved[row * WIDE_COLS..], &self.moved[(row + 1) * WIDE_COLS..]);
        let mut cells = [[0.0f32; 2]; WIDE_COLS];
        for ((cell, upper), lower) in cells.iter_mut().zip(upper).zip(lower) {
            *cell = [0, 1].map(|k| FINE as f32 * (upper[k] + down * (lower[k] - upper[k])));
        }
        // Where each pixel's pattern comes from, sixteenths of a pixel.
        let mut places = [[0i16; WIDTH]; 2];
        for (axis, places) in places.iter_mut().enumerate() {
            for (x, place) in places.iter_mut().enumerate() {
                let (col, right) = (BESIDE[x], ACROSS[x]);
                let (before, after) = (cells[col][axis], cells[col + 1][axis]);
                *place = nearest(before + right * (after - before));
            }
        }
        let mut levels = [0i16; WIDTH];
        let corner = |at: usize| self.fine.get(at..at + 2).map_or([0; 2], |two| [two[0], two[1]]);
        for x in from..to {
            let px = ((x + ROOM) << SHIFT).wrapping_add_signed(-isize::from(places[0][x]));
            let py = ((y + ROOM) << SHIFT).wrapping_add_signed(-isize::from(places[1][x]));
            let at = (py >> SHIFT) * WIDE_LINE + (px >> SHIFT);
            let (fx, fy) = ((px & 15) as i32, (py & 15) as i32);
            let ([a, b], [c, d]) = (corner(at), corner(at + WIDE_LINE));
            let [a, b, c, d] = [a, b, c, d].map(i32::from);
            let (upper, lower) = (a * (FINE - fx) + b * fx, c * (FINE - fx) + d * fx);
            levels[x] = ((upper * (FINE - fy) + lower * fy + FINE * FINE / 2) >> (2 * SHIFT)) as i16;
        }
        let lacking = &self.lacking[y * LINE + 3 * from..y * LINE + 3 * to];
        let parts = dither.as_chunks::<3>().0.iter().zip(lacking.as_chunks::<3>().0);
        for ((level, pixel), (dither, lacking)) in
            levels[from..to].iter().zip(out.as_chunks_mut::<3>().0).zip(parts)
        {
            for k in 0..3 {
                let change = (level + i16::from(lacking[k]) + i16::from(dither[k])) >> SHIFT;
                pixel[k] = (i16::from(pixel[k]) + change).clamp(0, 255) as u8;
            }
        }
    }
}

/// The field between four cells.
#[inline(always)]
fn between(shear: &ShearField, row: f32, col: f32) -> [f32; 2] {
    let (row, col) = (row.clamp(0.0, (WIDE_ROWS - 1) as f32), col.clamp(0.0, (WIDE_COLS - 1) as f32));
    let (r, c) = ((row as usize).min(WIDE_ROWS - 2), (col as usize).min(WIDE_COLS - 2));
    let (fy, fx) = (row - r as f32, col - c as f32);
    let corners = [shear.at(r, c), shear.at(r, c + 1), shear.at(r + 1, c), shear.at(r + 1, c + 1)];
    [0, 1].map(|k| {
        let upper = corners[0][k] + fx * (corners[1][k] - corners[0][k]);
        let lower = corners[2][k] + fx * (corners[3][k] - corners[2][k]);
        upper + fy * (lower - upper)
    })
}

#[inline(always)]
fn plain(still: &[i16], dither: &[u8], out: &mut [u8]) {
    for ((out, still), dither) in out.iter_mut().zip(still).zip(dither) {
        let level = i16::from(*out) + ((still + i16::from(*dither)) >> 4);
        *out = level.clamp(0, 255) as u8;
    }
}

/// Grain of a given deviation.
fn texture(drawn: Stream, rows: usize, cols: usize) -> Vec<f32> {
    let (high, wide) = (rows + 4, cols + 4);
    let white: Vec<f32> = (0..(high * wide) as u64).map(|k| drawn.normal(k)).collect();
    let mut across = vec![0.0; high * cols];
    for r in 0..high {
        for c in 0..cols {
            across[r * cols + c] = (0..5).map(|k| TAPS[k] * white[r * wide + c + k]).sum();
        }
    }
    let mut out = vec![0.0; rows * cols];
    for r in 0..rows {
        for c in 0..cols {
            let sum: f32 = (0..5).map(|k| TAPS[k] * across[(r + k) * cols + c]).sum();
            out[r * cols + c] = TEXTURE / KEPT * sum;
        }
    }
    out
}

/// Prints dots on a square grid whose place differs between units.
fn print(out: &mut [f32], drawn: Stream, rows: usize, cols: usize) {
    let (pitch, radius) = (PITCH_MM * PX_PER_MM, RADIUS_MM * PX_PER_MM);
    let [x0, y0] = [0, 1].map(|k| pitch * (drawn.bits(k) % 1024) as f64 / 1024.0);
    let off = |at: usize, first: f64| {
        let turns = (at as f64 - first) / pitch;
        pitch * (turns - turns.round())
    };
    for r in 0..rows {
        for c in 0..cols {
            let (x, y) = (off(c, x0), off(r, y0));
            let inside = (radius - (x * x + y * y).sqrt()) / EDGE_PX + 0.5;
            out[r * cols + c] -= DARK * inside.clamp(0.0, 1.0) as f32;
        }
    }
}

tega_simd::dispatched! {
    /// See [`Pattern::add`].
    add = Pattern::add,
    (pattern: &mut Pattern, shear: Option<&ShearField>, index: Option<u64>, out: &mut [u8]) -> ()
}
