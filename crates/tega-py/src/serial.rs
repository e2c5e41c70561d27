//! A serial port that is drained in a native thread, which no interpreter lock keeps waiting.

use std::os::fd::BorrowedFd;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tega_serial::Drain;

use crate::arguments::Whole;
use crate::errors::{BindError, InvalidValueError};
use crate::shared::{Shared, released};

#[pyclass(module = "tega._native", frozen)]
pub(crate) struct SerialDrain(Shared<Option<Drain>>);

#[pymethods]
impl SerialDrain {
    #[new]
    #[pyo3(signature = (fd, /))]
    fn new(fd: Whole) -> Result<Self, BindError> {
        let fd = fd.to("fd", "the descriptor of an open port")?;
        if fd < 0 {
            let hint = "pass the descriptor of an open port";
            return Err(InvalidValueError::new_err((format!("fd = {fd} is no descriptor"), hint)).into());
        }
        // SAFETY: it is borrowed for this call alone; the drain gets a copy of its own, which the system refuses to make
        // of what is not open.
        let port = unsafe { BorrowedFd::borrow_raw(fd) }.try_clone_to_owned().map_err(PyErr::from)?;
        Ok(Self(Shared::new(Some(Drain::start(port).map_err(PyErr::from)?))))
    }

    /// Bytes that have come, and when the last one did, nanoseconds.
    fn take<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyBytes>, i64)> {
        let (bytes, arrival_ns) =
            self.0.with(|drain| drain.as_ref().map_or_else(|| Ok((Vec::new(), 0)), Drain::take))?;
        Ok((PyBytes::new(py, &bytes), arrival_ns))
    }

    /// End the thread.
    fn close(&self, py: Python<'_>) {
        released(py, true, || self.0.with(|drain| drop(drain.take())));
    }
}
