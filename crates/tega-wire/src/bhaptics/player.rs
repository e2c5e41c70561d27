//! The vendor's Player, websocket protocol version 2: one JSON object a message.
//!
//! A new frame replaces the running one of the same key and ends by itself after its duration, so a stream of frames
//! with two constant keys and a duration of 1.5 to 3 periods goes silent when the host does.

use serde::{Deserialize, Serialize};
use tega_error::OutOfRange;

use super::Intensities;
use crate::WireError;

/// The shortest and longest duration the vendor's clients accept, ms.
const DURATION_MS: std::ops::RangeInclusive<u32> = 20..=100_000;

pub(super) fn check_duration(duration_ms: u32) -> Result<(), WireError> {
    if DURATION_MS.contains(&duration_ms) {
        return Ok(());
    }
    let value = f64::from(duration_ms);
    Err(OutOfRange::new("duration_ms", value, "ms", "20 to 100000").into())
}

// Field order is key order: the messages are compared byte for byte.
#[derive(Serialize)]
struct Dot {
    #[serde(rename = "Index")]
    index: usize,
    #[serde(rename = "Intensity")]
    intensity: u8,
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Frame<'a> {
    position: &'a str,
    duration_millis: u32,
    dot_points: Vec<Dot>,
    path_points: [u8; 0],
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Submit<'a> {
    r#type: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<Frame<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Envelope<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    register: Option<[u8; 0]>,
    submit: Vec<Submit<'a>>,
}

/// Text of a value that always serialises; an error would mean a map with keys that are not strings.
pub(super) fn text(packet: &'static str, value: &impl Serialize) -> Result<String, WireError> {
    serde_json::to_string(value).map_err(|e| WireError::Json { packet, reason: e.to_string() })
}

fn submit(submit: Submit<'_>) -> Result<String, WireError> {
    text("player message", &Envelope { register: None, submit: vec![submit] })
}

/// The message that plays forty intensities for `duration_ms`, one dot frame a panel.
///
/// A panel without a key is left out. A panel that is all zero is sent with no dots, which silences what its key was
/// playing.
///
/// # Errors
/// [`WireError::OutOfRange`] for a duration outside 20 to 100000 ms, [`WireError::Empty`] without any key or for an
/// empty one.
///
/// ```
/// use tega_wire::bhaptics::{Intensities, player_v2_message};
/// let message = player_v2_message(&Intensities::new(&[0; 40])?, 150, Some("front"), None)?;
/// assert!(message.starts_with(r#"{"Register":[],"Submit":[{"Type":"frame","Key":"front""#));
/// # Ok::<(), tega_wire::WireError>(())
/// ```
pub fn player_v2_message(
    intensities: &Intensities,
    duration_ms: u32,
    front_key: Option<&str>,
    back_key: Option<&str>,
) -> Result<String, WireError> {
    check_duration(duration_ms)?;
    let (front, back) = intensities.panels();
    let mut entries = Vec::with_capacity(2);
    for (key, name, position, panel) in
        [(front_key, "front_key", "VestFront", front), (back_key, "back_key", "VestBack", back)]
    {
        let Some(key) = key else { continue };
        if key.is_empty() {
            return Err(WireError::Empty { name });
        }
        let lit = panel.iter().enumerate().filter(|&(_, &intensity)| intensity > 0);
        let dot_points = lit.map(|(index, &intensity)| Dot { index, intensity }).collect();
        let frame = Frame { position, duration_millis: duration_ms, dot_points, path_points: [] };
        entries.push(Submit { r#type: "frame", key: Some(key), frame: Some(frame) });
    }
    if entries.is_empty() {
        return Err(WireError::Empty { name: "front_key and back_key" });
    }
    text("player message", &Envelope { register: Some([]), submit: entries })
}

/// The message that ends what one key is playing.
///
/// # Errors
/// [`WireError::Empty`] for an empty key.
pub fn player_v2_stop(key: &str) -> Result<String, WireError> {
    if key.is_empty() {
        return Err(WireError::Empty { name: "key" });
    }
    submit(Submit { r#type: "turnOff", key: Some(key), frame: None })
}

/// The message that ends everything.
///
/// # Errors
/// None in practice; the type is that of the other messages.
pub fn player_v2_stop_all() -> Result<String, WireError> {
    submit(Submit { r#type: "turnOffAll", key: None, frame: None })
}

/// A frame without dots for a foot that nobody wears: it makes the Player send a fresh status.
///
/// # Errors
/// None in practice; the type is that of the other messages.
pub fn player_v2_ping() -> Result<String, WireError> {
    let frame = Frame { position: "FootL", duration_millis: 100, dot_points: vec![], path_points: [] };
    submit(Submit { r#type: "frame", key: Some("ping"), frame: Some(frame) })
}

/// What the Player says of itself. It is no acknowledgement that anything moved.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PlayerStatus {
    /// How many devices it is connected to.
    pub connected_devices: i64,
    /// Their positions; a vest is "Vest".
    pub connected_positions: Vec<String>,
    /// Keys that are playing.
    pub active_keys: Vec<String>,
    /// Levels of the front panel as the Player reports them, usually twenty; empty if it does not.
    pub front: Vec<i64>,
    /// Likewise of the back panel.
    pub back: Vec<i64>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct RawStatus {
    #[serde(alias = "connectedDeviceCount")]
    connected_device_count: Option<i64>,
    #[serde(alias = "connectedPositions")]
    connected_positions: Option<Vec<String>>,
    #[serde(alias = "activeKeys")]
    active_keys: Option<Vec<String>>,
    #[serde(alias = "status")]
    status: Option<RawPanels>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct RawPanels {
    #[serde(alias = "vestFront")]
    vest_front: Option<Vec<i64>>,
    #[serde(alias = "vestBack")]
    vest_back: Option<Vec<i64>>,
}

/// Parse a status message. Fields that are missing, null or unknown do not matter.
///
/// # Errors
/// [`WireError::Json`] for text that is not a JSON object, or a known field of another type.
pub fn player_v2_status(message: &str) -> Result<PlayerStatus, WireError> {
    let bad = |reason: String| WireError::Json { packet: "player status", reason };
    // A derived parser would take a list of the fields in their order as well.
    if !message.trim_start().starts_with('{') {
        return Err(bad("not a JSON object".into()));
    }
    let raw: RawStatus = serde_json::from_str(message).map_err(|e| bad(e.to_string()))?;
    let panels = raw.status.unwrap_or_default();
    Ok(PlayerStatus {
        connected_devices: raw.connected_device_count.unwrap_or_default(),
        connected_positions: raw.connected_positions.unwrap_or_default(),
        active_keys: raw.active_keys.unwrap_or_default(),
        front: panels.vest_front.unwrap_or_default(),
        back: panels.vest_back.unwrap_or_default(),
    })
}
