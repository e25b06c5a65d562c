//! What one association came to: what was offered and refused, stored and refused, and how it ended.

use std::collections::BTreeMap;
use std::fmt;

use dicom_ul::pdu::PresentationContextProposed;
use dicom_ul::pdu::PresentationContextResultReason as Reason;

use super::negotiation::uid;

/// Characters of a UID (PS3.5 section 9.1).
const UID_LENGTH: usize = 64;

/// Lines of a list in the log; a request can offer 128 contexts with any number of syntaxes.
const MOST: usize = 8;

/// A presentation context that was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RefusedContext {
    abstract_syntax: String,
    transfer_syntaxes: Vec<String>,
    reason: &'static str,
}

impl RefusedContext {
    pub(crate) fn new(proposed: &PresentationContextProposed, reason: &Reason) -> Self {
        Self {
            abstract_syntax: short(&proposed.abstract_syntax),
            transfer_syntaxes: proposed.transfer_syntaxes.iter().take(MOST).map(|it| short(it)).collect(),
            reason: reason_name(reason),
        }
    }
}

/// A UID as it came, no longer than one may be.
fn short(text: &str) -> String {
    uid(text).chars().take(UID_LENGTH).collect()
}

/// The name of a result (PS3.8 table 9-18), for the log and the metrics.
pub(crate) fn reason_name(reason: &Reason) -> &'static str {
    match reason {
        Reason::Acceptance => "accepted",
        Reason::UserRejection => "user_rejection",
        Reason::NoReason => "no_reason",
        Reason::AbstractSyntaxNotSupported => "abstract_syntax_not_supported",
        Reason::TransferSyntaxesNotSupported => "transfer_syntaxes_not_supported",
    }
}

/// The refused contexts on one line: by abstract syntax, what it was refused for.
pub(crate) struct RefusedContexts<'a>(pub(crate) &'a [RefusedContext]);

impl fmt::Display for RefusedContexts<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Some senders offer a context for each transfer syntax.
        let mut lines = BTreeMap::<(&str, &str), Vec<&str>>::new();
        for context in self.0 {
            let syntaxes = lines.entry((context.reason, &context.abstract_syntax)).or_default();
            for syntax in &context.transfer_syntaxes {
                if !syntaxes.contains(&syntax.as_str()) {
                    syntaxes.push(syntax);
                }
            }
        }
        for (number, ((reason, abstract_syntax), syntaxes)) in lines.iter().take(MOST).enumerate() {
            let separator = if number == 0 { "" } else { "; " };
            write!(f, "{separator}{abstract_syntax} {reason}")?;
            // What matters of a class that is refused whatever its syntax is the class alone.
            if *reason != reason_name(&Reason::AbstractSyntaxNotSupported) {
                write!(f, " ({}", syntaxes.iter().take(MOST).copied().collect::<Vec<_>>().join(", "))?;
                let more = syntaxes.len().saturating_sub(MOST);
                if more > 0 { write!(f, " and {more} more)")? } else { f.write_str(")")? }
            }
        }
        let more = lines.len().saturating_sub(MOST);
        if more > 0 { write!(f, "; and {more} more") } else { Ok(()) }
    }
}

/// What was answered to the requests of an association.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// Instances that are durable now.
    pub(crate) stored: u64,
    /// Instances that were stored before with the same content.
    pub(crate) duplicate: u64,
    refused: BTreeMap<u16, u64>,
}

impl Tally {
    /// A request was answered with this status, which is no success.
    pub(crate) fn refused(&mut self, status: u16) {
        *self.refused.entry(status).or_default() += 1;
    }

    /// Requests that were refused.
    pub(crate) fn refusals(&self) -> u64 {
        self.refused.values().sum()
    }

    /// The refusals by their status, as `A700: 3, C002: 1`. The statuses are ours, so they are few.
    pub(crate) fn by_status(&self) -> String {
        let refused = self.refused.iter().map(|(status, count)| format!("{status:04X}: {count}"));
        refused.collect::<Vec<_>>().join(", ")
    }
}
