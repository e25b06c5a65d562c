//! Metrics and log set-up. Neither ever carries a patient's identity: labels are codes, states,
//! route templates.

mod escape;
mod logging;
mod metrics;

pub use logging::{LoggingError, init_logging};
pub use metrics::{Metrics, SenderKind};
