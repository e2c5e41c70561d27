//! What can be wrong with an indenter.

use tega_error::{Brief, OutOfRange};
use thiserror::Error;

/// Why an indenter or a buffer is refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum GelError {
    /// A number is not finite or out of its range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// The rotation of a pose is not orthonormal.
    #[error("the rotation of indenter {index} is no rotation: its columns are off by {error:.3}")]
    Rotation {
        /// Of which indenter, from 0.
        index: usize,
        /// Largest deviation of its columns' products from those of unit vectors.
        error: f64,
    },
    /// There are more indenters than the gel has room for.
    #[error("{got} indenters, wanted at most {limit}")]
    TooMany {
        /// How many there are.
        got: usize,
        /// How many there may be.
        limit: usize,
    },
    /// The picture's buffer has another size.
    #[error("the picture has {got} bytes, wanted {wanted}")]
    Picture {
        /// What it has.
        got: usize,
        /// What is needed.
        wanted: usize,
    },
    /// A gel with memory is asked for a moment that is past.
    #[error("t_s = {}, after a press at {} s", Brief(*t_s), Brief(*last_s))]
    Time {
        /// The moment.
        t_s: f64,
        /// Of the latest press.
        last_s: f64,
    },
}

impl GelError {
    /// What to do about it.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::OutOfRange(OutOfRange { name: "spread", .. }) => {
                "0 is the fitted sensor, 1 spreads units as sensors differ"
            }
            Self::OutOfRange(_) => "sizes and poses are in millimetres, forces in newtons",
            Self::Rotation { .. } => {
                "the first three columns of pose_mm are the shape's axes in the pad frame"
            }
            Self::TooMany { .. } => "pass the strongest contacts only",
            Self::Picture { .. } => "make it with numpy.empty((320, 240, 3), numpy.uint8)",
            Self::Time { .. } => {
                "a gel with memory sees frames in the order of their times; forget() starts again"
            }
        }
    }
}
