//! Series, instances and reconstructions as they are.

use std::sync::Arc;

use super::catalog::{Chosen, set_sha256};
use super::records::{
    AttributeChange, BrokenTransfer, Clinical, ClinicalChoice, IdentityChange, InstanceRecord, Page,
    ReconstructionFilter, ReconstructionId, ReconstructionRecord, Refused, SeriesFilter, SeriesRecord,
};
use super::recovery::ChoiceRecord;
use super::source::StoredInstances;
use super::{Damage, HashedFile, Store, blocking, hashed};
use crate::dicom::series::unfit_detail;
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::geometry::Plane;

impl Store {
    /// One series.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn series(&self, uid: &SeriesInstanceUid) -> Result<Option<SeriesRecord>> {
        self.0.catalog.series(uid).await
    }

    /// Why the series is no head CT, with figures and limit; `None` if it is one.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn unfit_detail(&self, uid: &SeriesInstanceUid, min_slices: usize) -> Result<Option<String>> {
        Ok(unfit_detail(&self.0.catalog.headers(uid).await?, min_slices))
    }

    /// Series, newest first.
    ///
    /// # Errors
    /// A cursor that is none of ours.
    pub async fn list_series(
        &self,
        filter: &SeriesFilter,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<SeriesRecord>> {
        self.0.catalog.list_series(filter, cursor, limit).await
    }

    /// All stored instances of a series, by SOP Instance UID.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn instances(&self, uid: &SeriesInstanceUid) -> Result<Vec<InstanceRecord>> {
        self.0.catalog.instances(uid).await
    }

    /// Exactly the instances that a reconstruction is made from: those that came later are left
    /// out.
    ///
    /// # Errors
    /// [`Error::SourceRemoved`] if they are no longer all stored.
    pub async fn instances_of(&self, reconstruction: &ReconstructionRecord) -> Result<Vec<InstanceRecord>> {
        let (uid, revision) = (&reconstruction.series_instance_uid, reconstruction.revision);
        let instances = self.0.catalog.instances_of_revision(uid, revision).await?;
        if set_sha256(&instances) == reconstruction.instances_sha256 {
            Ok(instances)
        } else {
            Err(Error::SourceRemoved)
        }
    }

    /// The changes of a series' identity that are over, the first one first.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn identity_changes(&self, uid: &SeriesInstanceUid) -> Result<Vec<IdentityChange>> {
        self.0.catalog.identity_changes(uid).await
    }

    /// The corrections of other attributes of a series than its identity, the first one first.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn attribute_changes(&self, uid: &SeriesInstanceUid) -> Result<Vec<AttributeChange>> {
        self.0.catalog.attribute_changes(uid).await
    }

    /// Instances of a series that were refused, by SOP Instance UID.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn refused(&self, uid: &SeriesInstanceUid) -> Result<Vec<Refused>> {
        self.0.catalog.refused(uid).await
    }

    /// The senders of a series that broke off and whose break nothing has made good.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn broken_transfers(&self, uid: &SeriesInstanceUid) -> Result<Vec<BrokenTransfer>> {
        self.0.catalog.broken_transfers(uid).await
    }

    /// The bytes of `instances`, in their order.
    #[must_use]
    pub fn instance_source(&self, instances: &[InstanceRecord]) -> StoredInstances {
        StoredInstances::new(Arc::clone(&self.0.blobs), instances.to_vec())
    }

    /// One reconstruction.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn reconstruction(&self, id: ReconstructionId) -> Result<Option<ReconstructionRecord>> {
        self.0.catalog.reconstruction(id).await
    }

    /// Reconstructions, newest first.
    ///
    /// # Errors
    /// A cursor that is none of ours.
    pub async fn list_reconstructions(
        &self,
        filter: &ReconstructionFilter,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<ReconstructionRecord>> {
        self.0.catalog.list_reconstructions(filter, cursor, limit).await
    }

    /// The clinical reconstruction of the series: of the highest revision that has one with a cloud,
    /// the one that an operator chose, or else the one that the service queued itself.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn clinical(&self, uid: &SeriesInstanceUid) -> Result<Option<Clinical>> {
        self.0.catalog.clinical(uid).await
    }

    /// How many series wait for the rest of their instances with a corrected identity.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn identities_changing(&self) -> Result<u64> {
        self.0.catalog.identities_changing().await
    }

    /// The one that is, or will be, clinical at that revision of the series, whatever its state.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn clinical_at(
        &self,
        uid: &SeriesInstanceUid,
        revision: u32,
    ) -> Result<Option<ReconstructionRecord>> {
        self.0.catalog.clinical_at(uid, revision).await
    }

    /// Makes a reconstruction of the series the clinical one of its present revision; `None`: the one
    /// that the service queued itself. `by` is the operator's name for the record.
    ///
    /// # Errors
    /// No such series, no such reconstruction of it, one without a cloud.
    pub async fn choose_clinical(
        &self,
        uid: &SeriesInstanceUid,
        id: Option<ReconstructionId>,
        by: Option<&str>,
    ) -> Result<()> {
        let Chosen { tx, choice, results } = self.0.catalog.choose_clinical(uid, id, by).await?;
        let keys: Vec<String> =
            results.iter().map(|prefix| format!("{prefix}/{}", ChoiceRecord::new_name())).collect();
        let (blobs, written, record) =
            (Arc::clone(&self.0.blobs), keys.clone(), ChoiceRecord::new(choice).to_json()?);
        // Beside the results first: a catalog that is made again knows of the choice.
        let put =
            move || Ok(written.iter().try_for_each(|key| hashed::put(&*blobs, key, &record).map(drop))?);
        let chosen = match blocking(put).await {
            Ok(()) => tx.commit().await.map_err(Error::from),
            Err(error) => Err(error),
        };
        if chosen.is_err() {
            let blobs = Arc::clone(&self.0.blobs);
            let remove = move || Ok(keys.iter().try_for_each(|key| hashed::remove(&*blobs, key))?);
            let removed = blocking(remove).await;
            if let Err(error) = removed {
                tracing::warn!(%error, "the record of a choice that was not made can't be removed");
            }
        }
        chosen
    }

    /// What operators chose, oldest first.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn clinical_choices(&self, uid: &SeriesInstanceUid) -> Result<Vec<ClinicalChoice>> {
        self.0.catalog.clinical_choices(uid).await
    }

    /// Series whose latest reconstruction of the service's own was made by an earlier release with a
    /// decoder at fault, and not again since.
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn to_make_again(&self) -> Result<Vec<SeriesInstanceUid>> {
        self.0.catalog.to_make_again().await
    }

    /// Somebody asked for what the service would queue itself: it takes that place, where the
    /// revision's is free (removed, failed).
    ///
    /// # Errors
    /// The catalog's own.
    pub async fn take_for_clinical(&self, record: &ReconstructionRecord) -> Result<()> {
        self.0.catalog.take_for_clinical(record).await
    }

    /// The stored cloud (binary PLY, LPS mm) of one plane, or for `None` the triplanar one.
    ///
    /// # Errors
    /// Those of [`Store::open_cloud`].
    pub async fn cloud(&self, id: ReconstructionId, plane: Option<Plane>) -> Result<Vec<u8>> {
        let file = self.open_cloud(id, plane).await?;
        blocking(move || file.whole().map_err(|error| Error::of_result(id, error))).await
    }

    /// The same, to be read block by block.
    ///
    /// # Errors
    /// No such reconstruction; one that has no cloud (yet); [`Error::ResultDamaged`].
    pub async fn open_cloud(&self, id: ReconstructionId, plane: Option<Plane>) -> Result<HashedFile> {
        let record = self.existing(id).await?;
        if !record.state.has_cloud() {
            let detail = "only a succeeded one has a cloud; see its state, error and report".to_owned();
            return Err(Error::ReconstructionState { state: record.state.name(), detail });
        }
        self.result_file(id, &cloud_name(plane)).await
    }

    /// The stored report (JSON).
    ///
    /// # Errors
    /// No such reconstruction; one that has no report (yet); [`Error::ResultDamaged`].
    pub async fn report(&self, id: ReconstructionId) -> Result<Vec<u8>> {
        let record = self.existing(id).await?;
        if !record.has_report {
            let detail = "it has no report; see its state and error".to_owned();
            return Err(Error::ReconstructionState { state: record.state.name(), detail });
        }
        let file = self.result_file(id, REPORT).await?;
        blocking(move || file.whole().map_err(|error| Error::of_result(id, error))).await
    }

    /// What the slices' pictures of a reconstruction are drawn from
    /// ([`crate::reconstruction::pictures`]).
    ///
    /// # Errors
    /// No such reconstruction; [`Error::ResultDamaged`].
    pub async fn pictures(&self, id: ReconstructionId) -> Result<Vec<u8>> {
        let file = self.result_file(id, PICTURES).await?;
        blocking(move || file.whole().map_err(|error| Error::of_result(id, error))).await
    }

    async fn existing(&self, id: ReconstructionId) -> Result<ReconstructionRecord> {
        let record = self.reconstruction(id).await?;
        record.ok_or_else(|| Error::NotFound { what: "reconstruction", id: id.to_string() })
    }

    /// A file of a result. One that is gone although the row still names it is damage.
    async fn result_file(&self, id: ReconstructionId, name: &str) -> Result<HashedFile> {
        let removed = || Error::NotFound { what: "reconstruction", id: id.to_string() };
        let result = self.0.catalog.result_of(id).await?.ok_or_else(removed)?;
        let (blobs, of, file) = (Arc::clone(&self.0.blobs), result.clone(), name.to_owned());
        let opened = blocking(move || Ok(hashed::open(&*blobs, &of.prefix, &file, of.seal.as_ref()))).await?;
        let error = match opened {
            Ok(file) => return Ok(file),
            Err(error) => error,
        };
        // The row tells whether it was removed since it was read.
        let named = self.0.catalog.result_of(id).await?;
        Err(if named == Some(result) { Error::of_result(id, error) } else { removed() })
    }

    /// Where the result of a reconstruction lies, if one of its files is damaged.
    pub(super) async fn damaged_result(&self, record: &ReconstructionRecord) -> Result<Option<String>> {
        let Some(result) = self.0.catalog.result_of(record.id).await? else { return Ok(None) };
        let blobs = Arc::clone(&self.0.blobs);
        blocking(move || {
            for name in required_names() {
                let file = hashed::open(&*blobs, &result.prefix, &name, result.seal.as_ref());
                match file.and_then(HashedFile::check) {
                    Err(error) if Damage::of(&error).is_some() => return Ok(Some(result.prefix)),
                    checked => checked?,
                }
            }
            Ok(None)
        })
        .await
    }
}

/// Name of the file within a result that its slices' pictures are drawn from.
pub(super) const PICTURES: &str = "pictures.bin";

/// Name of the report's blob within a result.
pub(super) const REPORT: &str = "report.json";

/// Name of a cloud's blob within a result.
pub(super) fn cloud_name(plane: Option<Plane>) -> String {
    format!("{}.ply", plane.map_or("triplanar", Plane::name))
}

/// Names of the files that the result of every reconstruction with a cloud has.
fn required_names() -> impl Iterator<Item = String> {
    let planes = std::iter::once(None).chain(Plane::ALL.map(Some));
    planes.map(cloud_name).chain(std::iter::once(REPORT.to_owned()))
}
