//! Butterworth low-pass and high-pass filters as second-order sections, designed in `f64`.
//!
//! The analogue poles lie evenly on a circle; the bilinear transform with the cutoff prewarped turns each conjugate
//! pair into one section in closed form, so no polynomial is ever multiplied out. At high rates the poles crowd
//! towards `z = 1`, where the only coefficient combination that matters for the gain, `1 + a1 + a2`, is far smaller
//! than the coefficients themselves: `a2` is therefore rounded so that this sum, not `a2`, is the accurate one, and
//! the gain is taken from the rounded sections. The passband gain is then 1 to the last digits at any rate.

use crate::error::EmgError;
use std::f64::consts::PI;
use tega_error::OutOfRange;

/// Most sections a filter can have.
pub(crate) const MAX_SECTIONS: usize = 4;
/// Highest order on offer: two per section.
pub const MAX_ORDER: usize = 2 * MAX_SECTIONS;
/// Closest a cutoff may come to 0 or to half the rate, as a share of the rate. Nearer, the rounding of the
/// coefficients alone would move the corner by about one part in a million.
pub const CUTOFF_MARGIN: f64 = 1e-6;

/// One second-order section: `y = (b0 + b1/z + b2/z²) / (1 + a1/z + a2/z²) x`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Numerator, `[b0, b1, b2]`.
    pub b: [f64; 3],
    /// Denominator without its leading 1, `[a1, a2]`.
    pub a: [f64; 2],
}

/// A designed filter: sections in the order they run, the one with the sharpest poles last, all gain in the first.
#[derive(Debug, Clone, PartialEq)]
pub struct Sos {
    sections: Vec<Section>,
}

impl Sos {
    /// Design a low-pass filter, 3 dB down at `cutoff_hz`.
    ///
    /// # Errors
    /// [`EmgError::OutOfRange`] if the rate is not 1e-6 to 1e12 Hz or the order not 1 to 8;
    /// [`EmgError::Cutoff`] if the cutoff does not lie inside (0, rate/2) by [`CUTOFF_MARGIN`].
    ///
    /// # Examples
    /// ```
    /// let sos = tega_emg::Sos::lowpass(1000.0, 50.0, 4)?;
    /// assert_eq!(sos.sections().len(), 2);
    /// # Ok::<(), tega_emg::EmgError>(())
    /// ```
    pub fn lowpass(rate_hz: f64, cutoff_hz: f64, order: usize) -> Result<Self, EmgError> {
        design(rate_hz, cutoff_hz, order, Band::Low)
    }

    /// Design a high-pass filter, 3 dB down at `cutoff_hz`.
    ///
    /// # Errors
    /// As for [`Sos::lowpass`].
    pub fn highpass(rate_hz: f64, cutoff_hz: f64, order: usize) -> Result<Self, EmgError> {
        design(rate_hz, cutoff_hz, order, Band::High)
    }

    /// The sections in running order.
    pub fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// The sections as rows `[b0, b1, b2, 1, a1, a2]`, the layout of `scipy.signal`.
    pub fn rows(&self) -> Vec<[f64; 6]> {
        self.sections.iter().map(|s| [s.b[0], s.b[1], s.b[2], 1.0, s.a[0], s.a[1]]).collect()
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Band {
    Low,
    High,
}

/// `tan(π cutoff / rate)` and its reciprocal, each from the side where it is small, so that both keep their digits
/// near 0 and near half the rate.
fn prewarp(rate_hz: f64, cutoff_hz: f64) -> (f64, f64) {
    if cutoff_hz <= 0.25 * rate_hz {
        let k = (PI * cutoff_hz / rate_hz).tan();
        (k, 1.0 / k)
    } else {
        let r = (PI * (0.5 * rate_hz - cutoff_hz) / rate_hz).tan();
        (1.0 / r, r)
    }
}

fn design(rate_hz: f64, cutoff_hz: f64, order: usize, band: Band) -> Result<Sos, EmgError> {
    check_rate(rate_hz)?;
    if order == 0 || order > MAX_ORDER {
        let wanted = "1 to 8";
        return Err(OutOfRange::new("order", order as f64, "", wanted).into());
    }
    let (low_hz, high_hz) = (CUTOFF_MARGIN * rate_hz, (0.5 - CUTOFF_MARGIN) * rate_hz);
    if !(cutoff_hz >= low_hz && cutoff_hz <= high_hz) {
        return Err(EmgError::Cutoff { cutoff_hz, rate_hz, low_hz, high_hz });
    }
    let (k, inverse) = prewarp(rate_hz, cutoff_hz);
    let sign = if band == Band::Low { 1.0 } else { -1.0 };
    let mut sections = Vec::with_capacity(order.div_ceil(2));
    let mut gain = 1.0;
    if order % 2 == 1 {
        // A real pole at (1 - k) / (1 + k).
        let a1 = if k <= 1.0 { (k - 1.0) / (k + 1.0) } else { (1.0 - inverse) / (1.0 + inverse) };
        gain *= 0.5 * (1.0 + sign * a1);
        sections.push(Section { b: [1.0, sign, 0.0], a: [a1, 0.0] });
    }
    for pair in 1..=order / 2 {
        // The pole's angle from the negative real axis: the wider, the sharper the resonance.
        let angle = PI * (2 * pair - 1 + order % 2) as f64 / (2 * order) as f64;
        let damping = 2.0 * angle.cos();
        let a = if k <= 1.0 { pole_pair(k, damping, -1.0) } else { pole_pair(inverse, damping, 1.0) };
        gain *= ((1.0 + sign * a[0]) + a[1]) / 4.0;
        sections.push(Section { b: [1.0, 2.0 * sign, 1.0], a });
    }
    if let Some(first) = sections.first_mut() {
        first.b = first.b.map(|b| b * gain);
    }
    Ok(Sos { sections })
}

/// Denominator of one pole pair for `t` = tan or its reciprocal, at most 1; `side` is the sign of `a1`.
fn pole_pair(t: f64, damping: f64, side: f64) -> [f64; 2] {
    let scale = 1.0 + damping * t + t * t;
    let a1 = 2.0 * (1.0 - t) * (1.0 + t) / scale;
    [side * a1, 4.0 * t * t / scale - (1.0 - a1)]
}

/// Rates beyond these are no rates, and their products with a time or a cutoff are no numbers any more.
const RATES_HZ: std::ops::RangeInclusive<f64> = 1e-6..=1e12;

pub(crate) fn check_rate(rate_hz: f64) -> Result<(), EmgError> {
    if RATES_HZ.contains(&rate_hz) {
        return Ok(());
    }
    let wanted = "1e-6 to 1e12";
    Err(OutOfRange::new("rate_hz", rate_hz, "Hz", wanted).into())
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Exact values are meant.
mod tests {
    use super::*;

    /// Value of the designed filter at frequency 0 (`z = 1`) or half the rate (`z = -1`).
    fn response(sos: &Sos, z: f64) -> f64 {
        sos.sections().iter().map(|s| (s.b[0] + s.b[1] * z + s.b[2]) / (1.0 + s.a[0] * z + s.a[1])).product()
    }

    #[test]
    fn passband_gain_is_one_and_stopband_is_zero_at_every_rate_and_order() -> Result<(), EmgError> {
        for rate_hz in [200.0, 250.0, 1e3, 1e4, 3e4, 1e5, 1e6] {
            for order in 1..=MAX_ORDER {
                let (low, high) = (Sos::lowpass(rate_hz, 50.0, order)?, Sos::highpass(rate_hz, 20.0, order)?);
                assert!((response(&low, 1.0) - 1.0).abs() < 1e-14, "{rate_hz} {order}");
                assert!((response(&high, -1.0) - 1.0).abs() < 1e-14, "{rate_hz} {order}");
                assert_eq!(response(&low, -1.0), 0.0);
                assert_eq!(response(&high, 1.0), 0.0);
            }
        }
        Ok(())
    }

    /// Square of the gain of `b0 + b1 / z + b2 / z²` on the unit circle.
    fn power([b0, b1, b2]: [f64; 3], w: f64) -> f64 {
        let (re, im) = (b0 + b1 * w.cos() + b2 * (2.0 * w).cos(), b1 * w.sin() + b2 * (2.0 * w).sin());
        re * re + im * im
    }

    #[test]
    fn half_the_power_is_left_at_the_cutoff_at_every_rate_and_order() -> Result<(), EmgError> {
        for rate_hz in [200.0, 250.0, 1e3, 1e4] {
            for cutoff_hz in [5.0, 20.0, 50.0, 90.0] {
                let w = 2.0 * PI * cutoff_hz / rate_hz;
                for order in 1..=MAX_ORDER {
                    for sos in
                        [Sos::lowpass(rate_hz, cutoff_hz, order)?, Sos::highpass(rate_hz, cutoff_hz, order)?]
                    {
                        let section = |s: &Section| power(s.b, w) / power([1.0, s.a[0], s.a[1]], w);
                        let left: f64 = sos.sections().iter().map(section).product();
                        assert!((left - 0.5).abs() < 1e-6, "{rate_hz} {cutoff_hz} {order}: {left}");
                    }
                }
            }
        }
        Ok(())
    }

    #[test]
    fn poles_are_inside_the_unit_circle_up_to_both_margins() -> Result<(), EmgError> {
        for share in [CUTOFF_MARGIN, 1e-5, 0.1, 0.25, 0.4, 0.49999, 0.5 - CUTOFF_MARGIN] {
            for order in 1..=MAX_ORDER {
                for s in Sos::lowpass(1.0, share, order)?.sections() {
                    assert!(s.a[1].abs() < 1.0 && s.a[0].abs() < 1.0 + s.a[1], "{share} {order} {s:?}");
                }
            }
        }
        Ok(())
    }

    #[test]
    fn sections_run_from_the_flattest_to_the_sharpest() -> Result<(), EmgError> {
        let sos = Sos::lowpass(1000.0, 50.0, 8)?;
        assert!(sos.sections().windows(2).all(|w| w[0].a[1] < w[1].a[1]));
        assert_eq!(sos.sections()[1].b, [1.0, 2.0, 1.0]);
        Ok(())
    }

    #[test]
    fn impossible_cutoffs_are_named() {
        for cutoff_hz in [0.0, -1.0, 100.0, 150.0, 1e-4, 99.9999, f64::NAN, f64::INFINITY] {
            let got = Sos::lowpass(200.0, cutoff_hz, 4);
            assert!(matches!(got, Err(EmgError::Cutoff { .. })), "{cutoff_hz}");
        }
        for (got, name) in [
            (Sos::lowpass(f64::NAN, 50.0, 4), "rate_hz"),
            (Sos::lowpass(200.0, 50.0, 0), "order"),
            (Sos::highpass(200.0, 20.0, 9), "order"),
        ] {
            assert!(got.is_err_and(|error| error.to_string().starts_with(name)), "{name}");
        }
    }
}
