//! From joint targets to torques: proportional-derivative law, torque and slew limits.

use crate::HandError;
use crate::joints::{Joints, TICK_S, TORQUE_LIMITS, by_finger, check_joints};
use crate::poses::LEVELS;
use tega_error::OutOfRange;

/// Gains and limits. Torques are in units of full motor duty (1.0 = 1200 counts), which a v4 hand cannot measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// Proportional gain, torque units per rad.
    pub kp: Joints,
    /// Damping gain, torque units per rad/s.
    pub kd: Joints,
    /// Largest position error that counts, rad.
    pub error_limit_rad: f64,
    /// Largest torque of each joint.
    pub torque_limits: Joints,
    /// Share of the torque limit allowed in each closure level, 1 to 5.
    pub level_factors: [f64; LEVELS],
    /// Largest change of a torque from one tick to the next.
    pub slew_per_tick: f64,
}

/// Largest gain of either kind, in its unit: a controller as stiff goes from no torque to full duty within a
/// milliradian, so whatever is larger is a mistake, and the law's numbers stay far from overflow.
pub const LARGEST_GAIN: f64 = 1e3;

impl Default for Gains {
    fn default() -> Self {
        Self {
            kp: by_finger([1.5; 4], [2.0; 4]),
            kd: [0.08; 16],
            error_limit_rad: 0.3,
            torque_limits: TORQUE_LIMITS,
            level_factors: [0.3, 0.3, 0.5, 0.7, 1.0],
            slew_per_tick: 0.05,
        }
    }
}

impl Gains {
    /// Refuse gains and limits no hand should get.
    ///
    /// # Errors
    /// A number that is not finite or negative, a gain above [`LARGEST_GAIN`], a torque limit or level factor above 1,
    /// an error limit or slew of 0.
    pub fn check(&self) -> Result<(), HandError> {
        check_joints("kp", "torque units per rad", &self.kp, 0.0, LARGEST_GAIN)?;
        check_joints("kd", "torque units per rad/s", &self.kd, 0.0, LARGEST_GAIN)?;
        check_joints("torque_limits", "torque units", &self.torque_limits, 0.0, 1.0)?;
        let positive = [
            ("error_limit_rad", self.error_limit_rad, "rad"),
            ("slew_per_tick", self.slew_per_tick, "torque units per 3 ms"),
        ];
        for (name, value, unit) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(OutOfRange::new(name, value, unit, "a finite number above 0").into());
            }
        }
        match self.level_factors.iter().find(|factor| !(0.0..=1.0).contains(*factor)) {
            Some(&value) => {
                Err(OutOfRange::new("level_factors", value, "of the torque limit", "0 to 1").into())
            }
            None => Ok(()),
        }
    }

    /// Torques of this tick from those of the last; `factor` is the share of the torque limits in force.
    ///
    /// The limit has the last word: a torque is within `factor` times its joint's limit even where the slew limit
    /// would hold it above.
    pub fn torques(
        &self,
        target_rad: &Joints,
        angles_rad: &Joints,
        velocities_rad_s: &Joints,
        factor: f64,
        last: &Joints,
    ) -> Joints {
        std::array::from_fn(|j| {
            let error = (target_rad[j] - angles_rad[j]).clamp(-self.error_limit_rad, self.error_limit_rad);
            let wanted = self.kp[j] * error - self.kd[j] * velocities_rad_s[j];
            let slewed = wanted.clamp(last[j] - self.slew_per_tick, last[j] + self.slew_per_tick);
            let limit = self.torque_limits[j] * factor.clamp(0.0, 1.0);
            slewed.clamp(-limit, limit)
        })
    }
}

/// Joint velocities from successive angles: first differences through a one-pole low-pass with unit gain at rest.
///
/// One encoder count in 3 ms is already 0.03 rad/s, hence the filter.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Velocity {
    last_rad: Option<Joints>,
    filtered_rad_s: Joints,
}

/// Corner of the velocity filter, Hz.
const VELOCITY_CORNER_HZ: f64 = 30.0;

impl Velocity {
    pub(crate) fn update(&mut self, angles_rad: &Joints) -> Joints {
        let weight = 1.0 - (-std::f64::consts::TAU * VELOCITY_CORNER_HZ * TICK_S).exp();
        if let Some(last) = self.last_rad {
            for ((filtered, angle), last) in self.filtered_rad_s.iter_mut().zip(angles_rad).zip(last) {
                *filtered += weight * ((angle - last) / TICK_S - *filtered);
            }
        }
        self.last_rad = Some(*angles_rad);
        self.filtered_rad_s
    }

    /// Take velocities measured elsewhere, so that the filter goes on from them.
    pub(crate) fn adopt(&mut self, angles_rad: &Joints, velocities_rad_s: &Joints) -> Joints {
        self.last_rad = Some(*angles_rad);
        self.filtered_rad_s = *velocities_rad_s;
        *velocities_rad_s
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "no difference yet is exactly no velocity")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_steady_ramp_is_measured_without_gain_error() {
        let mut velocity = Velocity::default();
        let speed = (0..200).map(|k| velocity.update(&[0.003 * f64::from(k); 16])[5]).last().unwrap();
        assert!((speed - 1.0).abs() < 1e-9, "{speed}");
        assert_eq!(Velocity::default().update(&[1.0; 16]), [0.0; 16]);
    }

    #[test]
    fn the_filter_answers_a_step_as_a_30_hz_low_pass() {
        let mut velocity = Velocity::default();
        velocity.update(&[0.0; 16]);
        let first = velocity.update(&[0.003; 16])[0];
        assert!((first - 0.431_916).abs() < 1e-5, "{first}"); // 1 − exp(−2π · 30 Hz · 3 ms)
        let second = velocity.update(&[0.003; 16])[0];
        assert!((second - first * (1.0 - first)).abs() < 1e-12, "{second}");
    }

    #[test]
    fn gains_are_checked_by_name() {
        Gains::default().check().unwrap();
        let mut gains = Gains::default();
        gains.kp[14] = f64::NAN;
        assert!(gains.check().unwrap_err().to_string().starts_with("kp of thumb_j2 = NaN"));
        let gains = Gains { level_factors: [0.3, 0.3, 1.2, 0.7, 1.0], ..Gains::default() };
        assert!(gains.check().unwrap_err().to_string().starts_with("level_factors = 1.2"));
        let gains = Gains { slew_per_tick: 0.0, ..Gains::default() };
        assert!(gains.check().unwrap_err().to_string().starts_with("slew_per_tick = 0 "));
        let gains = Gains { torque_limits: [1.01; 16], ..Gains::default() };
        assert!(gains.check().is_err());
        for largest in [f64::MAX, 1e300, 1000.1] {
            let error = Gains { kp: [largest; 16], ..Gains::default() }.check().unwrap_err().to_string();
            assert!(error.starts_with("kp of ") && error.contains("0 to 1000"), "{error}");
            assert!(Gains { kd: [largest; 16], ..Gains::default() }.check().is_err());
        }
    }

    proptest! {
        #[test]
        fn whatever_gains_pass_give_torques_that_are_numbers(
            kp in 0.0..f64::MAX,
            kd in 0.0..f64::MAX,
            error_limit_rad in 0.0..f64::MAX,
            slew_per_tick in 0.0..f64::MAX,
            speed in prop::array::uniform16(-f64::MAX..f64::MAX),
        ) {
            // Half of the gains as drawn, which no hand should get, half within what is taken.
            for scale in [1.0, LARGEST_GAIN / f64::MAX] {
                let gains = Gains {
                    kp: [kp * scale; 16], kd: [kd * scale; 16], error_limit_rad, slew_per_tick, ..Gains::default()
                };
                if gains.check().is_ok() {
                    let torques = gains.torques(&[2.9; 16], &[-2.9; 16], &speed, 1.0, &[0.0; 16]);
                    prop_assert!(torques.iter().zip(TORQUE_LIMITS).all(|(torque, limit)| torque.abs() <= limit));
                }
            }
        }

        #[test]
        fn torque_is_within_its_limit_and_slew(
            target in prop::array::uniform16(-3.0..3.0f64),
            angles in prop::array::uniform16(-3.0..3.0f64),
            speed in prop::array::uniform16(-1e9..1e9f64),
            factor in 0.0..1.0f64,
            share in prop::array::uniform16(-1.0..1.0f64),
        ) {
            let gains = Gains::default();
            let last: Joints = std::array::from_fn(|j| share[j] * factor * TORQUE_LIMITS[j]);
            let torques = gains.torques(&target, &angles, &speed, factor, &last);
            for j in 0..16 {
                prop_assert!(torques[j].abs() <= factor * TORQUE_LIMITS[j]);
                prop_assert!((torques[j] - last[j]).abs() <= 0.05 + 1e-15);
            }
        }
    }
}
