//! How warm the hand is, and how much torque that leaves.

use tega_wire::allegro::{Finger, temperature_c};

use crate::joints::{JOINT_NAMES, JOINTS};

/// Temperature of a joint above which the torque limits fall, linearly, to half at 75 °C.
pub const WARM_C: f64 = 60.0;
const HOT_C: f64 = 75.0;
const HOT_SHARE: f64 = 0.5;
/// Temperature of a joint at which the hand is let go.
pub const TOO_HOT_C: u8 = 80;
/// What was not reported for so long is unknown, which is treated as hot.
const UNKNOWN_NS: i64 = 5_000_000_000;

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Heat {
    pub(crate) joints_c: [Option<u8>; JOINTS],
    /// Last valid readings: a joint does not cool because its sensor fails.
    known_c: [Option<u8>; JOINTS],
    /// The hand says that it throttles, or that it talks badly to its own boards.
    warned: bool,
    /// When its status, and each joint's valid reading, came last; none before the hand is watched.
    status_ns: i64,
    last_ns: Option<[i64; JOINTS]>,
}

impl Heat {
    /// The hand begins to be watched.
    pub(crate) fn start(&mut self, t_ns: i64) {
        (self.status_ns, self.last_ns) = (t_ns, Some([t_ns; JOINTS]));
    }

    pub(crate) fn take_status(&mut self, warned: bool, t_ns: i64) {
        (self.warned, self.status_ns) = (warned, t_ns);
    }

    pub(crate) fn take(&mut self, finger: Finger, bytes: [u8; 4], t_ns: i64) {
        let last_ns = self.last_ns.get_or_insert([t_ns; JOINTS]);
        for (j, reading) in (4 * usize::from(finger.number())..).zip(bytes.map(temperature_c)) {
            self.joints_c[j] = reading;
            if reading.is_some() {
                (self.known_c[j], last_ns[j]) = (reading, t_ns);
            }
        }
    }

    /// For how long a finger has reported no valid temperature at all; the longest of the four.
    pub(crate) fn silent_ns(&self, t_ns: i64) -> i64 {
        let newest = |finger: &[i64]| finger.iter().copied().max();
        self.last_ns.map_or(0, |last| t_ns - last.chunks(4).filter_map(newest).min().unwrap_or(t_ns))
    }

    /// Whether status, a finger or a joint that had a reading before is silent for too long.
    fn unknown(&self, t_ns: i64) -> bool {
        let old = |last_ns: i64| t_ns - last_ns > UNKNOWN_NS;
        self.last_ns.is_some_and(|last| {
            let lost = self.known_c.iter().zip(last).any(|(known, last_ns)| known.is_some() && old(last_ns));
            lost || old(self.status_ns) || self.silent_ns(t_ns) > UNKNOWN_NS
        })
    }

    /// The warmest joint.
    fn warmest(&self) -> Option<(&'static str, u8)> {
        let known = JOINT_NAMES.into_iter().zip(self.known_c).filter_map(|(name, c)| Some((name, c?)));
        known.max_by_key(|&(_, c)| c)
    }

    /// The joint that is too hot to go on, with its temperature.
    pub(crate) fn too_hot(&self) -> Option<(&'static str, u8)> {
        self.warmest().filter(|&(_, c)| c >= TOO_HOT_C)
    }

    /// Share of the torque limits that the temperature leaves.
    pub(crate) fn share(&self, t_ns: i64) -> f64 {
        if self.warned || self.unknown(t_ns) {
            return HOT_SHARE;
        }
        let warmest = self.warmest().map_or(0.0, |(_, c)| f64::from(c));
        1.0 - (1.0 - HOT_SHARE) * ((warmest - WARM_C) / (HOT_C - WARM_C)).clamp(0.0, 1.0)
    }
}
