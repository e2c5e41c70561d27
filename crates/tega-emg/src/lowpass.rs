//! The streaming low-pass as an object of its own.

use crate::butterworth::Sos;
use crate::chain::{Chain, check_rows};
use crate::error::EmgError;

/// A causal Butterworth low-pass over several channels that keeps its state between calls.
///
/// Each channel starts settled on its first sample. A sample that is not finite, or larger than
/// [`LARGEST_SAMPLE`](crate::LARGEST_SAMPLE), is replaced by the channel's last good one and counted; after 100 ms
/// of them the channel starts afresh at its next good sample.
///
/// # Examples
/// ```
/// let mut filter = tega_emg::ButterworthLowpass::new(1000.0, 50.0, 4, 1)?;
/// let mut out = Vec::new();
/// filter.process(&[2.0, 2.0, 2.0], &mut out)?;
/// assert!(out.iter().all(|y| (y - 2.0).abs() < 1e-12));
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct ButterworthLowpass {
    sos: Sos,
    chain: Chain,
}

impl ButterworthLowpass {
    /// Design the filter for `channels` channels.
    ///
    /// # Errors
    /// As for [`Sos::lowpass`]; [`EmgError::OutOfRange`] unless there are 1 to 1024 channels.
    pub fn new(rate_hz: f64, cutoff_hz: f64, order: usize, channels: usize) -> Result<Self, EmgError> {
        let sos = Sos::lowpass(rate_hz, cutoff_hz, order)?;
        let chain = Chain::filter_only(rate_hz, channels, &sos)?;
        Ok(Self { sos, chain })
    }

    /// Filter rows of samples, one column a channel, and append as many rows to `out`.
    ///
    /// # Errors
    /// [`EmgError::Ragged`] if `samples` is not a whole number of rows.
    pub fn process(&mut self, mut samples: &[f64], out: &mut Vec<f64>) -> Result<(), EmgError> {
        check_rows(samples, self.chain.channels())?;
        out.reserve(samples.len());
        while !samples.is_empty() {
            let rows = self.chain.advance(samples, usize::MAX);
            out.extend_from_slice(rows);
            samples = &samples[rows.len()..];
        }
        Ok(())
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.chain.channels()
    }

    /// The designed sections.
    pub fn sos(&self) -> &Sos {
        &self.sos
    }

    /// Samples replaced so far, by channel.
    pub fn held_samples(&self) -> Vec<u64> {
        self.chain.guard().held()
    }
}
