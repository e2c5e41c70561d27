//! Bindings of `tega-wire`.

use tega_error::OutOfRange;

mod allegro;
mod streams;
mod vest;

use pyo3::prelude::*;
use tega_wire::WireError;

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    allegro::register(m)?;
    vest::register(m)?;
    streams::register(m)
}

/// A number of Python's as one of the wire's, or the error that names it.
fn narrow<T: TryFrom<i64>>(name: &'static str, value: i64, wanted: &'static str) -> Result<T, WireError> {
    T::try_from(value)
        .map_err(|_| WireError::OutOfRange(OutOfRange { name, value: value as f64, unit: "", wanted }))
}

/// A decoder's setting likewise.
fn setting<T: TryFrom<i64>>(name: &'static str, value: i64, wanted: &'static str) -> Result<T, WireError> {
    T::try_from(value).map_err(|_| WireError::Setting { name, value: value as f64, wanted })
}
