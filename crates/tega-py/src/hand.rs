//! Bindings of `tega-hand`.
#![allow(clippy::needless_pass_by_value, reason = "arguments arrive from Python as owned borrows")]

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tega_hand::{Asked, Gains, HandError, Joints, LEVELS, PoseSet};
use tega_wire::allegro::{self, Scale};

use crate::arguments::Whole;
use crate::errors::{BindError, InvalidValueError};
use crate::shared::{Shared, released};
use crate::wire::allegro::device;

type Vector<'py> = Bound<'py, PyArray1<f64>>;

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct HandController(pub(crate) Shared<tega_hand::HandController>);

#[pymethods]
impl HandController {
    #[new]
    #[pyo3(signature = (*, poses_rad, kp, kd, error_limit_rad, torque_limits, level_factors, slew_per_tick))]
    fn new(
        poses_rad: PyReadonlyArray2<'_, f64>,
        kp: PyReadonlyArray1<'_, f64>,
        kd: PyReadonlyArray1<'_, f64>,
        error_limit_rad: f64,
        torque_limits: PyReadonlyArray1<'_, f64>,
        level_factors: PyReadonlyArray1<'_, f64>,
        slew_per_tick: f64,
    ) -> Result<Self, BindError> {
        let gains = Gains {
            kp: numbers("kp", kp)?,
            kd: numbers("kd", kd)?,
            error_limit_rad,
            torque_limits: numbers("torque_limits", torque_limits)?,
            level_factors: numbers("level_factors", level_factors)?,
            slew_per_tick,
        };
        Ok(Self(Shared::new(tega_hand::HandController::new(PoseSet::new(poses(poses_rad)?)?, gains)?)))
    }

    #[pyo3(signature = (angles_rad, level, added, /, *, velocities_rad_s, out))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        angles_rad: PyReadonlyArray1<'py, f64>,
        level: f64,
        added: f64,
        velocities_rad_s: Option<PyReadonlyArray1<'py, f64>>,
        out: Option<Vector<'py>>,
    ) -> Result<Vector<'py>, BindError> {
        let angles_rad = numbers("angles_rad", angles_rad)?;
        let velocities = velocities_rad_s.map(|v| numbers("velocities_rad_s", v)).transpose()?;
        let step = || self.0.with(|core| core.step(&angles_rad, Asked { level, added }, velocities.as_ref()));
        let Some(out) = out else {
            return Ok(PyArray1::from_slice(py, &step()?));
        };
        let mut lent = borrow_out(&out)?;
        let torques = step()?;
        lent.as_array_mut().iter_mut().zip(torques).for_each(|(out, torque)| *out = torque);
        drop(lent);
        Ok(out)
    }

    /// Angles as a version 4 hand's encoders show them, torques as its messages carry them.
    #[pyo3(signature = (angles_rad, level, added, /, *, device_id))]
    fn step_encoded<'py>(
        &self,
        py: Python<'py>,
        angles_rad: PyReadonlyArray1<'py, f64>,
        level: f64,
        added: f64,
        device_id: Whole,
    ) -> Result<Vec<(u16, Bound<'py, PyBytes>, bool)>, BindError> {
        let mut shown: Joints = numbers("angles_rad", angles_rad)?;
        for angle in &mut shown {
            *angle = allegro::angle_rad(allegro::angle_counts(*angle, Scale::V4)?, Scale::V4);
        }
        let torques = self.0.with(|core| core.step(&shown, Asked { level, added }, None))?;
        let frames = allegro::torque_frames(&torques, device(device_id)?, Scale::V4)?;
        Ok(frames
            .iter()
            .map(|frame| (frame.id(), PyBytes::new(py, frame.data()), frame.is_remote()))
            .collect())
    }

    #[pyo3(signature = (angles_rad, /))]
    fn reset(&self, angles_rad: PyReadonlyArray1<'_, f64>) -> Result<(), BindError> {
        let angles_rad = numbers("angles_rad", angles_rad)?;
        Ok(self.0.with(|core| core.reset(&angles_rad))?)
    }

    #[getter]
    fn target_rad<'py>(&self, py: Python<'py>) -> Option<Vector<'py>> {
        self.0.with(|core| core.target_rad()).map(|target| PyArray1::from_slice(py, &target))
    }

    #[getter]
    fn level(&self) -> Option<f64> {
        self.0.with(|core| core.level())
    }
}

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct JointModel(Shared<tega_hand::JointModel>);

#[pymethods]
impl JointModel {
    #[new]
    #[pyo3(signature = (angles_rad, /, *, full_duty_speed_rad_s, time_constant_s))]
    fn new(
        angles_rad: PyReadonlyArray1<'_, f64>,
        full_duty_speed_rad_s: f64,
        time_constant_s: f64,
    ) -> Result<Self, BindError> {
        let angles_rad = numbers("angles_rad", angles_rad)?;
        let model = tega_hand::JointModel::new(&angles_rad, full_duty_speed_rad_s, time_constant_s)?;
        Ok(Self(Shared::new(model)))
    }

    #[pyo3(signature = (torques, /))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        torques: PyReadonlyArray1<'py, f64>,
    ) -> Result<Vector<'py>, BindError> {
        let torques = numbers("torques", torques)?;
        let angles_rad = self.0.with(|core| core.step(&torques))?;
        Ok(PyArray1::from_slice(py, &angles_rad))
    }

    #[getter]
    fn angles_rad<'py>(&self, py: Python<'py>) -> Vector<'py> {
        PyArray1::from_slice(py, &self.0.with(|core| *core.angles_rad()))
    }

    #[getter]
    fn velocities_rad_s<'py>(&self, py: Python<'py>) -> Vector<'py> {
        PyArray1::from_slice(py, &self.0.with(|core| *core.velocities_rad_s()))
    }
}

#[pyfunction]
#[pyo3(signature = (controller, model, level, added, /))]
pub(crate) fn step_modelled<'py>(
    py: Python<'py>,
    controller: PyRef<'py, HandController>,
    model: PyRef<'py, JointModel>,
    level: f64,
    added: f64,
) -> Result<(Vector<'py>, Vector<'py>), BindError> {
    let (angles, torques) = model.0.with(|model| {
        let torques =
            controller.0.with(|core| core.step(model.angles_rad(), Asked { level, added }, None))?;
        Ok::<_, HandError>((model.step(&torques)?, torques))
    })?;
    Ok((PyArray1::from_slice(py, &angles), PyArray1::from_slice(py, &torques)))
}

/// A clock with nothing to do beside it, for others to be compared with.
#[pyfunction]
#[pyo3(signature = (period_ns, n_ticks, /))]
pub(crate) fn bare_clock(py: Python<'_>, period_ns: Whole, n_ticks: Whole) -> Result<Vec<u64>, BindError> {
    let (period_ns, n_ticks) =
        (period_ns.to("period_ns", "0 or more")?, n_ticks.to("n_ticks", "0 to 4294967295")?);
    Ok(released(py, true, || tega_hand::bare_clock(period_ns, n_ticks)))
}

/// Exactly `N` numbers of an array of any stride; its borrow ends here, so that `out` may be the same array.
fn numbers<const N: usize>(
    name: &'static str,
    array: PyReadonlyArray1<'_, f64>,
) -> Result<[f64; N], HandError> {
    let view = array.as_array();
    if view.len() != N {
        return Err(HandError::Count { name, got: view.len(), wanted: N });
    }
    let mut out = [0.0; N];
    out.iter_mut().zip(view).for_each(|(out, value)| *out = *value);
    Ok(out)
}

fn poses(array: PyReadonlyArray2<'_, f64>) -> Result<[Joints; LEVELS], HandError> {
    let view = array.as_array();
    let (wanted, got) = (LEVELS * tega_hand::JOINTS, view.len());
    if view.dim() != (LEVELS, tega_hand::JOINTS) {
        return Err(HandError::Count { name: "poses_rad", got, wanted });
    }
    let mut out = [[0.0; tega_hand::JOINTS]; LEVELS];
    out.as_flattened_mut().iter_mut().zip(view).for_each(|(out, value)| *out = *value);
    Ok(out)
}

fn borrow_out<'py>(out: &Vector<'py>) -> Result<PyReadwriteArray1<'py, f64>, BindError> {
    let lent = out
        .try_readwrite()
        .map_err(|e| InvalidValueError::new_err((format!("out cannot be written: {e}"), "")))?;
    match lent.as_array().len() {
        tega_hand::JOINTS => Ok(lent),
        got => Err(HandError::Count { name: "out", got, wanted: tega_hand::JOINTS }.into()),
    }
}
