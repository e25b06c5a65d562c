//! Whom a request comes from, as far as limits go: the peer of its connection, or the one that a
//! trusted proxy names.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use axum::http::header::{FORWARDED, HeaderMap, HeaderName};

use crate::crowd::{Member, Network, Peer};

/// The chain of addresses that proxies passed a request on for.
const X_FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");

/// The client of a request, in the request's extensions.
#[derive(Debug, Clone)]
pub(super) struct Client {
    /// Whom to count it for.
    pub(super) peer: Peer,
    /// The connection that it came on.
    pub(super) connection: Arc<Member>,
}

/// The last address that a proxy was asked by and that is no trusted proxy itself; the proxy's own if
/// the headers name none.
pub(super) fn behind(proxy: IpAddr, headers: &HeaderMap, proxies: &[Network]) -> Peer {
    let values = |name| headers.get_all(name).iter().filter_map(|value| value.to_str().ok());
    let mut chain: Vec<Option<IpAddr>> =
        values(X_FORWARDED_FOR).flat_map(|value| value.split(',')).map(address).collect();
    if chain.is_empty() {
        chain = values(FORWARDED).flat_map(|value| value.split(',')).map(of_forwarded).collect();
    }
    let is_proxy = |address: IpAddr| proxies.iter().any(|range| range.contains(address));
    let mut last = proxy;
    for address in chain.into_iter().rev() {
        // What stands before something that can't be read is hearsay.
        let Some(address) = address else { break };
        last = address;
        if !is_proxy(address) {
            break;
        }
    }
    Peer::from(last)
}

/// An address with or without port, one of version 6 with or without brackets.
fn address(text: &str) -> Option<IpAddr> {
    let text = text.trim().trim_matches('"');
    let bare = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(text);
    bare.parse().ok().or_else(|| text.parse::<SocketAddr>().ok().map(|it| it.ip()))
}

/// The parameter `for` of one element of `Forwarded` (RFC 7239).
fn of_forwarded(element: &str) -> Option<IpAddr> {
    element.split(';').find_map(|pair| {
        let (name, value) = pair.split_once('=')?;
        name.trim().eq_ignore_ascii_case("for").then(|| address(value))?
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(lines: &[(&'static str, &str)]) -> Peer {
        let mut headers = HeaderMap::new();
        for (name, value) in lines {
            headers.append(*name, value.parse().unwrap());
        }
        let proxies = ["10.0.0.0/8", "fd00::/8"].map(|it| it.parse().unwrap());
        behind(IpAddr::from([10, 0, 0, 1]), &headers, &proxies)
    }

    fn peer(text: &str) -> Peer {
        Peer::from(text.parse::<IpAddr>().unwrap())
    }

    #[test]
    fn the_last_address_that_is_no_proxy_of_ours_counts() {
        let xff = "x-forwarded-for";
        assert_eq!(client(&[(xff, "192.0.2.7")]), peer("192.0.2.7"));
        // What the client wrote itself stands before.
        assert_eq!(client(&[(xff, "198.51.100.1, 192.0.2.7")]), peer("192.0.2.7"));
        assert_eq!(client(&[(xff, "192.0.2.7, 10.9.9.9")]), peer("192.0.2.7"));
        assert_eq!(client(&[(xff, "198.51.100.1"), (xff, "192.0.2.7:4711")]), peer("192.0.2.7"));
        assert_eq!(client(&[(xff, "[2001:db8::1]:443")]), peer("2001:db8::1"));
        assert_eq!(client(&[(xff, "192.0.2.7, unknown")]), peer("10.0.0.1"));
        assert_eq!(client(&[(xff, "10.2.2.2")]), peer("10.2.2.2"));
        assert_eq!(client(&[]), peer("10.0.0.1"));
        let forwarded = [("forwarded", "for=198.51.100.1, For=\"[2001:db8::1]:4711\";proto=https")];
        assert_eq!(client(&forwarded), peer("2001:db8::1"));
        assert_eq!(client(&[forwarded[0], (xff, "192.0.2.7")]), peer("192.0.2.7"));
    }
}
