//! Rigid shapes, and how far each point of their surface stays from the gel.

use tega_error::OutOfRange;

use crate::error::GelError;

/// Shapes that may press at once.
pub const MAX_INDENTERS: usize = 8;

/// What a point is that the shape does not lie over.
pub(crate) const CLEAR: f32 = -1e6;

/// A rigid body's form; lengths in millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Its radius.
        radius: f64,
    },
    /// A round bar along its own z, cut off square.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Half its length.
        half_length: f64,
    },
    /// A round bar along its own z with half balls beyond its ends.
    Capsule {
        /// Its radius.
        radius: f64,
        /// Half its length without the half balls.
        half_length: f64,
    },
    /// A block.
    Box {
        /// Half its lengths.
        half: [f64; 3],
    },
    /// Everything on the far side of its own z = 0.
    Plane,
}

/// A rigid shape pressed into the gel with a force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Indenter {
    /// Its form.
    pub shape: Shape,
    /// Its axes (columns) and its origin in the pad frame, row by row; millimetres. The origin's z does not matter:
    /// the shape goes in until it meets the force.
    pub pose_mm: [[f64; 4]; 3],
    /// Normal force, newtons; 0 touches nothing.
    pub force_n: f64,
}

impl Indenter {
    /// Refuses numbers that make no body.
    pub(crate) fn check(&self, index: usize) -> Result<(), GelError> {
        let wrong = |name, value, unit, wanted: &'static str| {
            let place = format_args!(" of indenter {index}");
            Err(OutOfRange::new(name, value, unit, wanted).placed(place).into())
        };
        let positive = |name, value: f64| {
            if value > 0.0 && value <= 1e4 { Ok(()) } else { wrong(name, value, "mm", "over 0 to 10000") }
        };
        match self.shape {
            Shape::Sphere { radius } => positive("the radius", radius)?,
            Shape::Cylinder { radius, half_length } | Shape::Capsule { radius, half_length } => {
                positive("the radius", radius)?;
                positive("the half length", half_length)?;
            }
            Shape::Box { half } => half.iter().try_for_each(|&h| positive("a half length", h))?,
            Shape::Plane => {}
        }
        if !(0.0..=1000.0).contains(&self.force_n) {
            return wrong("force_n", self.force_n, "N", "0 to 1000");
        }
        if let Some(&value) = self.pose_mm.as_flattened().iter().find(|v| !v.is_finite() || v.abs() > 1e6) {
            return wrong("a number of pose_mm", value, "mm", "finite numbers");
        }
        let p = &self.pose_mm;
        let mut error: f64 = 0.0;
        for a in 0..3 {
            for b in 0..=a {
                let dot: f64 = (0..3).map(|k| p[k][a] * p[k][b]).sum();
                error = error.max((dot - f64::from(u8::from(a == b))).abs());
            }
        }
        if error > 1e-3 { Err(GelError::Rotation { index, error }) } else { Ok(()) }
    }

    /// Fills `out` with how far the shape lies below its own origin's level along the row's points, millimetres:
    /// larger is nearer to the gel; [`CLEAR`] where it does not lie over the point.
    ///
    /// Points are at `xs`, `ys` in the pad frame. Each shape is cut by the line through the point along z.
    #[inline(always)]
    pub(crate) fn lowest(&self, xs: &[f32], ys: &[f32], out: &mut [f32]) {
        let p = &self.pose_mm;
        // In the shape's own frame the line is `origin + t * along`: x and y go with the point, t is the pad's z.
        let axis = |k: usize| [p[0][k] as f32, p[1][k] as f32, p[2][k] as f32];
        let [ax, ay, az] = [axis(0), axis(1), axis(2)];
        let (cx, cy) = (p[0][3] as f32, p[1][3] as f32);
        let points = (xs, ys, cx, cy);
        match self.shape {
            Shape::Sphere { radius } => {
                let r2 = (radius * radius) as f32;
                for_each(out, points, |dx, dy| {
                    let under = r2 - dy * dy - dx * dx;
                    if under > 0.0 { under.sqrt() } else { CLEAR }
                });
            }
            Shape::Plane => {
                // Its normal has to face the gel.
                let n = az;
                let down = if n[2] < -0.05 { 1.0 / n[2] } else { 0.0 };
                for_each(
                    out,
                    points,
                    |dx, dy| {
                        if down == 0.0 { CLEAR } else { (n[0] * dx + n[1] * dy) * down }
                    },
                );
            }
            Shape::Box { half } => {
                let half = half.map(|h| h as f32);
                let slabs = [slab(ax, half[0]), slab(ay, half[1]), slab(az, half[2])];
                for_each(out, points, |dx, dy| {
                    let (mut enter, mut leave) = (f32::MIN, f32::MAX);
                    for s in &slabs {
                        let (near, far) = s.cut(dx, dy);
                        enter = if near > enter { near } else { enter };
                        leave = if far < leave { far } else { leave };
                    }
                    if enter < leave { -enter } else { CLEAR }
                });
            }
            Shape::Cylinder { radius, half_length } => {
                let ends = slab(az, half_length as f32);
                let round = Round::new([ax, ay], radius as f32);
                for_each(out, points, |dx, dy| {
                    let ((a, b), (c, d)) = (ends.cut(dx, dy), round.cut(dx, dy));
                    let (enter, leave) = (if a > c { a } else { c }, if b < d { b } else { d });
                    if enter < leave { -enter } else { CLEAR }
                });
            }
            Shape::Capsule { radius, half_length } => {
                let (r, l) = (radius as f32, half_length as f32);
                let round = Round::new([ax, ay], r);
                let r2 = r * r;
                if round.stays_within(az, [bounds(xs, cx), bounds(ys, cy)], l) {
                    // A long bar lies over the whole row: its ends are not looked for.
                    for_each(out, points, |dx, dy| -round.cut(dx, dy).0);
                    return;
                }
                for_each(out, points, |dx, dy| {
                    let (enter, leave) = round.cut(dx, dy);
                    let along = az[0] * dx + az[1] * dy + az[2] * enter;
                    let mut low = if enter < leave && along <= l && along >= -l { -enter } else { CLEAR };
                    for end in [l, -l] {
                        let (ex, ey) = (dx - az[0] * end, dy - az[1] * end);
                        let under = r2 - ex * ex - ey * ey;
                        let ball = if under > 0.0 { under.sqrt() - az[2] * end } else { CLEAR };
                        low = if ball > low { ball } else { low };
                    }
                    low
                });
            }
        }
    }
}

#[inline(always)]
fn for_each(out: &mut [f32], (xs, ys, cx, cy): (&[f32], &[f32], f32, f32), low: impl Fn(f32, f32) -> f32) {
    for ((out, x), y) in out.iter_mut().zip(xs).zip(ys) {
        *out = low(x - cx, y - cy);
    }
}

/// Least and largest of a row's points, seen from the shape.
#[inline(always)]
fn bounds(points: &[f32], middle: f32) -> [f32; 2] {
    let (mut least, mut largest) = (f32::MAX, f32::MIN);
    for p in points {
        least = if *p < least { *p } else { least };
        largest = if *p > largest { *p } else { largest };
    }
    [least - middle, largest - middle]
}

/// The space between two parallel planes.
struct Slab {
    axis: [f32; 3],
    half: f32,
    per_z: f32,
}

fn slab(axis: [f32; 3], half: f32) -> Slab {
    // A plane that stands upright is met nowhere: leaning by 1e-6 it is met very far away.
    let z = if axis[2].abs() < 1e-6 { 1e-6 } else { axis[2] };
    Slab { axis, half, per_z: 1.0 / z }
}

impl Slab {
    /// Where the line enters and leaves.
    #[inline(always)]
    fn cut(&self, dx: f32, dy: f32) -> (f32, f32) {
        let start = self.axis[0] * dx + self.axis[1] * dy;
        let (a, b) = ((-self.half - start) * self.per_z, (self.half - start) * self.per_z);
        if a < b { (a, b) } else { (b, a) }
    }
}

/// An endless round bar along the shape's z.
struct Round {
    axes: [[f32; 3]; 2],
    r2: f32,
    square: f32,
    per: f32,
}

impl Round {
    fn new(axes: [[f32; 3]; 2], radius: f32) -> Self {
        let square = axes[0][2] * axes[0][2] + axes[1][2] * axes[1][2];
        let square = if square < 1e-9 { 1e-9 } else { square };
        Self { axes, r2: radius * radius, square, per: 1.0 / square }
    }

    /// Where the line enters and leaves; the other way round where it misses.
    #[inline(always)]
    fn cut(&self, dx: f32, dy: f32) -> (f32, f32) {
        let (half, under) = self.meet(dx, dy);
        let root = if under > 0.0 { under.sqrt() } else { 0.0 };
        let (enter, leave) = ((-half - root) * self.per, (-half + root) * self.per);
        if under > 0.0 { (enter, leave) } else { (f32::MAX, f32::MIN) }
    }

    /// How far the line's nearest point to the bar's axis lies along it, and by how much it meets the bar: not where
    /// negative.
    #[inline(always)]
    fn meet(&self, dx: f32, dy: f32) -> (f32, f32) {
        let [u, v] = self.axes;
        let (su, sv) = (u[0] * dx + u[1] * dy, v[0] * dx + v[1] * dy);
        let half = su * u[2] + sv * v[2];
        (half, half * half - self.square * (su * su + sv * sv - self.r2))
    }

    /// Whether the lines through a rectangle all meet the bar, and within a length either way of its middle; false where
    /// in doubt.
    fn stays_within(&self, axis: [f32; 3], [xs, ys]: [[f32; 2]; 2], length: f32) -> bool {
        // `half` is straight and `under` bends down: both are at their worst at a corner.
        let (mut deepest, mut across, mut meets) = (0.0f32, 0.0f32, true);
        for (dx, dy) in [(xs[0], ys[0]), (xs[1], ys[0]), (xs[0], ys[1]), (xs[1], ys[1])] {
            let (half, under) = self.meet(dx, dy);
            deepest = deepest.max((half.abs() + (self.square * self.r2).sqrt()) * self.per);
            across = across.max((axis[0] * dx + axis[1] * dy).abs());
            meets &= under > 0.0;
        }
        meets && across + axis[2].abs() * deepest < length
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a point of the shape's own frame lies in it, made thicker by so much.
    fn holds(shape: Shape, [x, y, z]: [f64; 3], thicker: f64) -> bool {
        let round = x.hypot(y);
        match shape {
            Shape::Sphere { radius } => round.hypot(z) <= radius + thicker,
            Shape::Cylinder { radius, half_length } => {
                round <= radius + thicker && z.abs() <= half_length + thicker
            }
            Shape::Capsule { radius, half_length } => {
                round.hypot((z.abs() - half_length).max(0.0)) <= radius + thicker
            }
            Shape::Box { half } => [x, y, z].iter().zip(half).all(|(c, h)| c.abs() <= h + thicker),
            Shape::Plane => z >= -thicker,
        }
    }

    /// Axes turned about z, x and y in turn, as the columns of a pose near the middle of the pad.
    fn turned(about_x: f64, about_y: f64) -> [[f64; 4]; 3] {
        let ((s, c), (t, d), (u, e)) = (about_x.sin_cos(), about_y.sin_cos(), 0.7f64.sin_cos());
        let [x, y, z] = [[d, 0.0, -t], [t * s, c, d * s], [t * c, -s, d * c]];
        let place = [0.5, -0.25, 7.0];
        [0, 1, 2].map(|k| [e * x[k] + u * y[k], e * y[k] - u * x[k], z[k], place[k]])
    }

    #[test]
    fn the_lowest_point_over_a_point_is_where_the_line_enters_the_body() {
        const MARGIN: f64 = 0.03;
        let shapes = [
            Shape::Sphere { radius: 3.0 },
            Shape::Cylinder { radius: 1.5, half_length: 4.0 },
            Shape::Capsule { radius: 1.5, half_length: 4.0 },
            Shape::Capsule { radius: 2.0, half_length: 60.0 },
            Shape::Box { half: [1.0, 2.0, 3.0] },
            Shape::Plane,
        ];
        let xs: Vec<f32> = (-15i8..16).map(|k| 0.5 * f32::from(k)).collect();
        for shape in shapes {
            for (about_x, about_y) in [(0.3, 0.2), (1.2, -0.4), (1.5, 0.0), (2.9, 0.3), (0.1, 1.4)] {
                let pose_mm = turned(about_x, about_y);
                let indenter = Indenter { shape, pose_mm, force_n: 1.0 };
                let inside = |dx: f64, dy: f64, t: f64, thicker: f64| {
                    let local =
                        [0, 1, 2].map(|k| pose_mm[0][k] * dx + pose_mm[1][k] * dy + pose_mm[2][k] * t);
                    holds(shape, local, thicker)
                };
                if shape == Shape::Plane && pose_mm[2][2] > -0.05 {
                    continue; // it faces away
                }
                for y in [-3.0f32, -0.75, 0.5, 4.0] {
                    let mut out = vec![0.0; xs.len()];
                    indenter.lowest(&xs, &vec![y; xs.len()], &mut out);
                    for (x, low) in xs.iter().zip(out) {
                        let (dx, dy) = (f64::from(*x) - 0.5, f64::from(y) + 0.25);
                        let enters = if low < CLEAR / 2.0 { f64::MAX } else { -f64::from(low) };
                        let case = format!("{shape:?} {about_x} {about_y} {dx} {dy} {low}");
                        assert!(enters == f64::MAX || inside(dx, dy, enters, MARGIN), "{case}");
                        let before =
                            (-1000i32..1000).map(|k| 0.02 * f64::from(k)).filter(|t| *t < enters - MARGIN);
                        let bounded = shape != Shape::Plane;
                        assert!(
                            !bounded || !before.into_iter().any(|t| inside(dx, dy, t, -MARGIN)),
                            "{case}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_bar_that_covers_a_row_is_met_between_its_ends_at_every_corner() {
        let (xs, ys) = ([-1.5f32, 1.0], [-0.75f32, 0.5]);
        let mut covers = 0;
        for (about_x, about_y) in [(0.9, 0.2), (1.2, -0.4), (1.5, 0.0), (2.0, 0.3), (0.4, 1.4)] {
            let p = turned(about_x, about_y);
            let [u, v, axis] = [0, 1, 2].map(|k| [p[0][k] as f32, p[1][k] as f32, p[2][k] as f32]);
            let round = Round::new([u, v], 4.0);
            for length in (1u8..60).map(|k| 0.25 * f32::from(k)) {
                if !round.stays_within(axis, [xs, ys], length) {
                    continue;
                }
                covers += 1;
                for (dx, dy) in xs.into_iter().flat_map(|x| ys.map(|y| (x, y))) {
                    let (enter, leave) = round.cut(dx, dy);
                    let along = axis[0] * dx + axis[1] * dy + axis[2] * enter;
                    assert!(
                        enter < leave && along.abs() < length + 1e-4,
                        "{about_x} {about_y} {length} {along}"
                    );
                }
            }
        }
        assert!(covers > 50, "{covers}");
    }
}
