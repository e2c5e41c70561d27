//! A channel's maximum from a recorded strong contraction.

use crate::block_mean::BlockSum;
use crate::chain::{Chain, Kind, check_rows};
use crate::error::EmgError;
use crate::intent::check_maximum;
use tega_error::OutOfRange;

/// The `percentile` (0 to 100, linear between ranks) of each channel's block means, through the chain of Eq 10.
///
/// `samples` are rows, one column a channel. The printed law takes the 100th percentile; the 95th does not hang on
/// one block.
///
/// # Errors
/// As for [`GraspIntent::new`](crate::GraspIntent::new), and [`EmgError::OutOfRange`] for the percentile,
/// [`EmgError::Ragged`], [`EmgError::BadCalibrationSample`] and [`EmgError::CalibrationTooShort`] for the samples.
///
/// # Examples
/// ```
/// let maxima = tega_emg::channel_maxima(&[0.5; 400], 2, 200.0, 20, tega_emg::Kind::Envelope, 95.0)?;
/// assert!(maxima.iter().all(|m| (m - 0.5).abs() < 1e-12));
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
pub fn channel_maxima(
    samples: &[f64],
    channels: usize,
    rate_hz: f64,
    tau: usize,
    kind: Kind,
    percentile: f64,
) -> Result<Vec<f64>, EmgError> {
    if !(0.0..=100.0).contains(&percentile) {
        let (name, unit, wanted) = ("percentile", "%", "0 to 100");
        return Err(OutOfRange::new(name, percentile, unit, wanted).into());
    }
    let mut chain = Chain::new(rate_hz, channels, kind)?;
    let mut sum = BlockSum::new(tau, channels)?;
    check_rows(samples, channels)?;
    if let Some(index) = samples.iter().position(|x| !x.is_finite()) {
        let (row, channel) = (index / channels, index % channels + 1);
        return Err(EmgError::BadCalibrationSample { row, channel, value: samples[index] });
    }
    if samples.len() / channels < tau {
        return Err(EmgError::CalibrationTooShort { samples: samples.len() / channels, tau });
    }
    let (mut means, mut rest) = (Vec::with_capacity(sum.completed_by(samples.len())), samples);
    while !rest.is_empty() {
        let rows = chain.advance(rest, sum.missing());
        sum.add(rows);
        rest = &rest[rows.len()..];
        sum.finish(&mut means);
    }
    (0..channels)
        .map(|channel| {
            let mut column: Vec<f64> = means.iter().skip(channel).step_by(channels).copied().collect();
            column.sort_unstable_by(f64::total_cmp);
            let maximum = quantile(&column, percentile / 100.0);
            check_maximum(channel, maximum).map(|()| maximum)
        })
        .collect()
}

/// Linear interpolation between the two ranks around `share` of the way up.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * sorted.len().saturating_sub(1) as f64;
    let below = (place as usize).min(sorted.len().saturating_sub(1));
    let above = (below + 1).min(sorted.len().saturating_sub(1));
    let (low, high, t) = (sorted[below], sorted[above], place - below as f64);
    low + (high - low) * t
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Exact values are meant.
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_ranks() {
        let sorted = [1.0, 2.0, 4.0];
        for (share, wanted) in [(0.0, 1.0), (0.25, 1.5), (0.5, 2.0), (0.75, 3.0), (1.0, 4.0)] {
            assert_eq!(quantile(&sorted, share), wanted);
        }
        assert_eq!(quantile(&[7.0], 0.95), 7.0);
    }

    #[test]
    fn useless_recordings_are_named() {
        let maxima =
            |samples: &[f64], percentile| channel_maxima(samples, 2, 200.0, 20, Kind::Raw, percentile);
        assert!(matches!(maxima(&[1.0; 400], 95.0), Err(EmgError::UnusableMaximum { channel: 1, .. })));
        assert!(matches!(
            maxima(&[1.0; 38], 95.0),
            Err(EmgError::CalibrationTooShort { samples: 19, tau: 20 })
        ));
        assert!(matches!(maxima(&[1.0; 401], 95.0), Err(EmgError::Ragged { .. })));
        assert!(maxima(&[1.0; 400], 101.0).is_err_and(|error| error.to_string().starts_with("percentile")));
        let mut gap = [1.0; 400];
        gap[7] = f64::NAN;
        assert!(matches!(maxima(&gap, 95.0), Err(EmgError::BadCalibrationSample { row: 3, channel: 2, .. })));
    }
}
