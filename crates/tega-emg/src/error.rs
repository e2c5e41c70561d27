//! What can be wrong with the input.

/// An input that cannot be used; the message names the argument, its value and its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EmgError {
    /// A number is out of its range or not finite.
    #[error("{name} = {value} {unit} is out of range: {wanted}")]
    OutOfRange {
        /// The argument.
        name: &'static str,
        /// The value given.
        value: f64,
        /// Its unit, or empty.
        unit: &'static str,
        /// What would be accepted.
        wanted: &'static str,
    },
}

impl EmgError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::OutOfRange { .. } => "",
        }
    }
}
