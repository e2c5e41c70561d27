//! Allegro Hand. Messages cross as `(kind, finger, values)`; `python/tega/wire/allegro.py` makes them its dataclasses.

// PyO3 hands arguments over by value.
#![allow(clippy::needless_pass_by_value)]

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use tega_wire::WireError;
use tega_wire::allegro::{
    self, CanFrame, Command, DeviceId, Finger, Info, Message, Received, Report, Request,
};

use super::narrow;
use crate::arguments::Whole;
use crate::errors::BindError;

pub(crate) fn device(number: Whole) -> Result<DeviceId, WireError> {
    DeviceId::new(narrow("device_id", number, "0 to 3")?)
}

fn finger(number: Whole) -> Result<Finger, WireError> {
    let index: usize = narrow("finger", number, "0 to 3")?;
    Finger::ALL.get(index).copied().ok_or_else(|| number.out_of_range("finger", "0 to 3").into())
}

fn scale(version: Whole) -> Result<allegro::Scale, WireError> {
    match version.to::<u8>("version", "4 or 5") {
        Ok(4) => Ok(allegro::Scale::V4),
        Ok(5) => Ok(allegro::Scale::V5),
        _ => Err(WireError::Setting(version.out_of_range("version", "4 or 5"))),
    }
}

fn exactly<T: TryFrom<i64> + TryFrom<u64>, const N: usize>(
    values: &[Whole],
    wanted: &'static str,
) -> Result<[T; N], WireError> {
    let got = values.len();
    let values = values.iter().map(|&value| narrow("a value of the message", value, wanted));
    let values: Vec<T> = values.collect::<Result<_, _>>()?;
    values.try_into().map_err(|_| WireError::Length {
        name: "the message",
        got,
        wanted: "those its kind has",
    })
}

fn sent<'py>(py: Python<'py>, frame: &CanFrame) -> (u16, Bound<'py, PyBytes>, bool) {
    (frame.id(), PyBytes::new(py, frame.data()), frame.is_remote())
}

#[pyfunction]
#[pyo3(signature = (torques, /, *, device_id, version))]
pub(crate) fn allegro_torque_frames<'py>(
    py: Python<'py>,
    torques: PyReadonlyArray1<'py, f64>,
    device_id: Whole,
    version: Whole,
) -> Result<Vec<(u16, Bound<'py, PyBytes>)>, BindError> {
    let torques = torques.as_array();
    let wrong = WireError::Length { name: "torques", got: torques.len(), wanted: "16" };
    let torques: [f64; 16] = torques.iter().copied().collect::<Vec<_>>().try_into().map_err(|_| wrong)?;
    let frames = allegro::torque_frames(&torques, device(device_id)?, scale(version)?)?;
    Ok(frames.iter().map(|frame| (frame.id(), PyBytes::new(py, frame.data()))).collect())
}

#[pyfunction]
#[pyo3(signature = (counts, /, *, version))]
pub(crate) fn allegro_angles_rad<'py>(
    py: Python<'py>,
    counts: PyReadonlyArray1<'py, i16>,
    version: Whole,
) -> Result<Bound<'py, PyArray1<f64>>, BindError> {
    let scale = scale(version)?;
    let angles = counts.as_array().iter().map(|&counts| allegro::angle_rad(counts, scale)).collect();
    Ok(PyArray1::from_vec(py, angles))
}

#[pyfunction]
#[pyo3(signature = (angles_rad, /, *, version))]
pub(crate) fn allegro_angle_counts<'py>(
    py: Python<'py>,
    angles_rad: PyReadonlyArray1<'py, f64>,
    version: Whole,
) -> Result<Bound<'py, PyArray1<i16>>, BindError> {
    let scale = scale(version)?;
    let angles_rad = angles_rad.as_array();
    let counts = angles_rad.iter().map(|&angle| allegro::angle_counts(angle, scale));
    Ok(PyArray1::from_vec(py, counts.collect::<Result<_, _>>()?))
}

/// A message as kind, finger and values; the values are what `allegro_encode` takes.
fn flat(message: &Message) -> (&'static str, u8, Vec<i64>) {
    fn list<T: Copy + Into<i64>>(values: &[T]) -> Vec<i64> {
        values.iter().map(|&value| value.into()).collect()
    }
    match message {
        Message::Command(Command::ServoOn) => ("servo_on", 0, vec![]),
        Message::Command(Command::ServoOff) => ("servo_off", 0, vec![]),
        Message::Command(Command::SetTorque { finger, counts }) => {
            ("set_torque", finger.number(), list(counts))
        }
        Message::Command(Command::SetPeriod { position_ms, imu_ms, temperature_ms, status_ms }) => {
            let three = list(&[*position_ms, *imu_ms, *temperature_ms]);
            ("set_period", 0, three.into_iter().chain(status_ms.map(i64::from)).collect())
        }
        Message::Report(Report::Info(Info { hardware, firmware, side, palm_c, status })) => {
            let bytes = list(&[*side, *palm_c, *status]);
            ("info", 0, [list(&[*hardware, *firmware]), bytes].concat())
        }
        Message::Report(Report::Serial(bytes)) => ("serial", 0, list(bytes)),
        Message::Report(Report::Position { finger, counts }) => ("position", finger.number(), list(counts)),
        Message::Report(Report::Imu(words)) => ("imu", 0, list(words)),
        Message::Report(Report::Temperature { finger, bytes }) => {
            ("temperature", finger.number(), list(bytes))
        }
        Message::Report(Report::Status(bytes)) => ("status", 0, list(bytes)),
        Message::Pose { finger, counts } => ("set_pose", finger.number(), list(counts)),
        Message::Config(bytes) => ("config", 0, list(bytes)),
    }
}

#[pyfunction]
#[pyo3(signature = (can_id, data, /, *, device_id, remote, extended, error))]
pub(crate) fn allegro_decode(
    can_id: Whole,
    data: &[u8],
    device_id: Whole,
    remote: bool,
    extended: bool,
    error: bool,
) -> Result<(&'static str, u8, Vec<i64>), BindError> {
    use allegro::Rejection::{ErrorFrame, Extended, ForeignDevice, Malformed, Remote, Unknown};
    // An identifier too large for a CAN frame is not ours either.
    let id = can_id.to("can_id", "").unwrap_or(u32::MAX);
    Ok(match allegro::decode(&Received { id, data, remote, extended, error }, device(device_id)?) {
        Ok(message) => flat(&message),
        Err(ErrorFrame) => ("error", 0, vec![]),
        Err(Extended) => ("extended", 0, vec![]),
        Err(Remote) => ("remote", 0, vec![]),
        Err(ForeignDevice) => ("foreign_device", 0, vec![]),
        Err(Unknown) => ("unknown", 0, vec![]),
        Err(Malformed) => ("malformed", 0, vec![]),
    })
}

#[pyfunction]
#[pyo3(signature = (can_id, /, *, device_id))]
pub(crate) fn allegro_requested(
    can_id: Whole,
    device_id: Whole,
) -> Result<Option<(&'static str, Option<u8>)>, BindError> {
    let request = allegro::requested(can_id.to("can_id", "").unwrap_or(u32::MAX), device(device_id)?);
    Ok(request.map(|request| match request {
        Request::Info => ("info", None),
        Request::Serial => ("serial", None),
        Request::Imu => ("imu", None),
        Request::Position(finger) => ("position", Some(finger.number())),
        Request::Temperature(finger) => ("temperature", Some(finger.number())),
    }))
}

#[pyfunction]
#[pyo3(signature = (kind, finger, values, /, *, device_id))]
pub(crate) fn allegro_encode<'py>(
    py: Python<'py>,
    kind: &str,
    finger: Whole,
    values: Vec<Whole>,
    device_id: Whole,
) -> Result<(u16, Bound<'py, PyBytes>, bool), BindError> {
    let (device, finger, counts) = (device(device_id)?, self::finger(finger)?, "-32768 to 32767 counts");
    let (bytes, ms) = ("0 to 255", "0 to 65535 ms");
    let frame = match kind {
        "servo_on" => Command::ServoOn.frame(device),
        "servo_off" => Command::ServoOff.frame(device),
        "set_torque" => Command::SetTorque { finger, counts: exactly(&values, counts)? }.frame(device),
        "set_period" => {
            let (three, status) = values.split_at_checked(3).unwrap_or((&values, &[]));
            let [position_ms, imu_ms, temperature_ms] = exactly(three, ms)?;
            let status_ms = status.first().map(|&value| narrow("status_ms", value, ms)).transpose()?;
            Command::SetPeriod { position_ms, imu_ms, temperature_ms, status_ms }.frame(device)
        }
        "request_info" => Request::Info.frame(device),
        "request_serial" => Request::Serial.frame(device),
        "request_imu" => Request::Imu.frame(device),
        "request_position" => Request::Position(finger).frame(device),
        "request_temperature" => Request::Temperature(finger).frame(device),
        "info" => {
            let (versions, rest) = values.split_at_checked(2).unwrap_or((&values, &[]));
            let [hardware, firmware] = exactly(versions, "0 to 65535")?;
            let [side, palm_c, status] = exactly(rest, bytes)?;
            Report::Info(Info { hardware, firmware, side, palm_c, status }).frame(device)?
        }
        "serial" => Report::Serial(exactly(&values, bytes)?).frame(device)?,
        "position" => Report::Position { finger, counts: exactly(&values, counts)? }.frame(device)?,
        "temperature" => Report::Temperature { finger, bytes: exactly(&values, bytes)? }.frame(device)?,
        "imu" => {
            let words = values.iter().map(|&value| narrow("a word", value, counts));
            Report::Imu(words.collect::<Result<_, _>>()?).frame(device)?
        }
        "status" => {
            let values = values.iter().map(|&value| narrow("a byte", value, bytes));
            Report::Status(values.collect::<Result<_, _>>()?).frame(device)?
        }
        _ => return Err(WireError::Empty { name: "kind of message" }.into()),
    };
    Ok(sent(py, &frame))
}
