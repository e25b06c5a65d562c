//! C-STORE, the Storage service (PS3.7 section 9.1.1, PS3.4 annex B).
//!
//! The data set goes to the spool as it arrives; it is never in memory as a whole. The answer is
//! sent when the intake has made the instance durable, or has said why not. A data set that is
//! refused is received to its end all the same, or the association would be out of step.

use super::Request;
use crate::dicom::sop_class;
use crate::dicom::uid::{SopClassUid, SopInstanceUid};
use crate::dimse::association::Association;
use crate::dimse::command::element;
use crate::dimse::fault::Fault;
use crate::dimse::status::{
    DATA_SET_MISMATCH, INVALID_SOP_INSTANCE, MISTYPED_ARGUMENT, Refusal, SOP_CLASS_NOT_SUPPORTED,
};
use crate::error::Error;
use crate::intake::{Announced, Encoding, Sender, Spool};
use crate::telemetry::SenderKind;

/// Receives, stores, answers.
pub(super) async fn perform(request: &Request, association: &mut Association) -> Result<(), Fault> {
    let announced = match announced(request, association.sender()) {
        Ok(announced) => announced,
        Err(refusal) => {
            association.discard_data_set(request).await?;
            return refuse(request, &refusal, association).await;
        }
    };
    let spool = match receive(request, association).await? {
        Ok(spool) => spool,
        Err(error) => {
            if let Error::Internal(cause) = &error {
                tracing::error!(association = %association.id(), %cause, "an instance could not be spooled");
            }
            return refuse(request, &Refusal::from(&error), association).await;
        }
    };
    // The intake counts and logs what it decides.
    match association.intake().store(spool, announced).await {
        Ok(receipt) => {
            association.count_taken(&receipt);
            association.answer(request, Ok(())).await
        }
        Err(error) => association.answer(request, Err(&Refusal::from(&error))).await,
    }
}

/// Answers a request that did not get as far as the intake.
async fn refuse(request: &Request, refusal: &Refusal, association: &mut Association) -> Result<(), Fault> {
    association.metrics().instance_received(SenderKind::Association, refusal.code);
    tracing::warn!(
        association = %association.id(),
        sop_instance_uid = request.command.text(element::AFFECTED_SOP_INSTANCE_UID),
        code = refusal.code,
        status = format_args!("{:04X}", refusal.status),
        comment = refusal.comment,
        "instance refused"
    );
    association.answer(request, Err(refusal)).await
}

/// What the command says of the instance, if it can be believed.
fn announced(request: &Request, sender: Sender) -> Result<Announced, Refusal> {
    let refused = |status, code, comment| Err(Refusal::new(status, code, comment));
    if !request.has_data_set {
        return refused(MISTYPED_ARGUMENT, "no-data-set", "C-STORE-RQ without a data set");
    }
    let sop_instance_uid = request.command.text(element::AFFECTED_SOP_INSTANCE_UID);
    let Some(Ok(sop_instance_uid)) = sop_instance_uid.map(str::parse::<SopInstanceUid>) else {
        let comment = "Affected SOP Instance UID (0000,1000) is no UID";
        return refused(INVALID_SOP_INSTANCE, "invalid-sop-instance", comment);
    };
    let sop_class_uid = request.command.text(element::AFFECTED_SOP_CLASS_UID);
    let Some(Ok(sop_class_uid)) = sop_class_uid.map(str::parse::<SopClassUid>) else {
        let comment = "Affected SOP Class UID (0000,0002) is no UID";
        return refused(MISTYPED_ARGUMENT, "invalid-sop-class", comment);
    };
    if !sop_class::is_accepted(&sop_class_uid) {
        let comment = "unsupported-sop-class: only CT images are accepted";
        return refused(SOP_CLASS_NOT_SUPPORTED, "unsupported-sop-class", comment);
    }
    if sop_class_uid.as_str() != request.context.abstract_syntax {
        let comment = "data-set-mismatch: SOP class is not this context's";
        return refused(DATA_SET_MISMATCH, "data-set-mismatch", comment);
    }
    Ok(Announced {
        encoding: Encoding::DataSet(request.context.transfer_syntax.uid()),
        sop_class_uid: Some(sop_class_uid),
        sop_instance_uid: Some(sop_instance_uid),
        study_instance_uid: None,
        sender,
    })
}

/// Spools the data set to its end. The outer error ends the association; the spool is dropped
/// then, and with it its file.
async fn receive(request: &Request, association: &mut Association) -> Result<Result<Spool, Error>, Fault> {
    let mut spool = association.intake().begin().await;
    let beginning = spool.as_ref().ok().map(Spool::beginning);
    loop {
        let data = association.data(request).await;
        if data.is_err() {
            let instance = request.command.text(element::AFFECTED_SOP_INSTANCE_UID);
            let encoding = Encoding::DataSet(request.context.transfer_syntax.uid());
            let begun = beginning.as_ref().map(|beginning| (beginning, &encoding));
            association.intake().cut(&association.sender(), instance, begun);
        }
        let (data, last) = data?;
        match &mut spool {
            Ok(file) => {
                if let Err(error) = file.write(&data).await {
                    spool = Err(error);
                }
            }
            Err(_) => association.count_discarded(data.len())?,
        }
        if last {
            return Ok(spool);
        }
    }
}
