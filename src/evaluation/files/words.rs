//! Words of a text file.

use super::FileError;

/// Words between white space, as numbers.
pub(super) struct Words<'a>(std::str::SplitAsciiWhitespace<'a>);

impl<'a> Words<'a> {
    /// The words of these bytes.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, FileError> {
        let text = std::str::from_utf8(bytes)
            .map_err(|_| FileError::format("its header says text, but bytes follow that are none"))?;
        Ok(Self(text.split_ascii_whitespace()))
    }

    /// The next one as a number.
    pub(super) fn number(&mut self) -> Result<f64, FileError> {
        let word = self.0.next().ok_or_else(|| FileError::length("the text ends before its last number"))?;
        word.parse().map_err(|_| FileError::format(format!("{:?} is no number", shortened(word))))
    }
}

/// At most 40 characters of what stands in a file, for a message.
pub(super) fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}
