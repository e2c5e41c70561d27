//! One virtual sensor: its still picture, its light, and how both differ from unit to unit.

use crate::grid::{COLS, MARGIN_COLS, MARGIN_ROWS, ROWS};
use crate::rng::Stream;

/// Rows of a picture.
pub const HEIGHT: usize = 320;
/// Columns of a picture.
pub const WIDTH: usize = 240;
/// Bytes of a picture's row.
pub(crate) const LINE: usize = WIDTH * 3;

/// Cells with a colour change: those of the picture and one more on each side, and across as many more as make the
/// number round.
pub(crate) const LIT_COLS: usize = (COLS - 2 * MARGIN_COLS + 2).next_multiple_of(16);
pub(crate) const LIT_ROWS: usize = ROWS - 2 * MARGIN_ROWS + 2;

/// Still picture, counts, blue, green, red: constant, X, Y, X², XY, Y² with X and Y from -1 to 1 across and down.
const STILL: [[f32; 6]; 3] = [
    [114.1, -20.4, 7.8, -23.0, -23.8, -19.8],
    [121.2, -6.4, -23.1, -27.2, 31.9, -19.9],
    [113.1, -27.8, -26.6, -9.2, -43.3, -31.0],
];
/// What that leaves of a real picture, standard deviation.
const STILL_REST: [f32; 3] = [11.8, 11.3, 20.4];
/// Colour change in counts for the normal's x, y and z - 1: the same six terms.
const LIGHT: [[[f32; 6]; 3]; 3] = [
    [
        [-37.0, 77.0, 52.0, 24.0, 44.0, 43.0],
        [-198.0, 49.0, -69.0, 57.0, 1.0, 38.0],
        [-58.0, 26.0, 71.0, -49.0, -57.0, -28.0],
    ],
    [
        [78.0, 12.0, -99.0, -40.0, 74.0, -33.0],
        [27.0, -10.0, -23.0, 11.0, 82.0, -25.0],
        [-73.0, 6.0, -70.0, -24.0, 9.0, -32.0],
    ],
    [
        [-88.0, 74.0, 177.0, 28.0, -10.0, 133.0],
        [120.0, -54.0, 16.0, -33.0, -76.0, -122.0],
        [-141.0, 66.0, -20.0, 43.0, -33.0, -31.0],
    ],
];
/// Between units: each coefficient by this share, all lights turned by this angle in radians (8 degrees).
const LIGHT_SPREAD: f32 = 0.2;
const TURN_SPREAD: f32 = 0.14;
/// Between units: each term of the still picture by this share.
const STILL_SPREAD: f32 = 0.1;
/// Knots of the still picture's rest: rows, columns. Cubic, so that it is smooth over some 50 pixels.
const KNOTS: [usize; 2] = [9, 8];

/// Colour changes are kept in eighths of a count.
pub(crate) const FINE: f32 = 8.0;

/// A sensor's still picture and light field.
#[derive(Debug, Clone)]
pub(crate) struct Unit {
    /// Counts, rows of blue, green, red.
    pub(crate) still: Vec<f32>,
    /// For each lit cell and colour: response to the normal's x, y and z - 1, plane after plane; eighths of a count.
    pub(crate) light: [[Vec<f32>; 3]; 3],
}

impl Unit {
    /// Draws a unit; a spread of 0 gives the light field that was fitted to a real one.
    pub(crate) fn new(seed: u64, spread: f32) -> Self {
        Self { still: still(seed, spread), light: light(seed, spread) }
    }
}

fn still(seed: u64, spread: f32) -> Vec<f32> {
    let mut still = vec![0.0; HEIGHT * LINE];
    let drawn = Stream::new(seed, 1);
    for (channel, terms) in STILL.iter().enumerate() {
        let mut terms = *terms;
        for (k, term) in terms.iter_mut().enumerate() {
            *term *= 1.0 + spread * STILL_SPREAD * drawn.normal((channel * 6 + k) as u64);
        }
        let rest = smooth_field(Stream::new(seed, 2 + channel as u64), STILL_REST[channel]);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let level = polynomial(&terms, across(x as f32), along(y as f32)) + rest[y * WIDTH + x];
                // So far from black and white that noise alone never clips.
                still[y * LINE + 3 * x + channel] = level.clamp(30.0, 225.0);
            }
        }
    }
    still
}

fn light(seed: u64, spread: f32) -> [[Vec<f32>; 3]; 3] {
    let drawn = Stream::new(seed, 5);
    // A rotation whose half-angle tangent is drawn: no trigonometry, so the same bits everywhere.
    let t = 0.5 * TURN_SPREAD * spread * drawn.normal(99);
    let (cos, sin) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
    std::array::from_fn(|channel| {
        let mut terms = LIGHT[channel];
        for (k, term) in terms.as_flattened_mut().iter_mut().enumerate() {
            *term *= 1.0 + spread * LIGHT_SPREAD * drawn.normal((channel * 18 + k) as u64);
        }
        let cells = |of: &dyn Fn([f32; 3]) -> f32| -> Vec<f32> {
            let mut out = Vec::with_capacity(LIT_ROWS * LIT_COLS);
            for r in 0..LIT_ROWS {
                for c in 0..LIT_COLS {
                    // Middle of the cell; the first is outside the picture, where the field is that of the border.
                    let x = across((4.0 * c as f32 - 2.5).clamp(0.0, 239.0));
                    let y = along((4.0 * r as f32 - 2.5).clamp(0.0, 319.0));
                    out.push(FINE * of(std::array::from_fn(|k| polynomial(&terms[k], x, y))));
                }
            }
            out
        };
        [cells(&|p| p[0] * cos - p[1] * sin), cells(&|p| p[0] * sin + p[1] * cos), cells(&|p| p[2])]
    })
}

fn across(x: f32) -> f32 {
    (x - 120.0) / 120.0
}

fn along(y: f32) -> f32 {
    (y - 160.0) / 160.0
}

fn polynomial(p: &[f32; 6], x: f32, y: f32) -> f32 {
    p[0] + p[1] * x + p[2] * y + p[3] * x * x + p[4] * x * y + p[5] * y * y
}

/// Random, smooth, mean about 0, standard deviation `sd`: a cubic B-spline over a few random knots.
fn smooth_field(drawn: Stream, sd: f32) -> Vec<f32> {
    let [rows, cols] = KNOTS;
    let mut field = Vec::with_capacity(HEIGHT * WIDTH);
    let at = |v: usize, size: usize, knots: usize| {
        let u = v as f32 / size as f32 * (knots - 3) as f32;
        (u as usize, spline(u - u.floor()))
    };
    // Its weights leave (151/315)² of the knots' variance on average.
    let scale = sd * 315.0 / 151.0;
    for y in 0..HEIGHT {
        let (r, down) = at(y, HEIGHT, rows);
        for x in 0..WIDTH {
            let (c, right) = at(x, WIDTH, cols);
            let mut sum = 0.0;
            for (i, wy) in down.iter().enumerate() {
                for (j, wx) in right.iter().enumerate() {
                    sum += wy * wx * drawn.normal(((r + i) * cols + c + j) as u64);
                }
            }
            field.push(scale * sum);
        }
    }
    field
}

/// Weights of four knots at a share `t` of the way between the middle two.
pub(crate) fn spline(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (1.0 - 3.0 * t + 3.0 * t2 - t3) / 6.0,
        (4.0 - 6.0 * t2 + 3.0 * t3) / 6.0,
        (1.0 + 3.0 * t + 3.0 * t2 - 3.0 * t3) / 6.0,
        t3 / 6.0,
    ]
}
