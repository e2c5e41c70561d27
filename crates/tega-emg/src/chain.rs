//! From raw rows to filtered rows: guard, offset removal and rectification as the input kind asks, low-pass.

use crate::bank::{BiquadBank, MARGIN};
use crate::butterworth::Sos;
use crate::error::EmgError;
use crate::guard::Guard;
use crate::pieces::LongBank;
use tega_error::{OutOfRange, UnknownChoice, choice};

/// Values handled at a time: few enough to stay in the first-level cache.
const VALUES: usize = 512;
/// Rows handled at a time at least.
const FEWEST_ROWS: usize = 16;
/// Order of Eq 10's low-pass and of the offset filter.
pub const ORDER: usize = 4;
/// Cutoff of Eq 10's low-pass.
pub const LOWPASS_HZ: f64 = 50.0;
/// Corner of the offset filter of raw input, where movement artefacts end and EMG begins.
pub const OFFSET_HZ: f64 = 20.0;

/// What the samples of a source are; it decides what happens before the low-pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// EMG that swings about a constant offset: the offset is removed and the rest is full-wave rectified.
    Raw,
    /// EMG rectified by the sensor: filtered as it is.
    Rectified,
    /// An envelope made by the sensor: filtered as it is.
    Envelope,
}

impl Kind {
    /// Read a kind from its name.
    ///
    /// # Errors
    /// [`UnknownChoice`] unless it is `raw`, `rectified` or `envelope`.
    ///
    /// # Examples
    /// ```
    /// assert_eq!(tega_emg::Kind::parse("envelope")?, tega_emg::Kind::Envelope);
    /// # Ok::<(), tega_error::UnknownChoice>(())
    /// ```
    pub fn parse(name: &str) -> Result<Self, UnknownChoice> {
        choice(
            "kind",
            name,
            &[("raw", Self::Raw), ("rectified", Self::Rectified), ("envelope", Self::Envelope)],
        )
    }
}

/// Samples that make up 100 ms, after which a channel without a good sample is bad.
fn patience(rate_hz: f64) -> usize {
    (rate_hz / 10.0).ceil().max(1.0) as usize
}

/// Everything that happens to a sample before it is averaged, with all its state.
#[derive(Debug, Clone)]
pub(crate) struct Chain {
    guard: Guard,
    offset: Option<BiquadBank>,
    lowpass: LongBank,
    channels: usize,
    rows_at_a_time: usize,
    held: Vec<f64>,
    swing: Vec<f64>,
    filtered: Vec<f64>,
}

impl Chain {
    /// The chain of Eq 10 for an input kind.
    pub(crate) fn new(rate_hz: f64, channels: usize, kind: Kind) -> Result<Self, EmgError> {
        Self::with_lowpass(rate_hz, channels, kind, LOWPASS_HZ, ORDER)
    }

    /// The same chain with another low-pass.
    pub(crate) fn with_lowpass(
        rate_hz: f64,
        channels: usize,
        kind: Kind,
        cutoff_hz: f64,
        order: usize,
    ) -> Result<Self, EmgError> {
        let mut chain = Self::filter_only(rate_hz, channels, &Sos::lowpass(rate_hz, cutoff_hz, order)?)?;
        if kind == Kind::Raw {
            chain.offset = Some(BiquadBank::new(&Sos::highpass(rate_hz, OFFSET_HZ, ORDER)?, channels));
        }
        Ok(chain)
    }

    pub(crate) fn filter_only(rate_hz: f64, channels: usize, sos: &Sos) -> Result<Self, EmgError> {
        check_channels(channels)?;
        let guard = Guard::new(channels, patience(rate_hz));
        let rows_at_a_time = (VALUES / channels).max(FEWEST_ROWS);
        let buffer = vec![0.0; channels * rows_at_a_time + MARGIN];
        let (held, swing, filtered) = (buffer.clone(), buffer.clone(), buffer);
        let lowpass = LongBank::new(sos, channels);
        Ok(Self { guard, offset: None, lowpass, channels, rows_at_a_time, held, swing, filtered })
    }

    pub(crate) fn channels(&self) -> usize {
        self.channels
    }

    pub(crate) fn guard(&self) -> &Guard {
        &self.guard
    }

    pub(crate) fn guard_mut(&mut self) -> &mut Guard {
        &mut self.guard
    }

    /// Filter the first rows of `samples`, at most `limit`, and return them; at least one if there is one.
    pub(crate) fn advance(&mut self, samples: &[f64], limit: usize) -> &[f64] {
        let there = (samples.len() / self.channels).min(limit);
        let most = match self.lowpass.stretch() {
            Some([least, most]) if there >= least => most,
            _ => self.rows_at_a_time,
        };
        let offered = there.min(most) * self.channels;
        let mut rows = self.guard.take(&samples[..offered], &mut self.held);
        for channel in self.guard.restarts() {
            let mut level = rows[channel];
            if let Some(offset) = &mut self.offset {
                level = offset.settle(channel, level).abs();
            }
            self.lowpass.settle(channel, level);
        }
        let needed = (rows.len() + MARGIN).max(self.filtered.len());
        if let Some(offset) = &mut self.offset {
            self.swing.resize(needed, 0.0);
            offset.process(rows, &mut self.swing);
            let swing = &mut self.swing[..rows.len()];
            for x in &mut *swing {
                *x = x.abs();
            }
            rows = swing;
        }
        self.filtered.resize(needed, 0.0);
        self.lowpass.process(rows, &mut self.filtered);
        &self.filtered[..rows.len()]
    }
}

/// Refuse a slice that is not a whole number of rows.
pub(crate) fn check_rows(samples: &[f64], channels: usize) -> Result<(), EmgError> {
    if samples.len().is_multiple_of(channels) {
        Ok(())
    } else {
        Err(EmgError::Ragged { len: samples.len(), channels })
    }
}

pub(crate) fn check_channels(channels: usize) -> Result<(), EmgError> {
    if (1..=1024).contains(&channels) {
        return Ok(());
    }
    Err(OutOfRange::new("channels", channels as f64, "", "1 to 1024").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mid_rail_counts_are_quiet_from_the_first_sample() -> Result<(), EmgError> {
        for rate_hz in [200.0, 1000.0, 1e6] {
            let mut chain = Chain::new(rate_hz, 2, Kind::Raw)?;
            let out = chain.advance(&[2048.0, 512.0].repeat(50), usize::MAX);
            assert!(out.len() == 100 && out.iter().all(|y| y.abs() < 1e-3), "{rate_hz}");
        }
        Ok(())
    }

    #[test]
    fn a_hundred_milliseconds_is_rounded_up_to_whole_samples() {
        assert_eq!([200.0, 250.0, 1000.0, 3.0].map(patience), [20, 25, 100, 1]);
    }
}
