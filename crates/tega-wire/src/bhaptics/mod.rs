//! bHaptics vests: one order of forty motors, and the frame in which it travels.
//!
//! Forty intensities are always given in the wearer's order: front then back, each panel row by row from the top,
//! four columns from the wearer's left to the wearer's right on both panels. Motor `4 * row + column` of a panel.
//!
//! Over Bluetooth LE they are 20 bytes of 16 steps: [`ble_frame`]. The Player's and the Hub's JSON is Python's
//! (`tega.wire.bhaptics_player`).

mod ble;

pub use ble::{BleFrame, ble_frame, ble_steps, x16_steps};

use tega_error::OutOfRange;

use crate::WireError;

/// Motors in the wearer's order.
pub const MOTORS: usize = 40;

/// Forty checked intensities, 0 to 100, in the wearer's order.
///
/// ```
/// use tega_wire::bhaptics::Intensities;
/// assert!(Intensities::new(&[100; 40]).is_ok());
/// assert!(Intensities::new(&[101; 40]).is_err());
/// assert!(Intensities::new(&[0; 32]).is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Intensities([u8; MOTORS]);

impl Intensities {
    /// Check forty intensities.
    ///
    /// # Errors
    /// [`WireError::Length`] for another number of them, [`WireError::OutOfRange`] for one above 100: what a vest makes
    /// of more than full drive is not known.
    pub fn new(values: &[u8]) -> Result<Self, WireError> {
        let values: [u8; MOTORS] = values.try_into().map_err(|_| WireError::Length {
            name: "intensities",
            got: values.len(),
            wanted: "40",
        })?;
        check(&values)?;
        Ok(Self(values))
    }

    /// All forty.
    pub fn values(&self) -> &[u8; MOTORS] {
        &self.0
    }
}

/// Check that every intensity is within 0 to 100.
pub(crate) fn check(values: &[u8]) -> Result<(), WireError> {
    match values.iter().position(|&value| value > 100) {
        None => Ok(()),
        Some(index) => {
            let value = values.get(index).map_or(0.0, |&value| f64::from(value));
            let wrong = OutOfRange::new("intensities", value, "%", "0 to 100");
            Err(wrong.placed(format_args!("[{index}]")).into())
        }
    }
}

/// The one of the sixteen steps of a vest that stands for an intensity of 0 to 100: `(15 i + 50) / 100`, in
/// integers, so that every language gets the same.
///
/// ```
/// use tega_wire::bhaptics::motor_step;
/// assert_eq!([0, 3, 4, 30, 70, 96, 97, 100].map(motor_step), [0, 0, 1, 5, 11, 14, 15, 15]);
/// ```
pub fn motor_step(intensity: u8) -> u8 {
    ((15 * u16::from(intensity.min(100)) + 50) / 100) as u8
}
