//! Bindings of the shear reader.

use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use tega_error::choice;
use tega_tactile::{ShearOptions, Sheared};

use crate::arguments::image;
use crate::errors::BindError;
use crate::shared::{Shared, released};
use crate::tactile::ORDERS;
use crate::touch::{TRACKED_PX, TouchTracker};

/// Length, direction, share that slid, speed, correlation.
type Read = (f64, f64, f64, f64, f64);

/// Reads the shear of one fingertip.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct ShearReader(Shared<tega_tactile::ShearReader>);

#[pymethods]
impl ShearReader {
    #[new]
    #[pyo3(signature = (baseline, /, *, mm_per_px, order))]
    fn new(
        py: Python<'_>,
        baseline: &Bound<'_, PyAny>,
        mm_per_px: f64,
        order: &str,
    ) -> Result<Self, BindError> {
        let image = image("baseline", baseline)?;
        let view = image.as_array();
        let options = ShearOptions { order: choice("order", order, &ORDERS)?, mm_per_px };
        Ok(Self(Shared::new(released(py, true, || tega_tactile::ShearReader::new(view, options))?)))
    }

    #[pyo3(signature = (frame, tracker, /, *, dt_s))]
    fn update(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        tracker: &TouchTracker,
        dt_s: f64,
    ) -> Result<Read, BindError> {
        let frame = image("frame", frame)?;
        let view = frame.as_array();
        let depth = tracker.tracker.with(|tracker| tracker.depth_map().0);
        let update = || self.0.with(|reader| reader.update(view, &depth, dt_s));
        let Sheared { shear_mm, direction_rad, incipient, slip_mm_s, sure } =
            released(py, view.len() > 3 * TRACKED_PX, update)?;
        Ok((shear_mm, direction_rad, incipient, slip_mm_s, sure))
    }

    fn flow<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyArray3<f32>>, BindError> {
        let (flow, [rows, cols]) = self.0.with(|reader| reader.flow());
        Ok(flow.into_flattened().into_pyarray(py).reshape([rows, cols, 2])?)
    }
}
