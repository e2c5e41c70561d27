//! The five closure poses, from open to a tight power grasp.

use tega_error::{Brief, OutOfRange};

use crate::joints::{JOINT_LIMITS_RAD, JOINT_NAMES, Joints, by_finger};
use crate::{HandError, JOINTS};

/// Number of closure levels.
pub const LEVELS: usize = 5;

/// Angles of the closure poses 1 to 5 (open, pre-shape, half, wrap, tight).
///
/// Abduction is 0 throughout, so that they serve a right and a left hand. Computed from the hand's geometry, not yet
/// tried on a real one.
pub const CLOSURE_POSES_RAD: [Joints; LEVELS] = [
    by_finger([0.0, 0.00, 0.10, 0.10], [0.80, 0.15, 0.10, 0.20]),
    by_finger([0.0, 0.40, 0.45, 0.35], [1.20, 0.25, 0.20, 0.30]),
    by_finger([0.0, 0.80, 0.70, 0.50], [1.35, 0.25, 0.30, 0.50]),
    by_finger([0.0, 1.10, 0.85, 0.65], [1.35, 0.32, 0.32, 0.90]),
    by_finger([0.0, 1.40, 1.00, 0.80], [1.35, 0.47, 0.15, 0.98]),
];

/// Distance a pose keeps from the joint limits: the default poses come as near as 0.046 rad (thumb opposition).
pub const POSE_MARGIN_RAD: f64 = 0.04;

/// Five poses that have been checked against the joint limits.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSet([Joints; LEVELS]);

impl Default for PoseSet {
    fn default() -> Self {
        Self(CLOSURE_POSES_RAD)
    }
}

impl PoseSet {
    /// Check five poses, level 1 first.
    ///
    /// # Errors
    /// An angle that is not finite or nearer than [`POSE_MARGIN_RAD`] to a limit; the error names pose and joint.
    ///
    /// # Examples
    /// ```
    /// use tega_hand::{CLOSURE_POSES_RAD, PoseSet};
    /// let mut poses = CLOSURE_POSES_RAD;
    /// poses[4][5] = 2.0;
    /// let error = PoseSet::new(poses).unwrap_err().to_string();
    /// assert!(error.starts_with("pose 5: middle_j1 = 2 rad"));
    /// ```
    pub fn new(poses_rad: [Joints; LEVELS]) -> Result<Self, HandError> {
        for (number, pose) in poses_rad.iter().enumerate() {
            for ((&value, (low, high)), joint) in pose.iter().zip(JOINT_LIMITS_RAD).zip(JOINT_NAMES) {
                let (low, high) = (low + POSE_MARGIN_RAD, high - POSE_MARGIN_RAD);
                if !(low..=high).contains(&value) {
                    let (place, wanted) =
                        (format!(" {}: {joint}", number + 1), format!("{} to {}", Brief(low), Brief(high)));
                    return Err(OutOfRange::new("pose", value, "rad", wanted).placed(place).into());
                }
            }
        }
        Ok(Self(poses_rad))
    }

    /// The angles, level 1 first.
    pub const fn angles_rad(&self) -> &[Joints; LEVELS] {
        &self.0
    }

    /// Largest angle any joint moves between neighbouring levels.
    pub(crate) fn largest_step_rad(&self) -> f64 {
        let neighbours = self.0.iter().zip(self.0.iter().skip(1));
        neighbours.map(|(a, b)| distance_rad(a, b)).fold(0.0, f64::max)
    }

    /// Number (from 0) of the pose nearest to `angles_rad`, the lower of two that are as near.
    pub(crate) fn nearest(&self, angles_rad: &Joints) -> usize {
        let distances = self.0.iter().map(|pose| distance_rad(pose, angles_rad));
        distances.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(number, _)| number)
    }

    /// The poses mixed by `shares`, which sum to 1.
    pub(crate) fn mix(&self, shares: &[f64; LEVELS]) -> Joints {
        let mut out = [0.0; JOINTS];
        for (pose, share) in self.0.iter().zip(shares) {
            for (out, angle) in out.iter_mut().zip(pose) {
                *out += share * angle;
            }
        }
        out
    }
}

/// Largest difference of any joint.
pub(crate) fn distance_rad(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_poses_pass_their_own_check() {
        assert_eq!(PoseSet::new(CLOSURE_POSES_RAD), Ok(PoseSet::default()));
        let clearance = CLOSURE_POSES_RAD.iter().flat_map(|pose| pose.iter().zip(JOINT_LIMITS_RAD));
        let nearest = clearance.map(|(a, (low, high))| (a - low).min(high - a)).fold(f64::MAX, f64::min);
        assert!((nearest - 0.046).abs() < 1e-12, "{nearest}");
    }

    #[test]
    fn bad_angles_are_named() {
        for bad in [f64::NAN, f64::INFINITY, 1.36, 0.30] {
            let mut poses = CLOSURE_POSES_RAD;
            poses[1][12] = bad;
            let error = PoseSet::new(poses).unwrap_err();
            assert!(error.to_string().starts_with("pose 2: thumb_j0"), "{error}");
        }
    }

    #[test]
    fn nearest_is_the_pose_itself() {
        let poses = PoseSet::default();
        for (number, pose) in CLOSURE_POSES_RAD.iter().enumerate() {
            assert_eq!(poses.nearest(pose), number);
        }
    }
}
