//! Values of small attributes.

use dicom_encoding::text::{SpecificCharacterSet, TextCodec};

/// Text of the default repertoire without the padding around it (PS3.5 section 6.2).
pub(crate) fn text(value: &[u8]) -> String {
    String::from_utf8_lossy(value).trim_matches([' ', '\0']).to_owned()
}

/// The values of a text with several, which backslashes separate.
pub(crate) fn texts(value: &[u8]) -> Vec<String> {
    let whole = text(value);
    if whole.is_empty() {
        return Vec::new();
    }
    whole.split('\\').map(|part| part.trim_matches([' ', '\0']).to_owned()).collect()
}

/// Text in the data set's character set (PS3.3 section C.12.1.1.2), `character_set` being the value of
/// Specific Character Set (0008,0005), without the padding around it.
pub(crate) fn decoded(value: &[u8], character_set: Option<&[u8]>) -> String {
    // Of several character sets the first is the one in force without escape sequences.
    let set = character_set.map(texts).unwrap_or_default();
    let codec = set.first().and_then(|code| SpecificCharacterSet::from_code(code)).unwrap_or_default();
    let decoded = codec.decode(value).unwrap_or_else(|_| String::from_utf8_lossy(value).into_owned());
    decoded.trim_matches([' ', '\0']).to_owned()
}
