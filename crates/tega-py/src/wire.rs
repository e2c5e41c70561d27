//! Bindings of `tega-wire`.

use tega_error::OutOfRange;

pub(crate) mod allegro;
pub(crate) mod streams;
pub(crate) mod vest;

use tega_wire::WireError;

/// A number of Python's as one of the wire's, or the error that names it.
fn narrow<T: TryFrom<i64>>(name: &'static str, value: i64, wanted: &'static str) -> Result<T, WireError> {
    T::try_from(value).map_err(|_| OutOfRange::new(name, value as f64, "", wanted).into())
}

/// A decoder's setting likewise.
fn setting<T: TryFrom<i64>>(name: &'static str, value: i64, wanted: &'static str) -> Result<T, WireError> {
    T::try_from(value).map_err(|_| WireError::Setting(OutOfRange::new(name, value as f64, "", wanted)))
}
