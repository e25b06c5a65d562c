//! Names and addresses of hosts.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// A name or address, comparable: lower case, no dot at the end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum HostName {
    /// An address.
    Address(IpAddr),
    /// A registered name.
    Name(String),
}

impl HostName {
    /// A registered name of letters, digits, hyphens, underscores and dots, or an address; one of
    /// version 6 in brackets.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        if let Some(inner) = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            return inner.parse::<Ipv6Addr>().ok().map(|it| Self::Address(IpAddr::V6(it).to_canonical()));
        }
        if let Ok(address) = text.parse::<Ipv4Addr>() {
            return Some(Self::Address(address.into()));
        }
        let name = text.strip_suffix('.').unwrap_or(text);
        let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        (!name.is_empty() && name.len() <= 253 && name.chars().all(allowed))
            .then(|| Self::Name(name.to_ascii_lowercase()))
    }

    /// One that stands in `http.hosts`: without scheme and port, an address of version 6 with brackets or
    /// without.
    pub(crate) fn listed(text: &str) -> Option<Self> {
        Self::parse(text).or_else(|| Self::parse(&format!("[{text}]")))
    }

    /// `localhost`, 127.0.0.0/8, `::1`.
    pub(crate) fn is_loopback(&self) -> bool {
        match self {
            Self::Address(address) => address.is_loopback(),
            Self::Name(name) => name == "localhost",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listed_host_has_no_port() {
        let is_host = |text| HostName::listed(text).is_some();
        assert!(is_host("::1") && is_host("[::1]") && is_host("ct.example.org") && !is_host("a:80"));
    }
}
