//! Places of uploads: so many in all and so many for one address, each with its share of the memory
//! budget; and where all are taken, an upload that is slow loses its place to one that comes.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use super::session::AT_A_TIME;
use crate::config;
use crate::crowd::{Peer, least_rate};
use crate::error::{Error, Result};
use crate::memory::{Memory, Share};

/// An upload is measured for so long before it can lose its place.
const MEASURED: Duration = Duration::from_secs(2);

/// An instance on its way to the disk: up to 1 MiB is collected before any of it is written, and with what
/// came last, in a buffer that grows by doubling, that is up to twice as much and a half.
const INSTANCE_BYTES: u64 = 5 << 19;

/// What else an upload holds: pieces of an archive that wait to be stored, one of the body, the
/// decompressor's window.
const BESIDE_BYTES: u64 = 3 << 19;

/// What one upload holds at most while it is received, whatever its size, beside what it remembers.
const UPLOAD_BYTES: u64 = (AT_A_TIME as u64 + 1) * INSTANCE_BYTES + BESIDE_BYTES;

/// What is remembered of a file until the answer is written: its name (up to 255 characters), its
/// header or the reason why it was refused, and its line in the answer.
const FILE_BYTES: u64 = 2048;

/// Memory is taken for so many files at a time.
const FILES: u64 = 512;

/// The uploads that are being received.
#[derive(Debug)]
pub(in crate::http) struct Uploads {
    max: usize,
    max_per_address: usize,
    crowded_bytes_per_second: u64,
    memory: Memory,
    next: AtomicU64,
    open: Mutex<HashMap<u64, Arc<Upload>>>,
}

/// One upload, as its body reports it.
#[derive(Debug)]
pub(in crate::http) struct Upload {
    peer: Peer,
    begun: Instant,
    received: AtomicU64,
    whole: AtomicBool,
    displaced: CancellationToken,
    held: Mutex<Held>,
}

/// What an upload holds of the memory budget.
#[derive(Debug)]
struct Held {
    share: Share,
    /// Files that are remembered.
    files: u64,
}

/// An upload's place; free again when dropped.
#[derive(Debug)]
pub(in crate::http) struct UploadPlace {
    uploads: Arc<Uploads>,
    id: u64,
    upload: Arc<Upload>,
}

impl Uploads {
    pub(in crate::http) fn new(settings: &config::Http, memory: Memory) -> Arc<Self> {
        Arc::new(Self {
            max: settings.max_uploads,
            max_per_address: settings.max_uploads_per_address,
            crowded_bytes_per_second: settings.crowded_bytes_per_second,
            memory,
            next: AtomicU64::new(0),
            open: Mutex::default(),
        })
    }

    /// A place for an upload of `peer`.
    ///
    /// # Errors
    /// [`Error::Busy`] if all are taken by uploads that are fast enough for a crowd, or the memory budget is
    /// in use.
    pub(in crate::http) fn take(self: &Arc<Self>, peer: Peer) -> Result<UploadPlace> {
        let held = Mutex::new(Held { share: self.memory.take(UPLOAD_BYTES)?, files: 0 });
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if open.values().filter(|it| it.peer == peer).count() >= self.max_per_address {
            self.displace(&mut open, |it| it.peer == peer).ok_or(Error::Busy(
                "as many uploads of one address as http.max_uploads_per_address allows are being received",
            ))?;
        }
        if open.len() >= self.max {
            self.displace(&mut open, |_| true)
                .or_else(|| self.displace_of_the_crowded(&mut open, peer))
                .ok_or(Error::Busy("as many uploads as http.max_uploads allows are being received"))?;
        }
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let upload = Arc::new(Upload {
            peer,
            begun: Instant::now(),
            received: AtomicU64::new(0),
            whole: AtomicBool::new(false),
            displaced: CancellationToken::new(),
            held,
        });
        open.insert(id, Arc::clone(&upload));
        Ok(UploadPlace { uploads: Arc::clone(self), id, upload })
    }

    /// Ends the slowest of those that are too slow.
    fn displace(&self, open: &mut HashMap<u64, Arc<Upload>>, of: impl Fn(&Upload) -> bool) -> Option<()> {
        let slow = open.iter().filter(|(_, it)| of(it)).filter_map(|(id, it)| {
            let rate = it.rate().filter(|rate| *rate < self.crowded_bytes_per_second)?;
            Some((rate, *id))
        });
        let (_, id) = slow.min()?;
        end(open, id)
    }

    /// For a peer that has none: ends the slowest of the address that has the most and more than its share,
    /// if that is too slow for so many.
    fn displace_of_the_crowded(&self, open: &mut HashMap<u64, Arc<Upload>>, newcomer: Peer) -> Option<()> {
        let mut of_peer = HashMap::<Peer, usize>::new();
        for upload in open.values() {
            *of_peer.entry(upload.peer).or_default() += 1;
        }
        if of_peer.contains_key(&newcomer) {
            return None;
        }
        let slow = open.iter().filter_map(|(id, it)| {
            let places = of_peer.get(&it.peer).copied().filter(|places| *places > 1)?;
            let least = least_rate(self.crowded_bytes_per_second, places, self.max, of_peer.len() + 1);
            let rate = it.rate().filter(|rate| *rate < least)?;
            Some((std::cmp::Reverse(places), rate, *id))
        });
        let (.., id) = slow.min()?;
        end(open, id)
    }
}

fn end(open: &mut HashMap<u64, Arc<Upload>>, id: u64) -> Option<()> {
    open.remove(&id)?.displaced.cancel();
    tracing::warn!("an upload that was too slow lost its place to another");
    Some(())
}

impl Upload {
    /// Bytes a second that came, if more are to come and it has been measured for long enough.
    fn rate(&self) -> Option<u64> {
        let measured = self.begun.elapsed();
        let slow = !self.whole.load(Ordering::Relaxed) && measured >= MEASURED;
        slow.then(|| (self.received.load(Ordering::Relaxed) as f64 / measured.as_secs_f64()) as u64)
    }

    /// So many bytes of its body came.
    pub(in crate::http) fn received(&self, bytes: usize) {
        self.received.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// One file more is remembered until the answer is written.
    ///
    /// # Errors
    /// [`Error::Busy`]: the memory budget is in use.
    pub(in crate::http) fn remember(&self) -> Result<()> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        if held.files.is_multiple_of(FILES) {
            held.share.grow(FILES * FILE_BYTES)?;
        }
        held.files += 1;
        Ok(())
    }

    /// Its body has come whole: what takes time now is ours.
    pub(in crate::http) fn whole(&self) {
        self.whole.store(true, Ordering::Relaxed);
    }

    /// Returns when it has lost its place.
    pub(in crate::http) async fn displaced(&self) {
        self.displaced.cancelled().await;
    }
}

impl UploadPlace {
    /// The upload.
    pub(in crate::http) fn upload(&self) -> &Arc<Upload> {
        &self.upload
    }
}

impl Drop for UploadPlace {
    fn drop(&mut self) {
        let mut open = self.uploads.open.lock().unwrap_or_else(PoisonError::into_inner);
        open.remove(&self.id);
    }
}
