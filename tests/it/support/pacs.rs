//! A PACS that pushes.

use std::time::Duration;

use triplanar::dimse::scu::{self, Answer, Instance, Outcome, Peer, ScuError};

use super::service::Service;

/// The service as an AE, called by `PACS`.
pub(crate) fn peer(service: &Service) -> Peer {
    Peer {
        address: service.dimse.to_string(),
        called_ae_title: "TRIPLANAR".to_owned(),
        calling_ae_title: "PACS".to_owned(),
        timeout: Duration::from_secs(60),
    }
}

/// Sends Part 10 files over one association.
pub(crate) async fn send(service: &Service, instances: &[Vec<u8>]) -> Result<Vec<Outcome>, ScuError> {
    let instances: Vec<_> = instances.iter().cloned().map(Instance::Bytes).collect();
    scu::store(&peer(service), &instances, |_| {}).await
}

/// The status of each instance, all of which must have been answered.
pub(crate) async fn statuses(service: &Service, instances: &[Vec<u8>]) -> Vec<u16> {
    let outcomes = send(service, instances).await.expect("the association holds");
    let code = |outcome: &Outcome| match &outcome.answer {
        Answer::Status { code, .. } => *code,
        Answer::ContextNotAccepted => panic!("no context for {}", outcome.sop_instance_uid),
    };
    outcomes.iter().map(code).collect()
}

/// Sends instances that must all be taken.
pub(crate) async fn push(service: &Service, instances: &[Vec<u8>]) {
    let statuses = statuses(service, instances).await;
    assert!(statuses.iter().all(|status| *status == 0), "not all were acknowledged: {statuses:04X?}");
}
