//! Numbers that mean what they print: 0.299 is 299/1000, not the binary fraction next to it.

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{One, Signed, Zero};
use tega_error::OutOfRange;

use crate::Order;
use crate::error::TactileError;
use crate::exact::Exact;
use crate::kernel::{MAX_WEIGHT, MAX_WEIGHT_SUM};

/// An exact decimal in lowest terms.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decimal(Parts);

/// Numerator and (positive) denominator; small where they fit, so that common options cost no allocation.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Parts {
    Small(i64, i64),
    Big(BigInt, BigInt),
}

impl Decimal {
    /// The decimal that `value` prints as (its shortest representation that reads back as the same `f64`).
    ///
    /// # Errors
    /// [`TactileError::OutOfRange`] when `value` is not finite.
    ///
    /// # Examples
    /// ```
    /// let d = tega_tactile::Decimal::printed("factor", 1.28)?;
    /// assert_eq!(d, tega_tactile::Decimal::new(32, 25));
    /// # Ok::<(), tega_tactile::TactileError>(())
    /// ```
    pub fn printed(name: &'static str, value: f64) -> Result<Self, TactileError> {
        if !value.is_finite() {
            return Err(OutOfRange::new(name, value, "", "a finite number").into());
        }
        // Four places or fewer, the usual case: no other decimal that short reads back as this value.
        let scaled = (value * 1e4).round();
        if value.abs() < 1e9 && scaled / 1e4 == value {
            return Ok(Self::new(scaled as i64, 10_000));
        }
        // Rust's `Display` for floats is the shortest decimal that round-trips, without an exponent.
        let text = format!("{value}");
        let digits: String = text.chars().filter(char::is_ascii_digit).collect();
        let places = text.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let magnitude = digits.parse::<BigInt>().unwrap_or_default();
        let numerator = if value < 0.0 { -magnitude } else { magnitude };
        Ok(Self::reduced(numerator, BigInt::from(10).pow(places as u32)))
    }

    /// `numerator / denominator`; a denominator below one is taken as one.
    pub fn new(numerator: i64, denominator: i64) -> Self {
        let denominator = denominator.max(1);
        let common = numerator.gcd(&denominator).max(1);
        Self(Parts::Small(numerator / common, denominator / common))
    }

    fn reduced(numerator: BigInt, denominator: BigInt) -> Self {
        let common = numerator.gcd(&denominator);
        let (n, d) = (numerator / &common, denominator / common);
        match (i64::try_from(&n), i64::try_from(&d)) {
            (Ok(n), Ok(d)) => Self(Parts::Small(n, d)),
            _ => Self(Parts::Big(n, d)),
        }
    }

    /// Numerator and denominator; `None` where they do not fit.
    pub(crate) fn parts<I: Exact>(&self) -> Option<[I; 2]> {
        Some(match &self.0 {
            Parts::Small(n, d) => [I::from_i64(*n)?, I::from_i64(*d)?],
            Parts::Big(n, d) => [I::from_big(n)?, I::from_big(d)?],
        })
    }

    fn big(&self) -> (BigInt, BigInt) {
        match &self.0 {
            Parts::Small(n, d) => ((*n).into(), (*d).into()),
            Parts::Big(n, d) => (n.clone(), d.clone()),
        }
    }

    /// The smallest integer `n` with `n / scale > self`; `None` on overflow.
    pub(crate) fn first_level_above<I: Exact>(&self, scale: &I) -> Option<I> {
        let [numerator, denominator] = self.parts::<I>()?;
        numerator.checked_mul(scale)?.div_floor(&denominator).checked_add(&I::one())
    }
}

/// Grey weights (ω red, ω green, ω blue) as integers over one denominator.
///
/// A grey value is then an integer, its *level*, over that denominator: sums, peaks and threshold counts are exact.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Weights(Form);

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Form {
    /// Red, green, blue and their denominator, small enough for the fast kernels.
    Narrow([i32; 3], i32),
    /// Of any size.
    Wide([BigInt; 3], BigInt),
}

impl Weights {
    /// Weights from the decimals that `(r, g, b)` print as.
    ///
    /// # Errors
    /// [`TactileError::OutOfRange`] for a weight that is not finite, [`TactileError::WeightSum`] when the three do not
    /// add up to 1 within 1e-9. They are never renormalised.
    pub fn printed(r: f64, g: f64, b: f64) -> Result<Self, TactileError> {
        if (r, g, b) == (0.299, 0.587, 0.114) {
            return Ok(Self::luma());
        }
        let parts = [
            Decimal::printed("weights", r)?,
            Decimal::printed("weights", g)?,
            Decimal::printed("weights", b)?,
        ]
        .map(|p| p.big());
        let denominator = parts.iter().fold(BigInt::one(), |acc, (_, d)| acc.lcm(d));
        let numerators = parts.map(|(n, d)| n * (&denominator / d));
        let sum: BigInt = numerators.iter().sum();
        if (&sum - &denominator).abs() * 1_000_000_000_i64 > denominator {
            return Err(TactileError::WeightSum { r, g, b, sum: BigInt::ratio(&sum, &denominator) });
        }
        Ok(Self(narrow(&numerators, &denominator).unwrap_or(Form::Wide(numerators, denominator))))
    }

    /// The usual luma weights 0.299, 0.587, 0.114: the default.
    pub const fn luma() -> Self {
        Self(Form::Narrow([299, 587, 114], 1000))
    }

    /// The numerators as the bytes of a pixel lie, and the denominator.
    pub(crate) fn arranged(&self, order: Order) -> Form {
        match &self.0 {
            Form::Narrow(n, d) => Form::Narrow(order.arrange(*n), *d),
            Form::Wide(n, d) => Form::Wide(order.arrange(n.clone()), d.clone()),
        }
    }
}

fn narrow(numerators: &[BigInt; 3], denominator: &BigInt) -> Option<Form> {
    let sum = numerators.iter().map(Signed::abs).fold(BigInt::zero(), |acc, n| acc + n);
    let small = sum <= MAX_WEIGHT_SUM.into() && numerators.iter().all(|n| n.abs() <= MAX_WEIGHT.into());
    let [r, g, b] = numerators;
    let weights = [i32::try_from(r).ok()?, i32::try_from(g).ok()?, i32::try_from(b).ok()?];
    small.then_some(Form::Narrow(weights, i32::try_from(denominator).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimal_means_its_printed_digits() {
        for (value, numerator, denominator) in [
            (0.299, 299, 1000),
            (1.28, 32, 25),
            (-0.5, -1, 2),
            (3.0, 3, 1),
            (0.0, 0, 1),
            (1e-9, 1, 1_000_000_000),
        ] {
            assert_eq!(Decimal::printed("x", value).unwrap(), Decimal::new(numerator, denominator));
        }
        assert!(Decimal::printed("x", f64::NAN).is_err());
    }

    #[test]
    fn common_weights_take_the_fast_form() {
        assert_eq!(Weights::printed(0.587, 0.299, 0.114).unwrap().0, Form::Narrow([587, 299, 114], 1000));
        assert_eq!(Weights::printed(0.25, 0.5, 0.25).unwrap().0, Form::Narrow([1, 2, 1], 4));
    }

    #[test]
    fn weights_must_add_up_and_are_not_renormalised() {
        assert!(Weights::printed(0.3, 0.3, 0.3).is_err());
        assert!(Weights::printed(0.3, 0.3, 0.4 + 0.9e-9).is_ok());
        assert!(Weights::printed(0.3, 0.3, 0.4 + 1.1e-9).is_err());
        assert!(Weights::printed(2.0, -0.5, -0.5).is_ok());
        assert!(matches!(Weights::printed(1e-300, 0.5, 0.5).unwrap().0, Form::Wide(..)));
    }

    #[test]
    fn first_level_above_is_strict() {
        assert_eq!(Decimal::new(6, 1).first_level_above(&1000_i128), Some(6001));
        assert_eq!(Decimal::new(1, 3).first_level_above(&1000_i128), Some(334));
    }
}
