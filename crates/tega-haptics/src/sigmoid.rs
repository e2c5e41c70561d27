//! Eq 7 to 9: the logistic law from a metric to a motor intensity.

use crate::HapticsError;
use tega_error::OutOfRange;

/// σ(0) of Eq 7; by symmetry σ(maximum) = 1 − 0.01.
pub const DEFAULT_END_VALUE: f64 = 0.01;

/// Below this ratio the rounding error of the ratio, raised to its power, is no longer a few ulp.
const COMPENSATED_BELOW: f64 = -1.0;
/// The intensity has underflowed to 0 long before.
const ZERO_BELOW: f64 = -1e6;

/// Intensity in percent, 0 to 100, by the logistic law of Eq 7 to 9.
///
/// 100 / (1 + exp(−k (value − maximum/2))) with k = 2 ln((1 − ε)/ε) / maximum, where ε is `end_value`: the printed
/// k = 2 ln 99 / maximum for ε = 0.01. It is evaluated as 100 / (1 + bᵈ), b = (1 − ε)/ε, d = 1 − 2 value/maximum,
/// which has no large intermediate, so that every finite value and every finite positive maximum is safe, and which
/// is exact at value = 0, maximum/2 and maximum. Values beyond the maximum pass through the law, as the paper has
/// no other rule for them.
///
/// For ε = 0.01 the relative error is below 3e-15 wherever the result is above 1e-290, and the result is
/// non-decreasing in `value`. Results under 1e-306 are 0.
///
/// # Errors
/// A value that is not finite; a maximum that is not finite and positive; an end value outside 0 to 0.5.
///
/// # Examples
/// ```
/// use tega_haptics::{DEFAULT_END_VALUE, intensity};
/// assert_eq!(intensity(0.0, 7.0, DEFAULT_END_VALUE)?, 1.0);
/// assert_eq!(intensity(3.5, 7.0, DEFAULT_END_VALUE)?, 50.0);
/// assert_eq!(intensity(7.0, 7.0, DEFAULT_END_VALUE)?, 99.0);
/// # Ok::<(), tega_haptics::HapticsError>(())
/// ```
pub fn intensity(value: f64, maximum: f64, end_value: f64) -> Result<f64, HapticsError> {
    check(value, maximum)?;
    if !(end_value > 0.0 && end_value < 0.5) {
        return Err(OutOfRange::new(
            "end_value",
            end_value,
            "",
            "more than 0 and less than 0.5 (a share of full intensity)",
        )
        .into());
    }
    let base = (1.0 - end_value) / end_value;
    let ratio = value / maximum;
    let power = base.powf(1.0 - 2.0 * ratio);
    Ok(if ratio < ZERO_BELOW {
        0.0
    } else if ratio < COMPENSATED_BELOW {
        100.0 / (1.0 + power * (1.0 + base.ln() * exponent_error(value, maximum, ratio)))
    } else {
        100.0 / (1.0 + power)
    })
}

/// Intensity in percent, 0 to 100, in proportion to value/maximum and held at the ends.
///
/// Not the paper's law: a logistic gives 9 % at a quarter of the maximum, which many people do not feel.
///
/// # Errors
/// A value that is not finite; a maximum that is not finite and positive.
///
/// # Examples
/// ```
/// assert_eq!(tega_haptics::linear_intensity(1.0, 4.0)?, 25.0);
/// # Ok::<(), tega_haptics::HapticsError>(())
/// ```
pub fn linear_intensity(value: f64, maximum: f64) -> Result<f64, HapticsError> {
    check(value, maximum)?;
    Ok(100.0 * (value / maximum).clamp(0.0, 1.0))
}

fn check(value: f64, maximum: f64) -> Result<(), HapticsError> {
    if !value.is_finite() {
        return Err(OutOfRange::new("value", value, "", "any finite number").into());
    }
    if !(maximum.is_finite() && maximum > 0.0) {
        return Err(OutOfRange::new(
            "maximum",
            maximum,
            "",
            "a finite number above 0, in the unit of the value",
        )
        .into());
    }
    Ok(())
}

/// What rounding took from 1 − 2 value/maximum, to first order; `ratio` is the rounded quotient.
fn exponent_error(value: f64, maximum: f64, ratio: f64) -> f64 {
    // A subnormal product would lose the remainder: both numbers move by the same power of two first.
    let scale = if maximum < 1e-200 { 2f64.powi(600) } else { 1.0 };
    let (value, maximum) = (value * scale, maximum * scale);
    let lost_in_ratio = (-ratio).mul_add(maximum, value) / maximum;
    let exponent = 1.0 - 2.0 * ratio;
    // Exact (2Sum with |2 ratio| > 1).
    let lost_in_exponent = 1.0 - (exponent + 2.0 * ratio);
    lost_in_exponent - 2.0 * lost_in_ratio
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "the law is exact at these points")]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn law(value: f64, maximum: f64) -> f64 {
        intensity(value, maximum, DEFAULT_END_VALUE).unwrap()
    }

    #[test]
    fn ends_and_middle_are_the_printed_ones_for_any_maximum() {
        for maximum in [1e-300, 5e-324 * 4.0, 0.004, 1.0, 22_600.0, 1e300, f64::MAX] {
            assert_eq!(law(0.0, maximum), 1.0);
            assert_eq!(law(maximum / 2.0, maximum), 50.0);
            assert_eq!(law(maximum, maximum), 99.0);
        }
    }

    #[test]
    fn extreme_arguments_stay_in_range() {
        for maximum in [5e-324, 1e-300, 1.0, 1e300, f64::MAX] {
            assert_eq!(law(f64::MAX, maximum), if maximum == f64::MAX { 99.0 } else { 100.0 });
            assert!(law(f64::MIN, maximum) <= 1.0);
            assert!(law(5e-324, maximum) >= 1.0);
        }
    }

    #[test]
    fn bad_arguments_are_named() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(intensity(bad, 1.0, 0.01).unwrap_err().to_string().starts_with("value = "));
        }
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = intensity(0.0, bad, 0.01).unwrap_err();
            assert!(error.to_string().starts_with("maximum = "));
            assert!(!error.hint().is_empty());
        }
        for bad in [0.0, -0.01, 0.5, f64::NAN] {
            assert!(intensity(0.0, 1.0, bad).unwrap_err().to_string().starts_with("end_value = "));
        }
    }

    proptest! {
        #[test]
        fn never_decreases_from_one_float_to_the_next(ratio in -160.0..5.0f64, maximum in 1e-6..1e6f64) {
            let mut value = ratio * maximum;
            for _ in 0..50 {
                let next = value.next_up();
                prop_assert!(law(next, maximum) >= law(value, maximum), "{value:e} {maximum:e}");
                value = next;
            }
        }

        #[test]
        fn linear_is_within_its_range(value in any::<f64>(), maximum in any::<f64>()) {
            match linear_intensity(value, maximum) {
                Ok(percent) => prop_assert!((0.0..=100.0).contains(&percent)),
                Err(_) => prop_assert!(!value.is_finite() || !maximum.is_finite() || maximum <= 0.0),
            }
        }
    }
}
