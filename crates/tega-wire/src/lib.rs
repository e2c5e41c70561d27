//! Bytes to typed packets and back: robot hand, vest, muscle sensors.
//!
//! Nothing here opens a port, reads a clock or keeps a thread. Encoders are functions from values to bytes; decoders
//! of streams are structs that are fed bytes as they arrive and give packets out. Every decoder takes any bytes
//! without panicking, holds a bounded number of them, and gives the same packets for every way of cutting the stream
//! into chunks.
//!
//! | module | link | what travels |
//! |---|---|---|
//! | [`allegro`] | CAN, 1 Mbit/s | torques to and angles from an Allegro Hand |
//! | [`bhaptics`] | BLE, websocket, TCP | motor levels to a bHaptics vest |
//! | [`hid`] | USB HID | the same levels to a bridge of one's own |
//! | [`cyton`] | serial, 115200 baud | eight channels from an `OpenBCI` Cyton |
//! | [`chords`] | serial | up to 16 channels from Chords firmware |
//! | [`spiker`] | serial, 230400 baud | channels from a `SpikerShield` |
//! | [`ascii`] | serial | one line of decimal numbers a sample |
//!
//! ```
//! use tega_wire::allegro::{self, DeviceId, Scale};
//!
//! let frames = allegro::torque_frames(&[0.1; 16], DeviceId::FACTORY, Scale::V4)?;
//! assert_eq!(frames[0].id(), 0x180);
//! assert_eq!(frames[0].data(), [120, 0, 120, 0, 120, 0, 120, 0]);
//! # Ok::<(), tega_wire::WireError>(())
//! ```
#![forbid(unsafe_code)]

pub mod allegro;
pub mod ascii;
pub mod bhaptics;
pub mod chords;
pub mod cyton;
mod error;
mod framing;
pub mod hid;
pub mod spiker;

pub use error::WireError;
