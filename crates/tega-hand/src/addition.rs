//! What a reflex adds to the closure that a hand is asked for, beside the moves from level to level.
//!
//! An addition of `a` levels is the share `a` of a step by one level, taken by every pose that the target is a mixture
//! of: what lies on pose 3 lies by `1 - a` on pose 3 and by `a` on pose 4. So it never opens, never leaves the poses,
//! and has its own speed, which is limited by what the moves leave of the hand's. Above level 4 it does that share of
//! what is left of the way to level 5.

use crate::joints::{Joints, TICK_S};
use crate::poses::LEVELS;

/// The largest addition, levels.
pub const MOST_ADDED_LEVELS: f64 = 1.0;
/// No addition by itself accelerates a joint's target faster, rad/s².
pub const ADDED_ACCELERATION_RAD_S2: f64 = 120.0;
/// Share of the acceleration with which a stop is planned: the last two ticks of one ask for up to 9/8 of it.
const PLANNED: f64 = 0.85;
/// Levels that are no way any more, but the rounding of one.
const ROUNDING: f64 = 1e-12;

/// An addition that follows what is asked for without a jump in position or speed, and without going beyond it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Addition {
    levels: f64,
    levels_per_s: f64,
}

impl Addition {
    /// Levels that are added now.
    pub(crate) const fn levels(&self) -> f64 {
        self.levels
    }

    /// Whether it is at rest where it is asked to be.
    #[allow(clippy::float_cmp, reason = "it comes to rest exactly where it is asked to be")]
    pub(crate) fn rests_at(&self, asked: f64) -> bool {
        self.levels == asked && self.levels_per_s == 0.0
    }

    /// One tick towards `asked` levels, with at most this speed and this change of speed, levels a second and second².
    ///
    /// As fast as it can still stop in time, which holds for every later wish as well: the way to either end is never
    /// shorter than the way to a stop.
    pub(crate) fn follow(&mut self, asked: f64, most_per_s: f64, acceleration: f64) {
        let (way, planned) = (asked - self.levels, PLANNED * acceleration);
        let stoppable = planned * ((TICK_S * TICK_S / 4.0 + 2.0 * way.abs() / planned).sqrt() - TICK_S / 2.0);
        let wanted = stoppable.min(way.abs() / TICK_S).copysign(way);
        let change = acceleration * TICK_S;
        let speed = wanted.clamp(self.levels_per_s - change, self.levels_per_s + change);
        self.levels_per_s = speed.clamp(-most_per_s, most_per_s);
        let step = self.levels_per_s * TICK_S;
        // A whole way is whole: what is taken back leaves nothing.
        let there = (step - way).abs() <= ROUNDING;
        self.levels = if there { asked } else { (self.levels + step).clamp(0.0, MOST_ADDED_LEVELS) };
    }
}

/// An addition as it is asked for: a number from 0 to the most.
pub(crate) fn within(added: f64) -> f64 {
    if added.is_nan() { 0.0 } else { added.clamp(0.0, MOST_ADDED_LEVELS) }
}

/// By how much each pose's share changes for a whole level more.
pub(crate) fn further(shares: &[f64; LEVELS]) -> [f64; LEVELS] {
    let mut change = [0.0; LEVELS];
    for pose in 1..LEVELS {
        change[pose - 1] -= shares[pose - 1];
        change[pose] += shares[pose - 1];
    }
    change
}

/// The speed that is left for a whole level more of `further_rad`, levels a second, where the joints have moved by
/// `moved_rad` in this tick and no joint may move by more than `most_rad`.
pub(crate) fn room_per_s(moved_rad: &Joints, further_rad: &Joints, most_rad: f64) -> f64 {
    let joints = moved_rad.iter().zip(further_rad).filter(|(_, further)| **further != 0.0);
    let steps = joints.map(|(moved, further)| (most_rad - moved.abs()).max(0.0) / further.abs());
    steps.fold(f64::MAX, f64::min) / TICK_S
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "it comes to rest exactly where it is asked to be")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn whatever_is_asked_it_is_bounded_has_no_jump_and_comes_to_rest_there(
            asked in prop::collection::vec((0.0..=MOST_ADDED_LEVELS, 1..120usize, 0.2..20.0f64), 1..40),
            acceleration in 20.0..2000.0f64,
            last in prop_oneof![Just(0.0), 0.0..=MOST_ADDED_LEVELS],
        ) {
            let mut addition = Addition::default();
            for (asked, n, most_per_s) in asked {
                for _ in 0..n {
                    let (levels, before) = (addition.levels, addition.levels_per_s);
                    addition.follow(asked, most_per_s, acceleration);
                    prop_assert!((0.0..=MOST_ADDED_LEVELS).contains(&addition.levels));
                    prop_assert!(addition.levels_per_s.abs() <= most_per_s);
                    // A lower limit of speed has the last word.
                    let change = addition.levels_per_s - before.clamp(-most_per_s, most_per_s);
                    prop_assert!(change.abs() <= acceleration * TICK_S + 1e-9, "{change}");
                    // The ends cut nothing off: what is shown as its speed is its speed.
                    let moved = (addition.levels - levels) / TICK_S;
                    prop_assert!((moved - addition.levels_per_s).abs() < 1e-9, "{moved} {addition:?}");
                }
            }
            for _ in 0..2000 {
                addition.follow(last, 5.0, acceleration);
            }
            prop_assert!(addition.rests_at(last), "{addition:?}");
        }

        #[test]
        fn it_never_goes_beyond_what_is_asked_from_rest(asked in 0.0..=MOST_ADDED_LEVELS, acceleration in 20.0..2000.0f64) {
            let mut addition = Addition::default();
            for _ in 0..1000 {
                addition.follow(asked, 7.0, acceleration);
                prop_assert!(addition.levels <= asked);
            }
            prop_assert!(addition.rests_at(asked));
        }

        #[test]
        fn a_level_more_moves_each_share_on_by_one(shares in prop::array::uniform5(0.0..1.0f64)) {
            let change = further(&shares);
            prop_assert!(change.iter().sum::<f64>().abs() < 1e-12);
            for pose in 1..LEVELS - 1 {
                prop_assert!((shares[pose] + change[pose] - shares[pose - 1]).abs() < 1e-12);
            }
            prop_assert_eq!(change[LEVELS - 1], shares[LEVELS - 2]);
        }
    }
}
