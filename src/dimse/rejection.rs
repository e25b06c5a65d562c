//! Why an association is rejected, and its A-ASSOCIATE-RJ (PS3.8 section 9.3.4).

use dicom_ul::pdu::{
    AssociationRJ, AssociationRJResult as Result, AssociationRJServiceProviderASCEReason as AcseReason,
    AssociationRJServiceProviderPresentationReason as PresentationReason,
    AssociationRJServiceUserReason as UserReason, AssociationRJSource as Source,
};

/// Why an association is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rejection {
    /// Not version 1 of the upper layer protocol.
    ProtocolVersion,
    /// Not the DICOM application context.
    ApplicationContext,
    /// `dimse.ae_title` was not called.
    CalledAeTitle,
    /// The caller is not in `dimse.calling_ae_titles`.
    CallingAeTitle,
    /// Presentation context IDs that are even or repeated.
    ContextIds,
    /// `dimse.max_associations` or `dimse.max_associations_per_peer`.
    Limit,
}

impl Rejection {
    /// Stable name, for the log and the metrics.
    pub(crate) fn code(self) -> &'static str {
        match self {
            Self::ProtocolVersion => "protocol_version",
            Self::ApplicationContext => "application_context",
            Self::CalledAeTitle => "unknown_called_ae_title",
            Self::CallingAeTitle => "unknown_calling_ae_title",
            Self::ContextIds => "presentation_context_ids",
            Self::Limit => "local_limit_exceeded",
        }
    }

    /// What the peer is told. Only the limit is transient: the same request may pass later.
    pub(crate) fn pdu(self) -> AssociationRJ {
        let (result, source) = match self {
            Self::ProtocolVersion => {
                (Result::Permanent, Source::ServiceProviderASCE(AcseReason::ProtocolVersionNotSupported))
            }
            Self::ApplicationContext => {
                (Result::Permanent, Source::ServiceUser(UserReason::ApplicationContextNameNotSupported))
            }
            Self::CalledAeTitle => {
                (Result::Permanent, Source::ServiceUser(UserReason::CalledAETitleNotRecognized))
            }
            Self::CallingAeTitle => {
                (Result::Permanent, Source::ServiceUser(UserReason::CallingAETitleNotRecognized))
            }
            Self::ContextIds => (Result::Permanent, Source::ServiceProviderASCE(AcseReason::NoReasonGiven)),
            Self::Limit => (
                Result::Transient,
                Source::ServiceProviderPresentation(PresentationReason::LocalLimitExceeded),
            ),
        };
        AssociationRJ { result, source }
    }
}
