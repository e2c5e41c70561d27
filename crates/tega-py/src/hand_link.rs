//! Binding of `tega_hand::HandLink`: frames cross as tuples.
#![allow(clippy::needless_pass_by_value, reason = "arguments arrive from Python as owned borrows")]

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBytes, PyDict};
use tega_hand::{Asked, LinkSettings, Phase};
use tega_wire::allegro::{CanFrame, Received};

use crate::arguments::Whole;
use crate::errors::{BindError, InvalidValueError};
use crate::hand::HandController;
use crate::shared::Shared;
use crate::wire::allegro::device;

/// Range of a clock's time.
const TIME: &str = "nanoseconds of 64 bits";

type Sent<'py> = Vec<(u16, Bound<'py, PyBytes>, bool)>;

/// Identifier, data, remote, extended, error frame.
type Given = (Whole, PyBackedBytes, bool, bool, bool);

/// The hand's own thread exchanges while others look on.
#[pyclass(module = "tega._native", frozen)]
pub(crate) struct HandLink(Shared<tega_hand::HandLink>);

#[pymethods]
impl HandLink {
    #[new]
    #[pyo3(signature = (controller, /, *, device_id, left, torque, silent_after_ns, lowest_rate_hz, reconnects))]
    fn new(
        controller: PyRef<'_, HandController>,
        device_id: Whole,
        left: bool,
        torque: bool,
        silent_after_ns: Whole,
        lowest_rate_hz: f64,
        reconnects: Whole,
    ) -> Result<Self, BindError> {
        let silent_after_ns = silent_after_ns.to("silent_after_ns", "above 0 ns")?;
        if silent_after_ns <= 0 || !(lowest_rate_hz.is_finite() && lowest_rate_hz >= 0.0) {
            let text = format!(
                "silent_after_ns = {silent_after_ns} ns, lowest_rate_hz = {lowest_rate_hz} Hz: the first is \
                 above 0, the second 0 or more"
            );
            return Err(InvalidValueError::new_err((text, "")).into());
        }
        let (device, reconnects) = (device(device_id)?, reconnects.to("reconnects", "0 to 4294967295")?);
        let settings = LinkSettings { device, left, torque, silent_after_ns, lowest_rate_hz, reconnects };
        let controller = controller.0.with(|core| core.clone());
        Ok(Self(Shared::new(tega_hand::HandLink::new(settings, controller))))
    }

    #[pyo3(signature = (frames, t_ns, level, added, /))]
    fn exchange<'py>(
        &self,
        py: Python<'py>,
        frames: Vec<Given>,
        t_ns: Whole,
        level: f64,
        added: f64,
    ) -> Result<Sent<'py>, BindError> {
        let frames: Vec<Received<'_>> = frames
            .iter()
            .map(|(id, data, remote, extended, error)| Received {
                // An identifier too large for a CAN frame is not ours either.
                id: id.to("id", "").unwrap_or(u32::MAX),
                data: data.as_ref(),
                remote: *remote,
                extended: *extended,
                error: *error,
            })
            .collect();
        let t_ns = t_ns.to("t_ns", TIME)?;
        Ok(sent(py, &self.0.with(|link| link.exchange(&frames, t_ns, Asked { level, added }))?))
    }

    #[pyo3(signature = (t_ns, /))]
    fn release(&self, t_ns: Whole) -> Result<(), BindError> {
        let t_ns = t_ns.to("t_ns", TIME)?;
        self.0.with(|link| link.release(t_ns));
        Ok(())
    }

    fn abandon<'py>(&self, py: Python<'py>) -> Sent<'py> {
        sent(py, &self.0.with(|link| link.abandon()))
    }

    #[getter]
    fn phase(&self) -> &'static str {
        match self.0.with(|link| link.phase()) {
            Phase::Listening => "listening",
            Phase::Identifying => "identifying",
            Phase::Checking => "checking",
            Phase::Running => "running",
            Phase::Silent => "silent",
            Phase::Releasing => "releasing",
            Phase::Stopped => "stopped",
            Phase::Faulted => "faulted",
        }
    }

    #[getter]
    fn released(&self) -> bool {
        self.0.with(|link| link.released())
    }

    #[getter]
    fn fault(&self) -> Option<(&'static str, String, &'static str)> {
        self.0.with(|link| link.fault().map(|fault| (fault.kind(), fault.to_string(), fault.hint())))
    }

    #[getter]
    fn angles_rad<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.with(|link| link.angles_rad().copied()).map(|angles| PyArray1::from_slice(py, &angles))
    }

    #[getter]
    fn target_rad<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.with(|link| link.target_rad()).map(|target| PyArray1::from_slice(py, &target))
    }

    #[getter]
    fn torques<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.with(|link| *link.torques()))
    }

    #[getter]
    fn info(&self) -> Option<(u16, u16, u8, u8, u8)> {
        self.0.with(|link| {
            link.info().map(|info| (info.hardware, info.firmware, info.side, info.palm_c, info.status))
        })
    }

    #[getter]
    fn serial(&self) -> String {
        let text = self.0.with(|link| String::from_utf8_lossy(link.serial()).into_owned());
        text.trim_end_matches('\0').escape_debug().to_string()
    }

    #[getter]
    fn joints_c(&self) -> Vec<Option<u8>> {
        self.0.with(|link| link.joints_c().to_vec())
    }

    #[pyo3(signature = (t_ns, /))]
    fn heat_share(&self, t_ns: Whole) -> Result<f64, BindError> {
        let t_ns = t_ns.to("t_ns", TIME)?;
        Ok(self.0.with(|link| link.heat_share(t_ns)))
    }

    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let counts = self.0.with(|link| link.counts());
        let dict = PyDict::new(py);
        for (name, count) in [
            ("sets", counts.sets),
            ("incomplete", counts.incomplete),
            ("copies", counts.copies),
            ("late", counts.late),
            ("silences", counts.silences),
            ("jumps", counts.jumps),
            ("malformed", counts.malformed),
            ("unknown", counts.unknown),
            ("others", counts.others),
        ] {
            dict.set_item(name, count)?;
        }
        Ok(dict)
    }
}

fn sent<'py>(py: Python<'py>, frames: &[CanFrame]) -> Sent<'py> {
    frames.iter().map(|frame| (frame.id(), PyBytes::new(py, frame.data()), frame.is_remote())).collect()
}
