//! An instance whose UID is stored already: the same again, or another one?

use std::io::Cursor;

use super::Intake;
use crate::dicom::identity::IdentityField;
use crate::dicom::scan::{Encoding, ScanError, scan};
use crate::dicom::series::no_slice;
use crate::dicom::uid::SopInstanceUid;
use crate::dicom::{attributes_digest, content};
use crate::error::{Error, Result};
use crate::memory::NoMemory;
use crate::store::{InstanceRecord, NewInstance, blocking};

/// What a stored instance is to one with its UID that came now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Comparison {
    /// The same data set, be it in another transfer syntax.
    Same,
    /// The same pixels, geometry and identity; other attributes say something else.
    Other,
    /// The same pixels and geometry; these parts of the identity say something else.
    Identity(Vec<IdentityField>),
}

impl Intake {
    /// The same data set, or the same pixels and geometry, and then whose.
    ///
    /// # Errors
    /// It is another one, or belongs to another series or study; or there is no memory to compare them.
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
        // Both are read whole and decoded: one pair at a time, from the budget of memory.
        let _permit = self.shared.comparisons.acquire().await.map_err(Error::internal)?;
        let memory = self.shared.memory.clone();
        let held = memory.take(stored.size.saturating_add(new.size)).map_err(|none| short(none, uid))?;
        if !self.shared.store.is_whole(stored).await? {
            return Err(Error::StoredDamaged(format!(
                "SOP instance {uid} is stored, but its file is missing or damaged, and this is another data set: send \
                 the one that was sent first, or remove the series and send all of it"
            )));
        }
        let former = self.shared.store.instance_bytes(&stored.blob).await?;
        let latter = self.shared.store.instance_bytes(&new.blob).await?;
        let limits = self.shared.scan_limits;
        let is_recoded = there.transfer_syntax_uid != here.transfer_syntax_uid;
        let (uid, here) = (uid.clone(), here.clone());
        blocking(move || {
            let none = |error: &ScanError| match error {
                ScanError::NoMemory(none) => Some(short(none.beside(held.bytes()), &uid)),
                _ => None,
            };
            let contents = [&former, &latter].map(|bytes| content(bytes, &limits, &memory));
            if let Some(none) = contents.iter().find_map(|content| none(content.as_ref().err()?)) {
                return Err(none);
            }
            match contents.into() {
                (Ok(one), Ok(other)) if one.digest == other.digest => {}
                // What can't be decoded is not known to be the same.
                (Ok(one), Ok(other)) if is_recoded && !(one.is_decoded && other.is_decoded) => {
                    return Err(Error::IncomparableInstance(uid));
                }
                _ => return Err(Error::ConflictingInstance(uid)),
            }
            let header = scan(Cursor::new(&former), &Encoding::Part10, &limits)?.header;
            // Whether it is a slice decides what the cloud shows.
            if no_slice(&header) != no_slice(&here) {
                return Err(Error::ConflictingInstance(uid));
            }
            let fields = header.identity.changed(&here.identity);
            if !fields.is_empty() {
                return Ok(Comparison::Identity(fields));
            }
            let digest = |bytes| {
                let digest = attributes_digest(bytes, &limits, &memory);
                digest.map_err(|error| none(&error).unwrap_or_else(|| error.into()))
            };
            let same = digest(&former)? == digest(&latter)?;
            Ok(if same { Comparison::Same } else { Comparison::Other })
        })
        .await
    }
}

/// No memory to compare: not now, or never.
fn short(none: NoMemory, uid: &SopInstanceUid) -> Error {
    if none.never_fits() { Error::TooLargeToCompare(uid.clone(), none) } else { none.into() }
}
