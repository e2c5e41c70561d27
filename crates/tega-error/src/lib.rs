//! Say what is wrong with a number: the one error that all crates share, and the one way a number is written.

use std::fmt::{self, Display, Formatter};

/// A number that is not finite or lies outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} = {}{} is out of range: {wanted}", Brief(*value), Spaced(unit))]
pub struct OutOfRange {
    /// The argument.
    pub name: &'static str,
    /// The value given.
    pub value: f64,
    /// Its unit, or empty.
    pub unit: &'static str,
    /// What would be accepted.
    pub wanted: &'static str,
}

/// Write a number as people do: a very large or very small one with an exponent, not with 300 digits.
#[derive(Debug, Clone, Copy)]
pub struct Brief(pub f64);

impl Display for Brief {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 || (1e-5..1e16).contains(&self.0.abs()) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

/// Write a unit with a space before it, and nothing where there is no unit.
#[derive(Debug, Clone, Copy)]
pub struct Spaced<'a>(pub &'a str);

impl Display for Spaced<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, " {}", self.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [0.0, 3.0, -0.25, 1e300, f64::MAX, -5e-324, f64::NAN, f64::INFINITY]
            .map(|x| Brief(x).to_string());
        let wanted = ["0", "3", "-0.25", "1e300", "1.7976931348623157e308", "-5e-324", "NaN", "inf"];
        assert_eq!(shown, wanted);
    }

    #[test]
    fn the_message_names_argument_value_unit_and_range() {
        let told = |unit| OutOfRange { name: "cutoff", value: 0.5, unit, wanted: "1 to 2" }.to_string();
        assert_eq!(told("Hz"), "cutoff = 0.5 Hz is out of range: 1 to 2");
        assert_eq!(told(""), "cutoff = 0.5 is out of range: 1 to 2");
    }
}
