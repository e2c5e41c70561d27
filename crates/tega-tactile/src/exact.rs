//! Equations 2 to 4 on exact integers: what is decided here does not depend on rounding.
//!
//! All sums are integers over the weights' denominator. The threshold `T = I(μ) − f·σ` is irrational in general, but
//! "is this grey level above `T`?" is a comparison of two squares, so it is decided exactly. The same code runs on
//! `i128` (every 8-bit weight set of practical size) and, where that overflows, on big integers.

use num_bigint::BigInt;
use num_integer::Integer;
use num_rational::Ratio;
use num_traits::{CheckedAdd, CheckedMul, CheckedSub, FromPrimitive, Signed, ToPrimitive};

/// Squares in this range neither overflow nor lose digits as `f64`.
const SAFE_SQUARES: std::ops::Range<f64> = 1e-280..1e280;

/// An integer wide enough, or one that says when it is not.
pub(crate) trait Exact:
    Clone + Ord + Signed + Integer + CheckedAdd + CheckedSub + CheckedMul + ToPrimitive + FromPrimitive
{
    /// `p / q` as the nearest `f64` (`q` positive).
    fn ratio(p: &Self, q: &Self) -> f64;
    /// The same integer, without a limit.
    fn to_big(&self) -> BigInt;
    /// The same integer, where it fits.
    fn from_big(n: &BigInt) -> Option<Self>;
}

impl Exact for i128 {
    fn ratio(p: &Self, q: &Self) -> f64 {
        const EXACT: u128 = 1 << f64::MANTISSA_DIGITS;
        let (dividend, divisor) = (p.unsigned_abs(), q.unsigned_abs());
        if dividend <= EXACT && divisor <= EXACT {
            return *p as f64 / *q as f64;
        }
        let size = divide(dividend, divisor);
        if *p < 0 { -size } else { size }
    }

    fn to_big(&self) -> BigInt {
        BigInt::from(*self)
    }

    fn from_big(n: &BigInt) -> Option<Self> {
        n.to_i128()
    }
}

/// `p / q` rounded to nearest, ties to even; `q` below 2^127 and not 0.
fn divide(p: u128, q: u128) -> f64 {
    // Long division until the quotient has more bits than an f64 keeps; what is left over only breaks ties.
    const ENOUGH: u32 = f64::MANTISSA_DIGITS + 2;
    let (mut quotient, mut rest, mut exponent) = (p / q, p % q, 0_i32);
    while rest > 0 && u128::BITS - quotient.leading_zeros() < ENOUGH {
        let step = rest.leading_zeros().min(quotient.leading_zeros()).min(ENOUGH);
        rest <<= step;
        quotient = (quotient << step) | (rest / q);
        rest %= q;
        exponent -= step as i32;
    }
    (quotient | u128::from(rest > 0)) as f64 * 2_f64.powi(exponent)
}

impl Exact for BigInt {
    fn ratio(p: &Self, q: &Self) -> f64 {
        Ratio::new_raw(p.clone(), q.clone()).to_f64().unwrap_or(f64::NAN)
    }

    fn to_big(&self) -> BigInt {
        self.clone()
    }

    fn from_big(n: &BigInt) -> Option<Self> {
        Some(n.clone())
    }
}

/// Weighted sums over the image, in levels (grey value times `denominator`).
#[derive(Debug, Clone)]
pub(crate) struct Sums<I> {
    /// Σ n.
    pub mass: I,
    /// Σ x·n and Σ y·n.
    pub first: [I; 2],
    /// Σ (x² + y²)·n.
    pub second: I,
    /// Σ n², where the intensity spread is asked for.
    pub squares: Option<I>,
    /// Levels per grey value.
    pub denominator: I,
}

/// The variance `numerator / denominator`, denominator positive.
pub(crate) struct Variance<I> {
    pub numerator: I,
    pub denominator: I,
}

impl<I: Exact> Sums<I> {
    /// The same sums in integers without a limit.
    pub fn widened(&self) -> Sums<BigInt> {
        Sums {
            mass: self.mass.to_big(),
            first: self.first.each_ref().map(I::to_big),
            second: self.second.to_big(),
            squares: self.squares.as_ref().map(I::to_big),
            denominator: self.denominator.to_big(),
        }
    }

    /// Centroid (x, y), pixels; `None` where the mass is not positive.
    pub fn centroid(&self) -> Option<[f64; 2]> {
        self.mass.is_positive().then(|| [0, 1].map(|axis| I::ratio(&self.first[axis], &self.mass)))
    }

    /// The pixel nearest to the centroid, ties upward, clamped into a `width` × `height` image.
    pub fn nearest_pixel(&self, width: usize, height: usize) -> Option<(usize, usize)> {
        let pixel = |first: &I, side: usize| {
            let twice = first.checked_add(first)?.checked_add(&self.mass)?;
            let nearest = twice.div_floor(&self.mass.checked_add(&self.mass)?);
            Some(if nearest.is_negative() { 0 } else { nearest.to_usize().unwrap_or(side).min(side - 1) })
        };
        let [x, y] = &self.first;
        Some((pixel(x, width)?, pixel(y, height)?))
    }

    /// Eq 3: `Σ[(x−μx)² + (y−μy)²]·n / Σ n`, in pixels squared; negative for some signed maps. `None` on overflow.
    pub fn spatial_variance(&self) -> Option<Variance<I>> {
        let [x, y] = &self.first;
        let numerator = self
            .second
            .checked_mul(&self.mass)?
            .checked_sub(&x.checked_mul(x)?)?
            .checked_sub(&y.checked_mul(y)?)?;
        let denominator = self.mass.checked_mul(&self.mass)?;
        Some(Variance { numerator, denominator })
    }

    /// Population variance of the grey map over `pixels` pixels, in grey values squared. `None` on overflow.
    pub fn intensity_variance(&self, pixels: usize) -> Option<Variance<I>> {
        let pixels = I::from_usize(pixels)?;
        let squares = self.squares.as_ref()?;
        let numerator = squares.checked_mul(&pixels)?.checked_sub(&self.mass.checked_mul(&self.mass)?)?;
        let scale = pixels.checked_mul(&self.denominator)?;
        Some(Variance { numerator, denominator: scale.checked_mul(&scale)? })
    }
}

/// Eq 4: `T = value − factor·σ`, kept as exact parts.
pub(crate) struct Threshold<I> {
    /// Value at the centroid, over `value_denominator`.
    pub value: I,
    pub value_denominator: I,
    /// σ² and the factor.
    pub variance: Variance<I>,
    pub factor: [I; 2],
    /// Levels per grey value.
    pub denominator: I,
}

impl<I: Exact> Threshold<I> {
    /// σ as an `f64`.
    pub fn spread(&self) -> f64 {
        let variance = I::ratio(&self.variance.numerator, &self.variance.denominator);
        if SAFE_SQUARES.contains(&variance) || self.variance.numerator.is_zero() {
            variance.sqrt()
        } else {
            self.root().to_f64().unwrap_or(f64::NAN)
        }
    }

    /// σ to 120 bits, for magnitudes whose square an `f64` cannot hold.
    fn root(&self) -> Ratio<BigInt> {
        let (p, q) = (self.variance.numerator.to_big(), self.variance.denominator.to_big());
        let shift = (q.bits() + 256).saturating_sub(p.bits()) / 2;
        Ratio::new_raw(((p << (2 * shift)) / q).sqrt(), BigInt::from(1) << shift)
    }

    /// `T` as an `f64` without cancellation, from σ; `None` on overflow.
    pub fn to_f64(&self, spread: f64) -> Option<f64> {
        let [f, g] = &self.factor;
        let value = I::ratio(&self.value, &self.value_denominator);
        let step = I::ratio(f, g) * spread;
        if value == 0.0 || step == 0.0 || (value < 0.0) != (step < 0.0) {
            return Some(value - step);
        }
        // Same sign: (v² − f²σ²)/(v + fσ) with an exact numerator, so that a small T keeps all its digits.
        if !(SAFE_SQUARES.contains(&(value * value)) && SAFE_SQUARES.contains(&(step * step))) {
            let ratio = |p: &I, q: &I| Ratio::new_raw(p.to_big(), q.to_big());
            let (value, f) = (ratio(&self.value, &self.value_denominator), ratio(f, g));
            let variance = ratio(&self.variance.numerator, &self.variance.denominator);
            let numerator = &value * &value - &f * &f * variance;
            return (numerator / (value + f * self.root())).to_f64();
        }
        let gq = self.value_denominator.checked_mul(g)?;
        let gq_square = gq.checked_mul(&gq)?;
        let pg = self.value.checked_mul(g)?;
        let fq = f.checked_mul(&self.value_denominator)?;
        let numerator = pg
            .checked_mul(&pg)?
            .checked_mul(&self.variance.denominator)?
            .checked_sub(&fq.checked_mul(&fq)?.checked_mul(&self.variance.numerator)?)?;
        let denominator = gq_square.checked_mul(&self.variance.denominator)?;
        Some(I::ratio(&numerator, &denominator) / (value + step))
    }

    /// Is grey level `n` above `T`? Exact; `None` on overflow.
    fn exceeds(&self, n: &I) -> Option<bool> {
        let [f, g] = &self.factor;
        // n/D > v − fσ  ⇔  fσ > e/h with e/h = v − n/D.
        let (e, h) = if self.value_denominator == self.denominator {
            (self.value.checked_sub(n)?, self.denominator.clone())
        } else {
            let value = self.value.checked_mul(&self.denominator)?;
            let level = n.checked_mul(&self.value_denominator)?;
            (value.checked_sub(&level)?, self.value_denominator.checked_mul(&self.denominator)?)
        };
        if f.is_negative() != e.is_negative() {
            // One side is negative, the other is not: only 0 > 0 could tie, and it is not above.
            return Some(!f.is_negative() && e.is_negative());
        }
        let (fh, eg) = (f.checked_mul(&h)?, e.checked_mul(g)?);
        let step = fh.checked_mul(&fh)?.checked_mul(&self.variance.numerator)?;
        let gap = eg.checked_mul(&eg)?.checked_mul(&self.variance.denominator)?;
        Some(if f.is_negative() { step < gap } else { step > gap })
    }

    /// The smallest level above `T`, searched outward from `T` as an `f64`; `None` on overflow.
    pub fn first_level_above(&self, estimate: f64) -> Option<I> {
        let estimate = estimate * self.denominator.to_f64()?;
        let mut n = I::from_f64(estimate.floor()).unwrap_or_else(I::zero);
        let mut stride = I::one();
        // Gallop until the pair (below, above) brackets the border …
        let (mut below, mut above);
        if self.exceeds(&n)? {
            loop {
                above = n.clone();
                n = n.checked_sub(&stride)?;
                if !self.exceeds(&n)? {
                    below = n;
                    break;
                }
                stride = stride.checked_add(&stride)?;
            }
        } else {
            loop {
                below = n.clone();
                n = n.checked_add(&stride)?;
                if self.exceeds(&n)? {
                    above = n;
                    break;
                }
                stride = stride.checked_add(&stride)?;
            }
        }
        // … then halve it.
        loop {
            let gap = above.checked_sub(&below)?;
            if gap.is_one() {
                return Some(above);
            }
            let middle = below.checked_add(&gap.div_floor(&(I::one() + I::one())))?;
            if self.exceeds(&middle)? {
                above = middle;
            } else {
                below = middle;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn threshold<I: Exact>(
        value: i64,
        variance: [i64; 2],
        factor: [i64; 2],
        denominator: i64,
    ) -> Threshold<I> {
        let int = |n| I::from_i64(n).unwrap();
        Threshold {
            value: int(value),
            value_denominator: int(denominator),
            variance: Variance { numerator: int(variance[0]), denominator: int(variance[1]) },
            factor: factor.map(int),
            denominator: int(denominator),
        }
    }

    fn evaluated<I: Exact>(t: &Threshold<I>) -> (f64, I) {
        let value = t.to_f64(t.spread()).unwrap();
        (value, t.first_level_above(value).unwrap())
    }

    #[test]
    fn quotients_are_rounded_to_nearest() {
        for (p, q) in
            [(1, 3), (i128::MAX, 3), (1, i128::MAX), (-(1 << 90) - 1, (1 << 60) + 1), (i128::MIN, 7)]
        {
            assert_eq!(i128::ratio(&p, &q), BigInt::ratio(&p.into(), &q.into()), "{p} / {q}");
        }
    }

    #[test]
    fn a_level_on_the_threshold_is_not_above_it() {
        // v = 10, σ = 2, f = 2: T = 6 exactly.
        let t = threshold::<i128>(10_000, [4, 1], [2, 1], 1000);
        assert_eq!(evaluated(&t), (6.0, 6001));
    }

    #[test]
    fn irrational_thresholds_are_decided_to_the_last_level() {
        // v = 1, σ = √2, f = 1: T = −0.41421356…
        let t = threshold::<i128>(1_000_000_000, [2, 1], [1, 1], 1_000_000_000);
        assert_eq!(evaluated(&t).1, -414_213_562);
        let t = threshold::<BigInt>(1_000_000_000, [2, 1], [1, 1], 1_000_000_000);
        assert_eq!(evaluated(&t).1, BigInt::from(-414_213_562));
    }

    #[test]
    fn a_negative_factor_raises_the_threshold() {
        let t = threshold::<i128>(10, [4, 1], [-2, 1], 1);
        assert_eq!(evaluated(&t).1, 15);
    }

    #[test]
    fn a_zero_spread_leaves_the_value_itself() {
        let t = threshold::<i128>(10, [0, 1], [32, 25], 1);
        assert_eq!(evaluated(&t).1, 11);
        let t = threshold::<i128>(10, [0, 1], [0, 1], 1);
        assert_eq!(evaluated(&t).1, 11);
    }

    #[test]
    fn overflow_is_said_not_wrapped() {
        let huge = i128::MAX / 2;
        let sums = Sums { mass: huge, first: [huge, huge], second: huge, squares: None, denominator: 1 };
        assert!(sums.spatial_variance().is_none());
    }
}
