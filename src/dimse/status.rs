//! What a refused request is told: a status and an Error Comment (0000,0902).

use crate::error::Error;

/// 0000: done.
pub(crate) const SUCCESS: u16 = 0x0000;
/// 0110: a failure of ours (PS3.7 section C.5.1).
pub(crate) const PROCESSING_FAILURE: u16 = 0x0110;
/// A700: out of resources (PS3.4 table B.2-1).
pub(crate) const OUT_OF_RESOURCES: u16 = 0xA700;
/// 0117: the SOP Instance UID is missing or is no UID (PS3.7 section C.5.7).
pub(crate) const INVALID_SOP_INSTANCE: u16 = 0x0117;
/// 0122: SOP class not supported (PS3.7 section C.5.6).
pub(crate) const SOP_CLASS_NOT_SUPPORTED: u16 = 0x0122;
/// 0211: no such operation on this presentation context (PS3.7 section C.5.10).
pub(crate) const UNRECOGNIZED_OPERATION: u16 = 0x0211;
/// 0212: the command's parts do not fit together (PS3.7 section C.5.8).
pub(crate) const MISTYPED_ARGUMENT: u16 = 0x0212;
/// A900: the data set does not match the SOP class (PS3.4 table B.2-1).
pub(crate) const DATA_SET_MISMATCH: u16 = 0xA900;

/// Longest LO (PS3.5 section 6.2).
const MAX_COMMENT: usize = 64;

/// A request that was not carried out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// Status (0000,0900).
    pub(crate) status: u16,
    /// Stable name of the cause, for the log and the metrics.
    pub(crate) code: &'static str,
    /// Error Comment (0000,0902): a valid LO, without any patient's identity.
    pub(crate) comment: String,
}

impl Refusal {
    /// Of the exchange itself, before any data set.
    pub(crate) fn new(status: u16, code: &'static str, comment: &str) -> Self {
        Self { status, code, comment: long_string(comment) }
    }
}

impl From<&Error> for Refusal {
    /// The stable code stands first. 64 characters hold little more: what differs from case to case
    /// follows; what does not is in the conformance statement.
    fn from(error: &Error) -> Self {
        let mapping = error.mapping();
        let code = mapping.code;
        let comment = match error {
            Error::NotDicom(detail) | Error::MalformedDataSet(detail) => format!("{code}: {detail}"),
            // Both UIDs don't fit.
            Error::DataSetMismatch(detail) => {
                let what = detail.split_once(" is ").map_or(detail.as_str(), |(what, _)| what);
                format!("{code}: {what} is not the command's")
            }
            Error::MissingAttribute { attribute } => format!("{code}: {attribute}"),
            Error::PixelDataSize(fault) => format!("{code}: {}", fault.figures()),
            Error::ConflictingInstance(_) => format!("{code}: stored with other content"),
            Error::IncomparableInstance(_) => format!("{code}: in another transfer syntax"),
            Error::TooLargeToCompare(..) => format!("{code}: beyond memory.budget_bytes"),
            Error::ConflictingSeries(_) => format!("{code}: stored in another series or study"),
            Error::ConflictingStudy(_) => format!("{code}: its series is of another study"),
            Error::ConflictingIdentity(_) => format!("{code}: stored with another identity"),
            Error::SeriesFull { limit, setting } => format!("{code}: {limit} ({setting})"),
            Error::TooLarge { limit_bytes, setting } => format!("{code}: over {limit_bytes} ({setting})"),
            Error::UnsupportedTransferSyntax(uid) => format!("{code}: {uid}"),
            Error::UnsupportedSopClass(uid) => format!("{code}: {uid}"),
            Error::OutOfStorage => format!("{code}: below storage.min_free_bytes"),
            Error::ShuttingDown => format!("{code}: try again later"),
            Error::Internal(_) => format!("{code}: the service's log has the cause"),
            other => format!("{code}: {other}"),
        };
        Self { status: mapping.dimse_status, code, comment: long_string(&comment) }
    }
}

/// Ends what was cut.
const CUT: &str = "...";

/// As LO allows it: 64 characters, no backslash, no control characters, here ASCII alone. What is
/// too long ends after a whole word, and with dots: half a UID is another UID.
fn long_string(text: &str) -> String {
    let allowed = |c: char| if (c.is_ascii_graphic() && c != '\\') || c == ' ' { c } else { '?' };
    let mut line: String = text.chars().map(allowed).collect();
    if line.len() > MAX_COMMENT {
        let room = MAX_COMMENT - CUT.len();
        let whole_words = line[..=room].rfind(' ').unwrap_or(room);
        line.truncate(whole_words);
        line.push_str(CUT);
    }
    line.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dicom::PixelExtentError;

    #[test]
    fn a_comment_begins_with_the_stable_code_and_is_a_valid_lo() {
        let refusal = Refusal::from(&Error::OutOfStorage);
        assert_eq!(refusal.status, 0xA700);
        assert!(refusal.comment.starts_with("out-of-storage: "), "{}", refusal.comment);
        assert!(refusal.comment.len() <= 64, "{}", refusal.comment);
        let refusal = Refusal::from(&Error::MalformedDataSet("40 sequences inside one another".to_owned()));
        assert_eq!(refusal.comment, "malformed-data-set: 40 sequences inside one another");
        assert_eq!(long_string("a\\b\nµ"), "a?b??");
        let words = long_string(&"a word ".repeat(20));
        assert!(words.len() <= 64 && words.ends_with(" a..."), "{words}");
        let mismatch = "its SOP instance is 1.2.3, the command's 1.2.4".to_owned();
        let comment = Refusal::from(&Error::DataSetMismatch(mismatch)).comment;
        assert_eq!(comment, "data-set-mismatch: its SOP instance is not the command's");
        let attribute = "SeriesInstanceUID (0020,000E)";
        let comment = Refusal::from(&Error::MissingAttribute { attribute }).comment;
        assert_eq!(comment, "missing-attribute: SeriesInstanceUID (0020,000E)");
        let fault = PixelExtentError::Short { length: 262_144, needed: 524_288 };
        let comment = Refusal::from(&Error::PixelDataSize(fault)).comment;
        assert_eq!(comment, "pixel-data-size: 262144 bytes where 524288 must be");
        let uid = "1.2.826.0.1.3680043.10.9999.5.3.11";
        let comment = Refusal::from(&Error::ConflictingInstance(uid.parse().unwrap())).comment;
        assert!(!comment.contains("1.2.826") || comment.contains(uid), "half a UID: {comment}");
    }
}
