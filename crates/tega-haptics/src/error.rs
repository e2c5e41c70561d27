//! What can be wrong with the input.

use tega_error::{Brief, OutOfRange};

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HapticsError {
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A finger's intensity is not a finite number.
    #[error("{face} intensity of the {finger} = {} percent is not a finite number", Brief(*value))]
    Intensity {
        /// `front` or `back`.
        face: &'static str,
        /// The finger, see [`crate::FINGERS`].
        finger: &'static str,
        /// The value given.
        value: f64,
    },
    /// A frame has another number of motors than its layout.
    #[error("intensities has {got} motors, layout {layout} has {wanted}")]
    MotorCount {
        /// Motors given.
        got: usize,
        /// Motors of the layout.
        wanted: usize,
        /// The layout's name.
        layout: &'static str,
    },
    /// A motor's intensity is above 100.
    #[error("intensities[{index}] = {value} percent is out of range: 0 to 100")]
    MotorIntensity {
        /// Position in the array.
        index: usize,
        /// The value given.
        value: u8,
    },
    /// A choice is not one of those offered.
    #[error("{name} = {value:?} is not known: choose {wanted}")]
    UnknownChoice {
        /// The argument.
        name: &'static str,
        /// The value given.
        value: String,
        /// The choices.
        wanted: &'static str,
    },
}

impl HapticsError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::OutOfRange(OutOfRange { name: "maximum", .. }) => {
                "calibrate the sensor with guided presses: its maximum is the largest value they reach"
            }
            Self::Intensity { .. } => {
                "send 0 for a finger without contact; check the metric that gave this value"
            }
            Self::OutOfRange(_)
            | Self::MotorCount { .. }
            | Self::MotorIntensity { .. }
            | Self::UnknownChoice { .. } => "",
        }
    }
}
