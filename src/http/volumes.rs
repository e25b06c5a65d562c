//! Volumes for slice pictures: the last few are kept, and each is read once however many requests
//! wait for it.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::OnceCell;

use crate::config::Config;
use crate::dicom::Volume;
use crate::dicom::series::{ReadLimits, read};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::pipeline::Silent;
use crate::store::{ReconstructionRecord, Store};

/// A series with a certain set of instances.
type Key = (SeriesInstanceUid, [u8; 32]);
type Slot = Arc<OnceCell<Arc<Volume>>>;

/// The volumes that are in memory or on their way there.
pub(super) struct Volumes {
    store: Store,
    limits: ReadLimits,
    /// Volumes that are kept when nobody uses them.
    kept: usize,
    /// The latest used last.
    slots: Mutex<Vec<(Key, Slot)>>,
    /// One series is read at a time: it takes memory and all processors.
    reading: tokio::sync::Mutex<()>,
}

impl Volumes {
    pub(super) fn new(store: Store, config: &Config) -> Self {
        Self {
            store,
            limits: config.read_limits(),
            kept: config.http.cached_volumes,
            slots: Mutex::default(),
            reading: tokio::sync::Mutex::new(()),
        }
    }

    /// The volume that a reconstruction was made from.
    ///
    /// # Errors
    /// [`Error::SourceRemoved`] if its instances are gone.
    pub(super) async fn of(&self, record: &ReconstructionRecord) -> Result<Arc<Volume>> {
        let key = (record.series_instance_uid.clone(), record.instances_sha256);
        let volume = self.slot(&key).get_or_try_init(|| self.read(record)).await.cloned();
        if self.kept == 0 {
            self.slots().retain(|(each, _)| *each != key);
        }
        volume
    }

    fn slot(&self, key: &Key) -> Slot {
        let mut slots = self.slots();
        let found = slots.iter().position(|(each, _)| each == key);
        let slot = found.map_or_else(Slot::default, |at| slots.remove(at).1);
        // Those in use stay findable, so that nobody reads them a second time.
        let excess = (slots.len() + 1).saturating_sub(self.kept.max(1));
        let mut dropped = 0;
        slots.retain(|(_, slot)| {
            let goes = dropped < excess && Arc::strong_count(slot) == 1;
            dropped += usize::from(goes);
            !goes
        });
        slots.push((key.clone(), Arc::clone(&slot)));
        slot
    }

    fn slots(&self) -> MutexGuard<'_, Vec<(Key, Slot)>> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn read(&self, record: &ReconstructionRecord) -> Result<Arc<Volume>> {
        let instances = self.store.instances_of(record).await?;
        let _one_at_a_time = self.reading.lock().await;
        let source = self.store.instance_source(&instances);
        let limits = self.limits;
        let volume = tokio::task::spawn_blocking(move || read(&source, &limits, &Silent)).await;
        match volume.map_err(Error::internal)? {
            Ok((volume, _warnings)) => Ok(Arc::new(volume)),
            Err(cause) => {
                // It was readable once: the instances may have been removed meanwhile.
                self.store.instances_of(record).await?;
                Err(Error::internal(cause))
            }
        }
    }
}
