//! Media types (RFC 9110 section 8.3.1) as they stand in Content-Type and Accept.

use axum::http::HeaderMap;
use axum::http::header::{ACCEPT, CONTENT_TYPE};

/// A media type with its parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MediaType {
    essence: String,
    parameters: Vec<(String, String)>,
}

impl MediaType {
    /// Reads `type/subtype; name=value; name="value"`; `None` if there is no type/subtype.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let essence = text.split(';').next()?.trim().to_ascii_lowercase();
        let (main, sub) = essence.split_once('/')?;
        if main.is_empty() || sub.is_empty() || sub.contains('/') {
            return None;
        }
        Some(Self { parameters: Self::parse_parameters(text), essence })
    }

    /// The parameters after the first semicolon, their names in lower case.
    pub(super) fn parse_parameters(text: &str) -> Vec<(String, String)> {
        let mut parameters = Vec::new();
        let mut rest = text;
        while let Some((_, after)) = rest.split_once(';') {
            let Some((name, value)) = after.split_once('=') else { break };
            if name.contains(';') {
                rest = after;
                continue;
            }
            let (value, tail) = quoted_or_plain(value.trim_start());
            parameters.push((name.trim().to_ascii_lowercase(), value));
            rest = tail;
        }
        parameters
    }

    /// Content-Type of a request, if it has one; one that can't be read has an empty essence,
    /// which nothing accepts.
    pub(super) fn of_request(headers: &HeaderMap) -> Option<Self> {
        let value = headers.get(CONTENT_TYPE)?;
        Some(value.to_str().ok().and_then(Self::parse).unwrap_or_else(Self::unknown))
    }

    /// One that is none.
    pub(super) fn unknown() -> Self {
        Self { essence: String::new(), parameters: Vec::new() }
    }

    /// `type/subtype` in lower case.
    pub(super) fn essence(&self) -> &str {
        &self.essence
    }

    /// The value of a parameter, by its name in lower case.
    pub(super) fn parameter(&self, name: &str) -> Option<&str> {
        self.parameters.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// How well this range of an Accept header fits: type/subtype, type/*, */*.
    fn specificity(&self, essence: &str) -> Option<u8> {
        let main = essence.split('/').next().unwrap_or("");
        match self.essence.split_once('/')? {
            ("*", "*") => Some(0),
            (range, "*") if range == main => Some(1),
            _ if self.essence == essence => Some(2),
            _ => None,
        }
    }
}

/// The value and what follows it.
fn quoted_or_plain(text: &str) -> (String, &str) {
    let Some(quoted) = text.strip_prefix('"') else {
        let end = text.find(';').unwrap_or(text.len());
        return (text[..end].trim().to_owned(), &text[end..]);
    };
    let mut value = String::new();
    let mut characters = quoted.char_indices();
    while let Some((at, character)) = characters.next() {
        match character {
            '"' => return (value, &quoted[at + 1..]),
            // Browsers escape the quote alone and leave a backslash of a file name as it is.
            '\\' if quoted[at + 1..].starts_with(['"', '\\']) => {
                value.extend(characters.next().map(|(_, escaped)| escaped));
            }
            other => value.push(other),
        }
    }
    (value, "")
}

/// The one of `offered` that the request's Accept header likes best (RFC 9110 section 12.5.1): by
/// quality, then by the order offered. Without the header, the first. `None` if it accepts none.
pub(super) fn negotiate(headers: &HeaderMap, offered: &[&'static str]) -> Option<usize> {
    let accepts: Vec<_> = headers.get_all(ACCEPT).iter().filter_map(|value| value.to_str().ok()).collect();
    let ranges: Vec<_> =
        accepts.iter().flat_map(|value| value.split(',')).filter_map(MediaType::parse).collect();
    if headers.get(ACCEPT).is_none() || accepts.iter().all(|value| value.trim().is_empty()) {
        return (!offered.is_empty()).then_some(0);
    }
    let quality = |essence: &str| {
        let best =
            ranges.iter().filter_map(|range| Some((range.specificity(essence)?, range))).max_by_key(|r| r.0);
        best.map_or(0, |(_, range)| thousandths(range.parameter("q")))
    };
    let mut best = None;
    for (index, essence) in offered.iter().enumerate() {
        let quality = quality(essence.split(';').next().unwrap_or("").trim());
        if quality > 0 && best.is_none_or(|(_, highest)| quality > highest) {
            best = Some((index, quality));
        }
    }
    best.map(|(index, _)| index)
}

/// A quality value; what can't be read counts as 1.
fn thousandths(q: Option<&str>) -> u16 {
    let value =
        q.and_then(|text| text.parse::<f32>().ok()).filter(|q| (0.0..=1.0).contains(q)).unwrap_or(1.0);
    (value * 1000.0).round() as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choose(accept: &str) -> Option<usize> {
        let mut headers = HeaderMap::new();
        headers.insert(ACCEPT, accept.parse().unwrap());
        negotiate(&headers, &["application/x-ply", "text/csv", "application/json"])
    }

    #[test]
    fn accept_is_read_as_the_standard_says() {
        assert_eq!(choose("*/*"), Some(0));
        assert_eq!(choose("text/*"), Some(1));
        assert_eq!(choose("application/json, text/csv;q=0.9"), Some(2));
        assert_eq!(choose("text/csv;q=0.1, application/*;q=0.1"), Some(0));
        assert_eq!(choose("*/*, application/x-ply;q=0"), Some(1));
        assert_eq!(choose("Application/JSON; charset=utf-8"), Some(2));
        assert_eq!(choose("image/png"), None);
        assert_eq!(choose("nonsense"), None);
        assert_eq!(choose(" "), Some(0));
        assert_eq!(negotiate(&HeaderMap::new(), &["a/b"]), Some(0));
    }

    #[test]
    fn parameters_are_read_quoted_and_plain() {
        let media_type =
            MediaType::parse("multipart/related; TYPE=\"application/dicom\" ;boundary = a=b; x=\"q;\\\"\"")
                .unwrap();
        assert_eq!(media_type.parameter("type"), Some("application/dicom"));
        assert_eq!(media_type.parameter("boundary"), Some("a=b"));
        assert_eq!(media_type.parameter("x"), Some("q;\""));
        assert_eq!(MediaType::parse("nothing"), None);
    }
}
