//! Average the maps of a contact over time, by as much as they scatter and for as long as nothing moves.
//!
//! A Kalman filter whose state is the maps of change and depth, with one variance for all. Each picture's area and depth are compared with those of
//! the picture before: what they differ by while nothing moves is the noise of the measurement, and the filter's time constant is the one that
//! brings it down to [`WANTED`]. A firm contact scatters less than that and is read picture by picture. What the picture differs by from the
//! filter's own, beyond what the sensor does at rest and by the same statistic that finds contacts, is motion: it is the process noise, and
//! opens the filter at once.

use super::colour::{Field, statistic};

/// Scatter of area and depth that is wanted, as a share.
const WANTED: f64 = 0.012;
/// The longest average, seconds.
const LONGEST_S: f64 = 3.0;
/// How the scatter is learned, seconds; at first its pictures are averaged.
const LEARN_S: f64 = 0.5;
/// Energy of a difference over that of noise, less 1, that noise itself may have.
const BY_CHANCE: f64 = 0.6;
/// A gain over this is 1: then the picture is read as it is.
const OPEN: f64 = 0.9;

/// What the filter goes by, beside the maps.
pub(super) struct Evidence<'a> {
    /// The picture's change in pooled cells, noise units.
    pub pooled: &'a Field,
    /// S at rest.
    pub rest: f64,
    pub dt_s: f64,
}

/// The filter of one fingertip.
#[derive(Debug, Clone, Default)]
pub(super) struct MapFilter {
    /// Filtered change of colour and depth, a value a cell.
    means: [Vec<f32>; 2],
    pooled: Field,
    difference: Field,
    /// Variance of the means over that of one picture; 0 before the first.
    variance: f64,
    /// Area and depth of the last picture by itself.
    last: [f32; 2],
    /// Squares of their scatter, as shares, and how many pictures they are known from.
    scatter: [f64; 2],
    known: f64,
}

impl MapFilter {
    /// Forgets the contact.
    pub fn clear(&mut self) {
        (self.variance, self.known, self.scatter) = (0.0, 0.0, [0.0; 2]);
    }

    /// Filters maps of change and depth in place; whether it changed them. `sizes` are area and depth of the picture by itself.
    pub fn take(&mut self, maps: [&mut Vec<f32>; 2], sizes: [f32; 2], evidence: &Evidence<'_>) -> bool {
        let gain = if self.variance > 0.0 { self.gain(sizes, evidence) } else { 1.0 };
        self.last = sizes;
        let open = gain > OPEN;
        self.variance = if open { 1.0 } else { gain };
        for (mean, map) in self.means.iter_mut().zip(maps) {
            blend(mean, map, gain as f32, open);
        }
        for (mean, pooled) in self.pooled.iter_mut().zip(evidence.pooled) {
            follow(mean, pooled, gain as f32, open);
        }
        !open
    }

    fn gain(&mut self, sizes: [f32; 2], evidence: &Evidence<'_>) -> f64 {
        let motion = self.motion(evidence);
        let slowest = evidence.dt_s / (LONGEST_S + evidence.dt_s);
        if motion == 0.0 {
            self.learn(sizes, evidence.dt_s);
        }
        // A mean with this gain has gain / (2 - gain) of the variance.
        let scatter = self.scatter[0].max(self.scatter[1]);
        let wanted = (2.0 * WANTED * WANTED / (scatter + WANTED * WANTED)).max(slowest);
        if wanted >= 1.0 {
            return 1.0;
        }
        // That of the posterior is the gain itself.
        let prior = self.variance + wanted * wanted / (1.0 - wanted) + motion * (1.0 + self.variance);
        if prior.is_finite() { prior / (prior + 1.0) } else { 1.0 }
    }

    /// Energy by which the picture differs from the filter's, over that of noise, beyond what noise has by chance.
    fn motion(&mut self, evidence: &Evidence<'_>) -> f64 {
        for ((difference, mean), pooled) in self.difference.iter_mut().zip(&self.pooled).zip(evidence.pooled)
        {
            difference.clear();
            difference.extend(pooled.iter().zip(mean).map(|(pooled, mean)| pooled - mean));
        }
        let differs = f64::from(statistic_of(&self.difference));
        let expected = evidence.rest * evidence.rest * (1.0 + self.variance);
        (differs * differs / expected.max(f64::MIN_POSITIVE) - 1.0 - BY_CHANCE).max(0.0)
    }

    /// Learns how much area and depth of two pictures differ while nothing moves.
    fn learn(&mut self, sizes: [f32; 2], dt_s: f64) {
        self.known += 1.0;
        let share = (dt_s / (LEARN_S + dt_s)).max(1.0 / self.known);
        for ((scatter, now), last) in self.scatter.iter_mut().zip(sizes).zip(self.last) {
            let (step, size) = (f64::from(now - last), 0.5 * f64::from(now + last));
            // Two pictures differ by the noise of both.
            let seen = if size > 0.0 { 0.5 * step * step / (size * size) } else { 0.0 };
            *scatter += share * (seen - *scatter);
        }
    }
}

tega_simd::dispatched! {
    /// See [`statistic`].
    statistic_of = statistic, (pooled: &Field) -> f32
}

/// Moves a mean a share of the way to new values, which become the mean; all the way where the filter is open.
fn blend(mean: &mut Vec<f32>, values: &mut [f32], share: f32, open: bool) {
    if open {
        mean.clear();
        mean.extend_from_slice(values);
        return;
    }
    for (mean, value) in mean.iter_mut().zip(values) {
        *mean += share * (*value - *mean);
        *value = *mean;
    }
}

/// The same, values left as they are.
fn follow(mean: &mut Vec<f32>, values: &[f32], share: f32, open: bool) {
    if open {
        mean.clear();
        mean.extend_from_slice(values);
        return;
    }
    for (mean, value) in mean.iter_mut().zip(values) {
        *mean += share * (*value - *mean);
    }
}
