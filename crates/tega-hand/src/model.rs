//! The ideal joint model: what stands in for a hand that is not attached.

use std::f64::consts::FRAC_PI_3;
use tega_error::OutOfRange;

use crate::HandError;
use crate::controller::check_angles;
use crate::joints::{JOINTS, Joints, STOP_MARGIN_RAD, TICK_S, check_joints, clamp_to_limits};
use crate::poses::CLOSURE_POSES_RAD;

/// Speed of a joint at full duty and no load: 60° in 0.11 s, quoted by the vendor for an older version of the hand.
pub const FULL_DUTY_SPEED_RAD_S: f64 = FRAC_PI_3 / 0.11;

/// Time in which a joint gathers 63 % of its speed after a step of duty. Chosen, not measured.
///
/// With the quoted 0.7 N·m at full duty it stands for an inertia of 0.0051 kg·m² at the joint. A published estimate
/// (0.14 kg·m²) would make it 1.9 s, and the gains that are in use on real hands would swing for seconds; with 0.07 s
/// they settle.
pub const TIME_CONSTANT_S: f64 = 0.07;

/// Sixteen independent joints, each an inertia with viscous damping driven by motor duty, between two stops.
///
/// The motors are driven by voltage, so that a duty leads to a speed: `time_constant · dv/dt = full_speed · torque − v`.
/// No gravity, no friction at rest, no contact between links, no noise, no delay, no encoder steps.
///
/// # Examples
/// ```
/// use tega_hand::JointModel;
/// let mut model = JointModel::default();
/// let mut torques = [0.0; 16];
/// torques[1] = 0.1;
/// let before = model.angles_rad()[1];
/// assert!(model.step(&torques)?[1] > before);
/// # Ok::<(), tega_hand::HandError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct JointModel {
    angles_rad: Joints,
    velocities_rad_s: Joints,
    full_duty_speed_rad_s: f64,
    time_constant_s: f64,
}

impl Default for JointModel {
    fn default() -> Self {
        Self {
            angles_rad: CLOSURE_POSES_RAD[0],
            velocities_rad_s: [0.0; JOINTS],
            full_duty_speed_rad_s: FULL_DUTY_SPEED_RAD_S,
            time_constant_s: TIME_CONSTANT_S,
        }
    }
}

impl JointModel {
    /// A hand at rest at `angles_rad`; a joint beyond a stop is put on it.
    ///
    /// # Errors
    /// An angle that is not finite or that no encoder can report; a speed or time constant that is not positive.
    pub fn new(
        angles_rad: &Joints,
        full_duty_speed_rad_s: f64,
        time_constant_s: f64,
    ) -> Result<Self, HandError> {
        check_angles(angles_rad)?;
        let positive = [
            ("full_duty_speed_rad_s", full_duty_speed_rad_s, "rad/s"),
            ("time_constant_s", time_constant_s, "s"),
        ];
        for (name, value, unit) in positive {
            if !(1e-6..=1e6).contains(&value) {
                return Err(OutOfRange::new(name, value, unit, "1e-6 to 1e6").into());
            }
        }
        Ok(Self {
            angles_rad: clamp_to_limits(*angles_rad, STOP_MARGIN_RAD),
            velocities_rad_s: [0.0; JOINTS],
            full_duty_speed_rad_s,
            time_constant_s,
        })
    }

    /// Joint angles now.
    pub const fn angles_rad(&self) -> &Joints {
        &self.angles_rad
    }

    /// Joint velocities now.
    pub const fn velocities_rad_s(&self) -> &Joints {
        &self.velocities_rad_s
    }

    /// Apply torques (duty; held within ±1) for one tick of [`TICK_S`] and return the angles after it.
    ///
    /// Semi-implicit Euler with the damping taken at the end of the tick, stable for every time constant.
    ///
    /// # Errors
    /// A torque that is not finite; nothing moves then.
    pub fn step(&mut self, torques: &Joints) -> Result<Joints, HandError> {
        check_joints("torques", "torque units", torques, -f64::MAX, f64::MAX)?;
        let share = TICK_S / self.time_constant_s;
        let mut free = self.angles_rad;
        for ((angle, velocity), torque) in free.iter_mut().zip(&mut self.velocities_rad_s).zip(torques) {
            let driven = self.full_duty_speed_rad_s * torque.clamp(-1.0, 1.0);
            *velocity = (*velocity + share * driven) / (1.0 + share);
            *angle += TICK_S * *velocity;
        }
        self.angles_rad = clamp_to_limits(free, STOP_MARGIN_RAD);
        for ((velocity, free), angle) in self.velocities_rad_s.iter_mut().zip(free).zip(self.angles_rad) {
            if free.to_bits() != angle.to_bits() {
                *velocity = 0.0;
            }
        }
        Ok(self.angles_rad)
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "a joint on its stop is exactly at rest")]
mod tests {
    use super::*;
    use crate::joints::{JOINT_LIMITS_RAD, JOINT_NAMES};
    use crate::{HandController, LEVELS};
    use proptest::prelude::*;

    /// Ticks until every joint stays within 0.005 rad of the pose, and the largest overshoot past it.
    fn settle(from: usize, to: usize) -> (usize, f64) {
        let (start, goal) = (CLOSURE_POSES_RAD[from], CLOSURE_POSES_RAD[to]);
        let mut controller = HandController::default();
        let mut model = JointModel::new(&start, FULL_DUTY_SPEED_RAD_S, TIME_CONSTANT_S).unwrap();
        let (mut last_outside, mut overshoot) = (0, 0f64);
        for tick in 1..=1500 {
            let torques = controller.step(model.angles_rad(), to as f64 + 1.0, None).unwrap();
            let angles = model.step(&torques).unwrap();
            for j in 0..JOINTS {
                if (angles[j] - goal[j]).abs() > 0.005 {
                    last_outside = tick;
                }
                // Only where the way is monotonous: thumb joint 2 turns back between the poses.
                if j != 14 {
                    overshoot = overshoot.max((angles[j] - goal[j]) * (goal[j] - start[j]).signum());
                }
            }
        }
        (last_outside, overshoot)
    }

    #[test]
    fn the_loop_settles_on_every_pose_without_swinging() {
        for from in 0..LEVELS {
            for to in 0..LEVELS {
                let (ticks, overshoot) = settle(from, to);
                assert!(ticks < 1000 && overshoot < 0.02, "{from} to {to}: {ticks} ticks, {overshoot} rad");
            }
        }
    }

    #[test]
    fn full_duty_leads_to_the_free_speed_and_the_stop_holds() {
        let mut model = JointModel::default();
        let mut fastest = 0f64;
        for _ in 0..400 {
            model.step(&[5.0; JOINTS]).unwrap();
            fastest = model.velocities_rad_s().iter().copied().fold(fastest, f64::max);
        }
        assert!(fastest < FULL_DUTY_SPEED_RAD_S && fastest > 0.5 * FULL_DUTY_SPEED_RAD_S, "{fastest}");
        for ((angle, (_, high)), joint) in model.angles_rad().iter().zip(JOINT_LIMITS_RAD).zip(JOINT_NAMES) {
            assert!((angle - (high + STOP_MARGIN_RAD)).abs() < 1e-12, "{joint}");
        }
        assert_eq!(model.velocities_rad_s(), &[0.0; JOINTS]);
    }

    #[test]
    fn bad_input_is_named_and_moves_nothing() {
        let mut model = JointModel::default();
        let before = model.clone();
        let mut torques = [0.0; JOINTS];
        torques[15] = f64::NAN;
        assert!(model.step(&torques).unwrap_err().to_string().starts_with("torques of thumb_j3 = NaN"));
        assert_eq!(model, before);
        assert!(JointModel::new(&[f64::NAN; JOINTS], 1.0, 1.0).is_err());
        assert!(JointModel::new(&[0.0; JOINTS], 0.0, 1.0).is_err());
        assert!(JointModel::new(&[0.0; JOINTS], 1.0, f64::NAN).is_err());
    }

    proptest! {
        #[test]
        fn it_stays_between_the_stops_for_any_drive_and_time_constant(
            time_constant_s in 1e-6..10.0f64,
            drive in prop::collection::vec(prop::array::uniform16(-2.0..2.0f64), 1..100),
        ) {
            let mut model = JointModel::new(&[0.0; JOINTS], FULL_DUTY_SPEED_RAD_S, time_constant_s).unwrap();
            for torques in drive {
                for (angle, (low, high)) in model.step(&torques).unwrap().iter().zip(JOINT_LIMITS_RAD) {
                    prop_assert!((low - 0.1..=high + 0.1).contains(angle));
                }
                prop_assert!(model.velocities_rad_s().iter().all(|v| v.abs() <= FULL_DUTY_SPEED_RAD_S));
            }
        }
    }
}
