//! What only the intake does: room for an instance, its durable place, its row.

use std::io::{self, Read, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use sha2::{Digest as _, Sha256};
use tempfile::NamedTempFile;
use uuid::Uuid;

use super::catalog::{Added, Catalog, NewInstance, OpenSender, Policy};
use super::verify::{self, is_whole};
use super::{Store, blocking};
use crate::dicom::header::InstanceHeader;
use crate::dicom::part10::{Content, sealed_file_meta};
use crate::dicom::uid::SopInstanceUid;
use crate::error::{Error, Result};

/// Bytes copied at a time.
const CHUNK: usize = 1 << 16;
/// Bytes after which the room is looked at again.
const ROOM_STEP: u64 = 1 << 20;

/// An instance in a temporary file, not durable yet.
#[derive(Debug)]
pub(crate) struct Staged {
    pub(crate) header: InstanceHeader,
    pub(crate) data_set_sha256: [u8; 32],
    file: NamedTempFile,
    size: u64,
}

impl Store {
    /// The rows behind grouping and completeness.
    pub(crate) fn catalog(&self) -> &Catalog {
        &self.0.catalog
    }

    /// Where bytes are collected that are no instance yet; emptied at start.
    pub(crate) fn incoming(&self) -> &Path {
        &self.0.incoming
    }

    /// Writes our file header and then `data_set`, untouched, to a temporary file. `image_sha256` is set
    /// where the data set took the place of another one of the same image. Blocks.
    pub(crate) fn stage(
        &self,
        header: InstanceHeader,
        image_sha256: Option<[u8; 32]>,
        mut data_set: impl Read,
    ) -> Result<Staged> {
        let mut file = self.0.blobs.temporary()?;
        let file_meta = |data_set_sha256| {
            sealed_file_meta(
                &header.sop_class_uid,
                &header.sop_instance_uid,
                &header.transfer_syntax_uid,
                &Content { data_set_sha256, image_sha256 },
            )
        };
        // Room for it: the hash is known at the end.
        let unsealed = file_meta([0; 32]);
        file.write_all(&unsealed)?;
        let mut hash = Sha256::new();
        let mut size = unsealed.len() as u64;
        let mut chunk = vec![0; CHUNK];
        let mut looked = 0;
        loop {
            let read = match data_set.read(&mut chunk) {
                Ok(0) => break,
                Ok(read) => &chunk[..read],
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error.into()),
            };
            if looked == 0 || size - looked >= ROOM_STEP {
                self.check_room(ROOM_STEP.min(read.len() as u64))?;
                looked = size;
            }
            hash.update(read);
            file.write_all(read)?;
            size += read.len() as u64;
        }
        let data_set_sha256 = hash.finalize().into();
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&file_meta(data_set_sha256))?;
        Ok(Staged { header, file, size, data_set_sha256 })
    }

    /// Makes a staged instance durable as a blob. It counts only with a row: see [`Store::enter`].
    /// Blocks.
    pub(crate) fn keep(&self, staged: Staged) -> io::Result<NewInstance> {
        let Staged { header, file, size, data_set_sha256 } = staged;
        // A name that nobody else writes: whoever loses a race removes its own file only.
        let unique = Uuid::new_v4();
        let folder = unique.as_bytes()[0];
        let blob = format!("instances/{folder:02x}/{}.{}.dcm", header.sop_instance_uid, unique.simple());
        self.0.blobs.adopt(file, &blob)?;
        Ok(NewInstance { header, blob, size, data_set_sha256, image_sha256: None })
    }

    /// The same instance in a file that also tells the hash of its image: the hash of the data set that
    /// was stored first, by which its set keeps its identity when the catalog is rebuilt. The former
    /// file is removed. Blocks.
    pub(crate) fn state_image(&self, new: &NewInstance, image_sha256: [u8; 32]) -> Result<NewInstance> {
        let mut former = self.0.blobs.open(&new.blob)?;
        verify::header_of(&mut former)?.ok_or_else(|| Error::internal("not the file that was kept"))?;
        let staged = self.stage(new.header.clone(), Some(image_sha256), former)?;
        if staged.data_set_sha256 != new.data_set_sha256 {
            return Err(Error::internal("the file that was kept has changed"));
        }
        let stated = self.keep(staged)?;
        self.0.blobs.remove(&new.blob)?;
        Ok(NewInstance { image_sha256: Some(image_sha256), ..stated })
    }

    /// Gives a durable instance its row. If that is refused its blob is removed; if there is a row
    /// with its UID, the caller compares the two and then calls [`Store::discard`].
    pub(crate) async fn enter(
        &self,
        new: &NewInstance,
        sender: &OpenSender,
        policy: &Policy,
    ) -> Result<Added> {
        let added = self.0.catalog.add_instance(new, sender, policy).await;
        if added.is_err() {
            // After a failed commit only the catalog knows whether the row is there. If it can't be
            // asked, the blob stays; without a row it is entered at the next start.
            let row = self.0.catalog.instance(&new.header.sop_instance_uid).await;
            if row.is_ok_and(|row| row.is_none_or(|row| row.blob != new.blob)) {
                self.discard(new).await?;
            }
        }
        added
    }

    /// Removes the blob of an instance that has no row.
    pub(crate) async fn discard(&self, new: &NewInstance) -> Result<()> {
        let (blobs, key) = (Arc::clone(&self.0.blobs), new.blob.clone());
        blocking(move || Ok(blobs.remove(&key)?)).await
    }

    /// The whole Part 10 file of a stored instance.
    pub(crate) async fn instance_bytes(&self, blob: &str) -> Result<Vec<u8>> {
        let (blobs, key) = (Arc::clone(&self.0.blobs), blob.to_owned());
        blocking(move || Ok(blobs.read(&key)?)).await
    }

    /// Whether the blob of a stored instance is what was received.
    pub(crate) async fn is_whole(&self, row: &super::InstanceRecord) -> Result<bool> {
        let (blobs, row) = (Arc::clone(&self.0.blobs), row.clone());
        blocking(move || match blobs.open(&row.blob).and_then(|file| is_whole(&row, file)) {
            Ok(is_whole) => Ok(is_whole),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(error.into()),
        })
        .await
    }

    /// Lets a durable blob with the same data set take the place of one that is missing or changed.
    pub(crate) async fn replace_damaged(&self, new: &NewInstance) -> Result<()> {
        let header = &new.header;
        if !self.0.catalog.replace_blob(new).await? {
            self.discard(new).await?;
            return Err(Error::Busy("the instance is being changed"));
        }
        self.0.counts.replaced.fetch_add(1, Ordering::Relaxed);
        tracing::error!(
            series = %header.series_instance_uid,
            instance = %header.sop_instance_uid,
            "the stored file was missing or damaged; the one that came again took its place. Look for a failing disk"
        );
        self.remove_noted().await
    }

    /// The stored instance of that UID.
    pub(crate) async fn instance(&self, uid: &SopInstanceUid) -> Result<Option<super::InstanceRecord>> {
        self.0.catalog.instance(uid).await
    }
}
