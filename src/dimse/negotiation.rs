//! What we answer to an association request (PS3.8 section 7.1.1, PS3.7 annex D). No network.

use std::collections::BTreeMap;

use dicom_ul::pdu::{
    AssociationAC, AssociationRQ, PresentationContextProposed, PresentationContextResult,
    PresentationContextResultReason, RequestorRoles, UserVariableItem,
};

use super::rejection::Rejection;
use super::services::Service;
use super::tally::RefusedContext;
use crate::config;
use crate::dicom::ae_title::AeTitle;
use crate::dicom::part10;
use crate::dicom::transfer_syntax::{self, TransferSyntax};

/// The DICOM application context name (PS3.7 section A.2.1).
pub(crate) const APPLICATION_CONTEXT: &str = "1.2.840.10008.3.1.1.1";

/// Version 1 of the upper layer protocol: bit 0.
pub(crate) const PROTOCOL_VERSION: u16 = 1;

/// An accepted presentation context.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Context {
    /// Presentation context ID.
    pub(crate) id: u8,
    /// What it is for.
    pub(crate) service: Service,
    /// Its abstract syntax.
    pub(crate) abstract_syntax: String,
    /// The transfer syntax of its data sets.
    pub(crate) transfer_syntax: &'static TransferSyntax,
}

/// An association that we accept.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Accepted {
    /// The accepted contexts by their ID.
    pub(crate) contexts: BTreeMap<u8, Context>,
    /// The other contexts that were offered.
    pub(crate) refused: Vec<RefusedContext>,
    /// Who calls.
    pub(crate) calling_ae_title: String,
    /// The largest P-DATA-TF body that the peer takes; 0: any.
    pub(crate) peer_max_pdu_length: u32,
    /// What the peer is told.
    pub(crate) answer: AssociationAC,
}

/// Accepts or rejects the request by what it says.
pub(crate) fn negotiate(request: AssociationRQ, config: &config::Dimse) -> Result<Accepted, Rejection> {
    if request.protocol_version & PROTOCOL_VERSION == 0 {
        return Err(Rejection::ProtocolVersion);
    }
    if uid(&request.application_context_name) != APPLICATION_CONTEXT {
        return Err(Rejection::ApplicationContext);
    }
    let called = AeTitle::parse(&request.called_ae_title).ok_or(Rejection::CalledAeTitle)?;
    if config.check_called_ae_title && AeTitle::parse(&config.ae_title).as_ref() != Some(&called) {
        return Err(Rejection::CalledAeTitle);
    }
    let calling = AeTitle::parse(&request.calling_ae_title).ok_or(Rejection::CallingAeTitle)?;
    let known = config.calling_ae_titles.iter().any(|title| AeTitle::parse(title).as_ref() == Some(&calling));
    if !(known || config.calling_ae_titles.is_empty()) {
        return Err(Rejection::CallingAeTitle);
    }
    let calling_ae_title = calling.to_string();

    let mut contexts = BTreeMap::new();
    let mut results = BTreeMap::new();
    let mut refused = Vec::new();
    for proposed in &request.presentation_contexts {
        let (context, result) = answer_context(proposed);
        if context.is_none() {
            refused.push(RefusedContext::new(proposed, &result.reason));
        }
        let repeated = results.insert(proposed.id, result).is_some();
        // Odd and unique, or an answer would not say which context it is for (PS3.8 9.3.2.2).
        if proposed.id % 2 == 0 || repeated {
            return Err(Rejection::ContextIds);
        }
        contexts.extend(context.map(|context| (context.id, context)));
    }

    let peer_max_pdu_length = request
        .user_variables
        .iter()
        .find_map(|item| if let UserVariableItem::MaxLength(length) = item { Some(*length) } else { None })
        .unwrap_or(0);
    let mut user_variables = own_user_variables(config.max_pdu_length);
    user_variables.extend(request.user_variables.iter().filter_map(|item| answer_roles(item, &contexts)));
    let answer = AssociationAC {
        protocol_version: PROTOCOL_VERSION,
        calling_ae_title: request.calling_ae_title,
        called_ae_title: request.called_ae_title,
        application_context_name: APPLICATION_CONTEXT.to_owned(),
        presentation_contexts: results.into_values().collect(),
        user_variables,
    };
    Ok(Accepted { contexts, refused, calling_ae_title, peer_max_pdu_length, answer })
}

/// What we say of ourselves, as acceptor and as requestor.
pub(crate) fn own_user_variables(max_pdu_length: u32) -> Vec<UserVariableItem> {
    vec![
        UserVariableItem::MaxLength(max_pdu_length),
        UserVariableItem::ImplementationClassUID(part10::IMPLEMENTATION_CLASS_UID.to_owned()),
        UserVariableItem::ImplementationVersionName(part10::IMPLEMENTATION_VERSION_NAME.to_owned()),
    ]
}

/// A UID without the padding that some peers send.
pub(crate) fn uid(text: &str) -> &str {
    text.trim_matches(['\0', ' '])
}

/// Of the proposed transfer syntaxes we take the one that stands first in *our* list.
fn answer_context(proposed: &PresentationContextProposed) -> (Option<Context>, PresentationContextResult) {
    let first_proposed = proposed.transfer_syntaxes.first().map_or("", |syntax| uid(syntax));
    let refused = |reason| {
        // The transfer syntax of a refused context is not significant (PS3.8 section 9.3.3.2).
        let result =
            PresentationContextResult { id: proposed.id, reason, transfer_syntax: first_proposed.to_owned() };
        (None, result)
    };
    let abstract_syntax = uid(&proposed.abstract_syntax);
    let Some(service) = Service::of_abstract_syntax(abstract_syntax) else {
        return refused(PresentationContextResultReason::AbstractSyntaxNotSupported);
    };
    let preferred = transfer_syntax::SUPPORTED
        .iter()
        .find(|supported| proposed.transfer_syntaxes.iter().any(|syntax| uid(syntax) == supported.uid));
    let Some(preferred) = preferred else {
        return refused(PresentationContextResultReason::TransferSyntaxesNotSupported);
    };
    let context = Context {
        id: proposed.id,
        service,
        abstract_syntax: abstract_syntax.to_owned(),
        transfer_syntax: preferred,
    };
    let result = PresentationContextResult {
        id: proposed.id,
        reason: PresentationContextResultReason::Acceptance,
        transfer_syntax: preferred.uid.to_owned(),
    };
    (Some(context), result)
}

/// The requestor may be SCU of what we accepted, never SCP (PS3.7 section D.3.3.4). What else is
/// negotiated (asynchronous operations, user identity, extended negotiation) is left unanswered,
/// which declines it.
fn answer_roles(item: &UserVariableItem, contexts: &BTreeMap<u8, Context>) -> Option<UserVariableItem> {
    let UserVariableItem::ScuScpRoleSelectionSubItem(sop_class, proposed) = item else { return None };
    let accepted = contexts.values().any(|context| context.abstract_syntax == uid(sop_class));
    let roles = RequestorRoles { scu: proposed.scu, scp: false };
    accepted.then(|| UserVariableItem::ScuScpRoleSelectionSubItem(uid(sop_class).to_owned(), roles))
}
