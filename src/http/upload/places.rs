//! Places of uploads: so many in all and so many for one address; and where all are taken, an upload
//! that is slow loses its place to one that comes.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use crate::config;
use crate::crowd::Peer;
use crate::error::{Error, Result};

/// An upload is measured for so long before it can lose its place.
const MEASURED: Duration = Duration::from_secs(2);

/// The uploads that are being received.
#[derive(Debug)]
pub(in crate::http) struct Uploads {
    max: usize,
    max_per_address: usize,
    crowded_bytes_per_second: u64,
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
}

/// An upload's place; free again when dropped.
#[derive(Debug)]
pub(in crate::http) struct UploadPlace {
    uploads: Arc<Uploads>,
    id: u64,
    upload: Arc<Upload>,
}

impl Uploads {
    pub(in crate::http) fn new(settings: &config::Http) -> Arc<Self> {
        Arc::new(Self {
            max: settings.max_uploads,
            max_per_address: settings.max_uploads_per_address,
            crowded_bytes_per_second: settings.crowded_bytes_per_second,
            next: AtomicU64::new(0),
            open: Mutex::default(),
        })
    }

    /// A place for an upload of `peer`.
    ///
    /// # Errors
    /// [`Error::Busy`] if all are taken by uploads that are fast enough for a crowd.
    pub(in crate::http) fn take(self: &Arc<Self>, peer: Peer) -> Result<UploadPlace> {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if open.values().filter(|it| it.peer == peer).count() >= self.max_per_address {
            self.displace(&mut open, |it| it.peer == peer).ok_or(Error::Busy(
                "as many uploads of one address as http.max_uploads_per_address allows are being received",
            ))?;
        }
        if open.len() >= self.max {
            self.displace(&mut open, |_| true)
                .ok_or(Error::Busy("as many uploads as http.max_uploads allows are being received"))?;
        }
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let upload = Arc::new(Upload {
            peer,
            begun: Instant::now(),
            received: AtomicU64::new(0),
            whole: AtomicBool::new(false),
            displaced: CancellationToken::new(),
        });
        open.insert(id, Arc::clone(&upload));
        Ok(UploadPlace { uploads: Arc::clone(self), id, upload })
    }

    /// Ends the slowest of those that are too slow.
    fn displace(&self, open: &mut HashMap<u64, Arc<Upload>>, of: impl Fn(&Upload) -> bool) -> Option<()> {
        let rate = |upload: &Upload| {
            upload.received.load(Ordering::Relaxed) as f64 / upload.begun.elapsed().as_secs_f64()
        };
        let slow = open.iter().filter(|(_, it)| {
            of(it)
                && !it.whole.load(Ordering::Relaxed)
                && it.begun.elapsed() >= MEASURED
                && rate(it) < self.crowded_bytes_per_second as f64
        });
        let (id, _) = slow.min_by(|(_, a), (_, b)| rate(a).total_cmp(&rate(b)))?;
        let id = *id;
        let upload = open.remove(&id)?;
        upload.displaced.cancel();
        tracing::warn!("an upload that was too slow lost its place to another");
        Some(())
    }
}

impl Upload {
    /// So many bytes of its body came.
    pub(in crate::http) fn received(&self, bytes: usize) {
        self.received.fetch_add(bytes as u64, Ordering::Relaxed);
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
