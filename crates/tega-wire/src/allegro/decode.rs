//! Frames from the bus to messages. Nothing on a bus is fatal: what cannot be decoded is classified, for counting.

use super::message::{
    CONFIG, CONFIG_IN_DOCUMENT, IMU, INFORMATION, POSITION, SERIAL, SERVO_OFF, SERVO_ON, SET_PERIOD,
    SET_POSE, SET_TORQUE, STATUS, TEMPERATURE,
};
use super::{Command, DeviceId, Finger, Info, Message, Report, Request, words};

/// A frame as a CAN library gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Received<'a> {
    /// The identifier.
    pub id: u32,
    /// The payload.
    pub data: &'a [u8],
    /// A remote frame: a request, perhaps one's own, echoed.
    pub remote: bool,
    /// A frame with a 29-bit identifier.
    pub extended: bool,
    /// An error frame of the controller; its identifier is not one.
    pub error: bool,
}

/// Why a frame was not decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Rejection {
    /// The controller's error frame.
    ErrorFrame,
    /// A 29-bit identifier: another device's.
    Extended,
    /// A request, which carries no data; see [`requested`].
    Remote,
    /// Another device number than ours.
    ForeignDevice,
    /// A message number the hand does not have.
    Unknown,
    /// A known message of the wrong length.
    Malformed,
}

/// Decode a frame of hand `device`.
///
/// # Errors
/// The [`Rejection`] to count it under.
///
/// ```
/// use tega_wire::allegro::{DeviceId, Finger, Message, Received, Rejection, Report, decode};
///
/// let frame = Received { id: 0x084, data: &[1, 0, 2, 0, 3, 0, 4, 0], remote: false, extended: false, error: false };
/// let position = Report::Position { finger: Finger::Middle, counts: [1, 2, 3, 4] };
/// assert_eq!(decode(&frame, DeviceId::FACTORY), Ok(Message::Report(position)));
/// assert_eq!(decode(&Received { data: &[1, 0], ..frame }, DeviceId::FACTORY), Err(Rejection::Malformed));
/// ```
pub fn decode(frame: &Received<'_>, device: DeviceId) -> Result<Message, Rejection> {
    if frame.error {
        return Err(Rejection::ErrorFrame);
    }
    if frame.extended || frame.id > 0x7FF {
        return Err(Rejection::Extended);
    }
    if frame.remote {
        return Err(Rejection::Remote);
    }
    if frame.id & 3 != u32::from(device.number()) {
        return Err(Rejection::ForeignDevice);
    }
    let number = (frame.id >> 2) as u16;
    let finger = Finger::of_bits(number);
    match (number, frame.data) {
        (POSITION..=0x23, &[a, b, c, d, e, f, g, h]) => {
            let counts = words([a, b, c, d, e, f, g, h]);
            Ok(Message::Report(Report::Position { finger, counts }))
        }
        (TEMPERATURE..=0x3B, &[a, b, c, d]) => {
            Ok(Message::Report(Report::Temperature { finger, bytes: [a, b, c, d] }))
        }
        (IMU, &[a, b, c, d, e, f]) => {
            let words = [[a, b], [c, d], [e, f]].map(i16::from_le_bytes);
            Ok(Message::Report(Report::Imu(words.to_vec())))
        }
        (IMU, &[a, b, c, d, e, f, g, h]) => {
            Ok(Message::Report(Report::Imu(words([a, b, c, d, e, f, g, h]).to_vec())))
        }
        (STATUS, bytes) if bytes.len() <= 8 => Ok(Message::Report(Report::Status(bytes.to_vec()))),
        (INFORMATION, &[a, b, c, d, side, palm_c, status]) => {
            let [hardware, firmware] = [[a, b], [c, d]].map(u16::from_le_bytes);
            Ok(Message::Report(Report::Info(Info { hardware, firmware, side, palm_c, status })))
        }
        (SERIAL, &[a, b, c, d, e, f, g, h]) => Ok(Message::Report(Report::Serial([a, b, c, d, e, f, g, h]))),
        (SERVO_ON, []) => Ok(Message::Command(Command::ServoOn)),
        (SERVO_OFF, []) => Ok(Message::Command(Command::ServoOff)),
        (SET_TORQUE..=0x63, &[a, b, c, d, e, f, g, h]) => {
            let counts = words([a, b, c, d, e, f, g, h]);
            Ok(Message::Command(Command::SetTorque { finger, counts }))
        }
        (SET_PERIOD, &[a, b, c, d, e, f, ref status @ ..]) => {
            let status_ms = match *status {
                [] => None,
                [g, h] => Some(u16::from_le_bytes([g, h])),
                _ => return Err(Rejection::Malformed),
            };
            let [position_ms, imu_ms, temperature_ms] = [[a, b], [c, d], [e, f]].map(u16::from_le_bytes);
            Ok(Message::Command(Command::SetPeriod { position_ms, imu_ms, temperature_ms, status_ms }))
        }
        (SET_POSE..=0xE3, &[a, b, c, d, e, f, g, h]) => {
            Ok(Message::Pose { finger, counts: words([a, b, c, d, e, f, g, h]) })
        }
        (CONFIG | CONFIG_IN_DOCUMENT, &[a, b, c, d, e, f]) => Ok(Message::Config([a, b, c, d, e, f])),
        (
            POSITION..=0x23
            | TEMPERATURE..=0x3B
            | IMU
            | STATUS
            | INFORMATION
            | SERIAL
            | SERVO_ON
            | SERVO_OFF
            | SET_TORQUE..=0x63
            | SET_PERIOD
            | SET_POSE..=0xE3
            | CONFIG
            | CONFIG_IN_DOCUMENT,
            _,
        ) => Err(Rejection::Malformed),
        _ => Err(Rejection::Unknown),
    }
}

/// What a remote frame with this identifier asks hand `device` for: what a simulated hand answers.
pub fn requested(id: u32, device: DeviceId) -> Option<Request> {
    if id > 0x7FF || id & 3 != u32::from(device.number()) {
        return None;
    }
    let number = (id >> 2) as u16;
    let finger = Finger::of_bits(number);
    match number {
        INFORMATION => Some(Request::Info),
        SERIAL => Some(Request::Serial),
        IMU => Some(Request::Imu),
        POSITION..=0x23 => Some(Request::Position(finger)),
        TEMPERATURE..=0x3B => Some(Request::Temperature(finger)),
        _ => None,
    }
}
