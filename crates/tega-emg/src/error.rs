//! What can be wrong with the input.

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EmgError {
    /// A number is out of its range or not finite.
    #[error("{name} = {}{} is out of range: {wanted}", brief(*value), spaced(unit))]
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
        "cutoff_hz = {} Hz cannot be filtered at rate_hz = {} Hz: it must lie between {} and {} Hz",
        brief(*cutoff_hz), brief(*rate_hz), brief(*low_hz), brief(*high_hz)
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
    #[error("calibration sample {row} of channel {channel} (counted from 1) is {}, not a finite number", brief(*value))]
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
    #[error("maximum of channel {channel} (counted from 1) is {}: it must be finite and greater than 0", brief(*value))]
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
            Self::OutOfRange { .. } | Self::UnknownChoice { .. } | Self::Ragged { .. } | Self::NoLevels => "",
        }
    }
}

/// A unit set off from its number.
fn spaced(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(" {unit}") }
}

/// A number as it is written by hand: a very large or very small one with an exponent, not with 300 digits.
fn brief(value: f64) -> String {
    if value == 0.0 || (1e-5..1e16).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod brief_numbers {
    use super::*;

    #[test]
    fn are_short() {
        let shown = [0.0, 3.0, -0.25, 1e300, f64::MAX, -5e-324, f64::NAN, f64::INFINITY].map(brief);
        let wanted = ["0", "3", "-0.25", "1e300", "1.7976931348623157e308", "-5e-324", "NaN", "inf"];
        assert_eq!(shown, wanted);
    }
}
