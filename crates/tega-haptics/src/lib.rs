//! `tega-haptics`.
#![forbid(unsafe_code)]

mod error;

pub use error::HapticsError;
