//! `tega-tactile`.
#![forbid(unsafe_code)]

mod error;

pub use error::TactileError;
