//! Contact metrics to vest intensities (Eq 7 to 9 and the column layout of the two torso arrays).
//!
//! A finger's CCI and EDA, each divided by that finger's calibrated maximum, go through a logistic law
//! ([`intensity`], Eq 7 to 9) to a motor intensity in percent. [`vest_frame`] writes four of them into the columns of
//! the front (CCI) and four into the columns of the back (EDA); column 0 is at the wearer's left on both faces.
//! [`contact_type`] puts the paper's reading rule of the two numbers into a word.
//!
//! ```
//! use tega_haptics::{DEFAULT_END_VALUE, Layout, Mirror, intensity, vest_frame};
//!
//! let thumb = intensity(0.03, 0.04, DEFAULT_END_VALUE)?;
//! assert!((thumb - 90.87).abs() < 0.01);
//! let frame = vest_frame([thumb, 0.0, 0.0, 0.0], [20.0, 0.0, 0.0, 0.0], Layout::Paper32, Mirror::None)?;
//! assert_eq!(frame.intensities()[..8], [91, 0, 0, 0, 91, 0, 0, 0]);
//! # Ok::<(), tega_haptics::HapticsError>(())
//! ```
#![forbid(unsafe_code)]

mod contact_type;
mod error;
mod layout;
mod sigmoid;

pub use contact_type::{ContactType, HIGH_SHARE, contact_type};
pub use error::HapticsError;
pub use layout::{FINGERS, Layout, Mirror, VestFrame, vest_frame, whole_percents};
pub use sigmoid::{DEFAULT_END_VALUE, intensity, linear_intensity};
