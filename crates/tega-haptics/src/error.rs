//! What can be wrong with the input.

use tega_error::OutOfRange;

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HapticsError {
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
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
}

impl HapticsError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::OutOfRange(OutOfRange { name: "maximum", .. }) => {
                "calibrate the sensor with guided presses: its maximum is the largest value they reach"
            }
            Self::OutOfRange(OutOfRange { name: "front intensity" | "back intensity", .. }) => {
                "send 0 for a finger without contact; check the metric that gave this value"
            }
            Self::OutOfRange(_) | Self::MotorCount { .. } => "",
        }
    }
}
