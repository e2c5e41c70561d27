//! Bindings of `tega-haptics`.
#![allow(clippy::needless_pass_by_value, reason = "arguments arrive from Python as owned borrows")]

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use tega_haptics::{Layout, Mirror, VestFrame};

use crate::errors::BindError;

#[pyfunction]
#[pyo3(signature = (value, maximum, /, *, end_value))]
pub(crate) fn logistic_intensity(value: f64, maximum: f64, end_value: f64) -> Result<f64, BindError> {
    Ok(tega_haptics::intensity(value, maximum, end_value)?)
}

#[pyfunction]
#[pyo3(signature = (value, maximum, /))]
pub(crate) fn linear_intensity(value: f64, maximum: f64) -> Result<f64, BindError> {
    Ok(tega_haptics::linear_intensity(value, maximum)?)
}

#[pyfunction]
#[pyo3(signature = (cci_norm, eda_norm, /))]
pub(crate) fn contact_type(cci_norm: f64, eda_norm: f64) -> Result<&'static str, BindError> {
    Ok(tega_haptics::contact_type(cci_norm, eda_norm)?.name())
}

#[pyfunction]
#[pyo3(signature = (front, back, /, *, layout, mirror))]
pub(crate) fn vest_intensities<'py>(
    py: Python<'py>,
    front: (f64, f64, f64, f64),
    back: (f64, f64, f64, f64),
    layout: &str,
    mirror: &str,
) -> Result<Bound<'py, PyArray1<u8>>, BindError> {
    let (layout, mirror) = (Layout::from_name(layout)?, Mirror::from_name(mirror)?);
    let frame = tega_haptics::vest_frame(front.into(), back.into(), layout, mirror)?;
    Ok(frame.intensities().to_vec().into_pyarray(py))
}

#[pyfunction]
#[pyo3(signature = (levels, /))]
pub(crate) fn vest_percents<'py>(
    py: Python<'py>,
    levels: PyReadonlyArray1<'py, f64>,
) -> Result<Bound<'py, PyArray1<u8>>, BindError> {
    let percents = match levels.as_slice() {
        Ok(levels) => tega_haptics::whole_percents(levels)?,
        Err(_) => tega_haptics::whole_percents(&levels.as_array().to_vec())?,
    };
    Ok(percents.into_pyarray(py))
}

#[pyfunction]
#[pyo3(signature = (layout, /))]
pub(crate) fn layout_motors<'py>(
    py: Python<'py>,
    layout: &str,
) -> Result<Bound<'py, PyArray1<u8>>, BindError> {
    Ok(Layout::from_name(layout)?.motors().into_pyarray(py))
}

#[pyfunction]
#[pyo3(signature = (layout, intensities, /))]
pub(crate) fn vest_x40<'py>(
    py: Python<'py>,
    layout: &str,
    intensities: PyReadonlyArray1<'py, u8>,
) -> Result<Bound<'py, PyArray1<u8>>, BindError> {
    let frame = VestFrame::new(Layout::from_name(layout)?, intensities.as_array().to_vec())?;
    Ok(frame.x40().to_vec().into_pyarray(py))
}
