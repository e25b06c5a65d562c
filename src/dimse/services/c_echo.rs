//! C-ECHO, the Verification service (PS3.7 section 9.1.5): "are you there?"

use super::Request;
use crate::dimse::association::Association;
use crate::dimse::fault::Fault;

/// Answers an echo with success.
pub(super) async fn perform(request: &Request, association: &mut Association) -> Result<(), Fault> {
    association.discard_data_set(request).await?;
    association.answer(request, Ok(())).await
}
