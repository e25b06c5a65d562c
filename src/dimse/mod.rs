//! DICOM in: listener, association, C-ECHO, C-STORE; our own SCU.
//!
//! From the socket up:
//!
//! | file | what it knows |
//! |---|---|
//! | `server` | the listener, one task a connection, the shutdown |
//! | `connection` | PDUs over TCP, bounded in size and time |
//! | `negotiation`, `rejection` | which associations and presentation contexts we accept |
//! | `pdata`, `channel`, `command` | fragments ↔ messages |
//! | `association` | one association from its request to its end |
//! | `services/` | what a message does, one file a service |
//! | `tally` | what an association came to, for the log |
//! | `status`, `fault` | what a peer is told when something is refused, or breaks |
//! | [`scu`] | the other side, over the same connection and channel |
//!
//! dicom-ul parses and writes the PDUs that open and close an association. Its ready-made
//! association is not used: it buffers by the claimed length, takes the transfer syntax that the
//! *client* prefers, and has neither limits nor the timeouts that a service needs.

mod association;
mod channel;
mod command;
mod connection;
mod fault;
mod missing;
mod negotiation;
mod pdata;
mod rejection;
pub mod scu;
mod server;
mod services;
mod status;
mod stop;
mod tally;

pub use fault::Fault;
pub use server::serve;
