//! One virtual sensor: its gel, its light, its still picture, and how they differ from unit to unit.

use crate::form::{Form, Surface};
use crate::light::Light;
use crate::picture::{HEIGHT, LINE, WIDTH, across, along, polynomial, spline};
use crate::rng::Stream;

/// Still picture, counts, blue, green, red: constant, X, Y, X², XY, Y² with X and Y from -1 to 1 across and down.
const STILL: [[f32; 6]; 3] = [
    [114.1, -20.4, 7.8, -23.0, -23.8, -19.8],
    [121.2, -6.4, -23.1, -27.2, 31.9, -19.9],
    [113.1, -27.8, -26.6, -9.2, -43.3, -31.0],
];
/// What that leaves of a real picture, standard deviation.
const STILL_REST: [f32; 3] = [11.8, 11.3, 20.4];
/// Between units: each term of the still picture by this share.
const STILL_SPREAD: f32 = 0.1;
/// Between units: what is left after release by this share. A guess; grips on one sensor differed by more.
const LAG_SPREAD: f32 = 0.3;
/// Knots of the still picture's rest: rows, columns. Cubic, so that it is smooth over some 50 pixels.
const KNOTS: [usize; 2] = [9, 8];

/// A sensor's still picture, its gel and its light.
#[derive(Debug, Clone)]
pub(crate) struct Unit {
    /// Counts, rows of blue, green, red.
    pub(crate) still: Vec<f32>,
    pub(crate) surface: Surface,
    pub(crate) light: Light,
    /// How much it lags behind, over what was measured.
    pub(crate) lag: f32,
}

impl Unit {
    /// Draws a unit; a spread of 0 gives the drawing's gel and the light field that was fitted to a real sensor.
    pub(crate) fn new(seed: u64, spread: f32, form: Form) -> Self {
        let drawn = Stream::new(seed, 6);
        let surface = Surface::new(form, [0, 1].map(|k| f64::from(spread * drawn.normal(k))));
        let light = Light::new(seed, spread, &surface);
        let lag = (1.0 + spread * LAG_SPREAD * drawn.normal(2)).clamp(0.3, 2.0);
        Self { still: still(seed, spread), surface, light, lag }
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
        let drawn = Stream::new(seed, 2 + channel as u64);
        let rest = smooth_field(|k| drawn.normal(k), STILL_REST[channel]);
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

/// Random, smooth, mean about 0, standard deviation `sd`: a cubic B-spline over a few random knots.
fn smooth_field(draw: impl Fn(u64) -> f32, sd: f32) -> Vec<f32> {
    let [rows, cols] = KNOTS;
    let drawn: Vec<f32> = (0..(rows * cols) as u64).map(draw).collect();
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
                    sum += wy * wx * drawn[(r + i) * cols + c + j];
                }
            }
            field.push(scale * sum);
        }
    }
    field
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_smooth_field_draws_each_knot_once() {
        let n_drawn = Cell::new(0);
        let count = |_| {
            n_drawn.set(n_drawn.get() + 1);
            1.0
        };
        let field = smooth_field(count, 2.0);
        assert_eq!((n_drawn.get(), field.len()), (KNOTS[0] * KNOTS[1], HEIGHT * WIDTH));
    }
}
