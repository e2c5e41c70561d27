//! Bindings of `tega-image`.

use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::errors::BindError;

#[pyfunction]
#[pyo3(signature = (file, /))]
fn decode_png<'py>(py: Python<'py>, file: &[u8]) -> Result<Option<Bound<'py, PyArray3<u8>>>, BindError> {
    let decoded = py.detach(|| tega_image::decode_png(file))?;
    Ok(match decoded {
        Some(image) => Some(image.bytes.into_pyarray(py).reshape((image.height, image.width, 3))?),
        None => None,
    })
}

pub(crate) fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(decode_png, m)?)
}
