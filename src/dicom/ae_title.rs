//! Application entity titles: value representation AE (PS3.5 section 6.2).

use std::fmt;

/// Characters that a title has at most.
const MAX_LENGTH: usize = 16;

/// An application entity title without its padding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AeTitle(String);

impl AeTitle {
    /// Takes spaces at both ends for padding, and nothing else. `None` for what no title holds:
    /// control characters (TAB, LF and VT among them), the backslash, anything beyond ASCII, more
    /// than 16 characters. A title of spaces alone is empty.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let title = text.trim_matches(' ');
        let allowed = |c: char| (c.is_ascii_graphic() && c != '\\') || c == ' ';
        (title.len() <= MAX_LENGTH && title.chars().all(allowed)).then(|| Self(title.to_owned()))
    }

    /// The title; empty where none was given.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for AeTitle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_spaces_are_padding() {
        let title = |text| AeTitle::parse(text).map(|title| title.0);
        assert_eq!(title("  GO OD  ").as_deref(), Some("GO OD"));
        assert_eq!(title("                ").as_deref(), Some(""));
        for text in [
            "GOOD\t",
            "\nGOOD",
            "\u{b}GOOD",
            "GOOD\0",
            "GO\\OD",
            "G\u{d6}D",
            "\u{a0}GOOD",
            "12345678901234567",
        ] {
            assert_eq!(title(text), None, "{text:?}");
        }
    }
}
