//! Vest frames and the HID reports.

// PyO3 hands arguments over by value.
#![allow(clippy::needless_pass_by_value)]

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tega_wire::bhaptics::{self, BleFrame, Intensities};
use tega_wire::{WireError, hid};

use super::narrow;
use crate::arguments::Whole;
use crate::errors::BindError;

type Column<'py, T> = Bound<'py, PyArray1<T>>;

fn intensities(values: &PyReadonlyArray1<'_, u8>) -> Result<Intensities, WireError> {
    let values = values.as_array();
    match values.as_slice() {
        Some(values) => Intensities::new(values),
        None => Intensities::new(&values.to_vec()),
    }
}

fn ble(frame: &[u8]) -> Result<BleFrame, WireError> {
    let wrong = WireError::PacketLength { packet: "vest frame", got: frame.len(), wanted: "20" };
    frame.try_into().map_err(|_| wrong)
}

#[pyfunction]
#[pyo3(signature = (intensities, /))]
pub(crate) fn motor_steps<'py>(py: Python<'py>, intensities: PyReadonlyArray1<'py, u8>) -> Column<'py, u8> {
    PyArray1::from_vec(py, intensities.as_array().iter().map(|&value| bhaptics::motor_step(value)).collect())
}

#[pyfunction]
#[pyo3(signature = (intensities, /, *, front_mirror))]
pub(crate) fn x40_ble_frame<'py>(
    py: Python<'py>,
    intensities: PyReadonlyArray1<'py, u8>,
    front_mirror: bool,
) -> Result<Bound<'py, PyBytes>, BindError> {
    Ok(PyBytes::new(py, &bhaptics::ble_frame(&self::intensities(&intensities)?, front_mirror)))
}

#[pyfunction]
#[pyo3(signature = (frame, /, *, front_mirror))]
pub(crate) fn x40_ble_steps<'py>(
    py: Python<'py>,
    frame: &[u8],
    front_mirror: bool,
) -> Result<Column<'py, u8>, BindError> {
    Ok(PyArray1::from_slice(py, &bhaptics::ble_steps(&ble(frame)?, front_mirror)))
}

#[pyfunction]
#[pyo3(signature = (frame, /, *, front_mirror))]
pub(crate) fn x16_steps<'py>(
    py: Python<'py>,
    frame: &[u8],
    front_mirror: bool,
) -> Result<Column<'py, u8>, BindError> {
    Ok(PyArray1::from_slice(py, &bhaptics::x16_steps(&ble(frame)?, front_mirror)))
}

#[pyfunction]
#[pyo3(signature = (intensities, /, *, sequence, ttl_ms, request_status))]
pub(crate) fn hid_motor_report<'py>(
    py: Python<'py>,
    intensities: PyReadonlyArray1<'py, u8>,
    sequence: Whole,
    ttl_ms: Whole,
    request_status: bool,
) -> Result<Bound<'py, PyBytes>, BindError> {
    let ttl_ms = narrow("ttl_ms", ttl_ms, "1 to 65535")?;
    let motor = hid::Motor::Levels { levels: intensities.as_array().to_vec(), ttl_ms, request_status };
    Ok(PyBytes::new(py, &hid::motor_report(narrow("sequence", sequence, "0 to 65535")?, &motor)?))
}

#[pyfunction]
#[pyo3(signature = (*, sequence))]
pub(crate) fn hid_stop_report(py: Python<'_>, sequence: Whole) -> Result<Bound<'_, PyBytes>, BindError> {
    let sequence = narrow("sequence", sequence, "0 to 65535")?;
    Ok(PyBytes::new(py, &hid::motor_report(sequence, &hid::Motor::Stop)?))
}

type MotorParts<'py> = (u16, Option<(Column<'py, u8>, u16, bool)>);

#[pyfunction]
#[pyo3(signature = (report, /))]
pub(crate) fn hid_motor<'py>(py: Python<'py>, report: &[u8]) -> Result<MotorParts<'py>, BindError> {
    let (sequence, motor) = hid::decode_motor(report)?;
    Ok(match motor {
        hid::Motor::Stop => (sequence, None),
        hid::Motor::Levels { levels, ttl_ms, request_status } => {
            (sequence, Some((PyArray1::from_vec(py, levels), ttl_ms, request_status)))
        }
    })
}

type StatusParts = (u16, u8, Option<u8>, u16, u32, u32);

#[pyfunction]
#[pyo3(signature = (report, /))]
pub(crate) fn hid_status(report: &[u8]) -> Result<StatusParts, BindError> {
    let status = hid::decode_status(report)?;
    Ok((status.sequence, status.link, status.battery, status.faults, status.uptime_ms, status.dropped))
}

type StatusFields = (Whole, Whole, Option<Whole>, Whole, Whole, Whole);

#[pyfunction]
#[pyo3(signature = (status, /))]
pub(crate) fn hid_status_report(
    py: Python<'_>,
    status: StatusFields,
) -> Result<Bound<'_, PyBytes>, BindError> {
    let (sequence, link, battery, faults, uptime_ms, dropped) = status;
    let battery = battery.map(|battery| narrow("battery", battery, "0 to 100 %")).transpose()?;
    let status = hid::Status {
        flags: 0,
        sequence: narrow("sequence", sequence, "0 to 65535")?,
        link: narrow("link", link, "0, 1 or 2")?,
        battery,
        faults: narrow("faults", faults, "0 to 65535")?,
        uptime_ms: narrow("uptime_ms", uptime_ms, "0 to 4294967295")?,
        dropped: narrow("dropped", dropped, "0 to 4294967295")?,
    };
    Ok(PyBytes::new(py, &hid::status_report(&status)))
}
