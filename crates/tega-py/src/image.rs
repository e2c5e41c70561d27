//! Bindings of `tega-image`.

use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

use crate::errors::BindError;
use crate::shared::{KEEP_UP_TO, released};

#[pyfunction]
#[pyo3(signature = (file, /))]
pub(crate) fn decode_png<'py>(
    py: Python<'py>,
    file: &[u8],
) -> Result<Option<Bound<'py, PyArray3<u8>>>, BindError> {
    let decoded = released(py, file.len() > KEEP_UP_TO, || tega_image::decode_png(file))?;
    Ok(match decoded {
        Some(image) => Some(image.bytes.into_pyarray(py).reshape((image.height, image.width, 3))?),
        None => None,
    })
}
