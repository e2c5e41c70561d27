//! Four frames, one per finger, to one set of joint angles.

use tega_wire::allegro::{Finger, Scale, angle_rad};

use crate::joints::{JOINTS, Joints};

/// A frame that repeats the frame before it this soon is the adapter's copy, not the hand's next report.
const COPY_NS: i64 = 1_500_000;
/// A finger whose frame was lost keeps its last angles this long: three cycles.
pub(crate) const HELD_NS: i64 = 9_000_000;

/// What a position frame did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Taken {
    /// The set is not complete yet, or the frame was a copy.
    Partly,
    /// All four fingers have reported.
    Complete,
    /// The next set began while fingers of this one were missing; theirs are a cycle or two old.
    Held,
    /// As `Held`, but a finger has been silent too long to go on with its angles.
    Unusable,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct PositionSets {
    counts: [[i16; 4]; 4],
    last_ns: [Option<i64>; 4],
    fresh: [bool; 4],
    newest: Option<usize>,
    pub(crate) n_copies: u64,
    pub(crate) n_incomplete: u64,
}

impl PositionSets {
    /// Forget what was received; the counters go on.
    pub(crate) fn restart(&mut self) {
        *self = Self { n_copies: self.n_copies, n_incomplete: self.n_incomplete, ..Self::default() };
    }

    pub(crate) fn take(&mut self, finger: Finger, counts: [i16; 4], t_ns: i64) -> Taken {
        let f = usize::from(finger.number());
        let since = self.last_ns[f].map(|last| t_ns - last);
        let repeated = self.newest.replace(f) == Some(f) && self.counts[f] == counts;
        if repeated && since.is_some_and(|since| since < COPY_NS) {
            self.n_copies += 1;
            return Taken::Partly;
        }
        let mut taken = Taken::Partly;
        if self.fresh[f] {
            self.n_incomplete += 1;
            self.fresh = [false; 4];
            let held = |last: &Option<i64>| last.is_some_and(|last| t_ns - last <= HELD_NS);
            taken = if self.last_ns.iter().all(held) { Taken::Held } else { Taken::Unusable };
        }
        self.counts[f] = counts;
        self.last_ns[f] = Some(t_ns);
        self.fresh[f] = true;
        if self.fresh == [true; 4] {
            self.fresh = [false; 4];
            return Taken::Complete;
        }
        taken
    }

    pub(crate) fn angles_rad(&self) -> Joints {
        let mut angles = [0.0; JOINTS];
        angles
            .iter_mut()
            .zip(self.counts.as_flattened())
            .for_each(|(angle, &c)| *angle = angle_rad(c, Scale::V4));
        angles
    }

    pub(crate) fn counts(&self) -> [[i16; 4]; 4] {
        self.counts
    }

    /// The first finger without a frame since `since_ns`.
    pub(crate) fn silent_finger(&self, since_ns: i64) -> Option<Finger> {
        Finger::ALL
            .into_iter()
            .zip(self.last_ns)
            .find(|(_, t)| t.is_none_or(|t| t < since_ns))
            .map(|(f, _)| f)
    }
}
