//! The camera's noise: a sheet larger than the picture, of which each frame of each unit shows another part.
//!
//! A sheet is drawn once and is the same for all units of a level: fingers in turn find it in the cache. At one place two
//! units' noise is then still unrelated, as their parts lie elsewhere, but for one frame in some 5,000.

use std::sync::OnceLock;

use crate::picture::{HEIGHT, LINE, WIDTH, nearest, spline};
use crate::rng::Stream;

/// Per-pixel deviation of 8-bit pictures, blue, green, red.
const SIGMA: [f32; 3] = [3.30, 1.70, 2.85];
/// Correlation between the channels: B-G, B-R, G-R.
const CORRELATION: [f32; 3] = [-0.40, 0.08, -0.48];
/// What neighbours share: white noise through a 4 x 4 box, and the rest white.
const BOX: usize = 4;
const SHARED: f32 = 0.964;
const OWN: f32 = 0.265;
/// How far a frame's part may start from the sheet's corner.
const ROOM_ROWS: usize = 128;
const ROOM_COLS: usize = 80;
pub(crate) const SHEET_LINE: usize = (WIDTH + ROOM_COLS) * 3;
pub(crate) const SHEET_ROWS: usize = HEIGHT + ROOM_ROWS;

/// Frames between two looks at the drift: a second at 60 Hz.
pub(crate) const EPOCH_FRAMES: u64 = 64;
/// Epochs between the drift's knots.
const KNOT_EPOCHS: u64 = 8;
/// Deviation of the slow colour change over the picture, and of its mean, blue, green, red.
const DRIFT: [f32; 3] = [0.53, 0.30, 0.69];
const OFFSET: [f32; 3] = [0.97, 0.79, 1.06];

/// The same of what goes on for minutes: knots in epochs; deviation of the mean, of tilts, and of the bend along the
/// picture. As a `GelSight` Mini's left alone for three minutes.
const SLOW_EPOCHS: u64 = 56;
const SLOW_OFFSET: [f32; 3] = [1.1, 0.6, 3.0];
const SLOW_TILT: [f32; 3] = [0.8, 1.0, 1.0];
const SLOW_BEND: [f32; 3] = [0.9, 1.6, 3.2];
/// Units' noise over the measured one; three units that were measured lie within 6 %.
const LEVELS: [f32; SHEETS] = [1.0, 0.92, 1.08];
pub(crate) const SHEETS: usize = 3;

/// The sheets' own, unrelated to any unit's.
const SHEET_SEED: u64 = 0x7465_6761;

/// One unit's noise.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    sheet: &'static [i8],
    level: usize,
    frames: Stream,
    drift: Stream,
    /// Whether the colours also drift for minutes.
    slow: bool,
}

/// Which part of the sheet a frame shows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Part {
    top: usize,
    left: usize,
    mirrored: bool,
}

impl Part {
    /// First row of the sheet that so many rows of the picture from `y` on show, in their order or the other way round.
    #[inline(always)]
    pub(crate) fn first_row(self, y: usize, rows: usize) -> usize {
        self.top + if self.mirrored { HEIGHT - y - rows } else { y }
    }

    /// The sheet's column that the picture begins with.
    pub(crate) fn left(self) -> usize {
        self.left
    }
}

impl Noise {
    /// A unit's noise: of the fitted sensor's level, or of one that the seed picks.
    pub(crate) fn new(seed: u64, spread: f32, slow: bool) -> Self {
        static MADE: [OnceLock<Vec<i8>>; SHEETS] = [const { OnceLock::new() }; SHEETS];
        let frames = Stream::new(seed, 20);
        let level = if spread > 0.0 { (Stream::new(seed, 22).bits(0) % SHEETS as u64) as usize } else { 0 };
        let sheet = MADE[level].get_or_init(|| sheet(LEVELS[level]));
        Self { sheet, level, frames, drift: Stream::new(seed, 21), slow }
    }

    /// The part that a frame shows. Two frames in a row never show the same one.
    pub(crate) fn part(&self, index: u64) -> Part {
        let bits = self.frames.bits(index);
        // Odd frames lie four rows off the even ones' grid of eight.
        let top = 8 * (bits % (ROOM_ROWS as u64 / 8)) + 4 * (index & 1);
        let left = (bits >> 16) % (ROOM_COLS as u64 + 1);
        Part { top: top as usize, left: left as usize, mirrored: bits >> 63 == 1 }
    }

    /// The sheet, and which of [`SHEETS`] it is.
    pub(crate) fn sheet(&self) -> (&'static [i8], usize) {
        (self.sheet, self.level)
    }

    /// A frame's noise in one row, counts.
    #[inline(always)]
    pub(crate) fn row(&self, part: Part, y: usize) -> &[i8] {
        let row = part.first_row(y, 1);
        &self.sheet[row * SHEET_LINE + 3 * part.left..][..LINE]
    }

    /// Numbers that change over so many epochs, of deviation 1: a spline through four knots of a stream.
    fn lately(&self, epoch: u64, epochs: u64, first: u64) -> impl Fn(u64) -> f32 {
        let (knot, weights) = (epoch / epochs, spline((epoch % epochs) as f32 / epochs as f32));
        let drawn = self.drift;
        // Four knots leave 151/315 of their variance on average.
        move |number| {
            let knots = (0..4).map(|k| weights[k as usize] * drawn.normal(first + (knot + k) * 16 + number));
            knots.sum::<f32>() * (315.0f32 / 151.0).sqrt()
        }
    }

    /// Writes the still picture as it has drifted by an epoch, counts less 128.
    #[inline(always)]
    fn drift(&self, still: &[f32], epoch: u64, out: &mut [i8]) {
        let quick = self.lately(epoch, KNOT_EPOCHS, 0);
        // Across and along, three terms share the drift: X and Y have variance 1/3, XY has 1/9.
        let mut terms: [[f32; 5]; 3] = std::array::from_fn(|channel| {
            let (number, d) = (4 * channel as u64, DRIFT[channel]);
            let term = |k: u64| quick(number + k);
            [OFFSET[channel] * term(0), d * term(1), d * term(2), 1.7 * d * term(3), 0.0]
        });
        if self.slow {
            let slow = self.lately(epoch, SLOW_EPOCHS, 1 << 40);
            for (channel, terms) in terms.iter_mut().enumerate() {
                let deviation =
                    [SLOW_OFFSET, SLOW_TILT, SLOW_TILT, SLOW_TILT, SLOW_BEND].map(|of| of[channel]);
                for (k, (term, deviation)) in terms.iter_mut().zip(deviation).enumerate() {
                    *term += deviation * slow((5 * channel + k) as u64);
                }
            }
        }
        // Along a row the drift is a straight line in each colour.
        let mut across = [0.0; LINE];
        for (j, across) in across.iter_mut().enumerate() {
            *across = ((j / 3) as f32 - 119.5) / 120.0;
        }
        for y in 0..HEIGHT {
            let v = (y as f32 - 159.5) / 160.0;
            // Of the three colours, again and again.
            let level = terms.map(|term| term[0] + term[2] * v + term[4] * v * v);
            let slope = terms.map(|term| term[1] + term[3] * v);
            let (level, slope) = ([level; WIDTH], [slope; WIDTH]);
            let line = y * LINE..(y + 1) * LINE;
            let drifts = level.as_flattened().iter().zip(slope.as_flattened()).zip(&across);
            for ((out, still), ((level, slope), u)) in
                out[line.clone()].iter_mut().zip(&still[line]).zip(drifts)
            {
                let drifted = still + (level + slope * u);
                let kept = if drifted < 225.0 { drifted } else { 225.0 };
                let kept = if kept > 30.0 { kept } else { 30.0 };
                *out = (nearest(kept) - 128) as i8;
            }
        }
    }
}

fn sheet(level: f32) -> Vec<i8> {
    let (rows, cols) = (SHEET_ROWS, WIDTH + ROOM_COLS);
    let planes: [Vec<f32>; 3] =
        std::array::from_fn(|k| plane(Stream::new(SHEET_SEED, 10 + k as u64), rows, cols));
    let mix = cholesky();
    let mut sheet = vec![0; rows * SHEET_LINE];
    for (i, pixel) in sheet.chunks_exact_mut(3).enumerate() {
        for (channel, out) in pixel.iter_mut().enumerate() {
            let sum: f32 = (0..=channel).map(|k| mix[channel][k] * planes[k][i]).sum();
            // Rounding to counts adds a twelfth of a count's square.
            let sigma = (level * level * SIGMA[channel] * SIGMA[channel] - 1.0 / 12.0).sqrt();
            *out = (sigma * sum).round().clamp(-29.0, 29.0) as i8;
        }
    }
    sheet
}

/// Deviation 1: the share that neighbours have in common, and each pixel's own.
fn plane(drawn: Stream, rows: usize, cols: usize) -> Vec<f32> {
    let (high, wide) = (rows + BOX - 1, cols + BOX - 1);
    let white: Vec<f32> = (0..high * wide).map(|i| drawn.normal(i as u64)).collect();
    let own = high * wide;
    let mut out = Vec::with_capacity(rows * cols);
    for r in 0..rows {
        for c in 0..cols {
            let sum: f32 = (0..BOX).map(|i| white[(r + i) * wide + c..][..BOX].iter().sum::<f32>()).sum();
            let alone = drawn.normal((own + r * cols + c) as u64);
            out.push(SHARED * sum / BOX as f32 + OWN * alone);
        }
    }
    out
}

fn cholesky() -> [[f32; 3]; 3] {
    let [bg, br, gr] = CORRELATION;
    let g = (1.0 - bg * bg).sqrt();
    let rg = (gr - br * bg) / g;
    [[1.0, 0.0, 0.0], [bg, g, 0.0], [br, rg, (1.0 - br * br - rg * rg).sqrt()]]
}

tega_simd::dispatched! {
    /// Writes the still picture as it has drifted by an epoch, counts less 128.
    drifted = Noise::drift, (noise: &Noise, still: &[f32], epoch: u64, out: &mut [i8]) -> ()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_colour_drifts_its_own_way() {
        let (noise, still) = (Noise::new(3, 1.0, false), vec![128.0; HEIGHT * LINE]);
        let mut sums = [0.0f64; 3];
        let n_epochs = 40 * KNOT_EPOCHS;
        for epoch in (0..n_epochs).step_by(KNOT_EPOCHS as usize) {
            let mut out = vec![0i8; HEIGHT * LINE];
            noise.drift(&still, epoch, &mut out);
            let mean = |channel: usize| {
                let colour = out.iter().skip(channel).step_by(3);
                colour.map(|&level| f64::from(level)).sum::<f64>()
                    / (HEIGHT * WIDTH) as f64
                    / f64::from(OFFSET[channel])
            };
            let [blue, green, red] = [mean(0), mean(1), mean(2)];
            sums[0] += (blue - green).abs();
            sums[1] += (green - red).abs();
            sums[2] += (red - blue).abs();
        }
        // Two numbers drawn apart differ by 1.1 deviations on average.
        assert!(sums.iter().all(|sum| sum / 40.0 > 0.5), "{sums:?}");
    }

    #[test]
    fn rows_of_the_root_give_the_correlations() {
        let rows = cholesky();
        let product = |a: usize, b: usize| -> f32 { rows[a].iter().zip(rows[b]).map(|(x, y)| x * y).sum() };
        for channel in 0..3 {
            assert!((product(channel, channel) - 1.0).abs() < 1e-6);
        }
        for (found, wanted) in [product(0, 1), product(0, 2), product(1, 2)].into_iter().zip(CORRELATION) {
            assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
        }
    }
}
