//! Say what is wrong with a number or a name: the errors that all crates share, and the one way a number is written.

use std::borrow::Cow;
use std::fmt::{self, Display, Formatter};

/// A number that is not finite or lies outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name}{place} = {}{} is out of range: {wanted}", Brief(*value), Spaced(unit))]
pub struct OutOfRange {
    /// The argument.
    pub name: &'static str,
    /// Which of its numbers, as it is written after the name: `[3]`, ` of indenter 1`; empty where there is one.
    pub place: String,
    /// The value given.
    pub value: f64,
    /// Its unit, or empty.
    pub unit: &'static str,
    /// What would be accepted.
    pub wanted: Cow<'static, str>,
}

impl OutOfRange {
    /// Name an argument, its value and unit, and what would be accepted.
    pub fn new(
        name: &'static str,
        value: f64,
        unit: &'static str,
        wanted: impl Into<Cow<'static, str>>,
    ) -> Self {
        Self { name, place: String::new(), value, unit, wanted: wanted.into() }
    }

    /// Say which of an argument's numbers it is.
    #[must_use]
    pub fn placed(self, place: impl Display) -> Self {
        Self { place: place.to_string(), ..self }
    }
}

/// A name that is none of the choices.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name} = '{value}' is not known")]
pub struct UnknownChoice {
    /// The argument.
    pub name: &'static str,
    /// The name given.
    pub value: String,
    /// The names that would be accepted.
    pub known: Vec<&'static str>,
}

impl UnknownChoice {
    /// The names to choose from, as the next step for the person who reads the message.
    pub fn hint(&self) -> String {
        let known: Vec<_> = self.known.iter().map(|known| format!("'{known}'")).collect();
        format!("use {}", known.join(" or "))
    }
}

/// Find a choice by its name.
///
/// # Errors
/// [`UnknownChoice`] for a name that is none of them.
///
/// # Examples
/// ```
/// assert_eq!(tega_error::choice("order", "rgb", &[("bgr", 0), ("rgb", 1)]), Ok(1));
/// let error = tega_error::choice("order", "red", &[("bgr", 0), ("rgb", 1)]).unwrap_err();
/// assert_eq!(format!("{error}; {}", error.hint()), "order = 'red' is not known; use 'bgr' or 'rgb'");
/// ```
pub fn choice<T: Copy>(
    name: &'static str,
    value: &str,
    choices: &[(&'static str, T)],
) -> Result<T, UnknownChoice> {
    let found = choices.iter().find(|(known, _)| *known == value).map(|(_, choice)| *choice);
    found.ok_or_else(|| {
        let known = choices.iter().map(|(known, _)| *known).collect();
        UnknownChoice { name, value: value.to_owned(), known }
    })
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

/// Write a computed number with six digits: what follows them is the noise of its computation.
#[derive(Debug, Clone, Copy)]
pub struct Computed(pub f64);

impl Display for Computed {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        Brief(format!("{:.5e}", self.0).parse().unwrap_or(self.0)).fmt(f)
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
    fn computed_numbers_end_where_their_noise_begins() {
        let shown = [1e-6 * 333.333_333_3, 0.499_999 * 333.333_333_3, 499.999, 0.0, f64::NAN]
            .map(|x| Computed(x).to_string());
        assert_eq!(shown, ["0.000333333", "166.666", "499.999", "0", "NaN"]);
    }

    #[test]
    fn the_message_names_argument_value_unit_and_range() {
        let told = |unit| OutOfRange::new("cutoff", 0.5, unit, "1 to 2");
        assert_eq!(told("Hz").to_string(), "cutoff = 0.5 Hz is out of range: 1 to 2");
        assert_eq!(told("").to_string(), "cutoff = 0.5 is out of range: 1 to 2");
        assert_eq!(told("Hz").placed("[3]").to_string(), "cutoff[3] = 0.5 Hz is out of range: 1 to 2");
    }
}
