//! An instance whose UID is stored already: the same again, or another one?

use std::io::Cursor;

use super::Intake;
use crate::dicom::content_digest;
use crate::dicom::identity::IdentityField;
use crate::dicom::scan::{Encoding, scan};
use crate::error::{Error, Result};
use crate::store::{InstanceRecord, NewInstance, blocking};

/// What a stored instance is to one with its UID that came now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Comparison {
    /// The same data set; or the same pixels, geometry and identity in another one.
    Same,
    /// The same pixels and geometry; these parts of the identity say something else.
    Identity(Vec<IdentityField>),
}

impl Intake {
    /// The same data set, or the same pixels and geometry, and then whose.
    ///
    /// # Errors
    /// It is another one, or belongs to another series or study.
    pub(super) async fn compare(&self, stored: &InstanceRecord, new: &NewInstance) -> Result<Comparison> {
        let (there, here) = (&stored.header, &new.header);
        let uid = &here.sop_instance_uid;
        if there.series_instance_uid != here.series_instance_uid
            || there.study_instance_uid != here.study_instance_uid
        {
            return Err(Error::ConflictingSeries(uid.clone()));
        }
        if there.transfer_syntax_uid == here.transfer_syntax_uid
            && stored.data_set_sha256 == new.data_set_sha256
        {
            return Ok(Comparison::Same);
        }
        // Both are decoded whole: one pair at a time.
        let _permit = self.shared.comparisons.acquire().await.map_err(Error::internal)?;
        if !self.shared.store.is_whole(stored).await? {
            return Err(Error::StoredDamaged(format!(
                "SOP instance {uid} is stored, but its file is missing or damaged, and this is another data set: send \
                 the one that was sent first, or remove the series and send all of it"
            )));
        }
        let former = self.shared.store.instance_bytes(&stored.blob).await?;
        let latter = self.shared.store.instance_bytes(&new.blob).await?;
        let limits = self.shared.scan_limits;
        let identity = here.identity.clone();
        let same = blocking(move || {
            // What can't be decoded is not known to be the same.
            let digests = (content_digest(&former, &limits), content_digest(&latter, &limits));
            if !matches!(digests, (Ok(former), Ok(latter)) if former == latter) {
                return Ok(None);
            }
            let former = scan(Cursor::new(&former), &Encoding::Part10, &limits)?.header.identity;
            Ok(Some(former.changed(&identity)))
        })
        .await?;
        match same {
            None => Err(Error::ConflictingInstance(uid.clone())),
            Some(fields) if fields.is_empty() => Ok(Comparison::Same),
            Some(fields) => Ok(Comparison::Identity(fields)),
        }
    }
}
