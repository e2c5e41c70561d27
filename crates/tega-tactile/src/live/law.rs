//! Depth and force of a dent from what was summed over it: one smooth law for every shape.
//!
//! Depth from shading reads small, deep dents truly and loses part of wide and of steep ones: cells average a steep flank, and the fit of the
//! light takes a share of a dent that fills much of the picture. Two other sums lose less there, the dent's height by its change of colour
//! and S. A product of powers of the three, corrected by the outlined share of the picture, holds for a small ball and a flat face alike.
//!
//! The constants were fitted once to sixteen simulated units (**in-sample**: nine shapes, 1 to 5 N), and exponents are eighths and
//! sixteenths so that roots alone compute them: the bits are the same on every processor.

/// What the laws need of a dent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sums {
    /// Depth from shading, millimetres.
    pub shaded_mm: f64,
    /// Volume under that depth within the outline, cubic millimetres.
    pub volume_mm3: f64,
    /// Height by the change of colour, millimetres: mean slope times width.
    pub height_mm: f64,
    /// S as a slope times the width that `height_mm` is given over, millimetres.
    pub difference_mm: f64,
    /// Outlined share of the picture.
    pub broad: f64,
}

/// Depth for sums of one; what the share of the picture adds.
const DEPTH: f64 = 1.184;
const DEPTH_BROAD: f64 = 2.0;
/// Pressed volume for sums of one; what the share of the picture adds.
const VOLUME: f64 = 1.692;
const VOLUME_BROAD: f64 = 3.5;

impl Sums {
    /// Largest depth, millimetres: shaded^(5/8) height^(3/16) S^(1/4).
    pub fn depth_mm(&self) -> f64 {
        let shaded = self.shaded_mm.sqrt() * eighth(self.shaded_mm);
        let height = eighth(self.height_mm) * eighth(self.height_mm).sqrt();
        let difference = self.difference_mm.sqrt().sqrt();
        DEPTH * shaded * height * difference * (1.0 + DEPTH_BROAD * self.broad * self.broad)
    }

    /// Pressed volume, cubic millimetres: shaded (S / height)^(3/8).
    pub fn volume_mm3(&self) -> f64 {
        if self.height_mm <= 0.0 {
            return 0.0;
        }
        let narrow = self.difference_mm / self.height_mm;
        let narrow = narrow.sqrt().sqrt() * eighth(narrow);
        VOLUME * self.volume_mm3 * narrow * (1.0 + VOLUME_BROAD * self.broad * self.broad)
    }
}

fn eighth(value: f64) -> f64 {
    value.sqrt().sqrt().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of depth's exponents; `calibrate_light` in Python has it too.
    const DEPTH_POWER: f64 = 17.0 / 16.0;
    const SUMS: Sums =
        Sums { shaded_mm: 0.4, volume_mm3: 5.0, height_mm: 0.3, difference_mm: 0.2, broad: 0.1 };

    fn scaled(by: f64) -> Sums {
        Sums {
            shaded_mm: by * SUMS.shaded_mm,
            volume_mm3: by * SUMS.volume_mm3,
            height_mm: by * SUMS.height_mm,
            difference_mm: by * SUMS.difference_mm,
            ..SUMS
        }
    }

    #[test]
    fn depth_and_volume_follow_a_gain_of_the_light_by_their_powers() {
        for by in [0.25, 0.9, 3.0] {
            let depth = scaled(by).depth_mm() / SUMS.depth_mm();
            assert!((depth / f64::powf(by, DEPTH_POWER) - 1.0).abs() < 1e-12, "{depth}");
            let volume = scaled(by).volume_mm3() / SUMS.volume_mm3();
            assert!((volume / by - 1.0).abs() < 1e-12, "{volume}");
        }
    }

    #[test]
    fn nothing_is_no_depth_and_no_volume() {
        let nothing = Sums { broad: 0.0, ..scaled(0.0) };
        assert_eq!((nothing.depth_mm(), nothing.volume_mm3()), (0.0, 0.0));
    }
}
