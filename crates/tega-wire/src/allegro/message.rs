//! The version 4 messages, and the frames they travel in.

use super::{CanFrame, DeviceId, Finger, payload};
use crate::WireError;

// Message numbers: the identifier without its two device bits. Those with a finger are the index finger's.
pub(super) const STATUS: u16 = 0x10;
pub(super) const POSITION: u16 = 0x20;
pub(super) const IMU: u16 = 0x30;
pub(super) const TEMPERATURE: u16 = 0x38;
pub(super) const SERVO_ON: u16 = 0x40;
pub(super) const SERVO_OFF: u16 = 0x41;
pub(super) const CONFIG_IN_DOCUMENT: u16 = 0x58;
pub(super) const SET_TORQUE: u16 = 0x60;
pub(super) const CONFIG: u16 = 0x68;
pub(super) const INFORMATION: u16 = 0x80;
pub(super) const SET_PERIOD: u16 = 0x81;
pub(super) const SERIAL: u16 = 0x88;
pub(super) const SET_POSE: u16 = 0xE0;

/// A message of the host to the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Switch the motors on.
    ServoOn,
    /// Switch the motors off. Some firmware is reported to ignore it: send zero torque first.
    ServoOff,
    /// Pulse width of one finger's four joints, in counts.
    SetTorque {
        /// The finger.
        finger: Finger,
        /// Counts of joints 0 to 3 of that finger.
        counts: [i16; 4],
    },
    /// How often the hand reports by itself, in milliseconds; 0 is never.
    SetPeriod {
        /// Joint positions; 3 is what the hand is built for.
        position_ms: u16,
        /// Inertial unit.
        imu_ms: u16,
        /// Joint temperatures.
        temperature_ms: u16,
        /// Status; without it the frame is six bytes long, as the vendor's drivers send it.
        status_ms: Option<u16>,
    },
}

impl Command {
    /// The frame that carries this command.
    pub fn frame(self, device: DeviceId) -> CanFrame {
        match self {
            Self::ServoOn => CanFrame::data_frame(SERVO_ON, device, []),
            Self::ServoOff => CanFrame::data_frame(SERVO_OFF, device, []),
            Self::SetTorque { finger, counts } => {
                CanFrame::data_frame(SET_TORQUE + u16::from(finger.number()), device, payload(counts))
            }
            Self::SetPeriod { position_ms, imu_ms, temperature_ms, status_ms } => {
                let [[a, b], [c, d], [e, f]] = [position_ms, imu_ms, temperature_ms].map(u16::to_le_bytes);
                match status_ms.map(u16::to_le_bytes) {
                    None => CanFrame::data_frame(SET_PERIOD, device, [a, b, c, d, e, f]),
                    Some([g, h]) => CanFrame::data_frame(SET_PERIOD, device, [a, b, c, d, e, f, g, h]),
                }
            }
        }
    }
}

/// What a remote frame asks the hand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Versions, side, palm temperature, status bits.
    Info,
    /// The serial number.
    Serial,
    /// One finger's joint positions.
    Position(Finger),
    /// The inertial unit.
    Imu,
    /// One finger's joint temperatures.
    Temperature(Finger),
}

impl Request {
    /// The remote frame that makes this request.
    pub fn frame(self, device: DeviceId) -> CanFrame {
        let message = match self {
            Self::Info => INFORMATION,
            Self::Serial => SERIAL,
            Self::Position(finger) => POSITION + u16::from(finger.number()),
            Self::Imu => IMU,
            Self::Temperature(finger) => TEMPERATURE + u16::from(finger.number()),
        };
        CanFrame::remote_frame(message, device)
    }
}

/// What the hand says about itself.
///
/// Sources agree on status bits 0 (servo on) and 1 (a joint too hot). For bits 2 to 4 there are two readings, and
/// which firmware means which is not known: bit 2 is an internal communication fault or thermal throttling, bit 3 a
/// communication fault, bit 4 a palm too hot. [`Info::must_stop`] and [`Info::must_warn`] take the careful side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Info {
    /// Hardware version, 0x0402 for "4.2".
    pub hardware: u16,
    /// Firmware version, likewise.
    pub firmware: u16,
    /// 0 is a right hand, 1 a left hand.
    pub side: u8,
    /// Temperature of the palm board in °C.
    pub palm_c: u8,
    /// Status bits as sent.
    pub status: u8,
}

impl Info {
    /// The hand's version: 4 for a version 4 hand. Torque must not be sent to any other than the configured one.
    pub fn major(self) -> u8 {
        (self.hardware >> 8) as u8
    }

    /// Bit 0.
    pub fn servo_on(self) -> bool {
        self.status & 1 != 0
    }

    /// Bits 1 and 4, a temperature fault in either reading: stop, send zero torque.
    pub fn must_stop(self) -> bool {
        self.status & 0b1_0010 != 0
    }

    /// Bits 2 and 3: warn and lower the torque limit.
    pub fn must_warn(self) -> bool {
        self.status & 0b0_1100 != 0
    }
}

/// A message of the hand to the host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Report {
    /// Versions, side, palm temperature, status bits.
    Info(Info),
    /// Eight characters, padded with zeros.
    Serial([u8; 8]),
    /// One finger's joint positions.
    Position {
        /// The finger.
        finger: Finger,
        /// Counts of joints 0 to 3 of that finger.
        counts: [i16; 4],
    },
    /// Inertial unit, three or four words. Neither their meaning nor their scale is known.
    Imu(Vec<i16>),
    /// One finger's joint temperatures.
    Temperature {
        /// The finger.
        finger: Finger,
        /// Degrees Celsius of joints 0 to 3 as sent; see [`super::temperature_c`].
        bytes: [u8; 4],
    },
    /// "Current status", up to eight bytes. What they mean is not known.
    Status(Vec<u8>),
}

impl Report {
    /// The frame that carries this report: what a simulated hand sends.
    ///
    /// # Errors
    /// [`WireError::Length`] for an inertial unit without three or four words, or a status of more than eight bytes.
    pub fn frame(&self, device: DeviceId) -> Result<CanFrame, WireError> {
        Ok(match self {
            Self::Info(Info { hardware, firmware, side, palm_c, status }) => {
                let [[a, b], [c, d]] = [*hardware, *firmware].map(u16::to_le_bytes);
                CanFrame::data_frame(INFORMATION, device, [a, b, c, d, *side, *palm_c, *status])
            }
            Self::Serial(text) => CanFrame::data_frame(SERIAL, device, *text),
            Self::Position { finger, counts } => {
                CanFrame::data_frame(POSITION + u16::from(finger.number()), device, payload(*counts))
            }
            Self::Temperature { finger, bytes } => {
                CanFrame::data_frame(TEMPERATURE + u16::from(finger.number()), device, *bytes)
            }
            Self::Imu(words) => match words[..] {
                [x, y, z] => {
                    let [[a, b], [c, d], [e, f]] = [x, y, z].map(i16::to_le_bytes);
                    CanFrame::data_frame(IMU, device, [a, b, c, d, e, f])
                }
                [w, x, y, z] => CanFrame::data_frame(IMU, device, payload([w, x, y, z])),
                _ => return Err(WireError::Length { name: "imu", got: words.len(), wanted: "3 or 4 words" }),
            },
            Self::Status(bytes) => {
                let mut frame = CanFrame::data_frame(STATUS, device, [0; 8]);
                if bytes.len() > 8 {
                    return Err(WireError::Length {
                        name: "status",
                        got: bytes.len(),
                        wanted: "at most 8 bytes",
                    });
                }
                frame.len = bytes.len() as u8;
                frame.bytes.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
                frame
            }
        })
    }
}

/// A decoded data frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Message {
    /// From the host: ours echoed, or another program's on the same bus.
    Command(Command),
    /// From the hand.
    Report(Report),
    /// A SET POSE of another program; version 4 firmware does not implement it.
    Pose {
        /// The finger.
        finger: Finger,
        /// Counts of joints 0 to 3 of that finger.
        counts: [i16; 4],
    },
    /// A CONFIG of another program, which writes the hand's flash memory.
    Config([u8; 6]),
}
