//! Where the joints should be: minimum-jerk moves between closure levels.
//!
//! A place among the closure levels, 1 to 5 with fractions between, is approached by one level at a time. Each step to a neighbour is a minimum-jerk move; the next
//! step may start once a third of it is over, and the moves add up. Every target is therefore a mixture of the poses
//! with shares that are never negative and sum to 1, whatever levels are asked for and when: the joints stay within
//! the range of the poses, position, velocity and acceleration have no jump, and the peak speed has a bound that
//! follows from the largest step between neighbours. A pose that was measured is left by one more minimum-jerk
//! blend, slow enough to keep the sum of the speeds under the limit. What a reflex adds ([`crate::addition`]) has what
//! these leave of it in each tick.

use std::collections::VecDeque;

use crate::addition::{ADDED_ACCELERATION_RAD_S2, Addition, further, room_per_s, within};
use crate::joints::{JOINT_LIMITS_RAD, Joints, TICK_S, clamp_to_limits};
use crate::poses::{LEVELS, PoseSet, distance_rad};

/// No joint target ever moves faster.
pub const MAX_SPEED_RAD_S: f64 = 3.0;
/// Duration of a move to a neighbouring level; longer where the poses lie far apart.
pub const MOVE_S: f64 = 0.6;

/// Shares of [`MAX_SPEED_RAD_S`] for moving between poses and for leaving a measured pose: 2.9 together.
const POSES_SPEED_RAD_S: f64 = 2.1;
const TAKEOVER_SPEED_RAD_S: f64 = 0.8;
/// Up to here an addition may bring the speed of any joint.
const ADDED_SPEED_RAD_S: f64 = 2.95;
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
/// Poses closer than this are taken to be so far apart, where their distance divides.
const LEAST_STEP_RAD: f64 = 0.01;

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

/// The joint targets of a hand that is asked for a closure level every tick, and for what is added to it.
///
/// # Examples
/// ```
/// use tega_hand::{CLOSURE_POSES_RAD, PoseSet, Trajectory};
///
/// let mut trajectory = Trajectory::new(PoseSet::default(), &CLOSURE_POSES_RAD[0]);
/// for _ in 0..=100 {
///     trajectory.advance(2.0, 0.0);
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
    addition: Addition,
    /// Largest change of the addition's speed, levels per second².
    added_acceleration: f64,
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
        let added_acceleration = ADDED_ACCELERATION_RAD_S2 / poses.largest_step_rad().max(LEAST_STEP_RAD);
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
            addition: Addition::default(),
            added_acceleration,
        }
    }

    /// One tick passes with `level` asked for, 1 to 5 with fractions between two poses, and `added` to it, 0 to
    /// [`crate::MOST_ADDED_LEVELS`]; both are held within.
    pub fn advance(&mut self, level: f64, added: f64) {
        let added = within(added);
        let before = (!self.addition.rests_at(added)).then(|| self.target_rad());
        self.advance_moves(level);
        if let Some(before) = before {
            let (moved, taken) = (self.target_rad(), self.taken());
            let moved = std::array::from_fn(|j| moved[j] - before[j]);
            let further_rad = self.poses.mix(&further(&self.own_shares())).map(|step| taken * step);
            let room_per_s = room_per_s(&moved, &further_rad, ADDED_SPEED_RAD_S * TICK_S);
            self.addition.follow(added, room_per_s, self.added_acceleration);
        }
    }

    fn advance_moves(&mut self, level: f64) {
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
        let (mut shares, added) = (self.own_shares(), self.addition.levels());
        if added > 0.0 {
            let change = further(&shares);
            shares.iter_mut().zip(change).for_each(|(share, change)| *share += added * change);
        }
        shares
    }

    /// The same without what is added.
    fn own_shares(&self) -> [f64; LEVELS] {
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
        let taken = self.taken();
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

    /// Share in which the measured pose has been left.
    fn taken(&self) -> f64 {
        minimum_jerk(self.takeover_age.unwrap_or(0), self.takeover_ticks)
    }

    /// Levels that are added now.
    pub const fn added(&self) -> f64 {
        self.addition.levels()
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
        trajectory.advance(to as f64, 0.0);
        (1..2000)
            .find(|_| {
                trajectory.advance(to as f64, 0.0);
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

    /// A level, what is added, and for how many ticks.
    fn asked() -> impl Strategy<Value = Vec<(f64, f64, usize)>> {
        let level = prop_oneof![(1..=5u8).prop_map(f64::from), 1.0..5.0f64];
        let added = prop_oneof![Just(0.0), Just(1.0), 0.0..=1.0f64, Just(f64::NAN), Just(f64::MAX)];
        prop::collection::vec((level, added, prop_oneof![1..8usize, 1..400usize]), 1..30)
    }

    /// Ticks until `added` levels are in the target of a hand that lies on pose 3.
    fn ticks_to_add(asked: impl Fn(usize) -> f64, added: f64) -> Option<usize> {
        let mut trajectory = Trajectory::new(PoseSet::default(), &CLOSURE_POSES_RAD[2]);
        (1..1000).find(|&tick| {
            trajectory.advance(3.0, asked(tick));
            let step = CLOSURE_POSES_RAD[3][1] - CLOSURE_POSES_RAD[2][1];
            trajectory.target_rad()[1] >= CLOSURE_POSES_RAD[2][1] + added * step - 1e-12
        })
    }

    #[test]
    fn half_a_level_is_there_within_a_tenth_of_a_second() {
        assert_eq!(ticks_to_add(|_| 0.5, 0.5), Some(31));
        // As fast as a reflex can wish for a level: ten levels a second.
        assert_eq!(ticks_to_add(|tick| (0.03 * tick as f64).min(1.0), 0.5), Some(27));
        assert_eq!(ticks_to_add(|tick| (0.03 * tick as f64).min(1.0), 1.0), Some(54));
    }

    #[test]
    fn without_an_addition_the_targets_are_those_of_before_there_was_one() {
        let mut draw = 1u64;
        let mut next = move || {
            draw = draw.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (draw >> 33) as u32
        };
        let mut trajectory = Trajectory::new(PoseSet::default(), &[0.3; JOINTS]);
        let mut sum = 0u64;
        for _ in 0..60 {
            let level = 1.0 + f64::from(next() % 401) / 100.0;
            for _ in 0..next() % 200 {
                trajectory.advance(level, 0.0);
                for angle in trajectory.target_rad() {
                    sum = sum.rotate_left(5) ^ angle.to_bits();
                }
            }
        }
        // Of the same course in the version that knew no addition.
        assert_eq!(sum, 11_791_872_153_816_629_368);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

        #[test]
        fn whatever_is_asked_the_target_is_smooth_slow_and_inside(
            poses in poses(),
            start in prop::array::uniform16(-2.9..2.9f64),
            on_pose in any::<bool>(),
            with_addition in any::<bool>(),
            asked in asked(),
        ) {
            let start = if on_pose { poses.angles_rad()[2] } else { start };
            let mut trajectory = Trajectory::new(poses.clone(), &start);
            let mut own = trajectory.clone();
            let mut before = trajectory.target_rad();
            prop_assert_eq!(before, clamp_to_limits(start, 0.0));
            let mut speed_before = [0.0; JOINTS];
            let (most_rad_s, most_rad_s2) = if with_addition { (MAX_SPEED_RAD_S, 200.0) } else { (2.91, 40.0) };
            for (level, added) in asked.into_iter().flat_map(|(level, added, n)| std::iter::repeat_n((level, added), n)) {
                trajectory.advance(level, if with_addition { added } else { 0.0 });
                own.advance(level, 0.0);
                prop_assert!(trajectory.moves.len() <= 3);
                let (shares, own_shares) = (trajectory.shares(), own.shares());
                prop_assert!(shares.iter().all(|&share| share >= 0.0));
                prop_assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                prop_assert!((0.0..=1.0).contains(&trajectory.added()));
                // What is added takes no share to a pose that is more open: from each pose on there is as much or more.
                for pose in 0..LEVELS {
                    let [firmer, of_own] = [&shares, &own_shares].map(|shares| shares[pose..].iter().sum::<f64>());
                    prop_assert!(firmer >= of_own - 1e-12);
                }
                let target = trajectory.target_rad();
                for joint in 0..JOINTS {
                    let (low, high) = JOINT_LIMITS_RAD[joint];
                    prop_assert!((low..=high).contains(&target[joint]));
                    let speed = (target[joint] - before[joint]) / TICK_S;
                    prop_assert!(speed.abs() < most_rad_s, "{speed}");
                    // Minimum-jerk acceleration peaks at 5.78 d/T²; a jump in velocity would show as far more.
                    let acceleration = (speed - speed_before[joint]) / TICK_S;
                    prop_assert!(acceleration.abs() < most_rad_s2, "{acceleration}");
                    speed_before[joint] = speed;
                }
                before = target;
            }
            // What is added is taken back, and leaves nothing behind.
            for _ in 0..400 {
                trajectory.advance(3.0, 0.0);
                own.advance(3.0, 0.0);
            }
            prop_assert_eq!(trajectory, own);
        }

        #[test]
        fn every_level_is_reached_and_kept(poses in poses(), asked in asked(), last in 1..=5usize) {
            let mut trajectory = Trajectory::new(poses.clone(), &poses.angles_rad()[0]);
            for (level, added, n) in asked {
                (0..n).for_each(|_| trajectory.advance(level, added));
            }
            let enough = 4 * trajectory.move_ticks;
            (0..enough).for_each(|_| trajectory.advance(last as f64, 0.0));
            prop_assert_eq!(trajectory.target_rad(), poses.angles_rad()[last - 1]);
        }

        #[test]
        fn every_place_between_two_poses_is_reached(place in 1.0..5.0f64, start in 1..=5usize) {
            let poses = PoseSet::default();
            let mut trajectory = Trajectory::new(poses.clone(), &poses.angles_rad()[start - 1]);
            (0..4 * trajectory.move_ticks).for_each(|_| trajectory.advance(place, 0.0));
            let below = place as usize;
            for (joint, target) in trajectory.target_rad().iter().enumerate() {
                let (low, high) = (poses.angles_rad()[below - 1][joint], poses.angles_rad()[below][joint]);
                let wanted = low + (place - below as f64) * (high - low);
                prop_assert!((target - wanted).abs() < 1e-8, "{target} {wanted}");
            }
        }
    }
}
