//! Counts, radians, torque units and degrees Celsius.

use super::{CanFrame, DeviceId, Finger, payload};
use crate::WireError;
use tega_error::OutOfRange;

/// Radians per encoder count of a version 4 (and 3) hand: 333.3 degrees over 65536 counts.
pub const RAD_PER_COUNT: f64 = 333.3 / 65536.0 * (std::f64::consts::PI / 180.0);

/// Radians per encoder count of a version 5 hand: 0.088 degrees.
const RAD_PER_COUNT_V5: f64 = 0.088 * (std::f64::consts::PI / 180.0);

/// Counts of pulse width for one unit of torque (tau) on a version 4 hand; also its full duty.
const COUNTS_PER_TAU: f64 = 1200.0;

/// The largest counts the vendor's drivers send to each joint of a version 4 hand, in the hand's order.
pub const PWM_LIMITS: [i16; 16] =
    [375, 675, 450, 285, 375, 675, 450, 285, 375, 675, 450, 285, 525, 405, 270, 270];

/// A joint temperature above this many degrees is a sensor that does not answer, not a hot joint.
pub const TEMPERATURE_VALID_MAX_C: u8 = 120;

/// Which hand's numbers to use. Version 4 counts on a version 5 hand mean nothing: read INFORMATION first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// 1200 counts per tau, clamped to [`PWM_LIMITS`]; 333.3/65536 degrees per count.
    V4,
    /// 1430 counts per tau, clamped to 240; 0.088 degrees per count. No joint is halved: the vendor's two drivers
    /// contradict each other about which hardware type wants that.
    V5,
}

impl Scale {
    fn counts_per_tau(self) -> f64 {
        match self {
            Self::V4 => COUNTS_PER_TAU,
            Self::V5 => 1430.0,
        }
    }

    fn limit(self, joint: usize) -> f64 {
        match self {
            Self::V4 => PWM_LIMITS.get(joint).map_or(0.0, |&limit| f64::from(limit)),
            Self::V5 => 240.0,
        }
    }

    fn rad_per_count(self) -> f64 {
        match self {
            Self::V4 => RAD_PER_COUNT,
            Self::V5 => RAD_PER_COUNT_V5,
        }
    }
}

/// Torque in tau units (1.0 is full pulse width on a version 4 hand) to counts: scaled in double precision, clamped
/// to the joint's limit, rounded to nearest with halves away from zero.
///
/// The vendor's drivers truncate instead, so they send up to one count less.
///
/// # Errors
/// [`WireError::OutOfRange`] for a torque that is not finite, and for a joint above 15.
///
/// ```
/// use tega_wire::allegro::{Scale, torque_counts};
/// assert_eq!(torque_counts(0.1, 0, Scale::V4)?, 120);
/// assert_eq!(torque_counts(0.65, 0, Scale::V4)?, 375);
/// assert!(torque_counts(f64::NAN, 0, Scale::V4).is_err());
/// # Ok::<(), tega_wire::WireError>(())
/// ```
pub fn torque_counts(tau: f64, joint: usize, scale: Scale) -> Result<i16, WireError> {
    if !tau.is_finite() || joint > 15 {
        let wanted = if joint > 15 { "joints 0 to 15" } else { "a finite torque" };
        let wrong = OutOfRange::new("torques", tau, "tau", wanted);
        return Err(wrong.placed(format_args!("[{joint}]")).into());
    }
    let limit = scale.limit(joint);
    Ok((tau * scale.counts_per_tau()).clamp(-limit, limit).round() as i16)
}

/// The four SET TORQUE frames of one control step, index finger first.
///
/// # Errors
/// [`WireError::OutOfRange`] if any torque is not finite; then no frame is made at all.
pub fn torque_frames(
    torques: &[f64; 16],
    device: DeviceId,
    scale: Scale,
) -> Result<[CanFrame; 4], WireError> {
    let mut counts = [[0_i16; 4]; 4];
    for (joint, (to, &tau)) in counts.as_flattened_mut().iter_mut().zip(torques).enumerate() {
        *to = torque_counts(tau, joint, scale)?;
    }
    let mut fingers = Finger::ALL.into_iter();
    Ok(counts.map(|counts| {
        let finger = fingers.next().unwrap_or(Finger::Thumb);
        CanFrame::data_frame(super::message::SET_TORQUE + u16::from(finger.number()), device, payload(counts))
    }))
}

/// Encoder counts to a joint angle in radians. The hand applies its own calibration: no offset, no direction.
pub fn angle_rad(counts: i16, scale: Scale) -> f64 {
    f64::from(counts) * scale.rad_per_count()
}

/// A joint angle in radians to the nearest encoder count.
///
/// # Errors
/// [`WireError::OutOfRange`] for an angle that is not finite or beyond what 16 bits hold (±2.9085 rad, version 4).
pub fn angle_counts(angle_rad: f64, scale: Scale) -> Result<i16, WireError> {
    let counts = (angle_rad / scale.rad_per_count()).round();
    if !(f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&counts) {
        let wanted = match scale {
            Scale::V4 => "-2.9085 to 2.9085",
            Scale::V5 => "-50.328 to 50.326",
        };
        return Err(OutOfRange::new("angle_rad", angle_rad, "rad", wanted).into());
    }
    Ok(counts as i16)
}

/// A joint temperature in °C, or nothing where the sensor does not answer.
pub fn temperature_c(byte: u8) -> Option<u8> {
    (byte <= TEMPERATURE_VALID_MAX_C).then_some(byte)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_torque_is_made_of_nan_or_infinity() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut torques = [0.0; 16];
            torques[9] = bad;
            let error = torque_frames(&torques, DeviceId::FACTORY, Scale::V4).unwrap_err();
            assert!(error.to_string().starts_with("torques[9] = "), "{error}");
            assert!(error.hint().contains("controller"));
        }
    }

    #[test]
    fn halves_round_away_from_zero_and_limits_hold() {
        assert_eq!(torque_counts(1.5 / 1200.0, 0, Scale::V4), Ok(2));
        assert_eq!(torque_counts(-1.5 / 1200.0, 0, Scale::V4), Ok(-2));
        assert_eq!(torque_counts(f64::MAX, 12, Scale::V4), Ok(525));
        assert_eq!(torque_counts(-f64::MAX, 3, Scale::V4), Ok(-285));
        assert!(torque_counts(0.0, 16, Scale::V4).is_err());
    }

    #[test]
    fn every_count_survives_the_way_through_radians() {
        for scale in [Scale::V4, Scale::V5] {
            for counts in i16::MIN..=i16::MAX {
                assert_eq!(angle_counts(angle_rad(counts, scale), scale), Ok(counts));
            }
        }
        assert!(angle_counts(f64::NAN, Scale::V4).is_err());
        assert!(angle_counts(2.91, Scale::V4).is_err());
    }
}
