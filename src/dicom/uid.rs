//! Unique identifiers, one type for each role, so that a series is never taken for a study.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// A text that is no UID.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("not a DICOM UID: 1 to 64 characters, digits in components that dots separate (PS3.5 section 9.1)")]
pub struct InvalidUid;

/// Digits in non-empty components, at most 64 characters. Leading zeros are let through: real
/// scanners write them.
fn checked(text: &str) -> Result<String, InvalidUid> {
    let text = text.trim_end_matches(['\0', ' ']);
    let components_are_digits =
        text.split('.').all(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()));
    if text.len() <= 64 && components_are_digits { Ok(text.to_owned()) } else { Err(InvalidUid) }
}

macro_rules! uid {
    ($(#[$doc:meta] $name:ident),+ $(,)?) => {$(
        #[$doc]
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, utoipa::ToSchema)]
        #[serde(try_from = "String", into = "String")]
        #[schema(value_type = String, pattern = r"^[0-9]+(\.[0-9]+)*$", max_length = 64, examples("1.2.826.0.1.3680043.10.9999.5.2"))]
        pub struct $name(String);

        impl $name {
            /// The UID's text.
            #[must_use]
            pub fn as_str(&self) -> &str { &self.0 }
        }
        impl FromStr for $name {
            type Err = InvalidUid;
            fn from_str(text: &str) -> Result<Self, InvalidUid> { checked(text).map(Self) }
        }
        impl TryFrom<String> for $name {
            type Error = InvalidUid;
            fn try_from(text: String) -> Result<Self, InvalidUid> { text.parse() }
        }
        impl From<$name> for String {
            fn from(uid: $name) -> Self { uid.0 }
        }
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result { f.write_str(&self.0) }
        }
    )+};
}

uid! {
    /// Study Instance UID (0020,000D).
    StudyInstanceUid,
    /// Series Instance UID (0020,000E).
    SeriesInstanceUid,
    /// SOP Instance UID (0008,0018).
    SopInstanceUid,
    /// SOP Class UID (0008,0016).
    SopClassUid,
    /// Transfer Syntax UID (0002,0010).
    TransferSyntaxUid,
    /// Frame of Reference UID (0020,0052).
    FrameOfReferenceUid,
}
