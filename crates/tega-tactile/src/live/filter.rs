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
