//! The whole forward chain: samples in, one fused closure level out per block.

use crate::block_mean::BlockSum;
use crate::chain::{Chain, Kind, LOWPASS_HZ, ORDER, check_rows};
use crate::error::EmgError;
use crate::fusion::{Fusion, fuse};
use crate::level::{Intervals, level_of};
use crate::steady::{Confirm, Steady};
use tega_error::{OutOfRange, UnknownChoice, choice};

/// What `live` takes of a channel's maximum, so that full closure is within comfortable reach.
pub const LIVE_SHARE: f64 = 0.8;

/// Which reading of the method turns block means into levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    /// The printed law: Eq 11 clamped, Eq 12 and 13, nothing else.
    Paper,
    /// For people: maxima times 0.8, steadied drives, a dead zone about each border, two blocks for a change.
    Live,
}

impl Preset {
    /// Read a preset from its name.
    ///
    /// # Errors
    /// [`UnknownChoice`] unless it is `paper` or `live`.
    ///
    /// # Examples
    /// ```
    /// assert_eq!(tega_emg::Preset::parse("live")?, tega_emg::Preset::Live);
    /// # Ok::<(), tega_error::UnknownChoice>(())
    /// ```
    pub fn parse(name: &str) -> Result<Self, UnknownChoice> {
        choice("preset", name, &[("paper", Self::Paper), ("live", Self::Live)])
    }
}

/// How Eq 10 to 13 are read; the default is as printed.
#[derive(Debug, Clone, PartialEq)]
pub struct Rules {
    /// Cutoff of Eq 10's low-pass.
    pub cutoff_hz: f64,
    /// Its order, 1 to 8.
    pub order: usize,
    /// Intervals of Eq 11.
    pub intervals: Intervals,
    /// What Eq 12 and 13 do with the channels' levels.
    pub fusion: Fusion,
    /// What each channel counts in that, 0 or more; `None` where all count alike.
    pub weights: Option<Vec<f64>>,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            cutoff_hz: LOWPASS_HZ,
            order: ORDER,
            intervals: Intervals::Four,
            fusion: Fusion::Floor,
            weights: None,
        }
    }
}

/// What one call gave: one entry a block.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Blocks {
    /// Fused levels, 1 to 5.
    pub fused: Vec<u8>,
    /// Levels of the channels, a row of them a block; 0 for a channel that had no vote.
    pub levels: Vec<u8>,
}

/// EMG samples of several channels to one closure level per block of τ samples.
///
/// A sample that is not finite, or larger than [`LARGEST_SAMPLE`](crate::LARGEST_SAMPLE), is replaced by the
/// channel's last good one and counted. After 100 ms of them, or at once if it is infinite, the channel is bad and
/// loses its vote for every block it is bad in; after 100 ms of good samples it is good again, its filters having
/// started afresh. With every
/// channel bad the last fused level is held (1 if there was none).
///
/// # Examples
/// ```
/// use tega_emg::{GraspIntent, Kind, Preset};
/// let mut intent = GraspIntent::new(200.0, &[1.0], 20, Kind::Envelope, Preset::Paper)?;
/// assert_eq!(intent.process(&[0.6; 45])?.fused, [3, 3]);
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct GraspIntent {
    chain: Chain,
    sum: BlockSum,
    maxima: Vec<f64>,
    rules: Rules,
    weights: Vec<f64>,
    live: Option<(Steady, Confirm)>,
    means: Vec<f64>,
    votes: Vec<bool>,
    fused: u8,
    holding: bool,
}

impl GraspIntent {
    /// A chain for as many channels as there are maxima.
    ///
    /// # Errors
    /// [`EmgError::OutOfRange`] for an unusable rate, τ or number of channels; [`EmgError::Cutoff`] if the rate is
    /// too low for the 50 Hz low-pass (100 Hz and less) or too high for the filters; [`EmgError::UnusableMaximum`]
    /// unless every maximum is finite and greater than 0.
    pub fn new(
        rate_hz: f64,
        maxima: &[f64],
        tau: usize,
        kind: Kind,
        preset: Preset,
    ) -> Result<Self, EmgError> {
        Self::with_rules(rate_hz, maxima, tau, kind, preset, Rules::default())
    }

    /// A chain that reads Eq 10 to 13 by other rules than the printed ones.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`EmgError::OutOfRange`] for weights that are negative, not finite, all 0, or not
    /// one a channel.
    pub fn with_rules(
        rate_hz: f64,
        maxima: &[f64],
        tau: usize,
        kind: Kind,
        preset: Preset,
        rules: Rules,
    ) -> Result<Self, EmgError> {
        let channels = maxima.len();
        let chain = Chain::with_lowpass(rate_hz, channels, kind, rules.cutoff_hz, rules.order)?;
        let weights = check_weights(rules.weights.as_deref(), channels)?;
        let sum = BlockSum::new(tau, channels)?;
        let share = if preset == Preset::Live { LIVE_SHARE } else { 1.0 };
        let maxima = maxima
            .iter()
            .enumerate()
            .map(|(i, &value)| check_maximum(i, value).map(|()| value * share))
            .collect::<Result<Vec<_>, _>>()?;
        let live = (preset == Preset::Live)
            .then(|| (Steady::new(tau as f64 / rate_hz, channels, rules.intervals), Confirm::default()));
        let (means, votes) = (Vec::with_capacity(channels), vec![true; channels]);
        Ok(Self { chain, sum, maxima, rules, weights, live, means, votes, fused: 1, holding: false })
    }

    /// Take rows of samples, one column a channel; samples left over wait for the next call.
    ///
    /// # Errors
    /// [`EmgError::Ragged`] if `samples` is not a whole number of rows.
    pub fn process(&mut self, mut samples: &[f64]) -> Result<Blocks, EmgError> {
        let channels = self.maxima.len();
        check_rows(samples, channels)?;
        let blocks = self.sum.completed_by(samples.len() / channels);
        let mut out =
            Blocks { fused: Vec::with_capacity(blocks), levels: Vec::with_capacity(blocks * channels) };
        while !samples.is_empty() {
            let rows = self.chain.advance(samples, self.sum.missing());
            self.sum.add(rows);
            samples = &samples[rows.len()..];
            if self.sum.finish(&mut self.means) {
                self.finish_block(&mut out);
                self.means.clear();
            }
        }
        Ok(out)
    }

    fn finish_block(&mut self, out: &mut Blocks) {
        for (channel, vote) in self.votes.iter_mut().enumerate() {
            *vote = !self.chain.guard_mut().take_was_bad(channel);
        }
        let start = out.levels.len();
        out.levels.resize(start + self.maxima.len(), 0);
        let levels = &mut out.levels[start..];
        if let Some((steady, _)) = &mut self.live {
            steady.levels(&self.means, &self.maxima, &self.votes, levels);
        } else {
            for (((level, mean), maximum), vote) in
                levels.iter_mut().zip(&self.means).zip(&self.maxima).zip(&self.votes)
            {
                *level = if *vote { level_of(*mean, *maximum, self.rules.intervals) } else { 0 };
            }
        }
        let weighted = levels.iter().copied().zip(self.weights.iter().copied());
        let voted = fuse(weighted.filter(|(level, _)| *level > 0), self.rules.fusion);
        self.holding = voted.is_none();
        self.fused = match (voted, &mut self.live) {
            (Some(level), None) => level,
            (Some(level), Some((_, confirm))) => confirm.pass(level),
            (None, None) => self.fused,
            (None, Some((_, confirm))) => {
                confirm.interrupt();
                self.fused
            }
        };
        out.fused.push(self.fused);
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.maxima.len()
    }

    /// The maxima in use, by channel; `live` has scaled them.
    pub fn maxima(&self) -> &[f64] {
        &self.maxima
    }

    /// Channels that are bad now, counted from 0.
    pub fn bad_channels(&self) -> Vec<usize> {
        (0..self.channels()).filter(|c| self.chain.guard().is_bad(*c)).collect()
    }

    /// Samples replaced so far, by channel.
    pub fn held_samples(&self) -> Vec<u64> {
        self.chain.guard().held()
    }

    /// Whether the last block only repeated the level before it because no channel had a vote.
    pub fn holding(&self) -> bool {
        self.holding
    }
}

/// One weight a channel, all 1 where none is given.
fn check_weights(weights: Option<&[f64]>, channels: usize) -> Result<Vec<f64>, EmgError> {
    let Some(weights) = weights else {
        return Ok(vec![1.0; channels]);
    };
    let (name, unit) = ("weights", "");
    if weights.len() != channels {
        let wanted = format!("{channels}, one for each channel");
        return Err(OutOfRange::new("number of weights", weights.len() as f64, unit, wanted).into());
    }
    let bad = weights.iter().find(|weight| !(weight.is_finite() && **weight >= 0.0));
    let none = weights.iter().sum::<f64>() <= 0.0;
    match bad.copied().or(none.then_some(0.0)) {
        None => Ok(weights.to_vec()),
        Some(value) => {
            let wanted = "finite numbers of 0 or more, one of them above 0";
            Err(OutOfRange::new(name, value, unit, wanted).into())
        }
    }
}

pub(crate) fn check_maximum(index: usize, value: f64) -> Result<(), EmgError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(EmgError::UnusableMaximum { channel: index + 1, value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn envelope(maxima: &[f64], preset: Preset) -> Result<GraspIntent, EmgError> {
        GraspIntent::new(200.0, maxima, 20, Kind::Envelope, preset)
    }

    #[test]
    fn live_scales_its_maxima_and_paper_does_not() -> Result<(), EmgError> {
        assert_eq!(envelope(&[2.0], Preset::Live)?.maxima(), [1.6]);
        assert_eq!(envelope(&[2.0], Preset::Live)?.process(&[1.6; 20])?.fused, [5]);
        assert_eq!(envelope(&[2.0], Preset::Paper)?.process(&[1.6; 20])?.fused, [4]);
        Ok(())
    }

    #[test]
    fn a_bad_channel_loses_its_vote_and_gets_it_back() -> Result<(), EmgError> {
        for preset in [Preset::Paper, Preset::Live] {
            let mut intent = envelope(&[1.0, 1.0, 1.0], preset)?;
            let good = [0.6, 0.6, 0.1].repeat(20);
            let lost = [f64::NAN, 0.6, 0.1].repeat(20);
            assert_eq!(intent.process(&good)?.levels.len(), 3);
            let blocks = intent.process(&lost)?;
            assert_eq!((blocks.levels[0], intent.bad_channels()), (0, vec![0]));
            assert_eq!(intent.held_samples(), [20, 0, 0]);
            // The block in which it recovers was begun while it was bad.
            assert_eq!(intent.process(&good)?.levels[0], 0);
            assert_eq!(intent.bad_channels(), []);
            assert!(intent.process(&good)?.levels[0] >= 3);
        }
        Ok(())
    }

    #[test]
    fn with_every_channel_bad_the_level_is_held() -> Result<(), EmgError> {
        for preset in [Preset::Paper, Preset::Live] {
            let mut intent = envelope(&[1.0], preset)?;
            let level = intent.process(&[0.7; 20])?.fused[0];
            assert!(level > 1 && !intent.holding());
            assert_eq!(intent.process(&[f64::INFINITY; 60])?.fused, [level; 3]);
            assert!(intent.holding());
            assert_eq!(intent.process(&[0.7; 40])?.fused, [level; 2]);
            assert!(!intent.holding());
        }
        Ok(())
    }

    #[test]
    fn a_stream_that_never_was_good_stays_open() -> Result<(), EmgError> {
        let mut intent = envelope(&[1.0, 1.0], Preset::Live)?;
        assert_eq!(intent.process(&[f64::NAN; 80])?.fused, [1, 1]);
        assert_eq!((intent.bad_channels(), intent.holding()), (vec![0, 1], true));
        Ok(())
    }

    #[test]
    fn a_rate_too_low_for_the_filter_is_named() {
        let got = GraspIntent::new(100.0, &[1.0], 10, Kind::Envelope, Preset::Paper);
        assert!(matches!(got, Err(EmgError::Cutoff { cutoff_hz: 50.0, .. })));
        let got = GraspIntent::new(200.0, &[1.0, 0.0], 10, Kind::Envelope, Preset::Paper);
        assert!(matches!(got, Err(EmgError::UnusableMaximum { channel: 2, .. })));
    }

    #[test]
    fn the_rules_change_what_they_name() -> Result<(), EmgError> {
        let fused = |rules: Rules, maxima: &[f64], samples: &[f64]| {
            GraspIntent::with_rules(200.0, maxima, 20, Kind::Envelope, Preset::Paper, rules)?
                .process(samples)
                .map(|blocks| blocks.fused)
        };
        let five = Rules { intervals: Intervals::Five, ..Rules::default() };
        assert_eq!(fused(Rules::default(), &[1.0], &[0.85; 20])?, [4]);
        assert_eq!(fused(five, &[1.0], &[0.85; 20])?, [5]);
        let rows = [0.1, 0.1, 0.9].repeat(20);
        let third = Rules { weights: Some(vec![0.0, 0.0, 1.0]), ..Rules::default() };
        assert_eq!(fused(Rules::default(), &[1.0; 3], &rows)?, [1]);
        assert_eq!(fused(third, &[1.0; 3], &rows)?, [4]);
        for weights in [vec![], vec![1.0], vec![0.0; 3], vec![-1.0, 1.0, 1.0], vec![f64::NAN, 1.0, 1.0]] {
            let rules = Rules { weights: Some(weights), ..Rules::default() };
            let got = fused(rules, &[1.0; 3], &rows);
            assert!(
                matches!(
                    got,
                    Err(EmgError::OutOfRange(OutOfRange { name: "weights" | "number of weights", .. }))
                ),
                "{got:?}"
            );
        }
        Ok(())
    }
}
