//! Versions 2 and 3, which share the frames' size and little else.
//!
//! Their identifiers are `command << 6 | to << 3 | from`; torque is big-endian with the joints in reverse order.
//! Torques are given in counts: whether an 8 V hand takes 800 or 1200 of them for one tau is disputed.

use super::{CanFrame, Finger, RAD_PER_COUNT};

/// The torque frame of one finger: counts of joints 0 to 3.
///
/// ```
/// use tega_wire::allegro::{Finger, v3_torque_frame};
/// let frame = v3_torque_frame(Finger::Index, [1, 2, 3, 4]);
/// assert_eq!((frame.id(), frame.data()), (0x18A, &[0, 4, 0, 3, 0, 2, 0, 1][..]));
/// ```
pub fn v3_torque_frame(finger: Finger, counts: [i16; 4]) -> CanFrame {
    let [[g, h], [e, f], [c, d], [a, b]] = counts.map(i16::to_be_bytes);
    let id = (0x06 + u16::from(finger.number())) << 6 | 1 << 3 | 2;
    CanFrame::raw_id(id, [a, b, c, d, e, f, g, h])
}

/// A joint angle in radians from a position word, the hand's offset for that joint (its calibration sheet has
/// sixteen) and whether its encoder counts downwards.
pub fn v3_angle_rad(raw: u16, offset: i32, down: bool) -> f64 {
    let raw = if down { -i64::from(raw) } else { i64::from(raw) };
    (raw - 32768 - i64::from(offset)) as f64 * RAD_PER_COUNT
}
