//! What can be wrong with the input.

use tega_error::{Brief, OutOfRange};

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HandError {
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A closure level is not one of the five.
    #[error("level = {} is out of range: 1 (open) to 5 (tight)", Brief(*value))]
    Level {
        /// The value given.
        value: f64,
    },
    /// One joint's number is out of its range or not finite.
    #[error("{name} of {joint} = {} {unit} is out of range: {} to {}", Brief(*value), Brief(*low), Brief(*high))]
    Joint {
        /// The argument.
        name: &'static str,
        /// The joint, see [`crate::JOINT_NAMES`].
        joint: &'static str,
        /// The value given.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Smallest value accepted.
        low: f64,
        /// Largest value accepted.
        high: f64,
    },
    /// A joint angle of a closure pose is out of its range or not finite.
    #[error("pose {pose}: {joint} = {} rad is out of range: {} to {}", Brief(*value), Brief(*low), Brief(*high))]
    Pose {
        /// Closure level, 1 to 5.
        pose: usize,
        /// The joint, see [`crate::JOINT_NAMES`].
        joint: &'static str,
        /// The value given.
        value: f64,
        /// Smallest angle accepted.
        low: f64,
        /// Largest angle accepted.
        high: f64,
    },
    /// A list has another length than the hand needs.
    #[error("{name} has {got} numbers, not {wanted}")]
    Count {
        /// The argument.
        name: &'static str,
        /// Numbers given.
        got: usize,
        /// Numbers needed.
        wanted: usize,
    },
}

impl HandError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Joint { name: "angles_rad", .. } => {
                "send zero torque and check the position frames; nothing is commanded from such a reading"
            }
            Self::Pose { .. } => "poses keep 0.04 rad from the joint limits; see JOINT_LIMITS_RAD",
            Self::Count { .. } => {
                "joints are in the order of JOINT_NAMES: index, middle, ring, thumb, four each"
            }
            Self::OutOfRange(_) | Self::Level { .. } | Self::Joint { .. } => "",
        }
    }
}
