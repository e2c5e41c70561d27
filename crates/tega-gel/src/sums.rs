//! A picture's sums over cells of 8 x 8 pixels, to the bit those of the painted picture, mostly without painting it.
//!
//! Where the gel is not displaced a pixel is the still picture and its noise added up, and nothing is cut off: a sum over
//! pixels is the sum of two sums. That of the still picture is known until it drifts, those of the noise stand in a table.
//! The strips of eight rows in which the gel is displaced are painted and summed, one after the other in one place.

use std::sync::OnceLock;

use crate::light::Light;
use crate::membrane::Relief;
use crate::noise::{Noise, Part, SHEET_LINE, SHEET_ROWS, SHEETS};
use crate::paint::{Canvas, area, rows};
use crate::picture::{HEIGHT, LINE, WIDTH};

/// Pixels along a cell's side; bytes of its row.
const CELL: usize = 8;
const CELL_BYTES: usize = 3 * CELL;
/// Rows and columns of [`crate::Gel::sums`].
pub const SUM_CELLS: [usize; 2] = [HEIGHT / CELL, WIDTH / CELL];
const STRIPS: usize = SUM_CELLS[0];
const ACROSS: usize = SUM_CELLS[1];
const STRIP: usize = CELL * LINE;

/// Sums of blue, green and red; a cell's is at most 16,320.
pub type Sums = [[i16; STRIPS * ACROSS]; 3];

/// A part of the noise begins at a row that this divides.
const EVERY_ROWS: usize = 4;
const FIRST_ROWS: usize = (SHEET_ROWS - CELL) / EVERY_ROWS + 1;
const SHEET_CELLS: usize = SHEET_LINE / CELL_BYTES;

/// Sums of a sheet of noise over every cell that a picture may show: by first row, by the first column's rest over 8, by
/// colour, one cell beside the other.
#[derive(Debug)]
struct NoiseSums {
    cells: Vec<[[[i16; SHEET_CELLS]; 3]; CELL]>,
}

impl NoiseSums {
    /// Of a unit's sheet; they are made when they are first asked for.
    fn of(noise: &Noise) -> &'static Self {
        static MADE: [OnceLock<NoiseSums>; SHEETS] = [const { OnceLock::new() }; SHEETS];
        let (sheet, level) = noise.sheet();
        MADE[level].get_or_init(|| Self::sum(sheet))
    }

    fn sum(sheet: &[i8]) -> Self {
        let mut cells = vec![[[[0; SHEET_CELLS]; 3]; CELL]; FIRST_ROWS];
        for (number, cells) in cells.iter_mut().enumerate() {
            let rows = &sheet[EVERY_ROWS * number * SHEET_LINE..][..CELL * SHEET_LINE];
            let down: Vec<i16> = (0..SHEET_LINE)
                .map(|j| (0..CELL).map(|r| i16::from(rows[r * SHEET_LINE + j])).sum())
                .collect();
            for (first, colours) in cells.iter_mut().enumerate() {
                for (colour, sums) in colours.iter_mut().enumerate() {
                    for (sum, pixels) in sums.iter_mut().zip(down[3 * first..].chunks_exact(CELL_BYTES)) {
                        *sum = pixels.iter().skip(colour).step_by(3).sum();
                    }
                }
            }
        }
        Self { cells }
    }

    /// Sums of a strip of eight rows, by colour.
    fn strip(&self, part: Part, strip: usize) -> [&[i16]; 3] {
        let row = part.first_row(CELL * strip, CELL);
        self.cells[row / EVERY_ROWS][part.left() % CELL]
            .each_ref()
            .map(|sums| &sums[part.left() / CELL..][..ACROSS])
    }
}

/// What is known of the still picture until it drifts, and room to work in.
#[derive(Debug, Clone, Default)]
pub(crate) struct Summing {
    epoch: Option<u64>,
    still: [Vec<i16>; 3],
    painted: Vec<u8>,
}

impl Summing {
    /// Takes note of the still picture as it has drifted by an epoch: counts less 128.
    pub(crate) fn drifted(&mut self, epoch: Option<u64>, still: &[i8]) {
        if self.epoch == epoch && epoch.is_some() {
            return;
        }
        self.epoch = epoch;
        self.painted.resize(STRIP, 0);
        self.still.iter_mut().for_each(|sums| sums.resize(STRIPS * ACROSS, 0));
        for (strip, rows) in still.chunks_exact(STRIP).enumerate() {
            let mut sums = [0i16; LINE];
            for row in rows.chunks_exact(LINE) {
                sums.iter_mut().zip(row).for_each(|(sum, count)| *sum += 128 + i16::from(*count));
            }
            let at = strip * ACROSS..(strip + 1) * ACROSS;
            add_cells(&sums, self.still.each_mut().map(|still| &mut still[at.clone()]));
        }
    }

    /// Sums a frame: see [`Canvas::paint`].
    #[inline(always)]
    pub(crate) fn sum(
        &mut self,
        canvas: &mut Canvas,
        relief: Option<Relief<'_>>,
        light: &Light,
        still: &[i8],
        (noise, part): (&Noise, Part),
        out: &mut Sums,
    ) {
        let table = NoiseSums::of(noise);
        for strip in 0..STRIPS {
            let at = strip * ACROSS..(strip + 1) * ACROSS;
            let noises = table.strip(part, strip);
            for ((out, still), noise) in out.iter_mut().zip(&self.still).zip(noises) {
                let pairs = still[at.clone()].iter().zip(noise);
                out[at.clone()].iter_mut().zip(pairs).for_each(|(out, (still, noise))| *out = still + noise);
            }
        }
        let Some(relief) = relief else { return };
        let area = area(relief);
        if area.bytes[0] == area.bytes[1] {
            return;
        }
        canvas.begin();
        for strip in area.rows[0] / CELL..area.rows[1].div_ceil(CELL) {
            let some = [CELL * strip, CELL * (strip + 1)];
            rows(canvas, relief, light, still, (noise, part), (&area, some), &mut self.painted);
            let at = strip * ACROSS..(strip + 1) * ACROSS;
            sum_rows(&self.painted, out.each_mut().map(|out| &mut out[at.clone()]));
        }
    }
}

/// Adds sums down the columns of a strip up over each of its cells.
#[inline(always)]
fn add_cells(down: &[i16; LINE], [blue, green, red]: [&mut [i16]; 3]) {
    let (mut four, mut two, mut one) = ([0i16; LINE], [0i16; LINE], [0i16; LINE]);
    fold(&mut four, down, 4);
    fold(&mut two, &four, 2);
    fold(&mut one, &two, 1);
    let cells = one.as_chunks::<CELL_BYTES>().0;
    for (((cell, blue), green), red) in cells.iter().zip(blue).zip(green).zip(red) {
        [*blue, *green, *red] = [cell[0], cell[1], cell[2]];
    }
}

/// Adds to each value the one so many pixels on.
#[inline(always)]
fn fold(out: &mut [i16; LINE], values: &[i16; LINE], pixels: usize) {
    for (out, (a, b)) in out.iter_mut().zip(values.iter().zip(&values[3 * pixels..])) {
        *out = a + b;
    }
}

/// Sums eight painted rows over their cells.
#[inline(always)]
fn sum_rows(rows: &[u8], out: [&mut [i16]; 3]) {
    let mut sums = [0i16; LINE];
    let row = |k: usize| &rows[k * LINE..][..LINE];
    for k in [0, 4] {
        let four = row(k).iter().zip(row(k + 1)).zip(row(k + 2)).zip(row(k + 3));
        for (sum, (((a, b), c), d)) in sums.iter_mut().zip(four) {
            *sum += i16::from(*a) + i16::from(*b) + i16::from(*c) + i16::from(*d);
        }
    }
    add_cells(&sums, out);
}

tega_simd::dispatched! {
    /// See [`Summing::sum`].
    sum = Summing::sum,
    (summing: &mut Summing, canvas: &mut Canvas, relief: Option<Relief<'_>>, light: &Light, still: &[i8], noise: (&Noise, Part), out: &mut Sums) -> ()
}
