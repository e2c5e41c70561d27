//! `tega-wire`.
#![forbid(unsafe_code)]

mod error;

pub use error::WireError;
