//! What can be wrong with the input.

use tega_error::OutOfRange;

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HandError {
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
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
            Self::OutOfRange(OutOfRange { name: "angles_rad", .. }) => {
                "send zero torque and check the position frames; nothing is commanded from such a reading"
            }
            Self::OutOfRange(OutOfRange { name: "pose", .. }) => {
                "poses keep 0.04 rad from the joint limits; see JOINT_LIMITS_RAD"
            }
            Self::Count { .. } => {
                "joints are in the order of JOINT_NAMES: index, middle, ring, thumb, four each"
            }
            Self::OutOfRange(_) => "",
        }
    }
}
