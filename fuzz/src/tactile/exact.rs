//! Comparing a floating-point number with a rational one.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, Signed, Zero};

/// `significand * 10^exponent` as a rational and as the nearest `f64`.
pub fn decimal(significand: i64, exponent: i32) -> (BigRational, f64) {
    let power = BigInt::from(10).pow(exponent.unsigned_abs());
    let exact = if exponent < 0 {
        BigRational::new(significand.into(), power)
    } else {
        BigRational::from_integer(power * significand)
    };
    (exact, format!("{significand}e{exponent}").parse().unwrap())
}

/// How far from the exact result a float may be: eight units in the last place, and the smallest of all floats.
fn slack(value: &BigRational) -> BigRational {
    let power = |n: u32| BigRational::new(BigInt::one(), BigInt::one() << n);
    value.abs() * power(49) + power(1070)
}

/// The range of exact results that `value` may stand for; `None` for what is no number.
pub fn around(value: f64) -> Option<[BigRational; 2]> {
    let exact = BigRational::from_float(value)?;
    let slack = slack(&exact);
    Some([&exact - &slack, exact + slack])
}

pub fn assert_near(what: &str, value: f64, wanted: &BigRational) {
    let near = around(value).is_some_and(|[low, high]| low <= *wanted && *wanted <= high);
    assert!(near, "{what} is {value}, wanted {wanted}");
}

/// The same where only the square of what is wanted is rational.
pub fn assert_root(what: &str, value: f64, square: &BigRational) {
    let near = value >= 0.0
        && around(value).is_some_and(|[low, high]| {
            let low = low.max(BigRational::zero());
            &low * &low <= *square && *square <= &high * &high
        });
    assert!(near, "{what} is {value}, wanted the root of {square}");
}
