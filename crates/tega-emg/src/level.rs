//! Eq 11: from a block mean to one of five closure levels, decided without rounding.

use crate::error::EmgError;
use tega_error::OutOfRange;

/// Number of closure levels; 1 is open, 5 is full closure.
pub const LEVELS: u8 = 5;

/// Parts a value may miss a border by and still count as on it: 1 of 10⁹.
const TOLERANCE_PARTS: u128 = 1_000_000_000;

/// Into how many equal intervals the range up to a maximum is cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Intervals {
    /// Four, as Eq 11 is printed: level 5 is reached at the maximum only.
    #[default]
    Four,
    /// Five, as the text beside Eq 11 says: level 5 begins at four fifths of the maximum.
    Five,
}

impl Intervals {
    /// Read the number of intervals, 4 or 5.
    ///
    /// # Errors
    /// [`EmgError::OutOfRange`] for any other number.
    pub fn from_count(count: usize) -> Result<Self, EmgError> {
        match count {
            4 => Ok(Self::Four),
            5 => Ok(Self::Five),
            _ => Err(OutOfRange::new("intervals", count as f64, "", "4 (as printed) or 5").into()),
        }
    }

    /// Tenths of an interval up to the maximum.
    const fn tenths(self) -> u128 {
        match self {
            Self::Four => 40,
            Self::Five => 50,
        }
    }
}

/// The level of a block mean: `⌊4 value / maximum + 1⌋`, clamped to 1..=5 (Eq 11).
///
/// A value that reaches a border within one part in 10⁹ counts as on it, so that 0.00225 of 0.003 is three quarters
/// as its decimals say. Negative values and NaN are level 1, the open hand.
///
/// # Errors
/// [`EmgError::OutOfRange`] unless the maximum is finite and greater than 0.
///
/// # Examples
/// ```
/// assert_eq!(tega_emg::grasp_level(0.00225, 0.003)?, 4);
/// # Ok::<(), tega_emg::EmgError>(())
/// ```
pub fn grasp_level(value: f64, maximum: f64) -> Result<u8, EmgError> {
    if !(maximum.is_finite() && maximum > 0.0) {
        let wanted = "a finite number greater than 0";
        return Err(OutOfRange::new("maximum", maximum, "(unit of value)", wanted).into());
    }
    Ok(level_of(value, maximum, Intervals::Four))
}

/// [`grasp_level`] for a maximum that has been checked, with a choice of intervals.
pub(crate) fn level_of(value: f64, maximum: f64, cut: Intervals) -> u8 {
    (1..LEVELS).fold(1, |level, k| level + u8::from(reaches(value, 10 * u32::from(k), maximum, cut)))
}

/// [`level_of`] with a dead zone of a tenth of a level on either side of each border around the present level.
pub(crate) fn level_with_hysteresis(value: f64, maximum: f64, present: u8, cut: Intervals) -> u8 {
    let mut level = present;
    while level < LEVELS && reaches(value, 10 * u32::from(level) + 1, maximum, cut) {
        level += 1;
    }
    if level == present {
        while level > 1 && !reaches(value, 10 * u32::from(level - 1) - 1, maximum, cut) {
            level -= 1;
        }
    }
    level
}

/// Whether `value ≥ (tenths / all tenths) · maximum · (1 − 10⁻⁹)`, in integers: both sides are a whole number times a
/// power of two, of less than 90 bits.
fn reaches(value: f64, tenths: u32, maximum: f64, cut: Intervals) -> bool {
    if !value.is_finite() {
        return value == f64::INFINITY;
    }
    if value <= 0.0 {
        return false;
    }
    let ((v, v_exp), (m, m_exp)) = (decompose(value), decompose(maximum));
    let left = v * cut.tenths() * TOLERANCE_PARTS;
    let right = m * u128::from(tenths) * (TOLERANCE_PARTS - 1);
    // A shift that does not fit makes that side larger than the other can be.
    let shift = v_exp.abs_diff(m_exp);
    if v_exp >= m_exp {
        shift >= left.leading_zeros() || left << shift >= right
    } else {
        shift < right.leading_zeros() && left >= right << shift
    }
}

/// A positive finite number as `mantissa · 2^exponent`.
fn decompose(x: f64) -> (u128, i32) {
    let bits = x.to_bits();
    let (exponent, fraction) = ((bits >> 52) as i32 & 0x7ff, bits & ((1 << 52) - 1));
    if exponent == 0 {
        (u128::from(fraction), -1074)
    } else {
        (u128::from(fraction | 1 << 52), exponent - 1075)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarters_given_as_decimals_are_on_the_border() {
        for thousandths in 1..=3000 {
            let maximum = f64::from(thousandths) / 1000.0;
            for k in 1..=4u8 {
                let value = f64::from(thousandths) * f64::from(k) / 4.0 / 1000.0;
                let levels = [value, value * (1.0 - 2e-9)].map(|v| level_of(v, maximum, Intervals::Four));
                assert_eq!(levels, [k + 1, k], "{value} of {maximum}");
            }
        }
    }

    #[test]
    fn values_outside_are_clamped_and_the_whole_range_of_numbers_works() {
        let (most, smallest) = (f64::MAX, f64::from_bits(1));
        let outside = [-1.0, -0.0, 0.0, f64::NAN, f64::NEG_INFINITY, f64::INFINITY, 7.5];
        assert_eq!(outside.map(|value| level_of(value, 1.0, Intervals::Four)), [1, 1, 1, 1, 1, 5, 5]);
        let ends = [(most, most), (most, smallest), (smallest, most), (smallest, smallest)];
        assert_eq!(ends.map(|(value, of)| level_of(value, of, Intervals::Four)), [5, 5, 1, 5]);
        assert_eq!(level_of(f64::MIN_POSITIVE / 2.0, f64::MIN_POSITIVE, Intervals::Four), 3);
        assert_eq!(level_of(0.5e300, 1e300, Intervals::Four), 3);
    }

    #[test]
    fn the_dead_zone_is_a_tenth_of_a_level() {
        for (value, before, level) in
            [(0.27, 1, 1), (0.275, 1, 2), (0.23, 2, 2), (0.2249, 2, 1), (1.1, 1, 5), (0.0, 5, 1)]
        {
            assert_eq!(level_with_hysteresis(value, 1.0, before, Intervals::Four), level, "{value}");
        }
    }

    #[test]
    fn an_unusable_maximum_is_named() {
        for maximum in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let got = grasp_level(1.0, maximum);
            assert!(got.is_err_and(|error| error.to_string().starts_with("maximum")), "{maximum}");
        }
    }

    #[test]
    fn five_equal_intervals_reach_level_five_below_the_maximum() {
        for (value, level) in [(0.199, 1), (0.2, 2), (0.4, 3), (0.6, 4), (0.799, 4), (0.8, 5), (1.0, 5)] {
            assert_eq!(level_of(value, 1.0, Intervals::Five), level, "{value}");
        }
        assert_eq!(level_with_hysteresis(0.81, 1.0, 4, Intervals::Five), 4);
        assert_eq!(level_with_hysteresis(0.82, 1.0, 4, Intervals::Five), 5);
        assert!(Intervals::from_count(3).is_err_and(|error| error.to_string().starts_with("intervals")));
    }
}
