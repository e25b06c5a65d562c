//! Representations of clouds, reports and pictures, served with a strong ETag, If-Match,
//! If-None-Match, Range, If-Range, HEAD and gzip (RFC 9110 sections 8.4, 8.8, 13, 14).
//!
//! Each content coding is a representation of its own with an ETag of its own; a range is always
//! one of the bytes without coding.

use std::ops::Range;

use axum::body::Body;
use axum::http::header::{
    ACCEPT_ENCODING, ACCEPT_RANGES, CACHE_CONTROL, CONTENT_DISPOSITION, CONTENT_ENCODING, CONTENT_LENGTH,
    CONTENT_RANGE, CONTENT_TYPE, ETAG, IF_MATCH, IF_NONE_MATCH, IF_RANGE, RANGE, VARY,
};
use axum::http::response::Builder;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode};
use axum::response::Response;
use bytes::Bytes;

use super::content::Content;
use crate::error::{Error, Result};

/// Shorter ones are not worth a coding.
const MIN_GZIP_BYTES: u64 = 1024;

/// What a resource looks like in one media type.
#[derive(Debug, Clone)]
pub(super) struct Representation<C = Bytes> {
    /// The bytes without any content coding.
    pub(super) bytes: C,
    /// Content-Type.
    pub(super) media_type: &'static str,
    /// The file name that a browser saves it under; without one it is shown.
    pub(super) file_name: Option<String>,
    /// Whether gzip makes it smaller.
    pub(super) compressible: bool,
    /// Value of Vary: what else of the request chose this representation.
    pub(super) vary: &'static str,
}

impl<C: Content> Representation<C> {
    /// The answer to a GET or HEAD with these headers. Hashes, reads and compresses: not for tokio's
    /// threads.
    ///
    /// # Errors
    /// [`Error::PreconditionFailed`], [`Error::RangeNotSatisfiable`].
    pub(super) fn respond(self, method: &Method, headers: &HeaderMap) -> Result<Response> {
        let hash = self.bytes.tag();
        let (identity_tag, gzip_tag) = (format!("\"{hash}\""), format!("\"{hash}-gzip\""));
        // Range is defined for GET alone.
        let range = headers.get(RANGE).filter(|_| method == Method::GET);
        let gzip = self.compressible
            && range.is_none()
            && self.bytes.length() >= MIN_GZIP_BYTES
            && accepts_gzip(headers);
        let tag = if gzip { gzip_tag } else { identity_tag };

        // Compared strongly (RFC 9110 section 13.1.1): a weak tag names no bytes.
        if headers.contains_key(IF_MATCH) && !tags(headers, IF_MATCH).any(|one| one == "*" || one == tag) {
            return Err(Error::PreconditionFailed);
        }
        if list_holds(headers, &tag) {
            return self
                .head(StatusCode::NOT_MODIFIED, &tag, None, &[])?
                .body(Body::empty())
                .map_err(Error::internal);
        }
        let if_range_holds =
            headers.get(IF_RANGE).is_none_or(|validator| validator.as_bytes() == tag.as_bytes());
        let length = self.bytes.length();
        if let Some(range) = range.filter(|_| if_range_holds).and_then(|value| value.to_str().ok()) {
            match requested(range, length) {
                Requested::Part(part) => {
                    let content_range = format!("bytes {}-{}/{length}", part.start, part.end - 1);
                    let more = [(CONTENT_RANGE, content_range)];
                    let head =
                        self.head(StatusCode::PARTIAL_CONTENT, &tag, Some(part.end - part.start), &more)?;
                    return head.body(self.bytes.part(part)?).map_err(Error::internal);
                }
                Requested::Outside => {
                    return Err(Error::RangeNotSatisfiable { length });
                }
                Requested::Whole => {}
            }
        }
        if gzip {
            let coding = [(CONTENT_ENCODING, "gzip".to_owned())];
            let mut head = self.head(StatusCode::OK, &tag, None, &coding)?;
            let (body, length) = self.bytes.gzip()?;
            if let Some(length) = length {
                head = head.header(CONTENT_LENGTH, length);
            }
            return head.body(body).map_err(Error::internal);
        }
        let head = self.head(StatusCode::OK, &tag, Some(length), &[])?;
        // The body of an answer to HEAD is not sent; nothing is read for it.
        let body = if method == Method::HEAD { Body::empty() } else { self.bytes.part(0..length)? };
        head.body(body).map_err(Error::internal)
    }

    /// The answer without its body, of which the length may be known.
    fn head(
        &self,
        status: StatusCode,
        tag: &str,
        length: Option<u64>,
        more: &[(HeaderName, String)],
    ) -> Result<Builder> {
        let mut response = Response::builder()
            .status(status)
            .header(ETAG, tag)
            .header(VARY, self.vary)
            .header(CACHE_CONTROL, "private, no-cache");
        if status != StatusCode::NOT_MODIFIED {
            response = response.header(CONTENT_TYPE, self.media_type).header(ACCEPT_RANGES, "bytes");
            if let Some(name) = &self.file_name {
                response = response.header(CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\""));
            }
        }
        if let Some(length) = length {
            response = response.header(CONTENT_LENGTH, length);
        }
        for (name, value) in more {
            response = response.header(name, HeaderValue::from_str(value).map_err(Error::internal)?);
        }
        Ok(response)
    }
}

/// If-None-Match holds the tag, compared weakly (RFC 9110 section 13.1.2).
fn list_holds(headers: &HeaderMap, tag: &str) -> bool {
    tags(headers, IF_NONE_MATCH).any(|one| one == "*" || one.strip_prefix("W/").unwrap_or(one) == tag)
}

/// The tags that a header lists. (Ours have no commas in them.)
fn tags(headers: &HeaderMap, name: HeaderName) -> impl Iterator<Item = &str> {
    headers
        .get_all(name)
        .into_iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(str::trim)
}

fn accepts_gzip(headers: &HeaderMap) -> bool {
    let mut any = false;
    let values = headers.get_all(ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    for coding in values.flat_map(|value| value.split(',')) {
        let mut parts = coding.split(';').map(str::trim);
        let name = parts.next().unwrap_or("").to_ascii_lowercase();
        let refused = parts
            .filter_map(|parameter| parameter.strip_prefix("q="))
            .any(|q| q.parse::<f32>().is_ok_and(|q| q <= 0.0));
        match name.as_str() {
            "gzip" | "x-gzip" => return !refused,
            "*" => any = !refused,
            _ => {}
        }
    }
    any
}

#[derive(Debug, PartialEq, Eq)]
enum Requested {
    Part(Range<u64>),
    Outside,
    /// No range that can be read, or several: the whole is a right answer to these.
    Whole,
}

/// Reads `bytes=first-last`, `bytes=first-` or `bytes=-last`.
fn requested(range: &str, length: u64) -> Requested {
    let Some((unit, set)) = range.split_once('=') else { return Requested::Whole };
    let Some((first, last)) = set.trim().split_once('-') else { return Requested::Whole };
    if !unit.trim().eq_ignore_ascii_case("bytes") || set.contains(',') {
        return Requested::Whole;
    }
    let number = |text: &str| {
        let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        digits.then(|| text.parse::<u64>().unwrap_or(u64::MAX))
    };
    let part = match (number(first.trim()), number(last.trim())) {
        (Some(first), Some(last)) if first <= last => first..last.saturating_add(1).min(length),
        (Some(first), None) if last.trim().is_empty() => first..length,
        (None, Some(suffix)) if first.trim().is_empty() => length.saturating_sub(suffix)..length,
        _ => return Requested::Whole,
    };
    if part.start < part.end { Requested::Part(part) } else { Requested::Outside }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_the_standard_says() {
        // RFC 9110 section 14.1.2, for a representation of 10000 bytes.
        assert_eq!(requested("bytes=0-499", 10_000), Requested::Part(0..500));
        assert_eq!(requested("bytes=500-999", 10_000), Requested::Part(500..1000));
        assert_eq!(requested("bytes=-500", 10_000), Requested::Part(9500..10_000));
        assert_eq!(requested("bytes=9500-", 10_000), Requested::Part(9500..10_000));
        assert_eq!(requested("bytes=9500-99999999999999999999999", 10_000), Requested::Part(9500..10_000));
        assert_eq!(requested("bytes=-20000", 10_000), Requested::Part(0..10_000));
        assert_eq!(requested("bytes=10000-", 10_000), Requested::Outside);
        assert_eq!(requested("bytes=-0", 10_000), Requested::Outside);
        assert_eq!(requested("bytes=0-", 0), Requested::Outside);
        for whole in ["bytes=5-4", "bytes=0-1,3-4", "lines=0-1", "bytes", "bytes=-", "bytes=a-b", "bytes=--1"]
        {
            assert_eq!(requested(whole, 10_000), Requested::Whole, "{whole}");
        }
    }

    fn answer(method: &Method, pairs: &[(HeaderName, &str)]) -> Result<Response> {
        let representation = Representation {
            bytes: Bytes::from(vec![7; 5000]),
            media_type: "application/x-ply",
            file_name: None,
            compressible: true,
            vary: "Accept, Accept-Encoding",
        };
        let headers =
            pairs.iter().map(|(name, value)| (name.clone(), HeaderValue::from_str(value).unwrap())).collect();
        representation.respond(method, &headers)
    }

    #[test]
    fn each_coding_has_a_tag_of_its_own() {
        let plain = answer(&Method::GET, &[]).unwrap();
        let gzip = answer(&Method::GET, &[(ACCEPT_ENCODING, "br, gzip")]).unwrap();
        assert_eq!(gzip.headers()[CONTENT_ENCODING], "gzip");
        assert_ne!(plain.headers()[ETAG], gzip.headers()[ETAG]);
        let gzip_tag = gzip.headers()[ETAG].to_str().unwrap();
        let again = answer(&Method::GET, &[(ACCEPT_ENCODING, "gzip"), (IF_NONE_MATCH, gzip_tag)]).unwrap();
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(again.headers()[ETAG], gzip_tag);
        let other = answer(&Method::GET, &[(IF_NONE_MATCH, gzip_tag)]).unwrap();
        assert_eq!(other.status(), StatusCode::OK);
        assert!(
            answer(&Method::GET, &[(ACCEPT_ENCODING, "gzip;q=0, *")])
                .unwrap()
                .headers()
                .get(CONTENT_ENCODING)
                .is_none()
        );
    }

    #[test]
    fn a_precondition_on_another_version_fails() {
        let tag = answer(&Method::GET, &[]).unwrap().headers()[ETAG].to_str().unwrap().to_owned();
        let (weak, several) = (format!("W/{tag}"), format!("\"other\", {tag}"));
        for matches in [tag.as_str(), "*", several.as_str()] {
            let part = answer(&Method::GET, &[(IF_MATCH, matches), (RANGE, "bytes=0-9")]).unwrap();
            assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT, "{matches}");
        }
        for other in ["\"other\"", weak.as_str(), ""] {
            for pairs in [&[(IF_MATCH, other)][..], &[(IF_MATCH, other), (RANGE, "bytes=0-9")]] {
                let refused = answer(&Method::GET, pairs);
                assert!(matches!(refused, Err(Error::PreconditionFailed)), "{other}: {refused:?}");
            }
        }
        // It comes before If-None-Match.
        assert!(answer(&Method::HEAD, &[(IF_MATCH, "\"other\""), (IF_NONE_MATCH, &tag)]).is_err());
    }

    #[test]
    fn a_range_of_another_version_gives_the_whole() {
        let tag = answer(&Method::GET, &[]).unwrap().headers()[ETAG].to_str().unwrap().to_owned();
        let part = answer(&Method::GET, &[(RANGE, "bytes=0-9"), (IF_RANGE, &tag)]).unwrap();
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
        assert_eq!(part.headers()[CONTENT_RANGE], "bytes 0-9/5000");
        let whole = answer(&Method::GET, &[(RANGE, "bytes=0-9"), (IF_RANGE, "\"other\"")]).unwrap();
        assert_eq!(whole.status(), StatusCode::OK);
        let head = answer(&Method::HEAD, &[(RANGE, "bytes=0-9")]).unwrap();
        assert_eq!(
            (head.status(), &head.headers()[CONTENT_LENGTH]),
            (StatusCode::OK, &"5000".parse().unwrap())
        );
        assert!(answer(&Method::GET, &[(RANGE, "bytes=5000-")]).is_err());
    }
}
