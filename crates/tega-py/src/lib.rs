//! `tega._native`: the thin layer between Python and the core crates.
//!
//! Each function checks, borrows, detaches where that pays, calls one core function and converts the answer. There
//! is no arithmetic here, and the module is flat. Its types are written down in `python/tega/_native.pyi`.

mod arguments;
mod emg;
mod errors;
mod gel;
mod hand;
mod hand_link;
mod haptics;
mod image;
mod shared;
mod tactile;
mod touch;
mod wire;

use pyo3::prelude::*;

#[pyfunction]
fn instruction_set() -> &'static str {
    tega_simd::instruction_set()
}

#[pymodule(gil_used = false)]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_function(wrap_pyfunction!(instruction_set, m)?)?;
    tactile::register(m)?;
    touch::register(m)?;
    haptics::register(m)?;
    emg::register(m)?;
    hand::register(m)?;
    hand_link::register(m)?;
    gel::register(m)?;
    image::register(m)?;
    wire::register(m)?;
    // The stub lists the names; a second list would have to be kept equal by hand.
    m.delattr("__all__")
}
