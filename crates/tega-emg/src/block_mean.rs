//! Eq 10: the mean of every τ samples.

use crate::chain::{check_channels, check_rows};
use crate::error::EmgError;
use crate::guard::Guard;
use crate::lanes::{LANES, LaneRows, Lanes};
use tega_error::OutOfRange;

/// Most samples in a block.
pub const MAX_TAU: usize = 10_000_000;

/// Running sums of one block; each holds its rounding error beside it, so that the mean is right to the last digit.
#[derive(Debug, Clone)]
pub(crate) struct BlockSum {
    tau: usize,
    rows: usize,
    channels: usize,
    /// Sum and what rounding took from it, by groups of channels.
    sums: Vec<[Lanes; 2]>,
}

impl BlockSum {
    pub(crate) fn new(tau: usize, channels: usize) -> Result<Self, EmgError> {
        check_tau(tau)?;
        check_channels(channels)?;
        Ok(Self { tau, rows: 0, channels, sums: vec![[Lanes::ZERO; 2]; channels.div_ceil(LANES)] })
    }

    /// Rows still missing from the present block.
    pub(crate) fn missing(&self) -> usize {
        self.tau - self.rows
    }

    /// Blocks that so many more rows complete.
    pub(crate) fn completed_by(&self, rows: usize) -> usize {
        (self.rows + rows) / self.tau
    }

    /// Add rows, no more than are missing.
    pub(crate) fn add(&mut self, rows: &[f64]) {
        for (index, sums) in self.sums.iter_mut().enumerate() {
            let [mut sum, mut lost] = *sums;
            for x in LaneRows::new(rows, self.channels, index * LANES) {
                let total = sum + x;
                let added = total - sum;
                lost = lost + ((sum - (total - added)) + (x - added));
                sum = total;
            }
            *sums = [sum, lost];
        }
        self.rows += rows.len() / self.channels;
    }

    /// Append the means if the block is complete, and begin the next block.
    pub(crate) fn finish(&mut self, out: &mut Vec<f64>) -> bool {
        if self.missing() > 0 {
            return false;
        }
        let tau = self.tau as f64;
        let lanes = self.sums.iter().flat_map(|[sum, lost]| sum.0.iter().zip(&lost.0));
        out.extend(lanes.take(self.channels).map(|(sum, lost)| (sum + lost) / tau));
        self.sums.fill([Lanes::ZERO; 2]);
        self.rows = 0;
        true
    }
}

pub(crate) fn check_tau(tau: usize) -> Result<(), EmgError> {
    if (1..=MAX_TAU).contains(&tau) {
        return Ok(());
    }
    let (name, unit, wanted) = ("tau", "samples", "1 to 10000000");
    Err(OutOfRange::new(name, tau as f64, unit, wanted).into())
}

/// The mean of every τ samples of each channel; samples left over wait for the next call.
///
/// A sample that is not finite, or larger than [`LARGEST_SAMPLE`](crate::LARGEST_SAMPLE), is replaced by the
/// channel's last good one (0 before the first) and counted.
///
/// # Examples
/// ```
/// let mut blocks = tega_emg::BlockMean::new(2, 1)?;
/// let mut out = Vec::new();
/// blocks.process(&[1.0, 3.0, 5.0], &mut out)?;
/// assert_eq!(out, [2.0]);
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
#[derive(Debug, Clone)]
pub struct BlockMean {
    guard: Guard,
    sum: BlockSum,
    held: Vec<f64>,
    channels: usize,
}

impl BlockMean {
    /// Average every `tau` samples of `channels` channels.
    ///
    /// # Errors
    /// [`EmgError::OutOfRange`] unless tau is 1 to [`MAX_TAU`] and there are 1 to 1024 channels.
    pub fn new(tau: usize, channels: usize) -> Result<Self, EmgError> {
        let sum = BlockSum::new(tau, channels)?;
        Ok(Self { guard: Guard::new(channels, usize::MAX), sum, held: vec![0.0; 64 * channels], channels })
    }

    /// Take rows of samples, one column a channel, and append one row of means for every block completed.
    ///
    /// # Errors
    /// [`EmgError::Ragged`] if `samples` is not a whole number of rows.
    pub fn process(&mut self, mut samples: &[f64], out: &mut Vec<f64>) -> Result<(), EmgError> {
        check_rows(samples, self.channels)?;
        out.reserve(self.sum.completed_by(samples.len() / self.channels) * self.channels);
        while !samples.is_empty() {
            let offered = samples.len().min(self.held.len()).min(self.sum.missing() * self.channels);
            let rows = self.guard.take(&samples[..offered], &mut self.held);
            self.sum.add(rows);
            self.sum.finish(out);
            samples = &samples[rows.len()..];
        }
        Ok(())
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Samples replaced so far, by channel.
    pub fn held_samples(&self) -> Vec<u64> {
        self.guard.held()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remainder_waits_for_the_next_call() -> Result<(), EmgError> {
        let mut blocks = BlockMean::new(3, 2)?;
        let mut out = Vec::new();
        blocks.process(&[1.0, 10.0, 2.0, 20.0], &mut out)?;
        assert!(out.is_empty());
        blocks.process(&[3.0, 30.0, 4.0, 40.0], &mut out)?;
        assert_eq!(out, [2.0, 20.0]);
        Ok(())
    }

    #[test]
    fn cancellation_costs_no_digit() -> Result<(), EmgError> {
        let mut out = Vec::new();
        BlockMean::new(4, 1)?.process(&[1e16, 1.0, -1e16, 2.0], &mut out)?;
        assert_eq!(out, [0.75]);
        Ok(())
    }

    #[test]
    fn a_bad_sample_repeats_the_last_good_one() -> Result<(), EmgError> {
        let (mut blocks, mut out) = (BlockMean::new(4, 1)?, Vec::new());
        blocks.process(&[f64::NAN, 2.0, f64::INFINITY, f64::NEG_INFINITY], &mut out)?;
        assert_eq!((out, blocks.held_samples()), (vec![1.5], vec![3]));
        Ok(())
    }

    #[test]
    fn impossible_blocks_are_named() {
        for (tau, channels, name) in [(0, 1, "tau"), (MAX_TAU + 1, 1, "tau"), (1, 0, "channels")] {
            let got = BlockMean::new(tau, channels);
            assert!(got.is_err_and(|error| error.to_string().starts_with(name)), "{name}");
        }
    }
}
