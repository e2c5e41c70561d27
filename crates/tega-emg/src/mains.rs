//! Finds the mains in the newest samples of each channel, by their power at a line's frequency and its multiples.

use std::f64::consts::TAU;

use crate::lanes::{LANES, LaneRows, Lanes};

/// A wave of less than this, once the others are taken out of it, is made of their rounding.
const LEAST_NORM: f64 = 1e-9;

/// Looks for mains among a fixed number of samples, with all the room it needs.
///
/// Sums of a channel go from its oldest sample to its newest.
#[derive(Debug, Clone)]
pub(crate) struct Mains {
    /// Share of the power from which a channel is mains.
    share: f64,
    /// Root mean square from which mains count, by channel.
    least_rms: Vec<f64>,
    combs: Vec<Comb>,
    /// Whether every line and multiple comes back as it was in the second half.
    returns: bool,
    /// A group of channels without their means.
    swing: Vec<Lanes>,
}

impl Mains {
    pub(crate) fn new(rows: usize, share: f64, least_rms: Vec<f64>, lines_hz: &[f64], rate_hz: f64) -> Self {
        let returns = rows.is_multiple_of(2)
            && lines_hz.iter().all(|line_hz| is_whole((rows / 2) as f64 * line_hz / rate_hz));
        let combs = lines_hz.iter().map(|line_hz| Comb::new(*line_hz, rate_hz, rows)).collect();
        Self { share, least_rms, combs, returns, swing: vec![Lanes::ZERO; rows] }
    }

    /// The channels that are nearly all mains, with the line's frequency; of two lines the last counts.
    pub(crate) fn find(&mut self, rows: &[f64], mut found: impl FnMut(usize, f64)) {
        let (channels, n) = (self.least_rms.len(), self.swing.len() as f64);
        for first in (0..channels).step_by(LANES) {
            let mean = LaneRows::new(rows, channels, first).fold(Lanes::ZERO, |sum, row| sum + row).over(n);
            for (swing, row) in self.swing.iter_mut().zip(LaneRows::new(rows, channels, first)) {
                *swing = row - mean;
            }
            let power = self.swing.iter().fold(Lanes::ZERO, |sum, x| sum + *x * *x);
            // What is no line is all that can differ between the halves, with at most twice its power. Muscles differ.
            let (older, newer) = self.swing.split_at(self.swing.len() / 2);
            let change = older.iter().zip(newer).fold(Lanes::ZERO, |sum, (x, y)| {
                let change = *x - *y;
                sum + change * change
            });
            let least_rms = self.least_rms.get(first..).unwrap_or(&[]);
            let is_loud = |lane: usize, power: &Lanes| {
                least_rms.get(lane).is_some_and(|least| (power.0[lane] / n).sqrt() >= *least)
            };
            // A line has no more power than the whole, so that at rest none is loud enough.
            let may_be: [bool; LANES] = std::array::from_fn(|lane| {
                let same = change.0[lane] <= 2.001 * (1.0 - self.share) * power.0[lane];
                is_loud(lane, &power) && (same || !self.returns)
            });
            if !may_be.contains(&true) {
                continue;
            }
            for comb in &mut self.combs {
                let line = comb.power(&self.swing);
                let is_line = |lane: &usize| {
                    // What is not a number is not greater.
                    may_be[*lane] && line.0[*lane] > self.share * power.0[*lane] && is_loud(*lane, &line)
                };
                (0..LANES).filter(is_line).for_each(|lane| found(first + lane, comb.line_hz));
            }
        }
    }
}

/// An orthonormal base of a frequency and its multiples below half the rate.
#[derive(Debug, Clone)]
struct Comb {
    line_hz: f64,
    /// Value of each wave at the first sample, at the second and so on.
    waves: Vec<f64>,
    /// One a wave.
    sums: Vec<Lanes>,
}

impl Comb {
    fn new(line_hz: f64, rate_hz: f64, rows: usize) -> Self {
        let multiples = (1u32..).map(f64::from).take_while(|k| *k < rate_hz / 2.0 / line_hz);
        // Of less samples than these a line cannot be distinguished from anything else.
        let most = rows / 4;
        let multiples: Vec<f64> = multiples.take(most + 1).collect();
        let mut base: Vec<Vec<f64>> = Vec::new();
        if multiples.len() <= most {
            let angle = |k: f64, row: usize| k * (TAU * row as f64 * line_hz / rate_hz);
            for k in multiples {
                for wave in [f64::cos, f64::sin] {
                    base.extend(unit((0..rows).map(|row| wave(angle(k, row))).collect(), &base));
                }
            }
        }
        let waves = (0..rows).flat_map(|row| base.iter().map(move |wave| wave[row])).collect();
        Self { line_hz, waves, sums: vec![Lanes::ZERO; base.len()] }
    }

    /// Power of each channel at the line and its multiples, summed over the samples.
    fn power(&mut self, swing: &[Lanes]) -> Lanes {
        self.sums.fill(Lanes::ZERO);
        for (waves, x) in self.waves.chunks_exact(self.sums.len().max(1)).zip(swing) {
            for (sum, wave) in self.sums.iter_mut().zip(waves) {
                *sum = *sum + Lanes::all(*wave) * *x;
            }
        }
        self.sums.iter().fold(Lanes::ZERO, |power, sum| power + *sum * *sum)
    }
}

/// What a wave has that a base has not, of length 1 (Gram and Schmidt, twice for rounding); `None` for nothing.
fn unit(mut wave: Vec<f64>, base: &[Vec<f64>]) -> Option<Vec<f64>> {
    for other in base.iter().chain(base) {
        let shared = product(&wave, other);
        wave.iter_mut().zip(other).for_each(|(x, y)| *x -= shared * y);
    }
    let norm = product(&wave, &wave).sqrt();
    (norm > LEAST_NORM).then(|| wave.into_iter().map(|x| x / norm).collect())
}

/// Scalar product in four sums, each of every fourth sample.
fn product(one: &[f64], other: &[f64]) -> f64 {
    let pairs = one.chunks(LANES).zip(other.chunks(LANES));
    let mut sums = [0.0; LANES];
    for (xs, ys) in pairs {
        for ((sum, x), y) in sums.iter_mut().zip(xs).zip(ys) {
            *sum += x * y;
        }
    }
    sums.iter().sum()
}

/// Within a billionth.
fn is_whole(x: f64) -> bool {
    (x - x.round()).abs() <= 1e-9 * x.abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sine(hz: f64, rate_hz: f64, rows: usize) -> Vec<f64> {
        (0..rows).map(|row| 100.0 * (TAU * row as f64 * hz / rate_hz + 1.0).sin()).collect()
    }

    fn found(hz: f64, rate_hz: f64) -> Vec<(usize, f64)> {
        let (rows, mut all) = ((0.2 * rate_hz) as usize, Vec::new());
        let mut mains = Mains::new(rows, 0.92, vec![5.0], &[50.0, 60.0], rate_hz);
        mains.find(&sine(hz, rate_hz, rows), |channel, line_hz| all.push((channel, line_hz)));
        all
    }

    #[test]
    fn a_line_and_its_multiples_are_found_and_nothing_beside_them() {
        for rate_hz in [200.0, 250.0, 333.0, 1000.0, 2000.0] {
            assert_eq!(found(50.0, rate_hz), [(0, 50.0)], "{rate_hz}");
            assert_eq!(found(60.0, rate_hz), [(0, 60.0)], "{rate_hz}");
            assert_eq!(found(75.0, rate_hz), [], "{rate_hz}");
        }
        assert_eq!(found(150.0, 1000.0), [(0, 50.0)]);
        assert_eq!(found(180.0, 1000.0), [(0, 60.0)]);
        assert_eq!(found(300.0, 1000.0), [(0, 50.0), (0, 60.0)]);
    }

    #[test]
    fn a_base_is_orthonormal_even_where_a_multiple_is_nearly_half_the_rate() {
        for rate_hz in [200.000_1, 300.5, 1000.0] {
            let comb = Comb::new(50.0, rate_hz, 40);
            let waves = comb.sums.len();
            for (one, other) in (0..waves).flat_map(|one| (0..=one).map(move |other| (one, other))) {
                let product: f64 = comb.waves.chunks(waves).map(|row| row[one] * row[other]).sum();
                assert!((product - f64::from(one == other)).abs() < 1e-12, "{rate_hz}: {product}");
            }
        }
    }

    #[test]
    fn too_few_samples_for_a_line_are_no_mains() {
        let mut mains = Mains::new(3, 0.92, vec![0.0], &[50.0], 1000.0);
        mains.find(&[1.0, -1.0, 1.0], |channel, line_hz| panic!("{channel}: {line_hz}"));
        Mains::new(0, 0.92, vec![0.0], &[50.0], 1000.0).find(&[], |channel, _| panic!("{channel}"));
    }
}
