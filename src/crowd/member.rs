//! One connection, as those see it who let it wait or work: what it does, since when, and how fast its
//! peer moves.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use super::Peer;
use super::flow::Flow;

/// Work that waits for its peer is measured for so long before it can make room.
pub(super) const MEASURED: Duration = Duration::from_secs(2);

/// One connection, as those see it who let it wait or work.
#[derive(Debug)]
pub(crate) struct Member {
    pub(super) peer: Peer,
    /// Many clients share it (a proxy): no limit per peer, and no shortened patience.
    pub(super) shared: bool,
    /// The connections' common zero of time.
    begun: Instant,
    /// Milliseconds after `begun` since which it waits.
    since: AtomicU64,
    /// What it works on: a request, a write.
    works: AtomicUsize,
    /// Milliseconds after `begun` since which it works.
    pub(super) works_since: AtomicU64,
    /// What of its work waits for the peer: a body, a write.
    awaited: AtomicUsize,
    /// Bytes that the peer sent or took since it works.
    moved: AtomicU64,
    /// How fast its peer has sent of late, over all that it works on.
    flow: Mutex<Flow>,
    /// It has a limit of its own (a stream of events) and is not counted here.
    apart: AtomicBool,
    /// What it was sent is not whole.
    broken: AtomicBool,
    pub(super) closed: CancellationToken,
}

/// The connection works as long as this lives.
#[derive(Debug)]
pub(crate) struct Busy(Arc<Member>);

/// The connection's work waits for its peer as long as this lives.
#[derive(Debug)]
pub(crate) struct Awaiting(Arc<Member>);

/// The connection is not counted as long as this lives.
#[derive(Debug)]
pub(crate) struct Apart(Arc<Member>);

impl Member {
    /// A connection of `peer` that waits from now on; its times count from `begun`.
    pub(super) fn new(peer: Peer, shared: bool, begun: Instant) -> Arc<Self> {
        let now = milliseconds(begun);
        Arc::new(Self {
            peer,
            shared,
            begun,
            since: AtomicU64::new(now),
            works: AtomicUsize::new(0),
            works_since: AtomicU64::new(now),
            awaited: AtomicUsize::new(0),
            moved: AtomicU64::new(0),
            flow: Mutex::default(),
            apart: AtomicBool::new(false),
            broken: AtomicBool::new(false),
            closed: CancellationToken::new(),
        })
    }

    /// It works until what this gives is dropped.
    pub(crate) fn work(self: &Arc<Self>) -> Busy {
        if self.works.fetch_add(1, Ordering::Relaxed) == 0 {
            self.works_since.store(milliseconds(self.begun), Ordering::Relaxed);
            self.moved.store(0, Ordering::Relaxed);
        }
        Busy(Arc::clone(self))
    }

    /// Its work waits for the peer until what this gives is dropped.
    pub(crate) fn wait_for_peer(self: &Arc<Self>) -> Awaiting {
        self.awaited.fetch_add(1, Ordering::Relaxed);
        Awaiting(Arc::clone(self))
    }

    /// The peer sent or took so many bytes.
    pub(crate) fn moved(&self, bytes: usize) {
        self.moved.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// The peer is waited for from now on, until bytes of it came.
    pub(crate) fn waits_for_bytes(&self) {
        self.flow.lock().unwrap_or_else(PoisonError::into_inner).waits(milliseconds(self.begun));
    }

    /// So many came.
    pub(crate) fn bytes_came(&self, bytes: usize) {
        self.flow.lock().unwrap_or_else(PoisonError::into_inner).came(milliseconds(self.begun), bytes);
    }

    /// Bytes a second that came of late, if they are waited for now and have been for at least `measured`.
    pub(super) fn flow(&self, now: u64, measured: Duration) -> Option<u64> {
        self.flow.lock().unwrap_or_else(PoisonError::into_inner).rate(now, measured)
    }

    /// It has a limit of its own until what this gives is dropped.
    pub(crate) fn stand_apart(self: &Arc<Self>) -> Apart {
        self.apart.store(true, Ordering::Relaxed);
        Apart(Arc::clone(self))
    }

    /// Whether it is one of those that may be too many.
    pub(super) fn counts(&self) -> bool {
        !self.apart.load(Ordering::Relaxed)
    }

    /// Whether it does nothing but wait for its peer's word.
    pub(super) fn waits(&self) -> bool {
        self.counts() && self.works.load(Ordering::Relaxed) == 0
    }

    /// What its peer was sent broke off: its end must not look like a good one.
    pub(crate) fn broke(&self) {
        self.broken.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_broken(&self) -> bool {
        self.broken.load(Ordering::Relaxed)
    }

    /// Bytes a second that the peer moved since it works, if the work waits for the peer now and has
    /// been measured for long enough.
    pub(super) fn rate(&self, now: u64) -> Option<u64> {
        let measured = now.saturating_sub(self.works_since.load(Ordering::Relaxed));
        let waits = self.counts()
            && self.works.load(Ordering::Relaxed) > 0
            && self.awaited.load(Ordering::Relaxed) > 0
            && u128::from(measured) >= MEASURED.as_millis();
        waits.then(|| self.moved.load(Ordering::Relaxed).saturating_mul(1000) / measured)
    }

    /// Milliseconds since which it waits.
    pub(super) fn since(&self) -> u64 {
        self.since.load(Ordering::Relaxed)
    }
}

impl Drop for Apart {
    fn drop(&mut self) {
        self.0.apart.store(false, Ordering::Relaxed);
    }
}

impl Drop for Awaiting {
    fn drop(&mut self) {
        self.0.awaited.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.0.since.store(milliseconds(self.0.begun), Ordering::Relaxed);
        self.0.works.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Milliseconds that have gone by.
pub(super) fn milliseconds(since: Instant) -> u64 {
    u64::try_from(since.elapsed().as_millis()).unwrap_or(u64::MAX)
}
