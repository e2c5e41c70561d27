//! Where a shape lies before a gel, from where the physics has it against a pad that is rounded more than the gel is.
//!
//! The physics' pad is a capsule, so that a fingertip twists and rolls as a soft one does. A contact beside the middle of
//! its rounding comes to the pad frame unrolled and rolled again: as far from the middle as along the capsule's surface,
//! with its normal that of the gel there.

use crate::form::fall;

/// A rotation, row after row.
type Turn = [[f64; 3]; 3];

/// A direction this close to upright, in radians, has no direction to be turned in.
const UPRIGHT: f64 = 1e-9;

/// The physics' pad: a capsule along the finger, and its frame in the world (x out of the pad, z along the finger).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pad {
    /// Radius of the capsule, metres.
    pub radius_m: f64,
    /// Half its straight length, metres.
    pub half_length_m: f64,
    /// Place of the middle of its surface in the world, metres.
    pub at_m: [f64; 3],
    /// Rotation from its frame to the world.
    pub turned: Turn,
}

/// Returns a shape's rotation and translation to the gel's pad frame, the latter in millimetres.
///
/// `near_m` is where it touches the pad and `normal` points from the pad to it, of any length but 0; `shape_m` and `lies`
/// are its place and rotation. All four are of the world.
pub fn pad_pose(
    pad: &Pad,
    near_m: [f64; 3],
    normal: [f64; 3],
    shape_m: [f64; 3],
    lies: &Turn,
) -> [[f64; 4]; 3] {
    // Rows: the gel's axes in the world, x to the right in the upright picture, y down (towards the palm), z out. In the
    // pad's own frame they are -y, -z and x.
    let [a, b, c] = [0, 1, 2].map(|k| pad.turned.map(|row| row[k]));
    let to_gel = [b.map(|x| -x), c.map(|x| -x), a];
    let offset = difference(near_m, pad.at_m);
    let [x, y, z] = to_gel.map(|row| dot(row, normal));
    let (sine, length) = (x.hypot(y), (x * x + y * y + z * z).sqrt());
    // Unroll: put the contact where the surface has it, and turn its normal to the gel's there.
    let along =
        (dot(to_gel[1], offset) - pad.radius_m * y / length).clamp(-pad.half_length_m, pad.half_length_m);
    let (mut across, mut along) = (0.0, along);
    if sine > UPRIGHT * length {
        let arc = pad.radius_m * sine.atan2(z);
        (across, along) = (arc * x / sine, along + arc * y / sine);
    }
    let [right, down] = fall(1e3 * across, 1e3 * along);
    let rolled = product(&transposed(&upright([right, down, 1.0])), &upright([x, y, z]));
    let turn = product(&rolled, &to_gel);
    let place = turn.map(|row| dot(row, difference(shape_m, near_m)));
    let (turned, moved) = (product(&turn, lies), [across, along, 0.0]);
    std::array::from_fn(|k| {
        let [u, v, w] = turned[k];
        [u, v, w, 1e3 * (place[k] + moved[k])]
    })
}

/// The rotation that turns a direction upright, to +z, by the shortest way.
fn upright([x, y, z]: [f64; 3]) -> Turn {
    let (sine, length) = (x.hypot(y), (x * x + y * y + z * z).sqrt());
    if sine <= UPRIGHT * length {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let (u, v, sine, cosine) = (x / sine, y / sine, sine / length, z / length);
    let less = cosine - 1.0;
    [
        [1.0 + less * u * u, less * u * v, -sine * u],
        [less * u * v, 1.0 + less * v * v, -sine * v],
        [sine * u, sine * v, cosine],
    ]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn transposed(turn: &Turn) -> Turn {
    [0, 1, 2].map(|k| turn.map(|row| row[k]))
}

fn product(a: &Turn, b: &Turn) -> Turn {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRAIGHT: Turn = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn pad() -> Pad {
        Pad { radius_m: 0.012, half_length_m: 0.01, at_m: [0.012, 0.0, 0.0], turned: STRAIGHT }
    }

    #[test]
    fn a_ball_on_the_middle_lies_upright_over_it() {
        let pose = pad_pose(&pad(), [0.012, 0.0, 0.0], [1.0, 0.0, 0.0], [0.042, 0.0, 0.0], &STRAIGHT);
        let at = pose.map(|row| row[3]);
        assert!(at[0].abs() < 1e-9 && at[1].abs() < 1.0 && (at[2] - 30.0).abs() < 0.5, "{at:?}");
    }

    #[test]
    fn a_ball_beside_the_middle_keeps_its_distance_from_where_it_touches() {
        let tilt = 0.4_f64;
        let out = [tilt.cos(), -tilt.sin(), 0.0];
        let near = out.map(|x| 0.012 * x);
        let pose = pad_pose(&pad(), near, out, out.map(|x| 0.042 * x), &STRAIGHT);
        let arc_mm = 12.0 * tilt;
        let from = [pose[0][3] - arc_mm, pose[1][3], pose[2][3]];
        let distance = from.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!((distance - 30.0).abs() < 1e-9, "{distance}");
        let turn = pose.map(|[a, b, c, _]| [a, b, c]);
        let square = product(&turn, &transposed(&turn));
        assert!(square.iter().flatten().zip(STRAIGHT.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
