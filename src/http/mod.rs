//! REST, STOW-RS and upload in; clouds, reports, events, health and metrics out.
//!
//! A request passes, from outside in: the connection's limits ([`server`](self)), its id, log line
//! and metrics, the headers that every answer has, the catching of panics, the check of its host and
//! origin, the check of who may do what, the check of its query parameters, and then its handler in
//! `resources/`, `upload/` or `stow/`.
//! Whatever is refused becomes a problem (RFC 9457) in one place, from the one table in
//! [`crate::error`].

mod about;
mod auth;
mod body;
mod client;
mod content;
mod context;
mod describe;
mod door;
mod extract;
mod host;
mod identity;
mod json;
mod media_type;
mod multipart;
mod observe;
mod octets;
mod problem;
mod query;
mod refused;
mod representation;
mod resources;
mod router;
mod server;
mod stored;
mod stow;
mod timed_io;
mod upload;
mod views;
mod volumes;

pub use auth::{Access, access};
pub use context::AppState;
use context::Context;
pub use describe::{openapi, openapi_json};
pub use observe::REQUEST_ID;
pub use problem::{MEDIA_TYPE as PROBLEM_MEDIA_TYPE, Problem};
pub use refused::{Refusal, SkipReason, Skipped};
pub use server::serve;
