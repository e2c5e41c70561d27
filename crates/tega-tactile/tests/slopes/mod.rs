//! A fingertip camera for the tests of the gate: what slopes do to light, and what a sensor adds by itself.
//!
//! The gel answers to its slope: each light brightens the flank that faces it. Inside a ball's contact the slope grows
//! in proportion to the distance from the middle, outside it dies away over 20 pixels (of 240 x 320).

#![allow(clippy::unwrap_used)]

use ndarray::Array3;
use tega_tactile::{SensorNoise, Touch, TouchTracker, TrackerOptions};

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
    fn bits(&mut self) -> u64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Evenly from 0 to 1.
    pub fn share(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }

    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.share()
    }

    /// Standard normal: the sum of twelve even draws of 16 bits, four to a number, within 6.
    fn normal(&mut self) -> f32 {
        // Two draws are added at a time: a half of 32 bits holds the sum of six.
        const HALVES: u64 = 0x0000_FFFF_0000_FFFF;
        let mut sums = 0;
        for _ in 0..3 {
            let z = self.bits();
            sums += (z & HALVES) + (z >> 16 & HALVES);
        }
        ((sums >> 32) + (sums & 0xFFFF_FFFF)) as f32 / (1 << 16) as f32 - 6.0
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
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
    untouched: Array3<f32>,
    turn_deg: f32,
}

impl Gel {
    /// Draws one.
    pub fn any(random: &mut Random, height: usize, width: usize) -> Self {
        // Constant, x, y, x², xy, y² a channel, x and y from -1 to 1.
        let background: [[f32; 6]; 3] = [(); 3].map(|()| {
            let mut terms = [(); 6].map(|()| random.between(-25.0, 25.0));
            terms[0] = random.between(90.0, 130.0);
            terms
        });
        let (last_x, last_y) = ((width - 1) as f32, (height - 1) as f32);
        let untouched = Array3::from_shape_fn((height, width, 3), |(y, x, c)| {
            let (x, y) = (2.0 * x as f32 / last_x - 1.0, 2.0 * y as f32 / last_y - 1.0);
            let [k, kx, ky, kxx, kxy, kyy] = background[c];
            k + kx * x + ky * y + kxx * x * x + kxy * x * y + kyy * y * y
        });
        Self { height, width, untouched, turn_deg: random.between(0.0, 360.0) }
    }

    /// One frame.
    pub fn frame(&self, random: &mut Random, press: Option<Press>, drift: Drift) -> Array3<u8> {
        self.frame_of(random, self.counts(press, drift), 1.0)
    }

    /// What the camera would show without noise, counts.
    pub fn counts(&self, press: Option<Press>, drift: Drift) -> Array3<f32> {
        let mut counts = self.untouched.clone();
        if drift != Drift::default() {
            let (last_x, last_y) = ((self.width - 1) as f32, (self.height - 1) as f32);
            self.add(&mut counts, |x, y| {
                let (x, y) = (2.0 * x / last_x - 1.0, 2.0 * y / last_y - 1.0);
                [0, 1, 2].map(|c| drift.step[c] + 0.5 * (drift.across[c] * x + drift.down[c] * y))
            });
        }
        if let Some(press) = press {
            self.shade(&mut counts, press);
        }
        counts
    }

    /// A frame of these counts, with noise of so many times the sensor's.
    pub fn frame_of(&self, random: &mut Random, mut counts: Array3<f32>, times: f32) -> Array3<u8> {
        // Rows share their noise in pairs, as colour stored for every second row does.
        let row = 3 * self.width;
        for pair in counts.as_slice_mut().unwrap_or_default().chunks_mut(2 * row) {
            let (upper, lower) = pair.split_at_mut(row);
            for (i, value) in upper.iter_mut().enumerate() {
                let noise = times * random.normal() * NOISE_SD[i % 3];
                *value += noise;
                if let Some(below) = lower.get_mut(i) {
                    *below += noise;
                }
            }
        }
        // A conversion cuts off, and stops at 0 and 255.
        counts.mapv(|value| (value + 0.5) as u8)
    }

    fn shade(&self, counts: &mut Array3<f32>, press: Press) {
        let scale = ((self.width * self.width + self.height * self.height) as f32).sqrt() / DIAGONAL;
        let (middle_x, middle_y) =
            (press.centre[0] * (self.width - 1) as f32, press.centre[1] * (self.height - 1) as f32);
        let facing = LIGHT_DEG.map(|light_deg| {
            let angle = (light_deg + self.turn_deg).to_radians();
            (angle.cos(), angle.sin())
        });
        let rim = press.contact_radius / press.ball_radius;
        self.add(counts, |x, y| {
            let (dx, dy) = ((x - middle_x) / scale, (y - middle_y) / scale);
            let distance = (dx * dx + dy * dy).sqrt() + 1e-6;
            let slope = if distance < press.contact_radius {
                distance / press.ball_radius
            } else {
                rim * ((press.contact_radius - distance) / DENT_LENGTH).exp()
            };
            [0, 1, 2].map(|c| {
                let (cos, sin) = facing[c];
                slope * COUNTS_PER_SLOPE[c] * (dx * cos + dy * sin) / distance
            })
        });
    }

    /// Adds to each pixel what its place, x and y, is given.
    fn add(&self, counts: &mut Array3<f32>, given: impl Fn(f32, f32) -> [f32; 3]) {
        let rows = counts.as_slice_mut().unwrap_or_default().chunks_exact_mut(3 * self.width);
        for (y, row) in rows.enumerate() {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let given = given(x as f32, y as f32);
                pixel[0] += given[0];
                pixel[1] += given[1];
                pixel[2] += given[2];
            }
        }
    }
}

/// A gel and its camera, with so many times a DIGIT's noise of its own.
pub struct Finger {
    pub gel: Gel,
    pub random: Random,
    pub noise: f32,
}

impl Finger {
    pub fn new(seed: u64, height: usize, width: usize) -> Self {
        let mut random = Random(seed);
        Self { gel: Gel::any(&mut random, height, width), random, noise: 1.0 }
    }

    pub fn frame(&mut self, press: Option<Press>, drift: Drift) -> Array3<u8> {
        let counts = self.gel.counts(press, drift);
        self.gel.frame_of(&mut self.random, counts, self.noise)
    }

    pub fn still(&mut self) -> Array3<u8> {
        self.frame(None, Drift::default())
    }

    /// A tracker that has measured its noise on so many untouched frames.
    pub fn tracker(&mut self, rate_hz: f64, frames: usize) -> TouchTracker {
        let still: Vec<_> = (0..frames).map(|_| self.still()).collect();
        let views: Vec<_> = still.iter().map(|frame| frame.view()).collect();
        let noise = SensorNoise::measure(&views, TrackerOptions::default().order).unwrap();
        TouchTracker::new(still[0].view(), TrackerOptions { rate_hz, noise, ..TrackerOptions::default() })
            .unwrap()
    }
}

/// Gives a tracker the next frame.
pub fn update(tracker: &mut TouchTracker, frame: &Array3<u8>) -> Touch {
    tracker.update(frame.view(), None, false).unwrap()
}
