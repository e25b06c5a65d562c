//! Nobody locks others out: who counts as one peer, how many connections and places one and all
//! may have, which connection goes first when there are too many, and how slow one may be.
//!
//! | file | what |
//! |---|---|
//! | `peer`, `network` | addresses that count as one, and ranges of them |
//! | `member` | one connection: whether it waits or works, since when, and how fast |
//! | `flow` | how fast a peer has sent of late |
//! | `connections` | all of them; the oldest that wait make room for new ones |
//! | `places` | places that are taken and given back: associations, streams, requests |
//! | `pace` | the least rate at which bytes must move |
//! | `descriptors` | file descriptors for all of it |

mod connections;
mod descriptors;
mod flow;
mod member;
mod network;
mod pace;
mod peer;
mod places;

pub(crate) use connections::{Connections, Limits, Place, Slow, least_rate};
pub(crate) use descriptors::fit;
pub(crate) use member::{Apart, Awaiting, Busy, Member};
pub use network::Network;
pub(crate) use pace::Pace;
pub(crate) use peer::Peer;
pub(crate) use places::{LimitReached, Places, Slot};
