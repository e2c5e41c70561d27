//! Displacement to colour to bytes: shading on cells, straight lines between them, noise on top.

use crate::grid::{CELL_PX, MARGIN_COLS, MARGIN_ROWS, PX_PER_MM, ROWS};
use crate::membrane::Membrane;
use crate::noise::{Noise, Part};
use crate::unit::{HEIGHT, LINE, LIT_COLS, LIT_ROWS, Unit, WIDTH};

/// Colour changes are kept in eighths of a count; none is larger than this.
const FINE: f32 = 8.0;
const LARGEST: f32 = 400.0 * FINE;
/// Shares of the cell before and after a pixel, in eighths.
const SHARES: [[i16; 2]; CELL_PX] = [[7, 1], [5, 3], [3, 5], [1, 7]];
/// Values of a row between the middles of the lit cells.
const SPAN: usize = (LIT_COLS - 1) * 12;
/// The picture's first value in such a row.
const FIRST: usize = 6;

/// What painting needs to remember between its steps.
#[derive(Debug, Clone)]
pub(crate) struct Canvas {
    colours: [Vec<i16>; 3],
    spread: Vec<i16>,
    shares: [Vec<i16>; 2],
    lines: [Vec<i16>; 2],
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
            spread: vec![0; SPAN + 12],
            shares: [share(0), share(1)],
            lines: [vec![0; SPAN], vec![0; SPAN]],
        }
    }

    /// Paints a frame: the still picture, its noise, and the colour change where the gel is displaced.
    #[inline(always)]
    pub(crate) fn paint(
        &mut self,
        membrane: Option<&Membrane>,
        unit: &Unit,
        still: &[u8],
        (noise, part): (&Noise, Part),
        out: &mut [u8],
    ) {
        let area = membrane.map_or(Area { rows: [0, 0], bytes: [0, 0], lit: [0, 0] }, area);
        for y in (0..area.rows[0]).chain(area.rows[1]..HEIGHT) {
            plain(&still[y * LINE..][..LINE], noise.row(part, y), &mut out[y * LINE..][..LINE]);
        }
        let Some(membrane) = membrane else { return };
        let [b0, b1] = area.bytes;
        // The lit row whose line is in `lines[1]`; the one before it in `lines[0]`.
        let mut below = usize::MAX;
        for y in area.rows[0]..area.rows[1] {
            // Pixel rows 4v - 2 to 4v + 1 lie between lit rows v and v + 1.
            let (v, k) = ((y + 2) / CELL_PX, (y + 2) % CELL_PX);
            if below != v + 1 {
                if below == v {
                    self.lines.swap(0, 1);
                } else {
                    self.line(membrane, unit, (v, area.lit), 0);
                }
                self.line(membrane, unit, (v + 1, area.lit), 1);
                below = v + 1;
            }
            let (still, noise) = (&still[y * LINE..][..LINE], noise.row(part, y));
            let out = &mut out[y * LINE..][..LINE];
            plain(&still[..b0], &noise[..b0], &mut out[..b0]);
            plain(&still[b1..], &noise[b1..], &mut out[b1..]);
            let [upper, lower] = [0, 1].map(|side| &self.lines[side][FIRST + b0..FIRST + b1]);
            let [wu, wl] = SHARES[k];
            let (still, noise) = (&still[b0..b1], &noise[b0..b1]);
            for ((((out, still), noise), u), l) in
                out[b0..b1].iter_mut().zip(still).zip(noise).zip(upper).zip(lower)
            {
                let change = (u * wu + l * wl + 32) >> 6;
                let level = i16::from(*still) + i16::from(*noise) + change;
                *out = level.clamp(0, 255) as u8;
            }
        }
    }

    /// Shades a lit row and draws lines between its cells, into `lines[side]`; eighths of a count.
    #[inline(always)]
    fn line(
        &mut self,
        membrane: &Membrane,
        unit: &Unit,
        (lit, [from, to]): (usize, [usize; 2]),
        side: usize,
    ) {
        let row = lit + MARGIN_ROWS - 1;
        let [above, here, under] = [0, 1, 2].map(|k| membrane.heights(row + k));
        // Half a step each way, millimetres.
        let per = (PX_PER_MM / (2.0 * CELL_PX as f64)) as f32;
        let (at, n) = (lit * LIT_COLS + from..lit * LIT_COLS + to, to - from);
        // Lit cell c is column c + MARGIN_COLS - 1, one further in rows that begin with a still cell.
        let first = MARGIN_COLS + from;
        let (left, right) = (&here[first - 1..][..n], &here[first + 1..][..n]);
        let (up, down) = (&above[first..][..n], &under[first..][..n]);
        let mut normals = [[0.0f32; LIT_COLS]; 3];
        let [nx, ny, nz] = normals.each_mut().map(|normals| &mut normals[..n]);
        for c in 0..n {
            let (gx, gy) = ((right[c] - left[c]) * per, (down[c] - up[c]) * per);
            let q = 1.0 / (1.0 + gx * gx + gy * gy).sqrt();
            (nx[c], ny[c], nz[c]) = (gx * q, gy * q, q - 1.0);
        }
        for (light, colours) in unit.light.iter().zip(&mut self.colours) {
            shade(&mut colours[..n], [0, 1, 2].map(|k| &light[k][at.clone()]), &normals);
        }
        let [blue, green, red] = &self.colours;
        let cells = self.spread[12 * from..12 * to].as_chunks_mut::<12>().0.iter_mut();
        for (out, ((b, g), r)) in cells.zip(blue.iter().zip(green).zip(red)) {
            *out = [*b, *g, *r, *b, *g, *r, *b, *g, *r, *b, *g, *r];
        }
        let span = 12 * from..12 * (to - 1);
        let [before, after] = [0, 1].map(|k| &self.shares[k][span.clone()]);
        let (near, far) = (&self.spread[span.clone()], &self.spread[span.start + 12..span.end + 12]);
        let shares = before.iter().zip(after);
        for ((out, (near, far)), (before, after)) in
            self.lines[side][span].iter_mut().zip(near.iter().zip(far)).zip(shares)
        {
            *out = (near * before + far * after + 4) >> 3;
        }
    }
}

/// Colour change of a row of cells, eighths of a count.
#[inline(always)]
fn shade(out: &mut [i16], light: [&[f32]; 3], normals: &[[f32; LIT_COLS]; 3]) {
    let n = out.len();
    let [px, py, pz] = light.map(|l| &l[..n]);
    let [nx, ny, nz] = normals.each_ref().map(|normals| &normals[..n]);
    for c in 0..n {
        let change = ((px[c] * nx[c] + py[c] * ny[c]) + pz[c] * nz[c]) * FINE;
        let below = if change < LARGEST { change } else { LARGEST };
        out[c] = nearest(if below > -LARGEST { below } else { -LARGEST });
    }
}

/// The nearest integer, of a number within ±4 million: adding 1.5 · 2²³ leaves it in the last bits.
#[inline(always)]
fn nearest(value: f32) -> i16 {
    (value + 12_582_912.0).to_bits() as i32 as i16
}

/// Still picture and noise; the picture keeps so far from 0 and 255 that no sum leaves a byte.
#[inline(always)]
fn plain(still: &[u8], noise: &[i8], out: &mut [u8]) {
    for ((out, still), noise) in out.iter_mut().zip(still).zip(noise) {
        *out = still.wrapping_add_signed(*noise);
    }
}

/// Pixels that a displaced cell reaches.
fn area(membrane: &Membrane) -> Area {
    let window = membrane.window();
    let pixels = |[from, to]: [usize; 2], margin: usize, size: usize| {
        // A cell's slope reaches its neighbours, and their colour half a cell further.
        let from = (CELL_PX * from).saturating_sub(CELL_PX * (margin + 2));
        let to = (CELL_PX * (to + 2)).saturating_sub(CELL_PX * margin).min(size);
        [from.min(to), to]
    };
    let cols = pixels(window.cols, MARGIN_COLS, WIDTH);
    // Pixels 4c - 2 to 4c + 1 lie between lit cells c and c + 1.
    let lit = [(cols[0] + 2) / CELL_PX, (cols[1] + 1) / CELL_PX + 2];
    Area { rows: pixels(window.rows, MARGIN_ROWS, HEIGHT), bytes: cols.map(|x| 3 * x), lit }
}

const _: () = assert!(LIT_ROWS + MARGIN_ROWS < ROWS, "every lit row has rows around it");
