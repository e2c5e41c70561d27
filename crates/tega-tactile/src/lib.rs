//! Touch: a fingertip camera's frame and its baseline to two numbers, CCI and EDA (equations 1 to 6).
//!
//! Frames are 8-bit colour images, borrowed as `ndarray` views of shape (height, width, 3). Sums are exact integers;
//! lengths are in pixels, grey values in counts of 0 to 255.
//!
//! ```
//! use ndarray::Array3;
//! use tega_tactile::{Options, Pair, Scratch, contact_metrics};
//!
//! let baseline = Array3::<u8>::from_elem((240, 320, 3), 90);
//! let frame = Array3::<u8>::from_elem((240, 320, 3), 100);
//! let metrics = contact_metrics(&Pair::new(frame.view(), baseline.view())?, &Options::default(), &mut Scratch::default());
//! assert_eq!(metrics.peak, 10.0);
//! # Ok::<(), tega_tactile::TactileError>(())
//! ```
#![deny(unsafe_code)] // allowed in `kernel` and in what `dispatched!` writes

mod bands;
mod baseline;
mod decimal;
mod error;
mod exact;
mod frame;
mod grey;
mod kernel;
mod live;
pub mod many;
mod metrics;
mod paper;
mod sums;
mod vote_lines;

pub use bands::{band_distances, picture_bands};
pub use baseline::{
    BaselineChoice, BaselineSource, BaselineSurvey, EstimatedBaseline, estimate_baseline, median_image,
};
pub use decimal::{Decimal, Weights};
pub use error::TactileError;
pub use frame::{Difference, MAX_SIDE, Order, Pair};
pub use grey::Scratch;
pub use live::{
    GelLight, LIGHT_TERMS, LiveReader, LiveScratch, Outline, SensorNoise, Touch, TouchTracker,
    TrackerOptions, read_live,
};
pub use metrics::{CentroidValue, ContactMetrics, Gate, Options, Spread, contact_metrics};
pub use paper::{MIN_PIXELS, NOISE_FLOOR, PaperScratch, read_paper};
pub use vote_lines::{VoteLines, vote_lines};
