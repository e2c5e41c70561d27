//! The sixteen joints of an Allegro Hand v4 in the order of its CAN messages.

use tega_error::{Brief, OutOfRange};

use crate::HandError;

/// Number of joints.
pub const JOINTS: usize = 16;

/// One number for each joint: index, middle, ring, thumb, from the palm outwards.
pub type Joints = [f64; JOINTS];

/// One control cycle: the hand sends its joint angles every 3 ms and takes one set of torques for each.
pub const TICK_S: f64 = 0.003;

/// The joints by name. Joint 0 of a finger is abduction, of the thumb opposition; 1 to 3 bend.
pub const JOINT_NAMES: [&str; JOINTS] = [
    "index_j0",
    "index_j1",
    "index_j2",
    "index_j3", //
    "middle_j0",
    "middle_j1",
    "middle_j2",
    "middle_j3", //
    "ring_j0",
    "ring_j1",
    "ring_j2",
    "ring_j3", //
    "thumb_j0",
    "thumb_j1",
    "thumb_j2",
    "thumb_j3",
];

const FINGER_LIMITS_RAD: [(f64, f64); 4] =
    [(-0.470, 0.470), (-0.196, 1.610), (-0.174, 1.709), (-0.227, 1.618)];
const THUMB_LIMITS_RAD: [(f64, f64); 4] = [(0.263, 1.396), (-0.105, 1.163), (-0.189, 1.644), (-0.162, 1.719)];

/// Lowest and highest angle of each joint, alike for right and left hands (the vendor's description of the hand).
pub const JOINT_LIMITS_RAD: [(f64, f64); JOINTS] = by_finger(FINGER_LIMITS_RAD, THUMB_LIMITS_RAD);

/// How far the mechanical stops lie outside [`JOINT_LIMITS_RAD`]: the margin the vendor's description takes off.
pub const STOP_MARGIN_RAD: f64 = 0.1;

/// Largest torque of each joint, in units of full motor duty (1.0 = 1200 counts): the vendor's per-joint limits.
pub const TORQUE_LIMITS: Joints = by_finger([0.3125, 0.5625, 0.375, 0.2375], [0.4375, 0.3375, 0.225, 0.225]);

/// No v4 encoder can report more: 32,768 counts of 333.3°/65,536.
pub const ENCODER_RANGE_RAD: f64 = 2.91;

/// The same four numbers for index, middle and ring, others for the thumb.
pub(crate) const fn by_finger<T: Copy>(finger: [T; 4], thumb: [T; 4]) -> [T; JOINTS] {
    let ([a, b, c, d], [e, f, g, h]) = (finger, thumb);
    [a, b, c, d, a, b, c, d, a, b, c, d, e, f, g, h]
}

/// Refuse a vector with a number that is not finite or outside `low..=high`; the error names the joint.
pub(crate) fn check_joints(
    name: &'static str,
    unit: &'static str,
    values: &Joints,
    low: f64,
    high: f64,
) -> Result<(), HandError> {
    match JOINT_NAMES.iter().zip(values).find(|(_, value)| !(low..=high).contains(*value)) {
        Some((joint, &value)) => Err(wrong(name, joint, value, unit, low, high)),
        None => Ok(()),
    }
}

/// Out of the way of the control step, which never comes here.
#[cold]
fn wrong(name: &'static str, joint: &str, value: f64, unit: &'static str, low: f64, high: f64) -> HandError {
    let wanted = format!("{} to {}", Brief(low), Brief(high));
    OutOfRange::new(name, value, unit, wanted).placed(format_args!(" of {joint}")).into()
}

/// The nearest angles within the limits widened by `margin_rad`.
pub(crate) fn clamp_to_limits(mut angles_rad: Joints, margin_rad: f64) -> Joints {
    for (angle, (low, high)) in angles_rad.iter_mut().zip(JOINT_LIMITS_RAD) {
        *angle = angle.clamp(low - margin_rad, high + margin_rad);
    }
    angles_rad
}
