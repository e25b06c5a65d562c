//! Which host names are answered, and whose pages may change something: a browser that visits a
//! foreign page must be no way in.
//!
//! A page of another origin can send requests here but not read the answers (no CORS header is ever
//! sent); what changes something is refused to it by `Origin` and `Sec-Fetch-Site` (Fetch standard,
//! Fetch Metadata). A page whose name was made to resolve to this address (DNS rebinding) is of our
//! origin to the browser, and is told apart by the name that it asks for: `Host`.

use axum::extract::{Request, State};
use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Version};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::Context;
use crate::config::{self, HostName};
use crate::error::{Error, Result};

/// Says where the page that sends a request stands to us (W3C Fetch Metadata).
const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// Paths that a probe of HTTP/1.0 asks for without a host.
pub(super) const PROBES: [&str; 2] = ["/healthz", "/readyz"];

/// A host and, where one is given, its port (RFC 3986 section 3.2).
#[derive(Debug, Clone, PartialEq, Eq)]
struct HostPort {
    host: HostName,
    port: Option<u16>,
}

impl HostPort {
    fn parse(text: &str) -> Option<Self> {
        // The last colon parts the port, unless it stands within the brackets of an address.
        let (host, port) = match text.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => (host, port),
            _ => (text, ""),
        };
        let digits = port.bytes().all(|byte| byte.is_ascii_digit());
        let port = match port {
            "" => None,
            port if digits => Some(port.parse().ok()?),
            _ => return None,
        };
        Some(Self { host: HostName::parse(host)?, port })
    }
}

/// The names that are answered.
#[derive(Debug, Clone)]
pub(super) struct Hosts {
    /// Any name: there are tokens, and no list.
    any: bool,
    listed: Vec<HostName>,
}

impl Hosts {
    /// Without tokens loopback and the listed ones; with tokens the listed ones, or any if none is.
    pub(super) fn new(settings: &config::Http) -> Self {
        let listed = settings.hosts.iter();
        let mut listed: Vec<_> = listed.filter_map(|it| HostName::listed(it)).collect();
        let any = !settings.tokens.is_empty() && listed.is_empty();
        // An address cannot be rebound: the one that we were told to listen on is ours.
        let own = settings.listen.ip();
        if !own.is_unspecified() {
            listed.push(HostName::Address(own.to_canonical()));
        }
        Self { any, listed }
    }

    /// Whether nothing but loopback is answered.
    pub(super) fn is_loopback_alone(&self) -> bool {
        !self.any && self.listed.iter().all(HostName::is_loopback)
    }

    fn answers(&self, name: &HostName) -> bool {
        self.any || name.is_loopback() || self.listed.contains(name)
    }
}

/// The layer that checks the host of every request, and the origin of what changes something.
pub(super) async fn check(State(context): State<Context>, request: Request, next: Next) -> Response {
    match judge(&context.hosts, &request) {
        Ok(()) => next.run(request).await,
        Err(error) => error.into_response(),
    }
}

fn judge(hosts: &Hosts, request: &Request) -> Result<()> {
    let target = target(request)?;
    match &target {
        Some(target) if !hosts.answers(&target.host) => return Err(Error::MisdirectedRequest),
        // HTTP/1.0 needs no host, and no browser leaves it out.
        None if !(hosts.any || PROBES.contains(&request.uri().path())) => {
            return Err(Error::MisdirectedRequest);
        }
        _ => {}
    }
    let changes = !matches!(*request.method(), Method::GET | Method::HEAD);
    if changes && is_foreign(request.headers(), target.as_ref()) {
        return Err(Error::ForeignOrigin);
    }
    Ok(())
}

/// Whom the request is for: the authority of a target in absolute form, otherwise the host
/// (RFC 9112 sections 3.2 and 3.2.2).
fn target(request: &Request) -> Result<Option<HostPort>> {
    let invalid = |what: &'static str| Error::InvalidHost(what);
    let mut fields = request.headers().get_all(HOST).iter();
    let host = match (fields.next(), fields.next()) {
        (Some(_), Some(_)) => return Err(invalid("more than one Host header")),
        (None, _) if request.version() >= Version::HTTP_11 => return Err(invalid("no Host header")),
        (None, _) => None,
        (Some(value), None) => Some(parse(value).ok_or(invalid("not a host and port"))?),
    };
    match request.uri().authority() {
        Some(authority) => of_authority(authority).map(Some).ok_or(invalid("not a host and port")),
        None => Ok(host),
    }
}

fn parse(value: &HeaderValue) -> Option<HostPort> {
    HostPort::parse(value.to_str().ok()?)
}

/// Name and password before the host are no part of a request for us.
fn of_authority(authority: &Authority) -> Option<HostPort> {
    HostPort::parse(authority.as_str())
}

/// Whether a page of another origin sends the request. Without either header no browser does.
fn is_foreign(headers: &HeaderMap, target: Option<&HostPort>) -> bool {
    let by_site = headers
        .get_all(SEC_FETCH_SITE)
        .iter()
        .any(|site| !matches!(site.as_bytes(), b"same-origin" | b"none"));
    let by_origin = headers.get_all(ORIGIN).iter().any(|origin| !is_same(origin, target));
    by_site || by_origin
}

/// Whether an origin (RFC 6454) is that of the request's target. A port that is not written is the
/// scheme's, on both sides: a proxy in front may speak TLS.
fn is_same(origin: &HeaderValue, target: Option<&HostPort>) -> bool {
    let of_scheme = |text: &str, scheme, port| {
        let origin = HostPort::parse(text.strip_prefix(scheme)?)?;
        Some((origin, port))
    };
    let Some((origin, default)) = origin
        .to_str()
        .ok()
        .and_then(|text| of_scheme(text, "http://", 80).or_else(|| of_scheme(text, "https://", 443)))
    else {
        return false;
    };
    target.is_some_and(|target| {
        origin.host == target.host && origin.port.unwrap_or(default) == target.port.unwrap_or(default)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn same(origin: &'static str, host: &str) -> bool {
        is_same(&HeaderValue::from_static(origin), HostPort::parse(host).as_ref())
    }

    #[test]
    fn an_origin_is_ours_if_host_and_port_are() {
        assert!(same("http://127.0.0.1:8080", "127.0.0.1:8080"));
        assert!(same("http://LOCALHOST", "localhost:80"));
        assert!(same("https://ct.example.org", "ct.example.org"));
        assert!(same("https://ct.example.org", "ct.example.org:443"));
        assert!(same("http://[::1]:8080", "[::1]:8080"));
        for (origin, host) in [
            ("http://127.0.0.1:8081", "127.0.0.1:8080"),
            ("http://localhost:8080", "127.0.0.1:8080"),
            ("http://ct.example.org", "ct.example.org:443"),
            ("null", "127.0.0.1"),
            ("file://", "127.0.0.1"),
            ("http://", "127.0.0.1"),
            ("http://127.0.0.1:8080/x", "127.0.0.1:8080"),
        ] {
            assert!(!same(origin, host), "{origin} {host}");
        }
    }

    #[test]
    fn what_is_no_host_and_port_is_not_read() {
        for text in [
            "",
            ":80",
            "a b",
            "a/b",
            "a@b",
            "a,b",
            "[::1",
            "::1",
            "[fe80::1%25lo]",
            "a:99999",
            "a:b",
            "a:1:2",
        ] {
            assert_eq!(HostPort::parse(text), None, "{text}");
        }
        let port = |text| HostPort::parse(text).unwrap().port;
        assert_eq!((port("a:"), port("[::1]:8080"), port("a.")), (None, Some(8080), None));
    }

    #[test]
    fn without_tokens_and_list_only_loopback_is_answered() {
        let hosts = Hosts::new(&crate::config::Config::defaults().http);
        let answers = |text| hosts.answers(&HostName::parse(text).unwrap());
        assert!(answers("localhost") && answers("LocalHost.") && answers("127.9.9.9") && answers("[::1]"));
        assert!(!answers("evil.example") && !answers("localhost.evil.example") && !answers("10.0.0.1"));
    }
}
