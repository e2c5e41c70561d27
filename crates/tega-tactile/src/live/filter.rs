//! Average the change of a contact over time, for as long as nothing says that it moves.
//!
//! A Kalman filter whose state is the change of every cell, with one variance for all: noise of a picture is 1. While the picture is what the
//! filter expects, within the noise that the sensor has at rest, the gain falls as it does for a mean, down to that of a first-order lag. What
//! the picture differs by more, by the same statistic that finds contacts, is taken for motion: its energy is the process noise, and the filter
//! opens at once. So a steady, faint dent is read from many pictures, and no dent lags by more than the noise of one.

use super::colour::Field;
use super::still::{Cells, plain_of};

/// The longest average, seconds.
const LONGEST_S: f64 = 1.0;
/// Energy of a difference over that of noise, less 1, that noise itself may have.
const BY_CHANCE: f64 = 0.25;
/// A gain over this is 1: then the picture is read as it is.
const OPEN: f64 = 0.9;

/// The filter of one fingertip.
#[derive(Debug, Clone, Default)]
pub(super) struct ChangeFilter {
    /// The filtered change, noise units.
    mean: Field,
    /// Its variance over that of one picture; 0 before the first.
    variance: f64,
    difference: Field,
}

impl ChangeFilter {
    /// Forgets the contact.
    pub fn clear(&mut self) {
        self.variance = 0.0;
    }

    /// Filters the change that was judged last, in place; its variance over that of one picture. `rest` is S at rest.
    pub fn take(&mut self, cells: &mut Cells, rest: f64, dt_s: f64) -> f32 {
        let gain = if self.variance > 0.0 { self.gain(cells, rest, dt_s) } else { 1.0 };
        if gain > OPEN {
            self.mean.clone_from(&cells.white);
            self.variance = 1.0;
            return 1.0;
        }
        for (mean, white) in self.mean.iter_mut().zip(&mut cells.white) {
            blend(mean, white, gain as f32);
        }
        // That of the posterior is the gain itself.
        self.variance = gain;
        gain as f32
    }

    fn gain(&mut self, cells: &mut Cells, rest: f64, dt_s: f64) -> f64 {
        for ((difference, mean), white) in self.difference.iter_mut().zip(&self.mean).zip(&cells.white) {
            difference.clear();
            difference.extend(white.iter().zip(mean).map(|(white, mean)| white - mean));
        }
        let differs = f64::from(plain_of(&mut cells.colour, &self.difference, &cells.grid));
        let expected = rest * rest * (1.0 + self.variance);
        let motion = (differs * differs / expected.max(f64::MIN_POSITIVE) - 1.0 - BY_CHANCE).max(0.0);
        let slowest = dt_s / (LONGEST_S + dt_s);
        let prior = self.variance + slowest * slowest / (1.0 - slowest) + motion * (1.0 + self.variance);
        if prior.is_finite() { prior / (prior + 1.0) } else { 1.0 }
    }
}

/// Moves a mean a share of the way to new values, which become the mean.
fn blend(mean: &mut [f32], values: &mut [f32], share: f32) {
    for (mean, value) in mean.iter_mut().zip(values) {
        *mean += share * (*value - *mean);
        *value = *mean;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Order;
    use crate::live::light::GelLight;
    use crate::live::noise::SensorNoise;
    use ndarray::Array3;
    use proptest::prelude::*;

    fn cells() -> Cells {
        let gel = Array3::<u8>::zeros((320, 240, 3));
        Cells::of(&gel.view(), SensorNoise::default(), &GelLight::default(), Order::Bgr).unwrap()
    }

    /// Noise of 1 in every cell around a dent of this height.
    fn show(cells: &mut Cells, seed: &mut u64, height: f32) {
        let cols = cells.grid.cols;
        for plane in &mut cells.white {
            for (k, white) in plane.iter_mut().enumerate() {
                let mut sum = 0.0;
                for _ in 0..12 {
                    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    sum += (*seed >> 40) as f32 / (1u64 << 24) as f32 - 0.5;
                }
                let inside = (10..16).contains(&(k / cols)) && (10..16).contains(&(k % cols));
                *white = sum + if inside { height } else { 0.0 };
            }
        }
    }

    #[test]
    fn a_steady_change_is_averaged_and_one_that_moves_is_read_at_once() {
        let (mut cells, mut filter, mut seed) = (cells(), ChangeFilter::default(), 1);
        show(&mut cells, &mut seed, 4.0);
        let rest = f64::from(plain_of(&mut cells.colour.clone(), &cells.white, &cells.grid)).min(0.75);
        assert_eq!(filter.take(&mut cells, rest, 1.0 / 60.0), 1.0);
        for _ in 0..60 {
            show(&mut cells, &mut seed, 4.0);
            filter.take(&mut cells, rest, 1.0 / 60.0);
        }
        assert!(filter.variance < 0.05, "{}", filter.variance);
        let inside = |cells: &Cells| cells.white[0][12 * cells.grid.cols + 12];
        assert!((inside(&cells) - 4.0).abs() < 1.0, "{}", inside(&cells));
        show(&mut cells, &mut seed, 12.0);
        let wanted = inside(&cells);
        assert_eq!(filter.take(&mut cells, rest, 1.0 / 60.0), 1.0);
        assert_eq!(inside(&cells), wanted);
    }

    proptest! {
        #[test]
        fn the_variance_is_a_share_and_every_value_lies_between_the_old_and_the_new(
            heights in prop::collection::vec(-30f32..30.0, 2..12), dt_s in 0f64..2.0, rest in 0f64..4.0, seed in any::<u64>()
        ) {
            let (mut cells, mut filter, mut seed) = (cells(), ChangeFilter::default(), seed);
            for height in heights {
                show(&mut cells, &mut seed, height);
                let (old, new) = (filter.mean.clone(), cells.white.clone());
                let began = filter.variance > 0.0;
                let variance = filter.take(&mut cells, rest, dt_s);
                prop_assert!(variance > 0.0 && variance <= 1.0, "{}", variance);
                for c in 0..3 {
                    for (k, value) in cells.white[c].iter().enumerate() {
                        let from = if began { old[c][k] } else { new[c][k] };
                        let (low, high) = (from.min(new[c][k]), from.max(new[c][k]));
                        prop_assert!((low - 1e-3..=high + 1e-3).contains(value));
                    }
                }
            }
        }
    }
}
