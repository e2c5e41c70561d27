//! Allegro Hand over CAN: version 4 in full, versions 3 and 5 as far as their numbers are known.
//!
//! Classic CAN at 1 Mbit/s, 11-bit identifiers, little-endian payloads. An identifier is
//! `message << 2 | device`, with a two-bit device number that is 0 from the factory.
//!
//! The CONFIG message (0x68, in some documents 0x58) is recognised when it is seen on the bus and has no encoder: it
//! writes the hand's flash memory, and its two published layouts contradict each other. SET POSE (0xE0) is recognised
//! likewise: the version 4 firmware does not implement it.

use tega_error::OutOfRange;

mod decode;
mod message;
mod units;

pub use decode::{Received, Rejection, decode, requested};
pub use message::{Command, Info, Message, Report, Request};
pub use units::{
    PWM_LIMITS, RAD_PER_COUNT, Scale, TEMPERATURE_VALID_MAX_C, angle_counts, angle_rad, temperature_c,
    torque_counts, torque_frames,
};

use crate::WireError;

/// A finger, in the hand's order: joints 0..=3 are the index's, 12..=15 the thumb's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Finger {
    /// Joints 0 to 3.
    Index,
    /// Joints 4 to 7.
    Middle,
    /// Joints 8 to 11.
    Ring,
    /// Joints 12 to 15.
    Thumb,
}

impl Finger {
    /// All four, in the hand's order.
    pub const ALL: [Self; 4] = [Self::Index, Self::Middle, Self::Ring, Self::Thumb];

    /// The finger's number on the wire, 0 to 3.
    pub fn number(self) -> u8 {
        match self {
            Self::Index => 0,
            Self::Middle => 1,
            Self::Ring => 2,
            Self::Thumb => 3,
        }
    }

    /// The finger's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Index => "index",
            Self::Middle => "middle",
            Self::Ring => "ring",
            Self::Thumb => "thumb",
        }
    }

    /// The finger of a number; only the low two bits count.
    pub(crate) fn of_bits(bits: u16) -> Self {
        match bits & 3 {
            0 => Self::Index,
            1 => Self::Middle,
            2 => Self::Ring,
            _ => Self::Thumb,
        }
    }
}

/// The two-bit device number stored in a hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DeviceId(u8);

impl DeviceId {
    /// The number a hand leaves the factory with.
    pub const FACTORY: Self = Self(0);

    /// Check a device number.
    ///
    /// # Errors
    /// [`WireError::OutOfRange`] above 3.
    pub fn new(number: u8) -> Result<Self, WireError> {
        if number > 3 {
            return Err(OutOfRange::new("device_id", f64::from(number), "", "0 to 3").into());
        }
        Ok(Self(number))
    }

    /// The number, 0 to 3.
    pub fn number(self) -> u8 {
        self.0
    }
}

/// A standard CAN frame to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: u16,
    remote: bool,
    len: u8,
    bytes: [u8; 8],
}

impl CanFrame {
    /// A data frame; `payload` beyond eight bytes cannot be given.
    pub(crate) fn data_frame<const N: usize>(message: u16, device: DeviceId, payload: [u8; N]) -> Self {
        const { assert!(N <= 8) };
        let mut bytes = [0; 8];
        for (to, from) in bytes.iter_mut().zip(payload) {
            *to = from;
        }
        Self { id: message << 2 | u16::from(device.0), remote: false, len: N as u8, bytes }
    }

    pub(crate) fn remote_frame(message: u16, device: DeviceId) -> Self {
        Self { id: message << 2 | u16::from(device.0), remote: true, len: 0, bytes: [0; 8] }
    }

    /// The 11-bit identifier.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// Whether this is a remote frame, which asks the hand for the data frame of the same identifier.
    pub fn is_remote(&self) -> bool {
        self.remote
    }

    /// The payload, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }
}

/// Four little-endian words from a payload.
pub(crate) fn words(bytes: [u8; 8]) -> [i16; 4] {
    let [a, b, c, d, e, f, g, h] = bytes;
    [[a, b], [c, d], [e, f], [g, h]].map(i16::from_le_bytes)
}

/// Four words as a little-endian payload.
pub(crate) fn payload(words: [i16; 4]) -> [u8; 8] {
    let [[a, b], [c, d], [e, f], [g, h]] = words.map(i16::to_le_bytes);
    [a, b, c, d, e, f, g, h]
}
