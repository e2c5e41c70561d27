//! Drain a serial port in a thread of its own, which waits for nobody, and stamp what arrives.
//!
//! A reader takes what has come since the last time, with the time at which the last of it arrived. A system's
//! buffer of a port keeps some kilobytes; here a mebibyte waits. There is nothing here but on Unix, whose ports are
//! descriptors.

#[cfg(unix)]
mod drain;

#[cfg(unix)]
pub use drain::Drain;
