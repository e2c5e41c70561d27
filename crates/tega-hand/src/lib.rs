//! `tega-hand`.
#![forbid(unsafe_code)]

mod error;

pub use error::HandError;
