//! The filter of a download: how far a point may be expected to be off.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Metadata, NoErrors, PointCloud};

/// The largest expected error that a point may have, mm: 0 to 1000.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f32")]
pub struct MaxError(f32);

/// It is never NaN.
impl Eq for MaxError {}

/// A number that is no [`MaxError`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the largest expected error must be a number of mm within 0 to 1000")]
pub struct InvalidMaxError;

/// Why a cloud can't be filtered by its expected errors.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unfiltered {
    /// None of its errors is known.
    #[error(transparent)]
    NoErrors(#[from] NoErrors),
    /// Not one point would be left.
    #[error("no point has an expected error of at most {limit} mm: the least one is {least_mm:.4} mm")]
    NothingLeft {
        /// What was asked for.
        limit: MaxError,
        /// The least expected error of the cloud's points, mm.
        least_mm: f32,
    },
}

impl MaxError {
    /// mm.
    #[must_use]
    pub fn mm(self) -> f32 {
        self.0
    }

    /// Drops the points beyond it and notes it among what the cloud says about itself.
    ///
    /// # Errors
    /// [`Unfiltered`] for a cloud whose errors are not known, and where no point would be left; the
    /// cloud stays as it is.
    pub fn apply(self, cloud: &mut PointCloud, metadata: &mut Metadata) -> Result<(), Unfiltered> {
        let least_mm = cloud.errors.iter().copied().reduce(f32::min);
        let nothing_left = !cloud.errors.iter().any(|&error| error <= self.0);
        if let (Some(least_mm), true) = (least_mm, nothing_left) {
            return Err(Unfiltered::NothingLeft { limit: self, least_mm });
        }
        cloud.keep_within(self.0)?;
        metadata.max_error_mm = Some(self);
        Ok(())
    }
}

impl TryFrom<f32> for MaxError {
    type Error = InvalidMaxError;

    fn try_from(mm: f32) -> Result<Self, InvalidMaxError> {
        if (0.0..=1000.0).contains(&mm) { Ok(Self(mm)) } else { Err(InvalidMaxError) }
    }
}

impl FromStr for MaxError {
    type Err = InvalidMaxError;

    fn from_str(text: &str) -> Result<Self, InvalidMaxError> {
        text.parse().ok().and_then(|mm: f32| mm.try_into().ok()).ok_or(InvalidMaxError)
    }
}

impl fmt::Display for MaxError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_finite_number_that_is_not_negative_will_do() {
        assert_eq!("0.1".parse().map(MaxError::mm), Ok(0.1));
        assert_eq!("0".parse().map(MaxError::mm), Ok(0.0));
        for wrong in ["", "-0.1", "nan", "inf", "1e9", "0,1", "0.1 mm"] {
            assert_eq!(wrong.parse::<MaxError>(), Err(InvalidMaxError), "{wrong}");
        }
    }
}
