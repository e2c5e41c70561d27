//! The quick answer against a patient one, and shapes wherever they touch.

use std::f64::consts::FRAC_PI_2;

use super::*;
use crate::form::Form;
use crate::shape::Shape;

fn flat() -> Surface {
    Surface::new(Form::Flat, [0.0; 2])
}

fn digit() -> Surface {
    Surface::new(Form::Digit, [0.0; 2])
}

/// Far longer on every grid than anything here needs.
const PATIENT: [Steps; 3] = [Steps { matches: 40, most: 40, sweeps: 10, last: 200, relax: 1.0 }; 3];

/// Shapes are laid over all of a grid.
const EVERYWHERE: f32 = 1e6;

fn tilted(tilt: f64, x: f64, y: f64) -> [[f64; 4]; 3] {
    let (c, s) = (tilt.cos(), tilt.sin());
    [[1.0, 0.0, 0.0, x], [0.0, c, -s, y], [0.0, s, c, 0.0]]
}

/// Largest errors of the displacement in the picture relative to its peak, and of the depth, over these shapes and
/// forces.
fn errors(surface: &Surface, shapes: &[Shape], tilts: &[f64], forces_n: &[f64]) -> [f32; 2] {
    let (mut few, mut many) = (Membrane::new(surface), Membrane::new(surface));
    let mut worst = [0.0f32; 2];
    for shape in shapes {
        for force_n in forces_n {
            for (tilt, x) in tilts.iter().zip([0.0, 0.1, 0.2]) {
                let indenter =
                    Indenter { shape: *shape, pose_mm: tilted(*tilt, x, x / 3.0), force_n: *force_n };
                let all = Grid::new(1, surface).whole();
                assert!(few.solve(&[indenter]) && many.solve_in(&[indenter], &PATIENT, all, EVERYWHERE));
                let mut peak = 0.0f32;
                let mut height = 0.0f32;
                for row in MARGIN_ROWS..ROWS - MARGIN_ROWS {
                    let seen = MARGIN_COLS + 1..COLS - MARGIN_COLS + 1;
                    let (a, b) =
                        (&few.relief().row(row + 1)[seen.clone()], &many.relief().row(row + 1)[seen]);
                    for (a, b) in a.iter().zip(b) {
                        (peak, height) = (peak.max(*b), height.max((a - b).abs()));
                    }
                }
                let height = height / peak;
                let depth = (few.pressed[0].depth / many.pressed[0].depth - 1.0).abs();
                worst = [worst[0].max(height), worst[1].max(depth)];
            }
        }
    }
    worst
}

#[test]
fn few_sweeps_come_close_to_many() {
    let round = [
        Shape::Sphere { radius: 4.4 },
        Shape::Sphere { radius: 30.0 },
        Shape::Cylinder { radius: 33.0, half_length: 100.0 },
        Shape::Box { half: [30.0, 30.0, 30.0] },
    ];
    let worst = errors(&digit(), &round, &[0.0, FRAC_PI_2], &[0.3, 1.0, 5.0, 15.0]);
    assert!(worst[0] < 0.035 && worst[1] < 0.02, "{worst:?}");
    let worst = errors(&flat(), &round[..2], &[0.0, FRAC_PI_2], &[0.3, 1.0, 5.0, 15.0]);
    assert!(worst[0] < 0.025 && worst[1] < 0.025, "{worst:?}");
    let sharp = [
        Shape::Sphere { radius: 1.0 },
        Shape::Capsule { radius: 1.0, half_length: 4.0 },
        Shape::Cylinder { radius: 3.0, half_length: 6.0 },
        Shape::Box { half: [2.5, 2.5, 2.5] },
    ];
    for surface in [digit(), flat()] {
        let worst = errors(&surface, &sharp, &[0.0, FRAC_PI_2, 0.5], &[0.1, 1.0, 5.0]);
        assert!(worst[0] < 0.18 && worst[1] < 0.13, "{worst:?}");
    }
}

#[test]
fn a_shape_is_laid_wherever_it_touches() {
    let shapes = [
        Shape::Sphere { radius: 0.5 },
        Shape::Sphere { radius: 4.4 },
        Shape::Capsule { radius: 1.0, half_length: 6.0 },
        Shape::Cylinder { radius: 3.0, half_length: 6.0 },
        Shape::Box { half: [0.4, 8.0, 3.0] },
        Shape::Box { half: [2.5, 2.5, 2.5] },
    ];
    let (mut some, mut all) = (Membrane::new(&digit()), Membrane::new(&digit()));
    for (k, shape) in shapes.iter().enumerate() {
        for force_n in [0.05, 0.5, 3.0, 12.0] {
            for (tilt, x) in [(0.0, -3.0), (0.4, 0.1), (1.2, 4.0), (1.57, 9.0)] {
                let own = Indenter { shape: *shape, pose_mm: tilted(tilt, x, -x / 2.0), force_n };
                let other = Indenter {
                    shape: shapes[(k + 1) % shapes.len()],
                    pose_mm: tilted(0.2 - tilt, -x, x),
                    force_n: 4.0 / force_n,
                };
                for indenters in [&[own][..], &[own, other]] {
                    let found = some.solve(indenters);
                    assert_eq!(found, all.solve_in(indenters, &SCHEDULE, LOOK, EVERYWHERE));
                    let rows = MARGIN_ROWS + 1..=ROWS - MARGIN_ROWS;
                    let (mut peak, mut worst) = (0.0f32, 0.0f32);
                    for (a, b) in
                        rows.flat_map(|row| some.relief().row(row).iter().zip(all.relief().row(row)))
                    {
                        (peak, worst) = (peak.max(*b), worst.max((a - b).abs()));
                    }
                    assert!(!found || worst <= 1e-3 * peak, "{indenters:?}: {worst} of {peak} mm");
                }
            }
        }
    }
}
