//! From spooled bytes to a durable instance, or to a reason why not.

use std::io::{Seek as _, SeekFrom};

use super::examination::{accept_class, accept_pixels, examine};
use super::spool::Reader;
use super::{Announced, Intake, Receipt, Spool};
use crate::dicom::scan::{self, Scan};
use crate::dicom::uid::{SeriesInstanceUid, SopInstanceUid, StudyInstanceUid};
use crate::error::{Error, Result};
use crate::store::{Added, InstanceRecord, Staged, blocking};

impl Intake {
    /// The whole way of one instance.
    pub(super) async fn receive(&self, spool: Spool, announced: Announced) -> Result<Receipt> {
        let mut reader = spool.finish().await?;
        let limits = self.shared.scan_limits;
        let (examined, reader, announced) = blocking(move || {
            let examined = examine(&mut *reader, &announced, &limits).map_err(|error| {
                let identity = scan::identify(&mut *reader, &announced.encoding, &limits);
                (error, identity)
            });
            Ok((examined, reader, announced))
        })
        .await?;
        let sender = announced.sender.id();
        let scan = match examined {
            Ok(scan) => scan,
            Err((error, Some((series, instance)))) => {
                self.record_refusal(&series, &instance, &error, None).await;
                return Err(error);
            }
            Err((error, None)) => {
                if is_damage(&error) {
                    self.lacks(sender, announced.sop_instance_uid);
                }
                return Err(error);
            }
        };
        let header = scan.header.clone();
        let kept = self.keep(scan, reader, &announced).await;
        match &kept {
            Ok(_) => self.shared.senders.brought(sender, &header.sop_instance_uid),
            Err(error) => {
                let study = Some(&header.study_instance_uid);
                let (series, instance) = (&header.series_instance_uid, &header.sop_instance_uid);
                self.record_refusal(series, instance, error, study).await;
            }
        }
        kept
    }

    async fn keep(&self, scan: Scan, reader: Box<dyn Reader>, announced: &Announced) -> Result<Receipt> {
        accept_class(&scan)?;
        accept_pixels(&scan)?;
        let staged = self.stage(scan, reader).await?;
        let header = staged.header.clone();
        let (store, policy, sender) =
            (&self.shared.store, &self.shared.policy, &self.open_sender(&announced.sender));

        let known = store.instance(&header.sop_instance_uid).await?;
        if let Some(stored) = known.filter(|stored| is_same_data_set(stored, &staged)) {
            // What is stored is durable, and nothing needs to be written, if it is what was received.
            if !store.is_whole(&stored).await? {
                let keeper = store.clone();
                let mut new = blocking(move || Ok(keeper.keep(staged)?)).await?;
                self.state_image(&mut new, &stored).await?;
                store.replace_damaged(&new).await?;
            }
            self.confirmed(&header, announced).await?;
            return Ok(Receipt { header, duplicate: true });
        }

        let keeper = store.clone();
        let new = blocking(move || Ok(keeper.keep(staged)?)).await?;
        match store.enter(&new, sender, policy).await? {
            Added::New(completion) => {
                self.shared.metrics.bytes_stored(new.size);
                if let Some(completion) = completion {
                    self.note_completion(&header.series_instance_uid, &completion);
                }
                self.shared.timers.notify_one();
                Ok(Receipt { header, duplicate: false })
            }
            Added::Exists(stored) => self.again(*stored, new, announced).await,
        }
    }

    /// Our file header and the data set as it came, in one file.
    async fn stage(&self, scan: Scan, mut reader: Box<dyn Reader>) -> Result<Staged> {
        let store = self.shared.store.clone();
        blocking(move || {
            let Scan { header, data_set_offset, .. } = scan;
            reader.seek(SeekFrom::Start(data_set_offset))?;
            store.stage(header, None, reader)
        })
        .await
    }

    /// A refusal of an instance that could be told stands in its series' reports. Passing faults
    /// of ours don't: the sender will try again.
    async fn record_refusal(
        &self,
        series: &SeriesInstanceUid,
        instance: &SopInstanceUid,
        error: &Error,
        study: Option<&StudyInstanceUid>,
    ) {
        if error.is_shortage() || matches!(error, Error::Internal(_) | Error::ShuttingDown) {
            return;
        }
        let code = error.mapping().code;
        if let Err(error) = self.shared.store.catalog().add_refused(series, instance, code, study).await {
            tracing::error!(%series, %instance, code, cause = ?error, "a refusal can't be recorded");
        }
    }
}

/// Whether what was sent may be a slice that lacks now: not what is of another kind, and not what the
/// sender will send again.
fn is_damage(error: &Error) -> bool {
    let is_of_another_kind =
        matches!(error, Error::UnsupportedSopClass(_) | Error::UnsupportedTransferSyntax(_));
    !is_of_another_kind && !error.is_shortage() && !matches!(error, Error::Internal(_) | Error::ShuttingDown)
}

/// The same bytes in the same transfer syntax, and so the same header.
fn is_same_data_set(stored: &InstanceRecord, staged: &Staged) -> bool {
    stored.data_set_sha256 == staged.data_set_sha256
        && stored.header.transfer_syntax_uid == staged.header.transfer_syntax_uid
}
