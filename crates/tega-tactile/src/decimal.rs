//! Numbers that mean what they print: 0.299 is 299/1000, not the binary fraction next to it.

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{One, Signed, ToPrimitive, Zero};

use crate::error::TactileError;
use crate::exact::Exact;

/// An exact decimal: `numerator / denominator`, in lowest terms, denominator positive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Decimal {
    pub(crate) numerator: BigInt,
    pub(crate) denominator: BigInt,
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
            return Err(TactileError::OutOfRange { name, value, unit: "", wanted: "a finite number" });
        }
        // Rust's `Display` for floats is the shortest decimal that round-trips, without an exponent.
        let text = format!("{value}");
        let digits: String = text.chars().filter(char::is_ascii_digit).collect();
        let places = text.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let magnitude = digits.parse::<BigInt>().unwrap_or_default();
        let numerator = if value < 0.0 { -magnitude } else { magnitude };
        let mut d = Self { numerator, denominator: BigInt::from(10).pow(places as u32) };
        d.reduce();
        Ok(d)
    }

    /// `numerator / denominator`; a denominator below one is taken as one.
    pub fn new(numerator: i64, denominator: i64) -> Self {
        let mut d = Self { numerator: numerator.into(), denominator: denominator.max(1).into() };
        d.reduce();
        d
    }

    fn reduce(&mut self) {
        let common = self.numerator.gcd(&self.denominator);
        if common > BigInt::one() {
            self.numerator /= &common;
            self.denominator /= &common;
        }
    }

    /// The smallest integer `n` with `n / scale > self`.
    pub(crate) fn first_level_above(&self, scale: &BigInt) -> BigInt {
        (&self.numerator * scale).div_floor(&self.denominator) + 1
    }
}

/// Grey weights (ω red, ω green, ω blue) as integers over one denominator.
///
/// A grey value is then an integer, its *level*, over that denominator: sums, peaks and threshold counts are exact.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Weights {
    /// Red, green, blue numerators.
    numerators: [BigInt; 3],
    denominator: BigInt,
    /// The same where every level of an 8-bit difference fits an `i32`: the fast kernels' form.
    narrow: Option<([i32; 3], i32)>,
}

impl Weights {
    /// Weights from the decimals that `(r, g, b)` print as.
    ///
    /// # Errors
    /// [`TactileError::OutOfRange`] for a weight that is not finite, [`TactileError::WeightSum`] when the three do not
    /// add up to 1 within 1e-9. They are never renormalised.
    pub fn printed(r: f64, g: f64, b: f64) -> Result<Self, TactileError> {
        let parts = [
            Decimal::printed("weights", r)?,
            Decimal::printed("weights", g)?,
            Decimal::printed("weights", b)?,
        ];
        let denominator = parts.iter().fold(BigInt::one(), |acc, p| acc.lcm(&p.denominator));
        let numerators = parts.map(|p| p.numerator * (&denominator / p.denominator));
        let sum: BigInt = numerators.iter().sum();
        if (&sum - &denominator).abs() * 1_000_000_000_i64 > denominator {
            return Err(TactileError::WeightSum { r, g, b, sum: BigInt::ratio(&sum, &denominator) });
        }
        let reach = numerators.iter().map(Signed::abs).fold(BigInt::zero(), |acc, n| acc + n) * 255;
        let narrow = (reach <= i32::MAX.into() && denominator <= i32::MAX.into())
            .then(|| {
                let [r, g, b] = &numerators;
                Some(([r.to_i32()?, g.to_i32()?, b.to_i32()?], denominator.to_i32()?))
            })
            .flatten();
        Ok(Self { numerators, denominator, narrow })
    }

    /// The usual luma weights 0.299, 0.587, 0.114: the default.
    pub fn luma() -> Self {
        let numerators = [299, 587, 114];
        Self {
            numerators: numerators.map(BigInt::from),
            denominator: BigInt::from(1000),
            narrow: Some((numerators, 1000)),
        }
    }

    pub(crate) fn narrow(&self, order: crate::Order) -> Option<([i32; 3], i32)> {
        self.narrow.map(|(n, d)| (order.arrange(n), d))
    }

    pub(crate) fn wide(&self, order: crate::Order) -> ([BigInt; 3], BigInt) {
        (order.arrange(self.numerators.clone()), self.denominator.clone())
    }
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
    fn luma_is_what_its_decimals_give() {
        assert_eq!(Weights::printed(0.299, 0.587, 0.114).unwrap(), Weights::luma());
    }

    #[test]
    fn weights_must_add_up_and_are_not_renormalised() {
        assert!(Weights::printed(0.3, 0.3, 0.3).is_err());
        assert!(Weights::printed(0.3, 0.3, 0.4 + 0.9e-9).is_ok());
        assert!(Weights::printed(0.3, 0.3, 0.4 + 1.1e-9).is_err());
        assert!(Weights::printed(2.0, -0.5, -0.5).is_ok());
        assert!(Weights::printed(1e-300, 0.5, 0.5).unwrap().narrow.is_none());
    }

    #[test]
    fn first_level_above_is_strict() {
        let scale = BigInt::from(1000);
        assert_eq!(Decimal::new(6, 1).first_level_above(&scale), BigInt::from(6001));
        assert_eq!(Decimal::new(1, 3).first_level_above(&scale), BigInt::from(334));
    }
}
