//! The light field: what colour a slope of the gel has at each place.

use crate::form::Surface;
use crate::grid::{CELL_PX, PX_PER_MM};
use crate::picture::{HEIGHT, LIT_COLS, LIT_ROWS, WIDTH, across, along, polynomial};
use crate::rng::Stream;

/// Colour in counts for the normal's x, y and z: constant, X, Y, X², XY, Y² each; `tega_figures.fit_light` of commit 2b4cc804.
const LIGHT: [[[f32; 6]; 3]; 3] = [
    [
        [-36.0, 102.0, 52.0, 20.0, 19.0, 43.0],
        [-196.0, 36.0, -83.0, 39.0, -22.0, 12.0],
        [-41.0, 20.0, 88.0, -69.0, -31.0, 39.0],
    ],
    [
        [77.0, 26.0, -100.0, -51.0, 109.0, -34.0],
        [29.0, -7.0, -14.0, 7.0, 72.0, -13.0],
        [-86.0, 32.0, -83.0, 39.0, -13.0, -6.0],
    ],
    [
        [-87.0, 112.0, 181.0, 17.0, 27.0, 159.0],
        [121.0, -56.0, 38.0, -14.0, -89.0, -126.0],
        [-125.0, 24.0, -45.0, 18.0, 7.0, -71.0],
    ],
];
/// Between units, guesses: each coefficient by this share, all by a gain, all lights turned by this angle in radians
/// (8 degrees).
const LIGHT_SPREAD: f32 = 0.2;
const GAIN_SPREAD: f32 = 0.1;
const TURN_SPREAD: f32 = 0.14;

/// Colours are kept in eighths of a count.
pub(crate) const FINE: f32 = 8.0;

/// What one unit's light makes of its gel, plane after plane of lit cells.
#[derive(Debug, Clone)]
pub(crate) struct Light {
    /// For each colour: response to the normal's x, y and z, eighths of a count; and the colour of the untouched gel.
    pub(crate) colours: [[Vec<f32>; 4]; 3],
    /// The untouched gel's slopes, downwards to the right and down the picture.
    pub(crate) fall: [Vec<f32>; 2],
    /// Half a step's slope in the gel to one in the picture: over the scale there.
    pub(crate) steep: Vec<f32>,
    /// Where a lit column and a lit row are, over the camera's distance: how far a step in the picture goes astray on a
    /// slope.
    pub(crate) astray: [Vec<f32>; 2],
}

impl Light {
    /// Draws a unit's light; a spread of 0 gives the field that was fitted to a real sensor.
    pub(crate) fn new(seed: u64, spread: f32, surface: &Surface) -> Self {
        let at = |cell: usize| CELL_PX as f64 * (cell as f64 - 0.5) - 0.5;
        let place = |pixel: f64, size: usize| (pixel - (size as f64 - 1.0) / 2.0) / PX_PER_MM;
        let seen: Vec<_> = (0..LIT_ROWS * LIT_COLS)
            .map(|k| surface.seen(place(at(k % LIT_COLS), WIDTH), place(at(k / LIT_COLS), HEIGHT)))
            .collect();
        let fall = [0, 1].map(|k| seen.iter().map(|s| s.fall[k] as f32).collect::<Vec<f32>>());
        let per = PX_PER_MM / (2.0 * CELL_PX as f64);
        let away = |pixel: f64, size: usize| (place(pixel, size) / crate::form::CAMERA_MM) as f32;
        let normals: Vec<[f32; 3]> = fall[0].iter().zip(&fall[1]).map(|(x, y)| normal(-x, -y)).collect();
        Self {
            colours: fields(seed, spread).map(|[x, y, z]| {
                let still = normals.iter().enumerate().map(|(k, n)| shade([x[k], y[k], z[k]], *n)).collect();
                [x, y, z, still]
            }),
            fall,
            steep: seen.iter().map(|s| (per / s.scale) as f32).collect(),
            astray: [
                (0..LIT_COLS).map(|c| away(at(c), WIDTH)).collect(),
                (0..LIT_ROWS).map(|r| away(at(r), HEIGHT)).collect(),
            ],
        }
    }
}

/// The normal of a gel that rises so steeply to the right and down the picture, towards the camera.
#[inline(always)]
pub(crate) fn normal(x: f32, y: f32) -> [f32; 3] {
    let q = inverse_root(1.0 + x * x + y * y);
    [x * q, y * q, q]
}

/// A colour, eighths of a count.
#[inline(always)]
pub(crate) fn shade(light: [f32; 3], normal: [f32; 3]) -> f32 {
    (light[0] * normal[0] + light[1] * normal[1]) + light[2] * normal[2]
}

/// 1/√x to 5e-6 of itself, of x from 1 on: two of Newton's steps from a start in the exponent's bits, which are quicker
/// than a root and a quotient and the same everywhere.
#[inline(always)]
fn inverse_root(x: f32) -> f32 {
    let start = f32::from_bits(0x5F37_5A86 - (x.to_bits() >> 1));
    let better = start * (1.5 - 0.5 * x * start * start);
    better * (1.5 - 0.5 * x * better * better)
}

/// For each colour and axis of the normal, the response of every lit cell.
fn fields(seed: u64, spread: f32) -> [[Vec<f32>; 3]; 3] {
    let drawn = Stream::new(seed, 5);
    // A rotation whose half-angle tangent is drawn: no trigonometry, so the same bits everywhere.
    let t = 0.5 * TURN_SPREAD * spread * drawn.normal(99);
    let (cos, sin) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
    let gain = FINE * (1.0 + spread * GAIN_SPREAD * drawn.normal(98));
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
                    out.push(gain * of(std::array::from_fn(|k| polynomial(&terms[k], x, y))));
                }
            }
            out
        };
        [cells(&|p| p[0] * cos - p[1] * sin), cells(&|p| p[0] * sin + p[1] * cos), cells(&|p| p[2])]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_colour_is_the_light_along_the_normal() {
        assert_eq!(shade([1.0, 2.0, 3.0], [0.5, 0.25, 0.125]), 1.375);
        for (x, y) in [(0.0f32, 0.0f32), (0.5, -2.0), (-30.0, 4.0)] {
            let exact = (1.0 + x * x + y * y).sqrt();
            for (got, wanted) in normal(x, y).into_iter().zip([x / exact, y / exact, 1.0 / exact]) {
                assert!((got - wanted).abs() <= 6e-6, "{got} {wanted}");
            }
        }
    }
}
