//! What a sender wrote cannot forge or hide a line of the log: characters that move the cursor,
//! colour, break the line or turn the reading direction are written as escapes, in whatever field
//! or text they stand.

use std::fmt::{self, Write};

use tracing::{Event, Subscriber};
use tracing_subscriber::field::RecordFields;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

/// Formats fields, or whole lines, as the one inside does, and escapes what comes out.
#[derive(Debug, Clone)]
pub(super) struct Escaped<F>(pub(super) F);

/// The text format: every field, the message included. Time, level and colours stay as they are.
impl<'writer, F> FormatFields<'writer> for Escaped<F>
where
    F: for<'any> FormatFields<'any>,
{
    fn format_fields<R: RecordFields>(&self, mut writer: Writer<'writer>, fields: R) -> fmt::Result {
        let mut escaping = Escaping { inner: &mut writer, style: Style::Text };
        self.0.format_fields(Writer::new(&mut escaping), fields)
    }
}

/// The JSON format: the whole line. JSON escapes the characters below U+0020 itself.
impl<S, N, F> FormatEvent<S, N> for Escaped<F>
where
    S: Subscriber + for<'any> LookupSpan<'any>,
    N: for<'any> FormatFields<'any> + 'static,
    F: FormatEvent<S, N>,
{
    fn format_event(
        &self,
        context: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let mut escaping = Escaping { inner: &mut writer, style: Style::Json };
        self.0.format_event(context, Writer::new(&mut escaping), event)
    }
}

/// How an escape looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Style {
    /// As Rust writes characters: `\n`, `\u{1b}`.
    Text,
    /// As JSON does (RFC 8259 section 7): `\u001b`.
    Json,
}

struct Escaping<'a, 'w> {
    inner: &'a mut Writer<'w>,
    style: Style,
}

impl Write for Escaping<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let mut rest = text;
        while let Some(at) = rest.find(|c| is_unsafe(c, self.style)) {
            let (before, from) = rest.split_at(at);
            self.inner.write_str(before)?;
            let mut characters = from.chars();
            let Some(character) = characters.next() else { break };
            match self.style {
                Style::Text => write!(self.inner, "{}", character.escape_debug())?,
                Style::Json => {
                    let mut units = [0; 2];
                    for unit in character.encode_utf16(&mut units) {
                        write!(self.inner, "\\u{unit:04x}")?;
                    }
                }
            }
            rest = characters.as_str();
        }
        self.inner.write_str(rest)
    }
}

/// Whether a character is not to be written as it is: controls, line and paragraph separators,
/// directions, invisible ones; in short, what Rust counts as not printable.
fn is_unsafe(c: char, style: Style) -> bool {
    match c {
        ' '..='~' => false,
        // The line's own end; within strings JSON has escaped it.
        '\n' if style == Style::Json => false,
        c => c.escape_debug().len() > 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn escaped(text: &str, style: Style) -> String {
        let mut out = String::new();
        let mut writer = Writer::new(&mut out);
        Escaping { inner: &mut writer, style }.write_str(text).unwrap();
        out
    }

    #[test]
    fn what_moves_hides_or_turns_text_is_escaped_and_letters_are_not() {
        let text = "a\n\r\t\u{1b}[31m\u{7f}\u{9b}\u{202e}\u{2066}\u{2028}\u{200f}\u{feff}é漢\\\"";
        assert_eq!(
            escaped(text, Style::Text),
            "a\\n\\r\\t\\u{1b}[31m\\u{7f}\\u{9b}\\u{202e}\\u{2066}\\u{2028}\\u{200f}\\u{feff}é漢\\\""
        );
        assert_eq!(escaped("x\u{202e}\u{7f}\u{e0001}y\n", Style::Json), "x\\u202e\\u007f\\udb40\\udc01y\n");
    }
}
