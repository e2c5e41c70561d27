//! Bindings of `tega-wire`.

pub(crate) mod allegro;
pub(crate) mod streams;
pub(crate) mod vest;

use tega_wire::WireError;

use crate::arguments::Whole;

/// A number of Python's as one of the wire's, or the error that names it.
fn narrow<T: TryFrom<i64> + TryFrom<u64>>(
    name: &'static str,
    value: Whole,
    wanted: &'static str,
) -> Result<T, WireError> {
    Ok(value.to(name, wanted)?)
}

/// A decoder's setting likewise.
fn setting<T: TryFrom<i64> + TryFrom<u64>>(
    name: &'static str,
    value: Whole,
    wanted: &'static str,
) -> Result<T, WireError> {
    value.to(name, wanted).map_err(WireError::Setting)
}
