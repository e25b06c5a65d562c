//! Connections that wait for their peer's word, and those that work. When there are too many, the
//! oldest that wait make room, first those of the peer that has the most; and where all work, the
//! slowest of those whose work waits for the peer's bytes.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use super::{LimitReached, Peer};

/// The shortest patience with a connection that waits, however great the crowd.
const LEAST_PATIENCE: Duration = Duration::from_secs(3);

/// The log tells of a crowd so often.
const TOLD_EVERY: Duration = Duration::from_secs(10);

/// Work that waits for its peer is measured for so long before it can make room.
const MEASURED_MS: u64 = 2_000;

/// How many connections there may be, and how long one may wait.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// In all.
    pub(crate) max: usize,
    /// Of one peer.
    pub(crate) max_per_peer: usize,
    /// Both settings' names.
    pub(crate) names: [&'static str; 2],
    /// The time that one may wait where there is no crowd.
    pub(crate) patience: Duration,
    /// Where all places are taken, work that waits for its peer makes room if the peer moves fewer bytes
    /// a second; 0: none does.
    pub(crate) crowded_bytes_per_second: u64,
    /// One that has waited for less makes no room.
    pub(crate) least_wait: Duration,
    /// Whether patience shrinks before the last place is taken.
    pub(crate) shrinks: bool,
}

/// All connections of one door.
#[derive(Debug)]
pub(crate) struct Connections {
    limits: Limits,
    begun: Instant,
    next: AtomicU64,
    /// Milliseconds after `begun` at which the log was last told of a crowd; 0: never.
    told: AtomicU64,
    members: Mutex<HashMap<u64, Arc<Member>>>,
}

/// One connection, as those see it who let it wait or work.
#[derive(Debug)]
pub(crate) struct Member {
    peer: Peer,
    /// Many clients share it (a proxy): no limit per peer, and no shortened patience.
    shared: bool,
    begun: Instant,
    /// Milliseconds after `begun` since which it waits.
    since: AtomicU64,
    /// What it works on: a request, a write.
    works: AtomicUsize,
    /// Milliseconds after `begun` since which it works.
    works_since: AtomicU64,
    /// What of its work waits for the peer: a body, a write.
    awaited: AtomicUsize,
    /// Bytes that the peer sent or took since it works.
    moved: AtomicU64,
    /// It has a limit of its own (a stream of events) and is not counted here.
    apart: AtomicBool,
    /// What it was sent is not whole.
    broken: AtomicBool,
    closed: CancellationToken,
}

/// A connection's place; free again when dropped.
#[derive(Debug)]
pub(crate) struct Place {
    connections: Arc<Connections>,
    id: u64,
    member: Arc<Member>,
    patience: Duration,
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

impl Connections {
    pub(crate) fn new(limits: Limits) -> Arc<Self> {
        let (next, told) = (AtomicU64::new(0), AtomicU64::new(0));
        Arc::new(Self { limits, begun: Instant::now(), next, told, members: Mutex::default() })
    }

    /// A place for a connection of `peer`. Where there is none, one that waits is closed for it, or one
    /// whose peer is slow; refused only if all of the peer, or all there are, work.
    pub(crate) fn admit(self: &Arc<Self>, peer: Peer, shared: bool) -> Result<Place, LimitReached> {
        let mut members = self.members.lock().unwrap_or_else(PoisonError::into_inner);
        let now = self.now();
        let patience = self.patience(members.values().filter(|it| it.counts()).count() + 1);
        if patience < self.limits.patience {
            self.tell();
            let late = |member: &Member| {
                member.waits()
                    && !member.shared
                    && u128::from(now.saturating_sub(member.since())) > patience.as_millis()
            };
            let ids: Vec<_> = members.iter().filter(|(_, it)| late(it)).map(|(id, _)| *id).collect();
            ids.into_iter().for_each(|id| close(&mut members, id));
        }
        let of_peer = members.values().filter(|it| it.counts() && it.peer == peer).count();
        if !shared && of_peer >= self.limits.max_per_peer {
            let of_peer = || members.iter().filter(|(_, it)| it.peer == peer);
            let victim = oldest(of_peer().filter(|(_, it)| self.gives_way(it, now)))
                .or_else(|| self.slowest(of_peer(), |_| 0));
            close(&mut members, victim.ok_or(LimitReached(self.limits.names[1]))?);
        }
        if members.values().filter(|it| it.counts()).count() >= self.limits.max {
            self.tell();
            let victim = self.victim(&members, peer, shared).ok_or(LimitReached(self.limits.names[0]))?;
            close(&mut members, victim);
        }
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let member = Arc::new(Member {
            peer,
            shared,
            begun: self.begun,
            since: AtomicU64::new(now),
            works: AtomicUsize::new(0),
            works_since: AtomicU64::new(now),
            awaited: AtomicUsize::new(0),
            moved: AtomicU64::new(0),
            apart: AtomicBool::new(false),
            broken: AtomicBool::new(false),
            closed: CancellationToken::new(),
        });
        members.insert(id, Arc::clone(&member));
        Ok(Place { connections: Arc::clone(self), id, member, patience })
    }

    /// The oldest that waits, of the peer that has the most connections of which one waits; a proxy's
    /// go last. None goes for a peer that has more connections than its own.
    fn victim(&self, members: &HashMap<u64, Arc<Member>>, newcomer: Peer, shared: bool) -> Option<u64> {
        let now = self.now();
        let mut of_peer = HashMap::<Peer, usize>::new();
        for member in members.values().filter(|it| it.counts()) {
            *of_peer.entry(member.peer).or_default() += 1;
        }
        let of_newcomer = if shared { 0 } else { of_peer.get(&newcomer).copied().unwrap_or(0) };
        // One that began to count meanwhile (its stream of events ended) is not among the counted.
        let peers = |it: &Member| of_peer.get(&it.peer).copied().unwrap_or(1);
        let may_go = |it: &Member| peers(it) >= of_newcomer;
        let waiting = members.iter().filter(|(_, it)| self.gives_way(it, now) && may_go(it));
        let rank = |member: &Member| (member.shared, std::cmp::Reverse(peers(member)), member.since());
        let waiting = waiting.min_by_key(|(id, it)| (rank(it), **id)).map(|(id, _)| *id);
        let working = members.iter().filter(|(_, it)| it.counts() && may_go(it));
        waiting.or_else(|| self.slowest(working, peers))
    }

    /// The slowest of those whose work waits for a slow peer, of the peer with the most connections.
    fn slowest<'a>(
        &self,
        members: impl Iterator<Item = (&'a u64, &'a Arc<Member>)>,
        of_peer: impl Fn(&Member) -> usize,
    ) -> Option<u64> {
        let now = self.now();
        let slow = members.filter_map(|(id, it)| {
            let rate = it.rate(now).filter(|rate| *rate < self.limits.crowded_bytes_per_second)?;
            Some((it.shared, std::cmp::Reverse(of_peer(it)), rate, *id))
        });
        slow.min().map(|(.., id)| id)
    }

    /// Whether it waits, and has done so for long enough to make room.
    fn gives_way(&self, member: &Member, now: u64) -> bool {
        let waited = u128::from(now.saturating_sub(member.since()));
        member.waits() && waited >= self.limits.least_wait.as_millis()
    }

    /// Half full, it begins to shrink; full, there is next to none.
    fn patience(&self, connections: usize) -> Duration {
        let Limits { max, patience, .. } = self.limits;
        let left = max.saturating_sub(connections);
        if 2 * left >= max || !self.limits.shrinks {
            return patience;
        }
        patience.mul_f64(2.0 * left as f64 / max as f64).max(LEAST_PATIENCE.min(patience))
    }

    fn now(&self) -> u64 {
        milliseconds(self.begun)
    }

    fn tell(&self) {
        let (now, told) = (self.now().max(1), self.told.load(Ordering::Relaxed));
        if told == 0 || u128::from(now - told.min(now)) > TOLD_EVERY.as_millis() {
            self.told.store(now, Ordering::Relaxed);
            let [setting, _] = self.limits.names;
            tracing::warn!(
                limit = setting,
                max = self.limits.max,
                "a crowd: connections that wait are closed early"
            );
        }
    }
}

fn milliseconds(since: Instant) -> u64 {
    u64::try_from(since.elapsed().as_millis()).unwrap_or(u64::MAX)
}

fn oldest<'a>(members: impl Iterator<Item = (&'a u64, &'a Arc<Member>)>) -> Option<u64> {
    members.filter(|(_, it)| it.waits()).min_by_key(|(id, it)| (it.since(), **id)).map(|(id, _)| *id)
}

/// Its place is free from now on; its task sees that and ends.
fn close(members: &mut HashMap<u64, Arc<Member>>, id: u64) {
    if let Some(member) = members.remove(&id) {
        member.closed.cancel();
    }
}

impl Member {
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

    /// It has a limit of its own until what this gives is dropped.
    pub(crate) fn stand_apart(self: &Arc<Self>) -> Apart {
        self.apart.store(true, Ordering::Relaxed);
        Apart(Arc::clone(self))
    }

    fn counts(&self) -> bool {
        !self.apart.load(Ordering::Relaxed)
    }

    fn waits(&self) -> bool {
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
    fn rate(&self, now: u64) -> Option<u64> {
        let measured = now.saturating_sub(self.works_since.load(Ordering::Relaxed));
        let waits = self.counts()
            && self.works.load(Ordering::Relaxed) > 0
            && self.awaited.load(Ordering::Relaxed) > 0
            && measured >= MEASURED_MS;
        waits.then(|| self.moved.load(Ordering::Relaxed).saturating_mul(1000) / measured)
    }

    fn since(&self) -> u64 {
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

impl Place {
    /// The connection.
    pub(crate) fn member(&self) -> &Arc<Member> {
        &self.member
    }

    /// How long it may wait for its peer's first word.
    pub(crate) fn patience(&self) -> Duration {
        self.patience
    }

    /// Returns when it is to be closed for others.
    pub(crate) async fn closed(&self) {
        self.member.closed.cancelled().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut members = self.connections.members.lock().unwrap_or_else(PoisonError::into_inner);
        members.remove(&self.id);
    }
}

#[cfg(test)]
mod tests {
    use std::net::IpAddr;

    use super::*;

    fn peer(number: u8) -> Peer {
        Peer::from(IpAddr::from([10, 0, 0, number]))
    }

    fn limits(max: usize, max_per_peer: usize) -> Limits {
        let (patience, least_wait) = (Duration::from_secs(30), Duration::ZERO);
        Limits {
            max,
            max_per_peer,
            names: ["all", "one"],
            patience,
            crowded_bytes_per_second: 65_536,
            least_wait,
            shrinks: true,
        }
    }

    fn connections(max: usize, max_per_peer: usize) -> Arc<Connections> {
        Connections::new(limits(max, max_per_peer))
    }

    fn is_closed(place: &Place) -> bool {
        place.member.closed.is_cancelled()
    }

    #[test]
    fn the_oldest_that_waits_of_the_most_crowded_peer_makes_room() {
        let connections = connections(4, 3);
        let quiet = connections.admit(peer(1), false).unwrap();
        let crowd = [2, 2, 2].map(|it| connections.admit(peer(it), false).unwrap());
        let _fresh = connections.admit(peer(3), false).unwrap();
        assert!(!is_closed(&quiet), "the oldest, but alone");
        assert_eq!(crowd.each_ref().map(is_closed), [true, false, false]);
    }

    #[test]
    fn a_peer_at_its_limit_makes_room_for_itself_and_work_is_not_closed() {
        let connections = connections(10, 2);
        let first = connections.admit(peer(1), false).unwrap();
        let busy = first.member().work();
        let second = connections.admit(peer(1), false).unwrap();
        let third = connections.admit(peer(1), false).unwrap();
        assert!(!is_closed(&first) && is_closed(&second));
        let _also = third.member().work();
        assert_eq!(connections.admit(peer(1), false).unwrap_err(), LimitReached("one"));
        connections.admit(peer(1), true).expect("a proxy has no limit of its own");
        drop(busy);
        connections.admit(peer(1), false).unwrap();
        assert!(is_closed(&first));
    }

    #[test]
    fn all_at_work_is_the_end_and_what_is_apart_does_not_count() {
        let connections = connections(2, 2);
        let places = [1, 2].map(|it| connections.admit(peer(it), false).unwrap());
        let _busy = places.each_ref().map(|place| place.member().work());
        assert_eq!(connections.admit(peer(3), false).unwrap_err(), LimitReached("all"));
        let apart = places[0].member().stand_apart();
        let third = connections.admit(peer(3), false).unwrap();
        drop(third);
        let third = connections.admit(peer(3), false).expect("a place that was given back");
        let _also = third.member().work();
        drop(apart);
        assert!(connections.admit(peer(4), false).is_err());
    }

    #[test]
    fn a_crowded_peer_takes_no_place_of_one_that_has_fewer() {
        let connections = connections(3, 3);
        let alone = connections.admit(peer(1), false).unwrap();
        let crowd = [2, 2].map(|it| connections.admit(peer(it), false).unwrap());
        let _busy = crowd.each_ref().map(|place| place.member().work());
        assert_eq!(connections.admit(peer(2), false).unwrap_err(), LimitReached("all"));
        assert!(!is_closed(&alone));
        let _fresh = connections.admit(peer(3), false).unwrap();
        assert!(is_closed(&alone), "an equal one does");
    }

    #[test]
    fn where_all_work_the_slowest_peer_of_the_most_crowded_makes_room() {
        let mut connections = Arc::into_inner(connections(3, 3)).unwrap();
        connections.begun -= Duration::from_millis(2 * MEASURED_MS);
        let connections = Arc::new(connections);
        let places = [1, 2, 2].map(|it| connections.admit(peer(it), false).unwrap());
        let _busy = places.each_ref().map(|place| place.member().work());
        let _awaited = places.each_ref().map(|place| place.member().wait_for_peer());
        assert!(connections.admit(peer(3), false).is_err(), "not measured yet");
        for place in &places {
            place.member.works_since.store(0, Ordering::Relaxed);
        }
        places[1].member().moved(1_000);
        places[2].member().moved(10_000_000);
        let fresh = connections.admit(peer(3), false).unwrap();
        assert_eq!(places.each_ref().map(is_closed), [false, true, false]);
        let _at_work = fresh.member().work();
        let _alone = connections.admit(peer(4), false).unwrap();
        assert_eq!(places.each_ref().map(is_closed), [true, true, false], "who keeps the rate stays");
    }

    #[test]
    fn what_has_not_waited_long_enough_makes_no_room() {
        let least_wait = Duration::from_secs(3600);
        let connections = Connections::new(Limits { least_wait, shrinks: false, ..limits(2, 2) });
        let _both = [1, 2].map(|it| connections.admit(peer(it), false).unwrap());
        assert_eq!(connections.admit(peer(3), false).unwrap_err(), LimitReached("all"));
    }

    #[test]
    fn patience_shrinks_when_it_is_more_than_half_full() {
        let connections = connections(100, 100);
        let seconds = |it| connections.patience(it).as_secs_f64();
        assert_eq!([seconds(1), seconds(50), seconds(75), seconds(100)], [30.0, 30.0, 15.0, 3.0]);
    }
}
