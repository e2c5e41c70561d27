//! The paper's reading rule: what a pair of CCI and EDA says about a contact.

use crate::HapticsError;
use tega_error::OutOfRange;

/// A share of the calibrated maximum from which a metric counts as high.
///
/// Half of the maximum is the midpoint of the logistic law: "high" is where the wearer's motor is at 50 % or more.
pub const HIGH_SHARE: f64 = 0.5;

/// What a finger touches, as far as CCI and EDA show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactType {
    /// No contact: EDA is 0.
    None,
    /// High CCI and low EDA: a small, sharp contact. Go carefully.
    Focal,
    /// Low CCI and high EDA: a wide, gentle contact. It tolerates more.
    Broad,
    /// Both high or both low: the rule says nothing.
    Mixed,
}

impl ContactType {
    /// The word used in tables and files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Focal => "focal",
            Self::Broad => "broad",
            Self::Mixed => "mixed",
        }
    }
}

/// Name a contact from CCI and EDA, each as a share of its calibrated maximum.
///
/// # Errors
/// A share that is not finite, or a negative one.
///
/// # Examples
/// ```
/// use tega_haptics::{ContactType, contact_type};
/// assert_eq!(contact_type(0.9, 0.2)?, ContactType::Focal);
/// assert_eq!(contact_type(0.1, 0.8)?, ContactType::Broad);
/// # Ok::<(), tega_haptics::HapticsError>(())
/// ```
pub fn contact_type(cci_norm: f64, eda_norm: f64) -> Result<ContactType, HapticsError> {
    for (name, value) in [("cci_norm", cci_norm), ("eda_norm", eda_norm)] {
        if !(value.is_finite() && value >= 0.0) {
            let wanted = "a finite share of the maximum, 0 or more";
            return Err(OutOfRange::new(name, value, "", wanted).into());
        }
    }
    if eda_norm == 0.0 {
        return Ok(ContactType::None);
    }
    Ok(match (cci_norm >= HIGH_SHARE, eda_norm >= HIGH_SHARE) {
        (true, false) => ContactType::Focal,
        (false, true) => ContactType::Broad,
        (true, true) | (false, false) => ContactType::Mixed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_at_its_borders() {
        let table = [
            (0.0, 0.0, ContactType::None),
            (3.0, 0.0, ContactType::None),
            (0.5, 0.499, ContactType::Focal),
            (0.499, 0.5, ContactType::Broad),
            (0.5, 0.5, ContactType::Mixed),
            (0.1, 0.1, ContactType::Mixed),
            (1.7, 1e-300, ContactType::Focal),
        ];
        for (cci, eda, wanted) in table {
            assert_eq!(contact_type(cci, eda).unwrap(), wanted, "{cci} {eda}");
        }
        assert!(contact_type(f64::NAN, 0.1).unwrap_err().to_string().starts_with("cci_norm"));
        assert!(contact_type(0.1, -0.1).unwrap_err().to_string().starts_with("eda_norm"));
    }
}
