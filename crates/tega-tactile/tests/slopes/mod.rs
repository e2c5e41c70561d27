//! A fingertip camera for the tests of the gate: what slopes do to light, and what a sensor adds by itself.
//!
//! The gel answers to its slope: each light brightens the flank that faces it. Inside a ball's contact the slope grows
//! in proportion to the distance from the middle, outside it dies away over 20 pixels (of 240 x 320).

use ndarray::{Array3, Axis};

/// Temporal noise of one pixel in counts: blue, green, red.
pub const NOISE_SD: [f32; 3] = [3.17, 1.65, 2.74];
/// Counts that a slope of one adds where it faces the light.
const COUNTS_PER_SLOPE: [f32; 3] = [165.0, 110.0, 150.0];
/// Where the lights stand, degrees.
const LIGHT_DEG: [f32; 3] = [79.0, 199.0, 306.0];
/// Diagonal of the picture in which lengths are given.
const DIAGONAL: f32 = 400.0;
const DENT_LENGTH: f32 = 20.0;

/// A small generator, so that a failing case is its seed.
pub struct Random(pub u64);

impl Random {
    /// Evenly from 0 to 1.
    pub fn share(&mut self) -> f32 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ z >> 31) >> 40) as f32 / (1 << 24) as f32
    }

    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.share()
    }

    /// Standard normal: the sum of twelve even draws, within 6.
    fn normal(&mut self) -> f32 {
        (0..12).map(|_| self.share()).sum::<f32>() - 6.0
    }
}

/// A ball against the gel; lengths in pixels of a picture of 240 x 320.
#[derive(Debug, Clone, Copy)]
pub struct Press {
    /// Where its middle is, as shares of width and height.
    pub centre: [f32; 2],
    pub contact_radius: f32,
    pub ball_radius: f32,
}

/// How the colours of a frame differ from those of the baseline, counts.
#[derive(Debug, Clone, Copy, Default)]
pub struct Drift {
    /// Blue, green, red: everywhere, and from one side of the picture to the other.
    pub step: [f32; 3],
    pub across: [f32; 3],
    pub down: [f32; 3],
}

/// A gel: its background and where its lights stand.
pub struct Gel {
    height: usize,
    width: usize,
    /// Constant, x, y, x², xy, y² a channel, x and y from -1 to 1.
    background: [[f32; 6]; 3],
    turn_deg: f32,
}

impl Gel {
    /// Draws one.
    pub fn any(random: &mut Random, height: usize, width: usize) -> Self {
        let background = [(); 3].map(|()| {
            let mut terms = [(); 6].map(|()| random.between(-25.0, 25.0));
            terms[0] = random.between(90.0, 130.0);
            terms
        });
        Self { height, width, background, turn_deg: random.between(0.0, 360.0) }
    }

    /// One frame.
    pub fn frame(&self, random: &mut Random, press: Option<Press>, drift: Drift) -> Array3<u8> {
        let mut counts = Array3::<f32>::zeros((self.height, self.width, 3));
        let (last_x, last_y) = ((self.width - 1) as f32, (self.height - 1) as f32);
        for ((y, x, c), value) in counts.indexed_iter_mut() {
            let (x, y) = (2.0 * x as f32 / last_x - 1.0, 2.0 * y as f32 / last_y - 1.0);
            let [k, kx, ky, kxx, kxy, kyy] = self.background[c];
            *value = k + kx * x + ky * y + kxx * x * x + kxy * x * y + kyy * y * y;
            *value += drift.step[c] + 0.5 * (drift.across[c] * x + drift.down[c] * y);
        }
        if let Some(press) = press {
            self.shade(&mut counts, press);
        }
        // Rows share their noise in pairs, as colour stored for every second row does.
        for mut rows in counts.axis_chunks_iter_mut(Axis(0), 2) {
            for (i, mut column) in rows.lanes_mut(Axis(0)).into_iter().enumerate() {
                column += random.normal() * NOISE_SD[i % 3];
            }
        }
        counts.mapv(|value| value.round().clamp(0.0, 255.0) as u8)
    }

    fn shade(&self, counts: &mut Array3<f32>, press: Press) {
        let scale = ((self.width * self.width + self.height * self.height) as f32).sqrt() / DIAGONAL;
        let (middle_x, middle_y) =
            (press.centre[0] * (self.width - 1) as f32, press.centre[1] * (self.height - 1) as f32);
        for ((y, x, c), value) in counts.indexed_iter_mut() {
            let (dx, dy) = ((x as f32 - middle_x) / scale, (y as f32 - middle_y) / scale);
            let distance = dx.hypot(dy) + 1e-6;
            let rim = press.contact_radius / press.ball_radius;
            let slope = if distance < press.contact_radius {
                distance / press.ball_radius
            } else {
                rim * ((press.contact_radius - distance) / DENT_LENGTH).exp()
            };
            let angle = (LIGHT_DEG[c] + self.turn_deg).to_radians();
            *value += slope * COUNTS_PER_SLOPE[c] * (dx * angle.cos() + dy * angle.sin()) / distance;
        }
    }
}
