//! What a simulated trial does every 3 or 10 ms, where a call of each array operation would take longer than the work.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::arguments::Whole;
use crate::errors::{BindError, InvalidValueError, ShapeError};

/// Writes torques, each cut to its limit, and returns whether all are finite; where one is not, nothing is written.
#[pyfunction]
#[pyo3(signature = (torques, limits, out, /))]
pub(crate) fn limit_torques(
    torques: PyReadonlyArray1<'_, f64>,
    limits: PyReadonlyArray1<'_, f64>,
    out: &Bound<'_, PyArray1<f64>>,
) -> Result<bool, BindError> {
    let mut lent = out
        .try_readwrite()
        .map_err(|e| InvalidValueError::new_err((format!("out cannot be written: {e}"), "")))?;
    let (torques, limits, mut out) = (torques.as_array(), limits.as_array(), lent.as_array_mut());
    if torques.len() != out.len() || limits.len() != out.len() {
        let (torques, limits, out) = (torques.len(), limits.len(), out.len());
        let message = format!("{torques} torques and {limits} limits for {out} joints");
        return Err(ShapeError::new_err((message, "")).into());
    }
    if !torques.iter().all(|torque| torque.is_finite()) {
        return Ok(false);
    }
    for ((out, torque), limit) in out.iter_mut().zip(torques).zip(limits) {
        *out = torque.max(-limit).min(*limit);
    }
    Ok(true)
}

/// Adds up what electrodes show, from one sample to another: their own noise and each muscle's activity times its amplitude.
#[pyfunction]
#[pyo3(signature = (sensor, sources, scales, first, end, /))]
pub(crate) fn mix_muscles<'py>(
    py: Python<'py>,
    sensor: PyReadonlyArray2<'py, f64>,
    sources: [PyReadonlyArray2<'py, f64>; 3],
    scales: [f64; 3],
    first: Whole,
    end: Whole,
) -> Result<Bound<'py, PyArray2<f64>>, BindError> {
    let (first, end): (usize, usize) = (first.to("first", "0 or more")?, end.to("end", "0 or more")?);
    let channels = sensor.as_array().ncols();
    let (from, to) = (first.saturating_mul(channels), end.saturating_mul(channels));
    let part = |of: &PyReadonlyArray2<'py, f64>| {
        let rows = of.as_slice().ok().filter(|_| of.as_array().ncols() == channels);
        let rows = rows.and_then(|rows| rows.get(from..to)).map(<[f64]>::to_vec);
        rows.ok_or_else(|| ShapeError::new_err(("samples are missing, or have gaps or other channels", "")))
    };
    let mut signal = part(&sensor)?;
    for (source, scale) in sources.iter().zip(scales) {
        let seen = part(source)?;
        signal.iter_mut().zip(seen).for_each(|(signal, seen)| *signal += seen * scale);
    }
    Ok(signal.into_pyarray(py).reshape([end - first, channels])?)
}
