//! An instance that is stored and came again: as it is, or with a corrected identity or other attributes.

use std::io::Cursor;

use super::duplicate::Comparison;
use super::{Announced, Intake, Receipt};
use crate::config::ChangedIdentity;
use crate::dicom::header::InstanceHeader;
use crate::dicom::identity::IdentityField;
use crate::dicom::scan::{Encoding, scan};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::store::{InstanceRecord, NewInstance, Settled, blocking};

/// Comparisons with an instance that others replace meanwhile.
const TRIES: usize = 8;

impl Intake {
    /// The stored instance stays, or its row takes the new data set. Either way one blob is left over
    /// and removed: the new one here, the former one once nobody reads it.
    pub(super) async fn again(
        &self,
        stored: InstanceRecord,
        mut new: NewInstance,
        announced: &Announced,
    ) -> Result<Receipt> {
        let corrected = self.correct(stored, &mut new, announced).await;
        if !matches!(corrected, Ok(true)) {
            // After a failed commit only the catalog knows whether the row names the new blob.
            let row = self.shared.store.instance(&new.header.sop_instance_uid).await;
            if row.is_ok_and(|row| row.is_none_or(|row| row.blob != new.blob)) {
                self.shared.store.discard(&new).await?;
            }
        }
        Ok(Receipt { duplicate: !corrected?, header: new.header })
    }

    /// True if the new data set is the stored one now.
    async fn correct(
        &self,
        mut stored: InstanceRecord,
        new: &mut NewInstance,
        announced: &Announced,
    ) -> Result<bool> {
        let (store, policy, sender) =
            (&self.shared.store, &self.shared.policy, &self.open_sender(&announced.sender));
        let (uid, series) = (&new.header.sop_instance_uid.clone(), &new.header.series_instance_uid.clone());
        for _ in 0..TRIES {
            let compared = self.compare(&stored, new).await;
            if compared.is_err()
                && let Some(now) = store.instance(uid).await?.filter(|now| now.blob != stored.blob)
            {
                // Another sender replaced it meanwhile: what is stored now is compared.
                stored = now;
                continue;
            }
            let fields = match compared? {
                Comparison::Same => {
                    self.confirmed(&new.header, announced).await?;
                    return Ok(false);
                }
                Comparison::Identity(_) if self.shared.changed_identity == ChangedIdentity::Refuse => {
                    return Err(Error::ConflictingIdentity(uid.clone()));
                }
                Comparison::Identity(fields) => fields,
                Comparison::Other => Vec::new(),
            };
            self.read_identities(series).await?;
            self.state_image(new, &stored).await?;
            if let Some(settled) = store.catalog().correct(&stored, &fields, new, sender, policy).await? {
                if fields.is_empty() {
                    tracing::info!(%series, instance = %uid, "attributes beside the identity of an instance corrected");
                } else {
                    tracing::info!(%series, instance = %uid, fields = names(&fields), "identity of an instance corrected");
                }
                self.shared.metrics.instance_corrected();
                self.note_settled(series, &settled);
                if let Err(error) = store.remove_replaced(false).await {
                    tracing::warn!(%series, %error, "a replaced data set can't be removed; will try again");
                }
                return Ok(true);
            }
            // Another sender was faster: what is stored now is compared.
            stored = store.instance(uid).await?.ok_or(Error::Busy("the series was removed meanwhile"))?;
        }
        Err(Error::Busy("others correct the same instance"))
    }

    /// The new file tells which image it is of, unless that goes without saying.
    pub(super) async fn state_image(&self, new: &mut NewInstance, stored: &InstanceRecord) -> Result<()> {
        let image = stored.image_sha256;
        if new.image_sha256.unwrap_or(new.data_set_sha256) != image {
            let (store, former) = (self.shared.store.clone(), new.clone());
            *new = blocking(move || store.state_image(&former, image)).await?;
        }
        Ok(())
    }

    /// The instance came as it is stored.
    pub(super) async fn confirmed(&self, header: &InstanceHeader, announced: &Announced) -> Result<()> {
        let (store, policy, sender) =
            (&self.shared.store, &self.shared.policy, &self.open_sender(&announced.sender));
        let settled = store.catalog().heard_again(header, sender, policy).await?;
        self.note_settled(&header.series_instance_uid, &settled);
        Ok(())
    }

    fn note_settled(&self, series: &SeriesInstanceUid, settled: &Settled) {
        if let Some(fields) = &settled.changed {
            tracing::info!(%series, fields = names(fields), "every instance carries the corrected identity");
            // What waited for it can be claimed.
            self.shared.wake.notify_one();
        }
    }

    /// Reads the identities of instances that an earlier version stored.
    async fn read_identities(&self, series: &SeriesInstanceUid) -> Result<()> {
        let store = &self.shared.store;
        let limits = self.shared.scan_limits;
        let mut read = Vec::new();
        for (_, blob) in store.catalog().without_identity(series).await? {
            // One that was replaced meanwhile has its identity; without that of an unreadable one the
            // change is not over.
            let Ok(bytes) = store.instance_bytes(&blob).await else { continue };
            let identity =
                blocking(move || Ok(scan(Cursor::new(bytes), &Encoding::Part10, &limits)?.header.identity));
            read.push((blob, identity.await?));
        }
        if read.is_empty() { Ok(()) } else { store.catalog().enter_identities(&read).await }
    }
}

/// Kinds of attributes, never what they say.
fn names(fields: &[IdentityField]) -> String {
    let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    names.join(",")
}
