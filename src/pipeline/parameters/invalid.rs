//! Parameters that can't be taken.

use super::profile::Profile;

/// A parameter outside its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{name} must be {range}, not {value}")]
pub struct InvalidParameter {
    /// The parameter's name, with dots for nested ones.
    pub name: String,
    /// What would be right.
    pub range: &'static str,
    /// What was given.
    pub value: f64,
}

/// A parameter was changed that the profile does not use.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name} has no effect under the profile {}: leave it out, or ask for {}", .profile.name(), .other.name())]
pub struct UnusedParameter {
    /// The parameter's name.
    pub name: &'static str,
    /// The profile that would run.
    pub profile: Profile,
    /// The profile that uses it.
    pub other: Profile,
}

/// Whether a value lies in its range.
///
/// # Errors
/// [`InvalidParameter`] with the range in words.
pub(crate) fn within(
    name: &str,
    value: f64,
    allowed: std::ops::RangeInclusive<f64>,
    range: &'static str,
) -> Result<(), InvalidParameter> {
    if allowed.contains(&value) {
        Ok(())
    } else {
        Err(InvalidParameter { name: name.to_owned(), range, value })
    }
}
