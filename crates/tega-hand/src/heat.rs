//! How warm the hand is, and how much torque that leaves.

use tega_wire::allegro::{Finger, temperature_c};

use crate::joints::{JOINT_NAMES, JOINTS};

/// Above this the torque limits fall, linearly, to [`HOT_SHARE`] at [`HOT_C`].
const WARM_C: f64 = 60.0;
const HOT_C: f64 = 75.0;
const HOT_SHARE: f64 = 0.5;
/// A joint this warm is let go.
const TOO_HOT_C: u8 = 80;
/// Without a reading for so long the temperature is unknown, which is treated as hot.
const UNKNOWN_NS: i64 = 5_000_000_000;

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Heat {
    pub(crate) joints_c: [Option<u8>; JOINTS],
    /// The hand says that it throttles, or that it talks badly to its own boards.
    pub(crate) warned: bool,
    last_ns: Option<i64>,
}

impl Heat {
    /// The hand begins to be watched.
    pub(crate) fn start(&mut self, t_ns: i64) {
        self.last_ns = Some(t_ns);
    }

    pub(crate) fn take(&mut self, finger: Finger, bytes: [u8; 4], t_ns: i64) {
        let readings = bytes.map(temperature_c);
        if readings.iter().any(Option::is_some) {
            self.last_ns = Some(t_ns);
        }
        let first = 4 * usize::from(finger.number());
        self.joints_c.iter_mut().skip(first).zip(readings).for_each(|(to, reading)| *to = reading);
    }

    pub(crate) fn silent_ns(&self, t_ns: i64) -> i64 {
        self.last_ns.map_or(0, |last| t_ns - last)
    }

    /// The warmest joint.
    fn warmest(&self) -> Option<(&'static str, u8)> {
        let known = JOINT_NAMES.into_iter().zip(self.joints_c).filter_map(|(name, c)| Some((name, c?)));
        known.max_by_key(|&(_, c)| c)
    }

    /// The joint that is too hot to go on, with its temperature.
    pub(crate) fn too_hot(&self) -> Option<(&'static str, u8)> {
        self.warmest().filter(|&(_, c)| c >= TOO_HOT_C)
    }

    /// Share of the torque limits that the temperature leaves.
    pub(crate) fn share(&self, t_ns: i64) -> f64 {
        if self.warned || self.silent_ns(t_ns) > UNKNOWN_NS {
            return HOT_SHARE;
        }
        let warmest = self.warmest().map_or(0.0, |(_, c)| f64::from(c));
        1.0 - (1.0 - HOT_SHARE) * ((warmest - WARM_C) / (HOT_C - WARM_C)).clamp(0.0, 1.0)
    }
}
