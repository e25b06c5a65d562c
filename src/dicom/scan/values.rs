//! Values of small attributes.

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
