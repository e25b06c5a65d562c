//! Volumes for slice pictures: the last few are kept, each is read once however many requests wait
//! for it, and no more than those few are in memory or on their way there. Beside a volume lies the
//! patient's border in it, once a picture of the profile `precise` has asked for it.

use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::{Notify, OnceCell};

use crate::config::Config;
use crate::dicom::Volume;
use crate::dicom::series::{OUT_OF_MEMORY, ReadLimits, read_admitted};
use crate::dicom::uid::SeriesInstanceUid;
use crate::error::{Error, Result};
use crate::memory::{Memory, Share};
use crate::observer::Silent;
use crate::pipeline::precise::BorderPoint;
use crate::pipeline::{Profile, border};
use crate::store::{ReconstructionRecord, Store};

/// A series with a certain set of instances.
type Key = (SeriesInstanceUid, [u8; 32]);
type Slot = Arc<Held>;

/// What is kept of a series.
#[derive(Default)]
struct Held {
    volume: OnceCell<Kept>,
    /// It depends on the volume alone, not on a reconstruction's parameters.
    border: OnceCell<Arc<Vec<BorderPoint>>>,
}

/// A volume with its share of the memory budget.
struct Kept {
    volume: Arc<Volume>,
    _share: Share,
}

/// Bytes of a voxel.
const BYTES_A_VOXEL: u64 = 2;

/// The volumes that are in memory or on their way there.
pub(super) struct Volumes {
    store: Store,
    limits: ReadLimits,
    /// So long a request waits for a place.
    patience: Duration,
    places: Arc<Places>,
    /// One series is read, or its border found, at a time: it takes memory and all processors.
    reading: Arc<tokio::sync::Mutex<()>>,
    /// The pipeline's threads.
    threads: Arc<rayon::ThreadPool>,
}

/// A volume that stays in memory as long as this lives.
pub(super) struct InUse {
    // Fields are dropped in this order: the place is free when the volume is gone.
    volume: Arc<Volume>,
    place: Place,
}

impl Deref for InUse {
    type Target = Volume;

    fn deref(&self) -> &Volume {
        &self.volume
    }
}

impl Volumes {
    pub(super) fn new(
        store: Store,
        config: &Config,
        memory: Memory,
        threads: Arc<rayon::ThreadPool>,
    ) -> Self {
        Self {
            store,
            limits: ReadLimits { memory, ..config.read_limits() },
            patience: config.http.idle_timeout,
            places: Arc::new(Places::new(config.http.cached_volumes)),
            reading: Arc::default(),
            threads,
        }
    }

    /// The volume that a reconstruction was made from.
    ///
    /// # Errors
    /// [`Error::SourceRemoved`] if its instances are gone, [`Error::Busy`] if others are in use for
    /// too long.
    pub(super) async fn of(&self, record: &ReconstructionRecord) -> Result<InUse> {
        let key = (record.series_instance_uid.clone(), record.instances_sha256);
        let place = tokio::time::timeout(self.patience, self.places.wait_for(&key))
            .await
            .map_err(|_| Error::Busy("pictures of http.cached_volumes other series are being made"))?;
        let kept = place.slot.volume.get_or_try_init(|| self.read(record, &place)).await?;
        Ok(InUse { volume: Arc::clone(&kept.volume), place: place.clone() })
    }

    /// The patient's border in a volume, as the profile `precise` finds it.
    ///
    /// # Errors
    /// [`Error::Busy`] without memory, [`Error::Internal`].
    pub(super) async fn border(&self, of: &InUse) -> Result<Arc<Vec<BorderPoint>>> {
        let border = of.place.slot.border.get_or_try_init(|| async {
            let turn = Arc::clone(&self.reading).lock_owned().await;
            let (volume, place) = (Arc::clone(&of.volume), of.place.clone());
            let beside = Profile::Precise.bytes_a_voxel() - BYTES_A_VOXEL;
            let share = self.limits.memory.take(volume.hu.len() as u64 * beside)?;
            let threads = Arc::clone(&self.threads);
            let finding = tokio::task::spawn_blocking(move || {
                (threads.install(|| border(&volume)), place, turn, share)
            });
            let (border, _place, _turn, _share) = finding.await.map_err(Error::internal)?;
            Ok::<_, Error>(Arc::new(border))
        });
        border.await.map(Arc::clone)
    }

    async fn read(&self, record: &ReconstructionRecord, place: &Place) -> Result<Kept> {
        let instances = self.store.instances_of(record).await?;
        let turn = Arc::clone(&self.reading).lock_owned().await;
        let source = self.store.instance_source(&instances);
        let stored = source.clone();
        let (limits, place) = (self.limits.clone(), place.clone());
        // A client that goes away stops no thread: until it has ended, place and turn are taken.
        let threads = Arc::clone(&self.threads);
        let reading = tokio::task::spawn_blocking(move || {
            let mut share = limits.memory.share();
            let mut admit = |voxels: u64| share.grow(voxels * BYTES_A_VOXEL).map(|()| share.bytes());
            let read = threads.install(|| read_admitted(&source, &limits, &Silent, &mut admit));
            (read.map(|(volume, _warnings)| Kept { volume: Arc::new(volume), _share: share }), place, turn)
        });
        let (volume, _place, _turn) = reading.await.map_err(Error::internal)?;
        match volume {
            Ok(volume) => Ok(volume),
            Err(cause) if cause.code() == OUT_OF_MEMORY => {
                Err(Error::Busy("the memory budget is in use (memory.budget_bytes)"))
            }
            Err(cause) => {
                // It was readable once: the instances may have been removed meanwhile.
                self.store.instances_of(record).await?;
                Err(match (stored.damage(), stored.shortage()) {
                    (Some(damage), _) => Error::StoredDamaged(damage.to_string()),
                    (None, Some(shortage)) => shortage,
                    (None, None) => Error::internal(cause),
                })
            }
        }
    }
}

/// Places for volumes, the latest used last.
struct Places {
    /// Volumes that are kept when nobody uses them.
    kept: usize,
    slots: Mutex<Vec<(Key, Slot)>>,
    /// Told that a place may be free.
    released: Notify,
}

/// A place that is held.
#[derive(Clone)]
struct Place {
    // Fields are dropped in this order: whoever is told finds the slot unused.
    slot: Slot,
    _release: Release,
}

#[derive(Clone)]
struct Release(Arc<Places>);

impl Drop for Release {
    fn drop(&mut self) {
        let kept = self.0.kept > 0;
        // What nobody uses stays only if it holds a volume that is to be kept.
        self.0.slots().retain(|(_, slot)| Arc::strong_count(slot) > 1 || (kept && slot.volume.initialized()));
        self.0.released.notify_waiters();
    }
}

impl Places {
    fn new(kept: usize) -> Self {
        Self { kept, slots: Mutex::default(), released: Notify::new() }
    }

    async fn wait_for(self: &Arc<Self>, key: &Key) -> Place {
        loop {
            // Listens before it looks, so that no release is missed in between.
            let mut released = std::pin::pin!(self.released.notified());
            released.as_mut().enable();
            if let Some(place) = self.take(key) {
                return place;
            }
            released.await;
        }
    }

    /// The key's place, a free one, or that of the volume that nobody has used for longest.
    fn take(self: &Arc<Self>, key: &Key) -> Option<Place> {
        let mut slots = self.slots();
        let slot = if let Some(at) = slots.iter().position(|(each, _)| each == key) {
            slots.remove(at).1
        } else {
            if slots.len() >= self.kept.max(1) {
                // Slots are shared under the lock alone: what is unused here stays so.
                let unused = slots.iter().position(|(_, slot)| Arc::strong_count(slot) == 1)?;
                slots.remove(unused);
            }
            Slot::default()
        };
        slots.push((key.clone(), Arc::clone(&slot)));
        Some(Place { slot, _release: Release(Arc::clone(self)) })
    }

    fn slots(&self) -> MutexGuard<'_, Vec<(Key, Slot)>> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(series: u8) -> Key {
        ("1.2.3".parse().unwrap(), [series; 32])
    }

    #[tokio::test]
    async fn there_are_no_more_places_than_volumes_may_be_in_memory() {
        for (kept, bound) in [(0, 1), (1, 1), (3, 3)] {
            let places = Arc::new(Places::new(kept));
            let mut held: Vec<_> = (0..bound).map(|i| places.take(&key(i)).expect("a free place")).collect();
            assert!(places.take(&key(9)).is_none(), "{kept} kept");
            assert!(places.take(&key(0)).is_some(), "a series that has its place shares it");
            let waiting = tokio::spawn({
                let places = Arc::clone(&places);
                async move { places.wait_for(&key(9)).await }
            });
            tokio::task::yield_now().await;
            held.pop();
            let ninth = waiting.await.unwrap();
            assert_eq!(places.slots().len(), usize::from(bound));
            drop((ninth, held));
            assert!(places.slots().is_empty(), "what was never read takes no place");
        }
    }
}
