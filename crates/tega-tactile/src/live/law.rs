//! Depth and force of a dent from what was summed over it: one smooth law for every shape.
//!
//! Depth from shading reads small, deep dents truly and loses part of wide and of steep ones: cells average a steep flank, and the fit of the
//! light takes a share of a dent that fills much of the picture. Two other sums lose less there, the dent's height by its change of colour
//! and S. A product of powers of the three, corrected by the outlined share of the picture, holds for a small ball and a flat face alike.
//!
//! A dent whose flanks lie near the border, as something softer than the gel presses it, is another matter: there the light differs most
//! between units, and by shading its volume scatters by twice as much as its height by the change of colour does. It is known by both: wide, and
//! higher by its colours than by shading. Its depth and volume come from height, S and share of the picture alone, and one law
//! passes into the other.
//!
//! The constants were fitted once to sixteen simulated units, those of wide dents to 32 others (**in-sample**: nine shapes, 1 to 5 N), and
//! exponents are eighths and sixteenths so that roots alone compute them: the bits are the same on every processor.

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

/// Depth for sums of one; what the share of the picture adds; depth where no shading is used.
const DEPTH: f64 = 1.184;
const DEPTH_BROAD: f64 = 2.0;
const DEPTH_WIDE: f64 = 0.797;
/// Pressed volume for sums of one; what the share of the picture adds; volume where no shading is used.
const VOLUME: f64 = 1.692;
const VOLUME_BROAD: f64 = 3.5;
const VOLUME_WIDE: f64 = 327.0;
/// Share of the picture times height over shaded depth at which a dent is half wide: 0.8 for a flat face, 2.3 for a soft block.
const WIDE: f64 = 1.65;

impl Sums {
    /// Largest depth, millimetres: shaded^(5/8) height^(3/16) S^(1/4), of wide dents height^(9/16) S^(1/2).
    pub fn depth_mm(&self) -> f64 {
        let shaded = self.shaded_mm.sqrt() * eighth(self.shaded_mm);
        let sixteenth = eighth(self.height_mm).sqrt();
        let height = eighth(self.height_mm) * sixteenth;
        let difference = self.difference_mm.sqrt();
        let broad = 1.0 + DEPTH_BROAD * self.broad * self.broad;
        let narrow = DEPTH * shaded * height * difference.sqrt() * broad;
        self.between(narrow, DEPTH_WIDE * self.height_mm.sqrt() * sixteenth * difference)
    }

    /// Pressed volume, cubic millimetres: shaded (S / height)^(3/8), of wide dents height (S / height)^(3/2) share^(5/4).
    pub fn volume_mm3(&self) -> f64 {
        if self.height_mm <= 0.0 {
            return 0.0;
        }
        let steep = self.difference_mm / self.height_mm;
        let power = steep.sqrt().sqrt() * eighth(steep);
        let narrow = VOLUME * self.volume_mm3 * power * (1.0 + VOLUME_BROAD * self.broad * self.broad);
        let share = self.broad * self.broad.sqrt().sqrt();
        self.between(narrow, VOLUME_WIDE * self.height_mm * steep * steep.sqrt() * share)
    }

    /// One value for narrow dents, the other for wide ones, and smoothly from one to the other.
    fn between(&self, narrow: f64, wide: f64) -> f64 {
        let [is, half] = [self.broad * self.height_mm, WIDE * self.shaded_mm].map(eighth_power);
        if is <= 0.0 {
            return narrow;
        }
        narrow + is / (is + half) * (wide - narrow)
    }
}

fn eighth(value: f64) -> f64 {
    value.sqrt().sqrt().sqrt()
}

fn eighth_power(value: f64) -> f64 {
    let square = value * value;
    (square * square) * (square * square)
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
        // Narrow, between, and wide.
        for broad in [0.1, 0.9, 2.0] {
            let of = |by: f64| Sums { broad, ..scaled(by) };
            for by in [0.25, 0.9, 3.0] {
                let depth = of(by).depth_mm() / of(1.0).depth_mm();
                assert!((depth / f64::powf(by, DEPTH_POWER) - 1.0).abs() < 1e-12, "{depth}");
                let volume = of(by).volume_mm3() / of(1.0).volume_mm3();
                assert!((volume / by - 1.0).abs() < 1e-12, "{volume}");
            }
        }
    }

    #[test]
    fn a_wide_dent_is_read_without_its_shading_and_a_narrow_one_by_it() {
        for (height_mm, follows) in [(0.3, true), (60.0, false)] {
            let of = |volume_mm3| Sums { broad: 0.5, height_mm, volume_mm3, ..SUMS }.volume_mm3();
            let doubled = of(10.0) / of(5.0);
            assert!((doubled - if follows { 2.0 } else { 1.0 }).abs() < 0.01, "{doubled}");
        }
    }

    #[test]
    fn nothing_is_no_depth_and_no_volume() {
        let nothing = Sums { broad: 0.0, ..scaled(0.0) };
        assert_eq!((nothing.depth_mm(), nothing.volume_mm3()), (0.0, 0.0));
    }
}
