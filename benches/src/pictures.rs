//! Pictures of a gel, touched and untouched: shading of fixed noise, and a lit dent with a bright middle.

use ndarray::Array3;

/// A fixed sequence of numbers (a linear congruential generator).
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number from -`reach` to `reach`.
    pub fn within(&mut self, reach: i32) -> i32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % (2 * reach as u64 + 1)) as i32 - reach
    }
}

/// The gel without contact, free of noise as a mean of many frames is.
pub fn baseline((height, width): (usize, usize)) -> Array3<u8> {
    Array3::from_shape_fn((height, width, 3), |(y, x, c)| {
        (90 + 10 * c + 40 * x / width + 20 * y / height) as u8
    })
}

/// Middles of the presses, as shares of width and height.
const MIDDLES: [(f64, f64); 3] = [(0.45, 0.55), (0.8, 0.2), (0.15, 0.2)];

/// One frame with up to three presses. Each channel's light comes from another side; the signed change has a sum above zero.
pub fn frame((height, width): (usize, usize), presses: usize) -> Array3<u8> {
    const TOWARDS: [(f64, f64); 3] = [(0.2, 1.0), (-0.9, -0.3), (0.6, -0.8)];
    let mut noise = Noise::new(5);
    let mut image = baseline((height, width));
    let radius = height as f64 / 6.0;
    for ((y, x, c), value) in image.indexed_iter_mut() {
        let mut dent = 0.0;
        for (middle_x, middle_y) in MIDDLES.into_iter().take(presses) {
            let dx = (x as f64 - middle_x * width as f64) / radius;
            let dy = (y as f64 - middle_y * height as f64) / radius;
            let distance = dx.hypot(dy);
            if distance < 1.0 {
                dent += 45.0 * (dx * TOWARDS[c].0 + dy * TOWARDS[c].1) + 140.0 * (1.0 - distance);
            }
        }
        *value = (i32::from(*value) + noise.within(2) + dent.round() as i32).clamp(0, 255) as u8;
    }
    image
}
