//! The untouched gel's form: how high it stands, and which place of it each pixel shows.

use std::sync::OnceLock;

/// Which gel a unit has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// Rounded across the finger and less along it, as the published drawing of the DIGIT's gel has it.
    #[default]
    Digit,
    /// Flat, as a `GelSight`'s.
    Flat,
}

/// Radius across the finger, millimetres: 20.5 to 21.6 at every section of the drawing that the camera sees.
pub const RADIUS_ACROSS_MM: f64 = 21.0;
/// The drawing's heights along the middle line: millimetres along the finger, millimetres high.
pub const HEIGHTS_ALONG_MM: [[f64; 2]; 7] =
    [[-16.0, 6.83], [-12.0, 7.94], [-8.0, 8.21], [-4.0, 8.20], [0.0, 8.07], [4.0, 7.42], [7.0, 6.46]];
/// Where along it the picture has its middle: that of the samples. A guess, as no drawing has gel and camera together.
pub const MIDDLE_ALONG_MM: f64 = -4.5;
/// From the camera's pinhole to the gel's top, millimetres. A guess between what the lens's angle says (17) and what a
/// published renderer has (22).
pub const CAMERA_MM: f64 = 20.0;

/// Between units: the radius across by this share (the drawing's sections differ by as much), and how much the gel falls
/// off along the finger, a guess.
const RADIUS_SPREAD: f64 = 0.02;
const FALL_SPREAD: f64 = 0.1;

/// Far enough for all grids; beyond, the form goes on straight.
const FARTHEST_MM: f64 = 13.0;
/// Newton's steps to what a pixel shows; the last changes nothing any more.
const STEPS: usize = 6;

/// How steeply the drawing's gel falls off at a place: to the right and down the picture.
pub fn fall(x_mm: f64, y_mm: f64) -> [f64; 2] {
    static DRAWING: OnceLock<Surface> = OnceLock::new();
    DRAWING.get_or_init(|| Surface::new(Form::Digit, [0.0; 2])).drop(x_mm, y_mm).1
}

/// A point of the untouched gel that a place of the picture shows; millimetres in the pad frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seen {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// How far it lies under the gel's top.
    pub(crate) drop: f64,
    /// Slopes of the drop, downwards positive.
    pub(crate) fall: [f64; 2],
    /// Millimetres of the gel to one at its top, as the camera sees them.
    pub(crate) scale: f64,
    /// The same for areas, the slope's foreshortening included.
    pub(crate) area: f64,
}

/// The untouched gel of one unit.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    /// Radius across and share of the fall along the finger; `None` for a flat gel.
    round: Option<(f64, f64)>,
    along: Spline,
    top: f64,
}

impl Surface {
    /// A gel whose radius and fall differ from the drawing by so many of their spreads.
    pub(crate) fn new(form: Form, [radius, fall]: [f64; 2]) -> Self {
        let along = Spline::through(&HEIGHTS_ALONG_MM);
        let round = match form {
            Form::Digit => {
                Some((RADIUS_ACROSS_MM * (1.0 + RADIUS_SPREAD * radius), 1.0 + FALL_SPREAD * fall))
            }
            Form::Flat => None,
        };
        let mut top = f64::MIN;
        for k in 0..=2300 {
            top = top.max(along.at(-16.0 + 0.01 * f64::from(k)).0);
        }
        Self { round, along, top }
    }

    /// How far a place lies under the top, and the drop's slopes across and along; y grows down the picture.
    pub(crate) fn drop(&self, x: f64, y: f64) -> (f64, [f64; 2]) {
        let Some((radius, share)) = self.round else { return (0.0, [0.0; 2]) };
        let (near_x, near_y) = (x.clamp(-FARTHEST_MM, FARTHEST_MM), y.clamp(-FARTHEST_MM, FARTHEST_MM));
        let root = (radius * radius - near_x * near_x).sqrt();
        let across = near_x / root;
        let (height, rise) = self.along.at(MIDDLE_ALONG_MM + near_y);
        let along = -share * rise;
        let drop = (radius - root) + share * (self.top - height);
        (drop + across * (x - near_x) + along * (y - near_y), [across, along])
    }

    /// What the camera sees at a place of the picture, given in millimetres at the top's distance from the middle.
    pub(crate) fn seen(&self, u: f64, v: f64) -> Seen {
        let mut scale = 1.0;
        for _ in 0..STEPS {
            let (drop, fall) = self.drop(u * scale, v * scale);
            let off = scale - 1.0 + drop / CAMERA_MM;
            scale -= off / (1.0 + (u * fall[0] + v * fall[1]) / CAMERA_MM);
        }
        let (x, y) = (u * scale, v * scale);
        let (drop, fall) = self.drop(x, y);
        let tilt = (u * fall[0] + v * fall[1]) / CAMERA_MM;
        Seen { x, y, drop, fall, scale, area: scale * scale / (1.0 + tilt) }
    }
}

/// A cubic spline whose bend at either end is that of the next sample.
#[derive(Debug, Clone)]
struct Spline {
    knots: [[f64; 2]; 7],
    bends: [f64; 7],
}

impl Spline {
    fn through(knots: &[[f64; 2]; 7]) -> Self {
        let step = |k: usize| knots[k + 1][0] - knots[k][0];
        let slope = |k: usize| (knots[k + 1][1] - knots[k][1]) / step(k);
        // Elimination of the three diagonals for the five inner bends, then back.
        let (mut main, mut right) = ([0.0; 7], [0.0; 7]);
        for k in 1..6 {
            main[k] = 2.0 * (step(k - 1) + step(k));
            right[k] = 6.0 * (slope(k) - slope(k - 1));
        }
        main[1] += step(0);
        main[5] += step(5);
        for k in 2..6 {
            let share = step(k - 1) / main[k - 1];
            main[k] -= share * step(k - 1);
            right[k] -= share * right[k - 1];
        }
        let mut bends = [0.0; 7];
        bends[5] = right[5] / main[5];
        for k in (1..5).rev() {
            bends[k] = (right[k] - step(k) * bends[k + 1]) / main[k];
        }
        (bends[0], bends[6]) = (bends[1], bends[5]);
        Self { knots: *knots, bends }
    }

    /// Value and slope; straight beyond the ends.
    fn at(&self, x: f64) -> (f64, f64) {
        let (first, last) = (self.knots[0][0], self.knots[6][0]);
        let near = x.clamp(first, last);
        let k = (1..6).rev().find(|k| near >= self.knots[*k][0]).unwrap_or(0);
        let ([x0, z0], [x1, z1]) = (self.knots[k], self.knots[k + 1]);
        let (step, a, b) = (x1 - x0, x1 - near, near - x0);
        let (m0, m1) = (self.bends[k], self.bends[k + 1]);
        let (c0, c1) = (z0 / step - m0 * step / 6.0, z1 / step - m1 * step / 6.0);
        let value = (m0 * a * a * a + m1 * b * b * b) / (6.0 * step) + c0 * a + c1 * b;
        let slope = (m1 * b * b - m0 * a * a) / (2.0 * step) + c1 - c0;
        (value + slope * (x - near), slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digit() -> Surface {
        Surface::new(Form::Digit, [0.0; 2])
    }

    #[test]
    fn heights_are_those_of_the_drawing() {
        let surface = digit();
        for [along, height] in HEIGHTS_ALONG_MM {
            let (drop, _) = surface.drop(0.0, along - MIDDLE_ALONG_MM);
            assert!((surface.top - drop - height).abs() < 1e-9, "{along}: {drop}");
        }
        // Across at the top, the drawing's own samples.
        for (x, height) in [(0.0, 8.22), (2.0, 8.11), (4.0, 7.85), (6.0, 7.33), (8.0, 6.68)] {
            let (drop, _) = surface.drop(x, -6.5 - MIDDLE_ALONG_MM);
            assert!((8.22 - drop - height).abs() < 0.05, "{x}: {drop}");
        }
    }

    #[test]
    fn slopes_are_those_of_the_heights_and_go_on_straight_outside() {
        let surface = digit();
        let d = 1e-5;
        for x in [-15.0, -6.3, 0.0, 3.0, 10.0] {
            for y in [-14.5, -8.0, -0.5, 0.0, 4.6, 9.0, 12.9, 14.0] {
                let (_, [across, along]) = surface.drop(x, y);
                let rise = |dx: f64, dy: f64| surface.drop(x + dx, y + dy).0 - surface.drop(x - dx, y - dy).0;
                assert!((rise(d, 0.0) / (2.0 * d) - across).abs() < 1e-6, "{x} {y}");
                assert!((rise(0.0, d) / (2.0 * d) - along).abs() < 1e-6, "{x} {y}");
            }
        }
    }

    #[test]
    fn a_pixel_shows_what_lies_on_its_ray_and_no_gel_is_seen_twice() {
        let surface = digit();
        let d = 1e-4;
        for u in [-10.2, -6.4, -1.0, 0.0, 3.0, 10.2] {
            for v in [-11.9, -8.5, -2.0, 0.0, 5.0, 8.5, 11.9] {
                let seen = surface.seen(u, v);
                assert!((seen.x * CAMERA_MM - u * (CAMERA_MM - seen.drop)).abs() < 1e-6, "{u} {v}");
                assert!((seen.y * CAMERA_MM - v * (CAMERA_MM - seen.drop)).abs() < 1e-6, "{u} {v}");
                let [a, b] = [surface.seen(u + d, v), surface.seen(u - d, v)];
                let [e, f] = [surface.seen(u, v + d), surface.seen(u, v - d)];
                let area = ((a.x - b.x) * (e.y - f.y) - (a.y - b.y) * (e.x - f.x)) / (4.0 * d * d);
                assert!((area - seen.area).abs() < 1e-4 && area > 0.2, "{u} {v}: {area} {}", seen.area);
            }
        }
    }

    #[test]
    fn a_flat_gel_is_seen_as_it_is() {
        let seen = Surface::new(Form::Flat, [2.0, -1.0]).seen(5.0, -7.0);
        assert_eq!(seen, Seen { x: 5.0, y: -7.0, drop: 0.0, fall: [0.0; 2], scale: 1.0, area: 1.0 });
    }
}
