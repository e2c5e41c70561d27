//! Where the joints should be: minimum-jerk moves between closure levels.
//!
//! A place among the closure levels, 1 to 5 with fractions between, is approached by one level at a time. Each step to a neighbour is a minimum-jerk move; the next
//! step may start once a third of it is over, and the moves add up. Every target is therefore a mixture of the poses
//! with shares that are never negative and sum to 1, whatever levels are asked for and when: the joints stay within
//! the range of the poses, position, velocity and acceleration have no jump, and the peak speed has a bound that
//! follows from the largest step between neighbours. A pose that was measured is left by one more minimum-jerk
//! blend, slow enough to keep the sum of the speeds under the limit.

use std::collections::VecDeque;

use crate::joints::{JOINT_LIMITS_RAD, Joints, TICK_S, clamp_to_limits};
use crate::poses::{LEVELS, PoseSet, distance_rad};

/// No joint target ever moves faster.
pub const MAX_SPEED_RAD_S: f64 = 3.0;
/// Duration of a move to a neighbouring level; longer where the poses lie far apart.
pub const MOVE_S: f64 = 0.6;

/// Shares of [`MAX_SPEED_RAD_S`] for moving between poses and for leaving a measured pose: 2.9 together.
const POSES_SPEED_RAD_S: f64 = 2.1;
const TAKEOVER_SPEED_RAD_S: f64 = 0.8;
/// Peak speed of a minimum-jerk move of unit length and duration.
const PEAK: f64 = 1.875;
/// Peak speed of unit moves that follow each other at thirds of their duration: PEAK · (1 + 2 · 16 · (1/6 · 5/6)²).
const OVERLAPPING_PEAK: f64 = 3.033;

/// Minimum-jerk position, 0 to 1, at the tick `age` of `duration`.
fn minimum_jerk(age: u32, duration: u32) -> f64 {
    if age >= duration {
        return 1.0;
    }
    let s = f64::from(age) / f64::from(duration);
    (s * s * s * (10.0 - s * (15.0 - 6.0 * s))).clamp(0.0, 1.0)
}

/// Places closer than this are the same.
const SAME_PLACE: f64 = 1e-9;

fn differ(a: f64, b: f64) -> bool {
    (a - b).abs() > SAME_PLACE
}

/// Add a share of a place, which lies on a pose or between two.
fn add_place(shares: &mut [f64; LEVELS], place: f64, share: f64) {
    let below = (place.max(0.0) as usize).min(LEVELS - 1);
    let above = place - below as f64;
    shares[below] += share * (1.0 - above);
    if let Some(next) = shares.get_mut(below + 1) {
        *next += share * above;
    }
}

fn ticks(duration_s: f64) -> u32 {
    (duration_s / TICK_S).ceil() as u32
}

/// A step to a place on the way through the poses, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Move {
    to: f64,
    age: u32,
}

/// The joint targets of a hand that is asked for a closure level every tick.
///
/// # Examples
/// ```
/// use tega_hand::{CLOSURE_POSES_RAD, PoseSet, Trajectory};
///
/// let mut trajectory = Trajectory::new(PoseSet::default(), &CLOSURE_POSES_RAD[0]);
/// for _ in 0..=100 {
///     trajectory.advance(2.0);
/// }
/// assert!((trajectory.target_rad()[1] - 0.2).abs() < 1e-12); // halfway to pose 2 after 0.3 s
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    poses: PoseSet,
    /// Place (from 0) at which the oldest move starts.
    settled: f64,
    /// Moves under way, the oldest first; at most three.
    moves: VecDeque<Move>,
    move_ticks: u32,
    spacing_ticks: u32,
    since_last_move: u32,
    start_rad: Joints,
    /// Ticks since the first level was asked for.
    takeover_age: Option<u32>,
    takeover_ticks: u32,
}

impl Trajectory {
    /// Start at a measured pose, put inside the joint limits.
    pub fn new(poses: PoseSet, angles_rad: &Joints) -> Self {
        let start_rad = clamp_to_limits(*angles_rad, 0.0);
        let nearest = poses.nearest(&start_rad);
        let move_s = (OVERLAPPING_PEAK * poses.largest_step_rad() / POSES_SPEED_RAD_S).max(MOVE_S);
        let move_ticks = ticks(move_s);
        let spacing_ticks = move_ticks.div_ceil(3);
        let away = poses.angles_rad().iter().map(|pose| distance_rad(pose, &start_rad)).fold(0.0, f64::max);
        let on_a_pose = poses.angles_rad().get(nearest) == Some(&start_rad);
        let takeover_ticks = if on_a_pose { 0 } else { ticks(PEAK * away / TAKEOVER_SPEED_RAD_S) };
        Self {
            poses,
            settled: nearest as f64,
            moves: VecDeque::with_capacity(3),
            move_ticks,
            spacing_ticks,
            since_last_move: spacing_ticks,
            start_rad,
            takeover_age: None,
            takeover_ticks,
        }
    }

    /// One tick passes with `level` asked for: 1 to 5, held within, with fractions between two poses.
    pub fn advance(&mut self, level: f64) {
        for step in &mut self.moves {
            step.age += 1;
        }
        if let Some(oldest) = self.moves.front().filter(|oldest| oldest.age >= self.move_ticks) {
            self.settled = oldest.to;
            self.moves.pop_front();
        }
        self.takeover_age = Some(self.takeover_age.map_or(0, |age| age.saturating_add(1)));
        self.since_last_move = self.since_last_move.saturating_add(1).min(self.spacing_ticks);
        let head = self.moves.back().map_or(self.settled, |newest| newest.to);
        let wanted = if level.is_nan() { head } else { level.clamp(1.0, LEVELS as f64) - 1.0 };
        if differ(head, wanted) && self.since_last_move >= self.spacing_ticks {
            let to = head + (wanted - head).clamp(-1.0, 1.0);
            self.moves.push_back(Move { to, age: 0 });
            self.since_last_move = 0;
        }
    }

    /// Share of each pose in the target, without the measured pose that is being left.
    pub fn shares(&self) -> [f64; LEVELS] {
        let mut shares = [0.0; LEVELS];
        let mut from = self.settled;
        add_place(&mut shares, from, 1.0);
        for step in &self.moves {
            let moved = minimum_jerk(step.age, self.move_ticks);
            add_place(&mut shares, from, -moved);
            add_place(&mut shares, step.to, moved);
            from = step.to;
        }
        // Between two poses a difference of nothing may be a rounding error below it.
        shares.map(|share| share.max(0.0))
    }

    /// Joint targets of this tick.
    pub fn target_rad(&self) -> Joints {
        let mut target = self.poses.mix(&self.shares());
        let taken = minimum_jerk(self.takeover_age.unwrap_or(0), self.takeover_ticks);
        if taken < 1.0 {
            for (target, start) in target.iter_mut().zip(&self.start_rad) {
                *target = (1.0 - taken) * start + taken * *target;
            }
        }
        // A mixture can leave the range of its parts by a rounding error.
        for (target, (low, high)) in target.iter_mut().zip(JOINT_LIMITS_RAD) {
            *target = target.clamp(low, high);
        }
        target
    }

    /// Duration of a move to a neighbouring level with these poses, in seconds.
    pub fn move_s(&self) -> f64 {
        f64::from(self.move_ticks) * TICK_S
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "targets are exact at rest")]
mod tests {
    use super::*;
    use crate::poses::CLOSURE_POSES_RAD;
    use crate::{JOINTS, POSE_MARGIN_RAD};
    use proptest::prelude::*;

    fn ticks_to_settle(from: usize, to: usize) -> usize {
        let mut trajectory = Trajectory::new(PoseSet::default(), &CLOSURE_POSES_RAD[from - 1]);
        trajectory.advance(to as f64);
        (1..2000)
            .find(|_| {
                trajectory.advance(to as f64);
                trajectory.target_rad() == CLOSURE_POSES_RAD[to - 1]
            })
            .unwrap()
    }

    #[test]
    fn durations_between_levels() {
        for (from, to) in [(1, 2), (2, 3), (3, 4), (4, 5), (5, 4), (2, 1)] {
            assert_eq!(ticks_to_settle(from, to), 200, "{from} to {to}");
        }
        for (from, to) in [(1, 5), (5, 1)] {
            assert_eq!(ticks_to_settle(from, to), 401, "{from} to {to}");
        }
    }

    #[test]
    fn the_overlap_constant_is_the_peak_of_three_moves() {
        let speed = |s: f64| if (0.0..=1.0).contains(&s) { 30.0 * (s * (1.0 - s)).powi(2) } else { 0.0 };
        let sum = |s: f64| (-4..=4).map(|k| speed(s + f64::from(k) / 3.0)).sum::<f64>();
        let peak = (0..=1000).map(|i| sum(f64::from(i) / 1000.0)).fold(0.0, f64::max);
        assert!(peak <= OVERLAPPING_PEAK && peak > OVERLAPPING_PEAK - 1e-3, "{peak}");
    }

    fn poses() -> impl Strategy<Value = PoseSet> {
        let angle = |joint: usize| {
            let (low, high) = JOINT_LIMITS_RAD[joint];
            low + POSE_MARGIN_RAD..high - POSE_MARGIN_RAD
        };
        let pose = std::array::from_fn::<_, JOINTS, _>(angle);
        let any = [pose.clone(), pose.clone(), pose.clone(), pose.clone(), pose];
        prop_oneof![Just(PoseSet::default()), any.prop_map(|poses| PoseSet::new(poses).unwrap())]
    }

    fn levels() -> impl Strategy<Value = Vec<(f64, usize)>> {
        prop::collection::vec(
            (prop_oneof![(1..=5u8).prop_map(f64::from), 1.0..5.0f64], prop_oneof![1..8usize, 1..400usize]),
            1..30,
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

        #[test]
        fn whatever_is_asked_the_target_is_smooth_slow_and_inside(
            poses in poses(),
            start in prop::array::uniform16(-2.9..2.9f64),
            on_pose in any::<bool>(),
            asked in levels(),
        ) {
            let start = if on_pose { poses.angles_rad()[2] } else { start };
            let mut trajectory = Trajectory::new(poses, &start);
            let mut before = trajectory.target_rad();
            prop_assert_eq!(before, clamp_to_limits(start, 0.0));
            let mut speed_before = [0.0; JOINTS];
            for level in asked.into_iter().flat_map(|(level, n)| std::iter::repeat_n(level, n)) {
                trajectory.advance(level);
                prop_assert!(trajectory.moves.len() <= 3);
                let shares = trajectory.shares();
                prop_assert!(shares.iter().all(|&share| share >= 0.0));
                prop_assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                let target = trajectory.target_rad();
                for joint in 0..JOINTS {
                    let (low, high) = JOINT_LIMITS_RAD[joint];
                    prop_assert!((low..=high).contains(&target[joint]));
                    let speed = (target[joint] - before[joint]) / TICK_S;
                    prop_assert!(speed.abs() < 2.91, "{speed}");
                    // Minimum-jerk acceleration peaks at 5.78 d/T²; a jump in velocity would show as far more.
                    let acceleration = (speed - speed_before[joint]) / TICK_S;
                    prop_assert!(acceleration.abs() < 40.0, "{acceleration}");
                    speed_before[joint] = speed;
                }
                before = target;
            }
        }

        #[test]
        fn every_level_is_reached_and_kept(poses in poses(), asked in levels(), last in 1..=5usize) {
            let mut trajectory = Trajectory::new(poses.clone(), &poses.angles_rad()[0]);
            for (level, n) in asked {
                (0..n).for_each(|_| trajectory.advance(level));
            }
            let enough = 4 * trajectory.move_ticks;
            (0..enough).for_each(|_| trajectory.advance(last as f64));
            prop_assert_eq!(trajectory.target_rad(), poses.angles_rad()[last - 1]);
        }

        #[test]
        fn every_place_between_two_poses_is_reached(place in 1.0..5.0f64, start in 1..=5usize) {
            let poses = PoseSet::default();
            let mut trajectory = Trajectory::new(poses.clone(), &poses.angles_rad()[start - 1]);
            (0..4 * trajectory.move_ticks).for_each(|_| trajectory.advance(place));
            let below = place as usize;
            for (joint, target) in trajectory.target_rad().iter().enumerate() {
                let (low, high) = (poses.angles_rad()[below - 1][joint], poses.angles_rad()[below][joint]);
                let wanted = low + (place - below as f64) * (high - low);
                prop_assert!((target - wanted).abs() < 1e-8, "{target} {wanted}");
            }
        }
    }
}
