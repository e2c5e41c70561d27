//! `tega-emg`.
#![forbid(unsafe_code)]

mod error;

pub use error::EmgError;
