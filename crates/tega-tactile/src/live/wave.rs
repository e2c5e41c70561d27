//! Bands of mains light that hardly move: a wave over the lines, whose length stays while it turns.
//!
//! At rest the gains of two outer thirds of the picture are averaged for half a second, in which bands that move leave nothing. Where one wave
//! explains most of what is left, its length is known. In contact such bands cannot be separated from it line by line, but the two numbers of a wave of
//! known length are found from the lines' parts that nothing touches.

use std::ops::RangeInclusive;

use super::trig::cos_of_turn;

/// Root mean square gain from which a wave is taken out: 0.04 % of amplitude. One that is known may have half of it.
const LEAST: f32 = 0.0003;
/// How the lines' gains are averaged, seconds; at first over as many pictures as there are.
const LEARN_S: f64 = 0.5;
/// A wave is looked for in one of so many pictures.
const EVERY: u32 = 30;
/// Parts of a period in which a wave's length is known, and in which steps it is looked for.
const PARTS: usize = 256;
const STEPS: [usize; 4] = [64, 16, 4, 1];
/// Waves that are looked for have 1.25 to 6 periods over the picture.
const LENGTHS: RangeInclusive<usize> = PARTS * 5 / 4..=PARTS * 6;
/// A wave explains at least this share of the gains' square.
const EXPLAINS: f32 = 0.6;
/// The level, a change along the lines, and both parts of a wave.
const TERMS: usize = 4;

/// What the lines of two thirds have shown, and the wave in it.
#[derive(Debug, Clone, Default)]
pub(super) struct Wave {
    means: [Vec<f32>; 2],
    frames: u32,
    /// The terms, line by line; empty where there is no wave.
    terms: Vec<[f32; TERMS]>,
    parts: [f32; TERMS],
    /// Mean square of the gains that both thirds had in common when it was found.
    power: f32,
}

impl Wave {
    /// Learns from the gains of two thirds of a picture at rest, `dt_s` after those before.
    pub fn learn(&mut self, thirds: [&[f32]; 2], dt_s: f64) {
        self.frames = self.frames.saturating_add(1);
        let share = (dt_s / (LEARN_S + dt_s)).max(1.0 / f64::from(self.frames)) as f32;
        for (mean, now) in self.means.iter_mut().zip(thirds) {
            mean.resize(now.len(), 0.0);
            mean.iter_mut().zip(now).for_each(|(mean, now)| *mean += share * (now - *mean));
        }
        if self.frames.is_multiple_of(EVERY) {
            self.look();
        }
    }

    /// Whether there is one.
    pub fn is_known(&self) -> bool {
        !self.terms.is_empty()
    }

    /// Mean square of its gains, as a share of the light squared; 0 where there is none.
    pub fn power(&self) -> f32 {
        if self.is_known() { self.power } else { 0.0 }
    }

    /// Looks for the wave that explains most of both thirds.
    fn look(&mut self) {
        let [one, other] = &self.means;
        let common = one.iter().zip(other).map(|(a, b)| a * b).sum::<f32>() / one.len() as f32;
        let least = if self.is_known() { 0.5 * LEAST } else { LEAST };
        if common < least * least {
            self.terms.clear();
            self.parts = [0.0; TERMS];
            return;
        }
        let mean: Vec<f32> = one.iter().zip(other).map(|(a, b)| 0.5 * (a + b)).collect();
        let alike = vec![1.0; mean.len()];
        let explained = |length: usize| {
            let terms = terms_of(length, mean.len());
            let parts = fitted(&terms, &mean, &alike, 0.0);
            let gains = terms.iter().map(|terms| sum_of(terms, &parts));
            gains.zip(&mean).map(|(gain, mean)| 2.0 * gain * (2.0 * mean - gain)).sum::<f32>()
        };
        let best = |lengths: RangeInclusive<usize>, step: usize| {
            lengths
                .step_by(step)
                .map(|length| (explained(length), length))
                .max_by(|(a, _), (b, _)| a.total_cmp(b))
        };
        let (mut most, mut length, mut lengths) = (0.0, 0, LENGTHS);
        for step in STEPS {
            if let Some(found) = best(lengths, step) {
                (most, length) = found;
            }
            lengths = length - step..=length + step;
        }
        if most > EXPLAINS * one.iter().chain(other).map(|gain| gain * gain).sum::<f32>() {
            self.terms = terms_of(length, mean.len());
            self.power = common;
            // In contact level and slope are left to the fit of the light: a wide dent would pull them, and the wave with them.
            self.terms.iter_mut().for_each(|terms| terms[..2].fill(0.0));
        }
    }

    /// The gains of the lines by the last fit.
    pub fn gains(&self, gains: &mut Vec<f32>) {
        gains.clear();
        gains.extend(self.terms.iter().map(|terms| sum_of(terms, &self.parts)));
    }

    /// Fits the wave to weighted sums of each line; it is held against a prior of this many noise units squared.
    pub fn fit(&mut self, products: &[f32], squares: &[f32], held: f32) {
        self.parts = fitted(&self.terms, products, squares, held);
    }
}

/// The terms of a wave that has so many parts of a period over the lines.
fn terms_of(length: usize, lines: usize) -> Vec<[f32; TERMS]> {
    let whole = PARTS * lines;
    let [turned, aside] = [0, whole * 3 / 4].map(|from| cos_of_turn(2 * (length + from), whole));
    let (mut cosine, mut sine) = (1.0, 0.0);
    let mut terms = Vec::with_capacity(lines);
    for k in 0..lines {
        terms.push([1.0, 2.0 * k as f32 / lines as f32 - 1.0, cosine as f32, sine as f32]);
        (cosine, sine) = (cosine * turned - sine * aside, sine * turned + cosine * aside);
    }
    terms
}

fn sum_of(terms: &[f32; TERMS], parts: &[f32; TERMS]) -> f32 {
    terms.iter().zip(parts).map(|(term, part)| term * part).sum()
}

/// Least squares of the terms to each line's product over its square, weighted by the square; zeros where that has no answer.
fn fitted(terms: &[[f32; TERMS]], products: &[f32], squares: &[f32], held: f32) -> [f32; TERMS] {
    let mut m = [[0f64; TERMS + 1]; TERMS];
    for ((terms, product), square) in terms.iter().zip(products).zip(squares) {
        for (row, by) in m.iter_mut().zip(terms) {
            for (cell, term) in row.iter_mut().zip(terms) {
                *cell += f64::from(by * term * square);
            }
            row[TERMS] += f64::from(by * product);
        }
    }
    for k in 0..TERMS {
        m[k][k] += f64::from(held);
        let row = m[k];
        if row[k] <= 0.0 {
            return [0.0; TERMS];
        }
        for other in (0..TERMS).filter(|other| *other != k) {
            let share = m[other][k] / row[k];
            m[other].iter_mut().zip(row).for_each(|(cell, by)| *cell -= share * by);
        }
    }
    std::array::from_fn(|k| (m[k][TERMS] / m[k][k]) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gains of the lines of two thirds under a wave of so many periods, `at` of a turn on.
    fn thirds(amplitude: f64, periods: f64, at: f64) -> [Vec<f32>; 2] {
        let gain = |k: usize| amplitude * (std::f64::consts::TAU * (periods * k as f64 / 40.0 + at)).sin();
        // Noise of each third's own.
        [7, 11].map(|by| (0..40).map(|k| (gain(k) + 1e-4 * (((k * by) % 5) as f64 - 2.0)) as f32).collect())
    }

    fn learned(amplitude: f64, periods: f64, turns: f64) -> Wave {
        let mut wave = Wave::default();
        for k in 0..60 {
            let [one, other] = thirds(amplitude, periods, turns * f64::from(k));
            wave.learn([&one, &other], 1.0 / 60.0);
        }
        wave
    }

    #[test]
    fn a_wave_of_any_length_is_taken_out_of_the_lines_that_are_seen() {
        for periods in [1.4, 1.8, 3.6, 5.9] {
            let mut wave = learned(0.004, periods, 0.001);
            assert!(wave.is_known(), "{periods}");
            let [seen, _] = thirds(0.02, periods, 0.4);
            // A third of the lines is covered, and has another gain.
            let products: Vec<f32> = seen
                .iter()
                .enumerate()
                .map(|(k, gain)| if (10..23).contains(&k) { 0.0 } else { *gain })
                .collect();
            let squares: Vec<f32> = (0..40).map(|k| if (10..23).contains(&k) { 0.0 } else { 1.0 }).collect();
            wave.fit(&products, &squares, 1e-6);
            let mut gains = Vec::new();
            wave.gains(&mut gains);
            for (k, (found, gain)) in gains.iter().zip(&seen).enumerate() {
                assert!((found - gain).abs() < 1e-3, "{periods} {k}: {found} for {gain}");
            }
        }
    }

    #[test]
    fn what_moves_fast_and_what_is_no_wave_are_none() {
        assert!(!learned(0.02, 1.8, 1.0 / 3.0).is_known());
        assert!(!learned(0.0, 1.8, 0.0).is_known());
        let mut wave = Wave::default();
        let step: Vec<f32> = (0..40).map(|k| if (18..21).contains(&k) { 0.01 } else { 0.0 }).collect();
        (0..60).for_each(|_| wave.learn([&step, &step], 1.0 / 60.0));
        assert!(!wave.is_known());
    }
}
