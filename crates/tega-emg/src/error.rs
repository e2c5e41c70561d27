//! What can be wrong with the input.

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EmgError {
    /// A number is out of its range or not finite.
    #[error("{name} = {value}{} is out of range: {wanted}", spaced(unit))]
    OutOfRange {
        /// The argument.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Its unit, or empty.
        unit: &'static str,
        /// What would be accepted.
        wanted: &'static str,
    },
    /// No filter with this cutoff exists at this sample rate, or rounding alone would spoil it.
    #[error(
        "cutoff_hz = {cutoff_hz} Hz cannot be filtered at rate_hz = {rate_hz} Hz: it must lie between {low_hz} and {high_hz} Hz"
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
    /// An option is not one of those offered.
    #[error("{name} = {got:?} is not one of {wanted}")]
    UnknownChoice {
        /// The option.
        name: &'static str,
        /// The value given.
        got: String,
        /// What is offered.
        wanted: &'static str,
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
    #[error("calibration sample {row} of channel {channel} (counted from 1) is {value}, not a finite number")]
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
    #[error("maximum of channel {channel} (counted from 1) is {value}: it must be finite and greater than 0")]
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
            Self::Cutoff { .. } => "use a faster sample rate or another cutoff",
            Self::Channels { .. } => "pick the channels before the call, one column each",
            Self::BadCalibrationSample { .. } => {
                "cut the gap out of the recording or record the contraction again"
            }
            Self::CalibrationTooShort { .. } => "record a strong contraction of a few seconds",
            Self::UnusableMaximum { .. } => "check the electrode and the input kind, then calibrate again",
            Self::OutOfRange { .. } | Self::UnknownChoice { .. } | Self::Ragged { .. } | Self::NoLevels => "",
        }
    }
}

/// A unit set off from its number.
fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}
