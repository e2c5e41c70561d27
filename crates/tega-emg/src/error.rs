//! What can be wrong with the input.

use tega_error::{Brief, Computed, OutOfRange};

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EmgError {
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// No filter with this cutoff exists at this sample rate, or rounding alone would spoil it.
    #[error(
        "cutoff_hz = {} Hz cannot be filtered at rate_hz = {} Hz: it must lie between {} and {} Hz",
        Brief(*cutoff_hz), Brief(*rate_hz), Computed(*low_hz), Computed(*high_hz)
    )]
    Cutoff {
        /// The cutoff asked for.
        cutoff_hz: f64,
        /// The sample rate.
        rate_hz: f64,
        /// Smallest usable cutoff at this rate.
        low_hz: f64,
        /// Largest usable cutoff at this rate.
        high_hz: f64,
    },
    /// The samples have another number of channels than the object was made for.
    #[error("samples have {got} channels, expected {wanted}")]
    Channels {
        /// Channels given.
        got: usize,
        /// Channels expected.
        wanted: usize,
    },
    /// A flat slice of samples is not a whole number of rows.
    #[error("{len} values are not a whole number of rows of {channels} channels")]
    Ragged {
        /// Values given.
        len: usize,
        /// Channels in a row.
        channels: usize,
    },
    /// There is no level to fuse.
    #[error("levels is empty: nothing to fuse")]
    NoLevels,
    /// A calibration recording holds a sample that is not a finite number.
    #[error("calibration sample {row} of channel {channel} (counted from 1) is {}, not a finite number", Brief(*value))]
    BadCalibrationSample {
        /// Row of the sample, from 0.
        row: usize,
        /// Channel, from 1.
        channel: usize,
        /// The sample.
        value: f64,
    },
    /// A calibration recording is shorter than one block.
    #[error("calibration has {samples} samples, less than one block of tau = {tau} samples")]
    CalibrationTooShort {
        /// Samples given.
        samples: usize,
        /// Samples per block.
        tau: usize,
    },
    /// A channel maximum is zero, negative or not finite.
    #[error("maximum of channel {channel} (counted from 1) is {}: it must be finite and greater than 0", Brief(*value))]
    UnusableMaximum {
        /// Channel, from 1.
        channel: usize,
        /// Its maximum.
        value: f64,
    },
}

impl EmgError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Cutoff { .. } => "sample faster: the 50 Hz of the grasp chain needs 125 samples/s or more",
            Self::Channels { .. } => "pick the channels before the call, one column each",
            Self::BadCalibrationSample { .. } => {
                "cut the gap out of the recording or record the contraction again"
            }
            Self::CalibrationTooShort { .. } => "record a strong contraction of a few seconds",
            Self::UnusableMaximum { .. } => "check the electrode and the input kind, then calibrate again",
            Self::OutOfRange(_) | Self::Ragged { .. } | Self::NoLevels => "",
        }
    }
}
