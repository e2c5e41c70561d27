//! How a gel's light turns slopes into colours: the light field that depth is read with.

use super::cells::Grid;

/// Terms of a light field: constant, X, Y, X², XY, Y² with X and Y from -1 to 1 across and down the picture.
pub const LIGHT_TERMS: usize = 6;

/// Change of colour in counts for a slope of 1 of the gel's surface, over the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GelLight {
    /// For blue, green, red: the terms for a slope across (down to the right) and along (down to the bottom).
    pub terms: [[[f32; LIGHT_TERMS]; 2]; 3],
    /// Millimetres of gel a pixel shows where the picture is 320 x 240; other sizes show the same gel.
    pub mm_per_px: f64,
    /// Pressure a depth, newtons per cubic millimetre.
    pub stiffness_n_mm3: f64,
}

impl Default for GelLight {
    /// The field fitted to the ball presses of one DIGIT, its nominal scale, and the stiffness of a published `GelSight` press.
    fn default() -> Self {
        Self {
            terms: [
                [[-36.0, 102.0, 52.0, 20.0, 19.0, 43.0], [-196.0, 36.0, -83.0, 39.0, -22.0, 12.0]],
                [[77.0, 26.0, -100.0, -51.0, 109.0, -34.0], [29.0, -7.0, -14.0, 7.0, 72.0, -13.0]],
                [[-87.0, 112.0, 181.0, 17.0, 27.0, 159.0], [121.0, -56.0, 38.0, -14.0, -89.0, -126.0]],
            ],
            mm_per_px: 1.0 / 17.5,
            stiffness_n_mm3: 0.225,
        }
    }
}

/// Share of the field's mean strength that every slope is held against, so that a colour that hardly answers is not believed.
const HELD: f32 = 0.1;

/// For each cell the slopes that a change of colour stands for: slope = Σ over colours of a weight times the change in noise units.
#[derive(Debug, Clone, Default)]
pub(super) struct Slopes {
    /// Across and along, for each byte of a pixel.
    pub weights: [[Vec<f32>; 3]; 2],
    /// What a change of colour is multiplied by, so that a slope counts for as much where the light answers weakly as where it answers strongly.
    pub even: Vec<f32>,
    /// Change of colour for a slope of 1, noise units: root mean square over the picture, both directions and the colours.
    pub strength: f64,
}

impl Slopes {
    /// Least squares over the three colours, weighed by the noise; both as the bytes of a pixel lie.
    pub fn of(light: &GelLight, noise: [f32; 3], bytes: [usize; 3], grid: &Grid) -> Self {
        let mut slopes = Self::default();
        slopes.weights.iter_mut().flatten().for_each(|plane| plane.reserve_exact(grid.cells()));
        slopes.even.reserve_exact(grid.cells());
        let answers = |row: usize, col: usize| -> [[f32; 2]; 3] {
            let x = (2 * col + 1) as f32 / grid.cols as f32 - 1.0;
            let y = (2 * row + 1) as f32 / grid.rows as f32 - 1.0;
            let terms = [1.0, x, y, x * x, x * y, y * y];
            std::array::from_fn(|byte| {
                let [across, along] = &light.terms[bytes[byte]];
                [across, along].map(|p| p.iter().zip(terms).map(|(p, t)| p * t).sum::<f32>() / noise[byte])
            })
        };
        let cells = || (0..grid.rows).flat_map(|row| (0..grid.cols).map(move |col| (row, col)));
        let strength: f32 =
            cells().map(|(row, col)| summed(answers(row, col).map(|[x, y]| x * x + y * y))).sum();
        slopes.strength = (f64::from(strength) / (6 * grid.cells()) as f64).sqrt();
        let held = HELD * strength / (2 * grid.cells()) as f32 + f32::MIN_POSITIVE;
        for (row, col) in cells() {
            let a = answers(row, col);
            let dot = |i: usize, j: usize| summed(a.map(|a| a[i] * a[j]));
            let (xx, xy, yy) = (dot(0, 0) + held, dot(0, 1), dot(1, 1) + held);
            let det = xx * yy - xy * xy;
            slopes.even.push(1.0 / (xx + yy).sqrt());
            for (byte, a) in a.iter().enumerate() {
                slopes.weights[0][byte].push((yy * a[0] - xy * a[1]) / det);
                slopes.weights[1][byte].push((xx * a[1] - xy * a[0]) / det);
            }
        }
        slopes
    }
}

/// Sum over the bytes of a pixel: the same bits whether blue or red comes first.
fn summed([first, middle, last]: [f32; 3]) -> f32 {
    (first + last) + middle
}
