//! The vendor's newer sockets: Player version 3, and the Hub on a phone. The inner message is a JSON text in a string.

use serde::Serialize;

use super::Intensities;
use super::player::{check_duration, text};
use crate::WireError;

/// How many motor values a version 3 message carries for the vest. Both are in use, and how the Player tells them
/// apart is not known: try it on the one at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motors {
    /// Five rows a panel.
    Forty,
    /// Rows 0 to 3 of each panel.
    ThirtyTwo,
}

impl Motors {
    fn select(self, intensities: &Intensities) -> Result<Vec<u8>, WireError> {
        let values = intensities.values();
        match self {
            Self::Forty => Ok(values.to_vec()),
            Self::ThirtyTwo => {
                let row_four = |index: &usize| index % 20 >= 16;
                if let Some((index, &value)) = values.iter().enumerate().find(|(i, v)| row_four(i) && **v > 0)
                {
                    return Err(WireError::NoSuchRow { index, value });
                }
                Ok(values.iter().enumerate().filter(|(i, _)| !row_four(i)).map(|(_, &v)| v).collect())
            }
        }
    }
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Dots {
    request_id: u32,
    position: u8,
    motor_values: Vec<u8>,
    duration_millis: u32,
    device_index: i8,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct HubDots {
    request_id: u32,
    pos: u8,
    motors: Vec<u8>,
    duration_millis: u32,
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Envelope<'a> {
    r#type: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

#[derive(Serialize)]
struct HubEnvelope<'a> {
    message: String,
    r#type: &'a str,
}

/// The vest's number in these protocols.
const VEST: u8 = 0;

/// The version 3 message that plays intensities on every connected vest.
///
/// # Errors
/// [`WireError::OutOfRange`] for the duration, [`WireError::NoSuchRow`] if 32 motors cannot hold what is lit.
pub fn sdk3_dot_message(
    intensities: &Intensities,
    request_id: u32,
    duration_ms: u32,
    motors: Motors,
) -> Result<String, WireError> {
    check_duration(duration_ms)?;
    let motor_values = motors.select(intensities)?;
    let inner =
        Dots { request_id, position: VEST, motor_values, duration_millis: duration_ms, device_index: -1 };
    let message = Some(text("dot message", &inner)?);
    text("dot message", &Envelope { r#type: "SdkPlayDotMode", message })
}

/// The version 3 message that ends everything.
///
/// # Errors
/// None in practice; the type is that of the other messages.
pub fn sdk3_stop_all() -> Result<String, WireError> {
    text("stop message", &Envelope { r#type: "SdkStopAll", message: None })
}

/// The line, newline included, that plays intensities through a Hub.
///
/// # Errors
/// [`WireError::OutOfRange`] for the duration.
pub fn hub_line(intensities: &Intensities, request_id: u32, duration_ms: u32) -> Result<String, WireError> {
    check_duration(duration_ms)?;
    let motors = Motors::Forty.select(intensities)?;
    let message = text("hub line", &HubDots { request_id, pos: VEST, motors, duration_millis: duration_ms })?;
    let mut line = text("hub line", &HubEnvelope { message, r#type: "SdkPlayDotMode" })?;
    line.push('\n');
    Ok(line)
}
