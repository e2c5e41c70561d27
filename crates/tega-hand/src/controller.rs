//! One call per control cycle: measured angles and a closure level in, torques out.

use tega_error::OutOfRange;

use crate::HandError;
use crate::addition::MOST_ADDED_LEVELS;
use crate::joints::{ENCODER_RANGE_RAD, JOINTS, Joints, check_joints};
use crate::pd::{Gains, Velocity};
use crate::poses::{LEVELS, PoseSet};
use crate::trajectory::Trajectory;

/// What a hand is asked for in a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked {
    /// Closure level, 1 to 5 with fractions between two poses; changes are moves of 0.6 s and more.
    pub level: f64,
    /// What a reflex adds to it, 0 to [`MOST_ADDED_LEVELS`] levels: beside the moves, within a tenth of a second.
    pub added: f64,
}

impl From<f64> for Asked {
    /// A level and nothing beyond it.
    fn from(level: f64) -> Self {
        Self { level, added: 0.0 }
    }
}

impl Asked {
    /// The same if both numbers are in range.
    ///
    /// # Errors
    /// A level outside 1 to 5; an addition below 0 or above the most.
    pub(crate) fn check(self) -> Result<Self, HandError> {
        if !(1.0..=LEVELS as f64).contains(&self.level) {
            return Err(OutOfRange::new("level", self.level, "", "1 (open) to 5 (tight)").into());
        }
        if !(0.0..=MOST_ADDED_LEVELS).contains(&self.added) {
            let wanted = format!("0 to {MOST_ADDED_LEVELS}");
            return Err(OutOfRange::new("added", self.added, "levels", wanted).into());
        }
        Ok(self)
    }
}

/// Steers the hand to the closure level asked for, within the torque, slew and speed limits.
///
/// It holds no clock: each [`step`](Self::step) is one cycle of [`crate::TICK_S`], driven by the hand's own position
/// messages.
///
/// # Examples
/// ```
/// use tega_hand::{CLOSURE_POSES_RAD, HandController};
///
/// let mut controller = HandController::default();
/// let torques = controller.step(&CLOSURE_POSES_RAD[0], 3.0, None)?;
/// assert_eq!(torques, [0.0; 16]); // the target starts where the hand is
/// # Ok::<(), tega_hand::HandError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HandController {
    poses: PoseSet,
    gains: Gains,
    trajectory: Option<Trajectory>,
    velocity: Velocity,
    torques: Joints,
    level: Option<f64>,
}

impl HandController {
    /// A controller for these poses and gains; it adopts the first angles it is given.
    ///
    /// # Errors
    /// Gains that do not pass [`Gains::check`].
    pub fn new(poses: PoseSet, gains: Gains) -> Result<Self, HandError> {
        gains.check()?;
        Ok(Self { poses, gains, ..Self::default() })
    }

    /// One cycle towards a closure level, with or without an addition. Velocities are estimated from the angles where
    /// they are not given (rad/s).
    ///
    /// # Errors
    /// A level outside 1 to 5 or an addition that is out of range; an angle or velocity that is not finite, or an angle no encoder can report. There is
    /// no torque then: send zero. The target stays where it was, and the next torque starts from zero.
    pub fn step(
        &mut self,
        angles_rad: &Joints,
        asked: impl Into<Asked>,
        velocities_rad_s: Option<&Joints>,
    ) -> Result<Joints, HandError> {
        self.step_within(1.0, angles_rad, asked, velocities_rad_s)
    }

    /// One cycle with every torque limit lowered to a share of it, 0 to 1: a hot hand, or one that is let go.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn step_within(
        &mut self,
        share: f64,
        angles_rad: &Joints,
        asked: impl Into<Asked>,
        velocities_rad_s: Option<&Joints>,
    ) -> Result<Joints, HandError> {
        let checked = asked.into().check().and_then(|asked| {
            check_angles(angles_rad)?;
            if let Some(velocities) = velocities_rad_s {
                check_joints("velocities_rad_s", "rad/s", velocities, -f64::MAX, f64::MAX)?;
            }
            Ok(asked)
        });
        let asked = checked.inspect_err(|_| self.stop())?;
        let velocities = match velocities_rad_s {
            Some(given) => self.velocity.adopt(angles_rad, given),
            None => self.velocity.update(angles_rad),
        };
        let trajectory =
            self.trajectory.get_or_insert_with(|| Trajectory::new(self.poses.clone(), angles_rad));
        trajectory.advance(asked.level, asked.added);
        // The torque factor moves with the pose and what is added, so that the limit has no jump either.
        let factor: f64 = trajectory.shares().iter().zip(self.gains.level_factors).map(|(s, f)| s * f).sum();
        let factor = share.clamp(0.0, 1.0) * factor;
        let target = trajectory.target_rad();
        self.torques = self.gains.torques(&target, angles_rad, &velocities, factor, &self.torques);
        self.level = Some(asked.level);
        Ok(self.torques)
    }

    /// Adopt a measured pose: the target is there, at rest, and the torque starts from zero.
    ///
    /// # Errors
    /// An angle that is not finite, or that no encoder can report.
    pub fn reset(&mut self, angles_rad: &Joints) -> Result<(), HandError> {
        self.stop();
        check_angles(angles_rad)?;
        self.trajectory = Some(Trajectory::new(self.poses.clone(), angles_rad));
        self.level = None;
        Ok(())
    }

    /// Joint targets of the last cycle; none before the first.
    pub fn target_rad(&self) -> Option<Joints> {
        self.trajectory.as_ref().map(Trajectory::target_rad)
    }

    /// The place among the levels asked for last, 1 to 5; none before the first cycle and after [`reset`](Self::reset).
    pub const fn level(&self) -> Option<f64> {
        self.level
    }

    fn stop(&mut self) {
        self.torques = [0.0; JOINTS];
        self.velocity = Velocity::default();
    }
}

pub(crate) fn check_angles(angles_rad: &Joints) -> Result<(), HandError> {
    check_joints("angles_rad", "rad", angles_rad, -ENCODER_RANGE_RAD, ENCODER_RANGE_RAD)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "an adopted pose is taken as it is")]
mod tests {
    use super::*;
    use crate::CLOSURE_POSES_RAD;
    use crate::joints::TORQUE_LIMITS;
    use proptest::prelude::*;

    #[test]
    fn bad_input_gives_no_torque_and_the_next_starts_from_zero() {
        let mut controller = HandController::default();
        let open = CLOSURE_POSES_RAD[0];
        for _ in 0..100 {
            controller.step(&open, 5.0, None).unwrap();
        }
        let target = controller.target_rad();
        let mut broken = open;
        broken[7] = f64::NAN;
        let error = controller.step(&broken, 5.0, None).unwrap_err();
        assert!(error.to_string().starts_with("angles_rad of middle_j3 = NaN"), "{error}");
        assert_eq!(controller.target_rad(), target);
        assert!(controller.step(&open, 5.0, None).unwrap().iter().all(|tau| tau.abs() <= 0.05));
        for level in [0.0, 6.0, -1.0, f64::MAX, 0.999, 5.001] {
            let error = controller.step(&open, level, None).unwrap_err();
            assert!(error.to_string().ends_with("is out of range: 1 (open) to 5 (tight)"), "{error}");
        }
        for added in [f64::NAN, f64::INFINITY, -0.01, 1.01] {
            let error = controller.step(&open, Asked { level: 3.0, added }, None).unwrap_err();
            assert!(error.to_string().ends_with("levels is out of range: 0 to 1"), "{error}");
            assert_eq!(controller.torques, [0.0; JOINTS]);
        }
        assert!(controller.step(&[2.92; 16], 1.0, None).is_err());
        assert!(controller.step(&open, 1.0, Some(&[f64::INFINITY; 16])).is_err());
    }

    #[test]
    fn a_limp_hand_is_adopted_where_it_lies() {
        let mut controller = HandController::default();
        let limp = [0.3; JOINTS];
        assert_eq!(controller.step(&limp, 5.0, None).unwrap(), [0.0; JOINTS]);
        assert_eq!(controller.target_rad(), Some(limp));
        controller.reset(&[0.5; JOINTS]).unwrap();
        // Abduction goes no further than its limit of 0.47 rad.
        let adopted = std::array::from_fn(|j| if [0, 4, 8].contains(&j) { 0.47 } else { 0.5 });
        assert_eq!((controller.target_rad(), controller.level()), (Some(adopted), None));
    }

    #[test]
    fn what_is_added_raises_the_torque_limit_with_the_pose_and_without_a_jump() {
        let mut controller = HandController::default();
        // Held open by an object: the torque is at its limit throughout.
        let held = CLOSURE_POSES_RAD[0];
        let tau = |controller: &mut HandController, added: f64| {
            controller.step(&held, Asked { level: 3.0, added }, None).unwrap()[1] / TORQUE_LIMITS[1]
        };
        let firm = (0..500).map(|_| tau(&mut controller, 0.0)).last().unwrap();
        assert!((firm - 0.5).abs() < 1e-12, "{firm}");
        let mut shares = vec![firm];
        shares.extend((0..100).map(|_| tau(&mut controller, 0.5)));
        assert!((shares[100] - 0.6).abs() < 1e-12, "half of the way from level 3's limit to that of level 4");
        assert!(shares.windows(2).all(|two| (0.0..0.01).contains(&(two[1] - two[0]))), "{shares:?}");
        controller.reset(&held).unwrap();
        assert_eq!(controller.trajectory.as_ref().map(Trajectory::added), Some(0.0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

        #[test]
        fn torque_never_exceeds_a_joints_limit(
            cycles in prop::collection::vec(
                (prop::array::uniform16(-2.9..2.9f64), 1.0..=5.0f64, 0.0..=MOST_ADDED_LEVELS), 1..200),
        ) {
            let mut controller = HandController::default();
            let mut last = [0.0; JOINTS];
            for (angles, level, added) in cycles {
                let torques = controller.step(&angles, Asked { level, added }, None).unwrap();
                for j in 0..JOINTS {
                    prop_assert!(torques[j].abs() <= TORQUE_LIMITS[j]);
                    prop_assert!((torques[j] - last[j]).abs() <= 0.05 + 1e-12);
                }
                last = torques;
            }
        }
    }
}
