//! Displacement to colour to bytes: shading on cells, straight lines between them, noise on top.

use crate::grid::{CELL_PX, MARGIN_COLS, MARGIN_ROWS, ROWS};
use crate::light::{FINE, Light, normal, shade};
use crate::membrane::Relief;
use crate::noise::{Noise, Part};
use crate::picture::{HEIGHT, LINE, LIT_COLS, LIT_ROWS, WIDTH, nearest};

/// No colour change is larger than this, so that it fits a byte.
const LARGEST: f32 = 127.0 * FINE;
/// What a colour change of nothing is as a byte.
const ZERO: u8 = 128;
/// Shares of the cell before and after a pixel, in eighths.
const SHARES: [[i16; 2]; CELL_PX] = [[7, 1], [5, 3], [3, 5], [1, 7]];
/// Values of a row from the middle of each lit cell to the next.
const SPAN: usize = LIT_COLS * CELL_PX * 3;
/// The picture's first value in such a row.
const FIRST: usize = 6;
/// Lit cells are worked on so many at a time, and bytes of the picture, of which a window has so many times the lower.
const SOME_CELLS: usize = 16;
const MANY_BYTES: usize = 64;
const SOME_BYTES: usize = 16;

/// What painting needs to remember between its steps.
#[derive(Debug, Clone)]
pub(crate) struct Canvas {
    colours: [Vec<i16>; 3],
    /// Of a row of lit cells: blue, green, red of one after the other, and each cell's four times.
    cells: Vec<i16>,
    spread: Vec<i16>,
    shares: [Vec<i16>; 2],
    /// Colour change in counts over [`ZERO`].
    lines: [Vec<u8>; 2],
    /// The lit row whose line is in `lines[1]`, the one before it in `lines[0]`; beyond all rows at first.
    below: usize,
}

/// Rows and bytes of the picture that differ from the still one; ends excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Area {
    pub(crate) rows: [usize; 2],
    pub(crate) bytes: [usize; 2],
    /// Lit cells of a row whose colours are needed.
    lit: [usize; 2],
}

impl Canvas {
    pub(crate) fn new() -> Self {
        let share = |side: usize| (0..SPAN).map(|j| SHARES[j % 12 / 3][side]).collect();
        Self {
            colours: std::array::from_fn(|_| vec![0; LIT_COLS]),
            cells: vec![0; 3 * LIT_COLS],
            spread: vec![0; SPAN + 12],
            shares: [share(0), share(1)],
            lines: [vec![ZERO; SPAN], vec![ZERO; SPAN]],
            below: usize::MAX,
        }
    }

    /// Paints a frame: the still picture (counts less 128), its noise, and the colour change where the gel is displaced.
    #[inline(always)]
    pub(crate) fn paint(
        &mut self,
        relief: Option<Relief<'_>>,
        light: &Light,
        still: &[i8],
        (noise, part): (&Noise, Part),
        out: &mut [u8],
    ) {
        match relief {
            Some(relief) => {
                self.begin();
                rows(self, relief, light, still, (noise, part), (&area(relief), [0, HEIGHT]), out);
            }
            None => {
                for (y, out) in out.chunks_exact_mut(LINE).enumerate() {
                    plain(&still[y * LINE..][..LINE], noise.row(part, y), out);
                }
            }
        }
    }

    /// Forgets the lines of another frame.
    pub(crate) fn begin(&mut self) {
        self.below = usize::MAX;
    }

    /// Paints some rows of a frame, which `out` has from its beginning; from the top down, after [`Self::begin`].
    #[inline(always)]
    fn rows(
        &mut self,
        relief: Relief<'_>,
        light: &Light,
        still: &[i8],
        (noise, part): (&Noise, Part),
        (area, [first, end]): (&Area, [usize; 2]),
        out: &mut [u8],
    ) {
        let [above, under] = area.rows.map(|row| row.clamp(first, end));
        for y in (first..above).chain(under..end) {
            plain(&still[y * LINE..][..LINE], noise.row(part, y), &mut out[(y - first) * LINE..][..LINE]);
        }
        let [b0, b1] = area.bytes;
        let mut y = above;
        while y < under {
            // Pixel rows 4v - 2 to 4v + 1 lie between lit rows v and v + 1.
            let (v, past) = ((y + 2) / CELL_PX, (y + 2) % CELL_PX);
            if self.below != v + 1 {
                if self.below == v {
                    self.lines.swap(0, 1);
                } else {
                    line(self, relief, light, (v, area.lit), 0);
                }
                line(self, relief, light, (v + 1, area.lit), 1);
                self.below = v + 1;
            }
            let lines = [0, 1].map(|side| &self.lines[side][FIRST + b0..FIRST + b1]);
            let last = (y + CELL_PX - past).min(under);
            for (y, between) in (y..last).zip(past..) {
                let (still, noise) = (&still[y * LINE..][..LINE], noise.row(part, y));
                let out = &mut out[(y - first) * LINE..][..LINE];
                if area.bytes != [0, LINE] {
                    plain(&still[..b0], &noise[..b0], &mut out[..b0]);
                    plain(&still[b1..], &noise[b1..], &mut out[b1..]);
                }
                blend(&still[b0..b1], &noise[b0..b1], lines, between, &mut out[b0..b1]);
            }
            y = last;
        }
    }

    /// Shades a lit row and draws lines between its cells, into `lines[side]`.
    #[inline(always)]
    fn line(
        &mut self,
        relief: Relief<'_>,
        light: &Light,
        (lit, [from, to]): (usize, [usize; 2]),
        side: usize,
    ) {
        let row = lit + MARGIN_ROWS - 1;
        let [above, here, under] = [0, 1, 2].map(|k| relief.row(row + k));
        let (at, n) = (lit * LIT_COLS + from..lit * LIT_COLS + to, to - from);
        // Lit cell c is column c + MARGIN_COLS - 1, one further in rows that begin with a still cell.
        let first = MARGIN_COLS + from;
        let (left, right) = (&here[first - 1..][..n], &here[first + 1..][..n]);
        let (up, down) = (&above[first..][..n], &under[first..][..n]);
        let mut normals = [[0.0f32; LIT_COLS]; 3];
        let [nx, ny, nz] = normals.each_mut().map(|normals| &mut normals[..n]);
        let [falls_x, falls_y] = light.fall.each_ref().map(|fall| &fall[at.clone()]);
        let (steep, astray, down_astray) =
            (&light.steep[at.clone()], &light.astray[0][from..to], light.astray[1][lit]);
        for c in 0..n {
            // Slopes in the picture, and in the gel, on whose own slope a step of the picture ends elsewhere.
            let (across, along) = (right[c] - left[c], down[c] - up[c]);
            let off = astray[c] * across + down_astray * along;
            let gx = (across - falls_x[c] * off) * steep[c] - falls_x[c];
            let gy = (along - falls_y[c] * off) * steep[c] - falls_y[c];
            [nx[c], ny[c], nz[c]] = normal(gx, gy);
        }
        for (colour, out) in light.colours.iter().zip(&mut self.colours) {
            change(&mut out[..n], colour.each_ref().map(|plane| &plane[at.clone()]), &normals);
        }
        let [blue, green, red] = self.colours.each_ref().map(|colours| &colours[..n]);
        let cells = self.cells[..3 * n].as_chunks_mut::<3>().0.iter_mut();
        for (out, ((b, g), r)) in cells.zip(blue.iter().zip(green).zip(red)) {
            *out = [*b, *g, *r];
        }
        let span = 12 * from..12 * to;
        let spread = self.spread[span.clone()].as_chunks_mut::<96>().0.iter_mut();
        for (out, cells) in spread.zip(self.cells.as_chunks::<24>().0) {
            *out = four_times(cells);
        }
        let [before, after] = [0, 1].map(|k| &self.shares[k][span.clone()]);
        let (near, far) = (&self.spread[span.clone()], &self.spread[span.start + 12..span.end + 12]);
        let shares = before.iter().zip(after);
        for ((out, (near, far)), (before, after)) in
            self.lines[side][span].iter_mut().zip(near.iter().zip(far)).zip(shares)
        {
            // Of counts there are 64 parts: eight of the shares, eight of what a count is kept in.
            let change = (near * before + far * after + 32) >> 6;
            *out = (change as u8) ^ ZERO;
        }
    }
}

/// Blue, green, red of eight cells, for each cell's four pixels across; written out so that compilers shuffle.
#[inline(always)]
fn four_times(cells: &[i16; 24]) -> [i16; 96] {
    let pixels = |c: usize| {
        let [b, g, r] = [cells[3 * c], cells[3 * c + 1], cells[3 * c + 2]];
        [b, g, r, b, g, r, b, g, r, b, g, r]
    };
    let eight = [pixels(0), pixels(1), pixels(2), pixels(3), pixels(4), pixels(5), pixels(6), pixels(7)];
    let mut out = [0; 96];
    out.copy_from_slice(eight.as_flattened());
    out
}

/// Colour change of a row of cells against the untouched gel.
#[inline(always)]
fn change(out: &mut [i16], colour: [&[f32]; 4], normals: &[[f32; LIT_COLS]; 3]) {
    let n = out.len();
    let [px, py, pz, still] = colour.map(|plane| &plane[..n]);
    let [nx, ny, nz] = normals.each_ref().map(|normals| &normals[..n]);
    for c in 0..n {
        let change = shade([px[c], py[c], pz[c]], [nx[c], ny[c], nz[c]]) - still[c];
        let below = if change < LARGEST { change } else { LARGEST };
        out[c] = nearest(if below > -LARGEST { below } else { -LARGEST });
    }
}

/// Still picture and noise; the picture keeps so far from 0 and 255 that no sum leaves a byte.
#[inline(always)]
fn plain(still: &[i8], noise: &[i8], out: &mut [u8]) {
    for ((out, still), noise) in out.iter_mut().zip(still).zip(noise) {
        *out = still.wrapping_add(*noise) as u8 ^ ZERO;
    }
}

/// Still picture, noise, and the colour change of one of the four rows between two lines.
#[inline(always)]
fn blend(still: &[i8], noise: &[i8], [upper, lower]: [&[u8]; 2], between: usize, out: &mut [u8]) {
    match between {
        0 => blend_row::<true>(still, noise, upper, lower, out),
        1 => blend_row::<false>(still, noise, upper, lower, out),
        2 => blend_row::<false>(still, noise, lower, upper, out),
        _ => blend_row::<true>(still, noise, lower, upper, out),
    }
}

#[inline(always)]
fn blend_row<const OUTER: bool>(still: &[i8], noise: &[i8], near: &[u8], far: &[u8], out: &mut [u8]) {
    let (most, rest) = out.as_chunks_mut::<MANY_BYTES>();
    let done = most.as_flattened().len();
    blend_some::<OUTER, _>(still, noise, near, far, most);
    let rest = rest.as_chunks_mut::<SOME_BYTES>().0;
    blend_some::<OUTER, _>(&still[done..], &noise[done..], &near[done..], &far[done..], rest);
}

/// The far line has an eighth in an outer row, three in an inner one: halves of halves. The last half is rounded down
/// and the others up, so that on the whole nothing is added.
#[inline(always)]
fn blend_some<const OUTER: bool, const N: usize>(
    still: &[i8],
    noise: &[i8],
    near: &[u8],
    far: &[u8],
    out: &mut [[u8; N]],
) {
    let pictures = still.as_chunks::<N>().0.iter().zip(noise.as_chunks::<N>().0);
    let lines = near.as_chunks::<N>().0.iter().zip(far.as_chunks::<N>().0);
    for ((out, (still, noise)), (near, far)) in out.iter_mut().zip(pictures).zip(lines) {
        for k in 0..N {
            let half = upper_mean(near[k], far[k]);
            let quarter = upper_mean(near[k], half);
            let change = lower_mean(quarter, if OUTER { near[k] } else { half });
            // Noise alone does not leave a byte; what the change would is cut off.
            let level = still[k].wrapping_add(noise[k]).saturating_add((change ^ ZERO) as i8);
            out[k] = level as u8 ^ ZERO;
        }
    }
}

/// The mean of two bytes, halves rounded up: an instruction of most processors.
#[inline(always)]
fn upper_mean(a: u8, b: u8) -> u8 {
    ((u16::from(a) + u16::from(b) + 1) >> 1) as u8
}

/// The mean of two bytes, halves rounded down: the other one, less the half that it added.
#[inline(always)]
fn lower_mean(a: u8, b: u8) -> u8 {
    upper_mean(a, b).wrapping_sub((a ^ b) & 1)
}

/// Pixels that a displaced cell reaches.
pub(crate) fn area(relief: Relief<'_>) -> Area {
    let window = relief.window;
    let pixels = |[from, to]: [usize; 2], margin: usize, size: usize| {
        // A cell's slope reaches its neighbours, and their colour half a cell further.
        let from = (CELL_PX * from).saturating_sub(CELL_PX * (margin + 2));
        let to = (CELL_PX * (to + 2)).saturating_sub(CELL_PX * margin).min(size);
        [from.min(to), to]
    };
    let cols = pixels(window.cols, MARGIN_COLS, WIDTH);
    // Pixels 4c - 2 to 4c + 1 lie between lit cells c and c + 1.
    let [from, to] = [(cols[0] + 2) / CELL_PX, (cols[1] + 1) / CELL_PX + 2];
    let n = (to - from).next_multiple_of(SOME_CELLS).min(LIT_COLS);
    let from = from.min(LIT_COLS - n);
    let lit = [from, from + n];
    Area { rows: pixels(window.rows, MARGIN_ROWS, HEIGHT), bytes: cols.map(|x| 3 * x), lit }
}

const _: () = assert!(LIT_ROWS + MARGIN_ROWS < ROWS, "every lit row has rows around it");

tega_simd::dispatched! {
    /// See [`Canvas::line`].
    line = Canvas::line, (canvas: &mut Canvas, relief: Relief<'_>, light: &Light, lit: (usize, [usize; 2]), side: usize) -> ()
}

tega_simd::dispatched! {
    /// See [`Canvas::rows`].
    rows = Canvas::rows,
    (canvas: &mut Canvas, relief: Relief<'_>, light: &Light, still: &[i8], noise: (&Noise, Part), some: (&Area, [usize; 2]), out: &mut [u8]) -> ()
}

tega_simd::dispatched! {
    /// See [`Canvas::paint`].
    paint = Canvas::paint,
    (canvas: &mut Canvas, relief: Option<Relief<'_>>, light: &Light, still: &[i8], noise: (&Noise, Part), out: &mut [u8]) -> ()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest and mean error of a row between all pairs of lines, counts; `far` is the far line's share.
    fn error<const OUTER: bool>(share: f64) -> (f64, f64) {
        let (mut worst, mut sum) = (0.0f64, 0.0);
        for near in 0..=255u8 {
            let far: Vec<u8> = (0..=255).collect();
            let mut out = [0; 256];
            blend_row::<OUTER>(&[0; 256], &[0; 256], &[near; 256], &far, &mut out);
            for (out, far) in out.iter().zip(far) {
                let exact = f64::from(near) + share * (f64::from(far) - f64::from(near));
                let off = f64::from(*out) - exact;
                (worst, sum) = (worst.max(off.abs()), sum + off);
            }
        }
        (worst, sum / 65536.0)
    }

    #[test]
    fn a_row_between_two_lines_is_right_to_a_count_and_on_the_whole() {
        for (worst, mean) in [error::<true>(1.0 / 8.0), error::<false>(3.0 / 8.0)] {
            assert!(worst < 0.7 && mean.abs() < 0.07, "{worst} {mean}");
        }
    }

    #[test]
    fn a_change_is_cut_off_at_the_largest_either_way() {
        let mut normals = [[0.0f32; LIT_COLS]; 3];
        normals[2][..3].copy_from_slice(&[1e6, -1e6, 1.0]);
        let mut out = [0i16; 3];
        change(&mut out, [&[0.0; 3], &[0.0; 3], &[1.0; 3], &[0.0; 3]], &normals);
        assert_eq!(out[0], nearest(LARGEST));
        assert_eq!(out[1], -out[0]);
        assert!(out[2].abs() < out[0]);
    }

    #[test]
    fn a_change_that_leaves_a_byte_is_cut_off() {
        let mut out = [0; 64];
        for (still, change, level) in [(100, 255, 255), (-100, 0, 0), (0, 255, 255), (0, 0, 0), (5, 128, 133)]
        {
            blend_row::<true>(&[still; 64], &[0; 64], &[change; 64], &[change; 64], &mut out);
            assert_eq!(out, [level; 64]);
        }
    }
}
