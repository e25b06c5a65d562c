//! Connections that wait for their peer's word, and those that work: when there are too many, the
//! oldest that wait make room, first those of the peer that has the most; and where all work, the
//! slowest of those whose work waits for the peer's bytes: any of them, or by address (see [`Slow`]).

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::member::{Member, milliseconds};
use super::{LimitReached, Peer};

/// The shortest patience with a connection that waits, however great the crowd.
const LEAST_PATIENCE: Duration = Duration::from_secs(3);

/// The log tells of a crowd so often.
const TOLD_EVERY: Duration = Duration::from_secs(10);

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
    /// Which of these.
    pub(crate) slow: Slow,
    /// One that has waited for less makes no room.
    pub(crate) least_wait: Duration,
    /// Whether patience shrinks before the last place is taken.
    pub(crate) shrinks: bool,
}

/// Whose work makes room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Slow {
    /// Any that is slow.
    Any,
    /// By address: that of a peer with more than one, for one that has none. All that one has beyond its
    /// share of the places must be as many times as fast as it has places ([`least_rate`]): slots that
    /// are worth their traffic.
    OfTheCrowded,
}

/// Bytes a second that each of a peer's `places` must move to keep them where all `max` are taken by so
/// many `peers`, the newcomer among them.
pub(crate) fn least_rate(crowded: u64, places: usize, max: usize, peers: usize) -> u64 {
    let beyond_its_share = places > max / peers.max(1);
    if beyond_its_share { crowded.saturating_mul(places as u64) } else { crowded }
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

/// A connection's place; free again when dropped.
#[derive(Debug)]
pub(crate) struct Place {
    connections: Arc<Connections>,
    id: u64,
    member: Arc<Member>,
    patience: Duration,
}

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
            let victim = oldest(of_peer().filter(|(_, it)| self.gives_way(it, now))).or_else(|| {
                (self.limits.slow == Slow::Any).then(|| self.slowest(of_peer(), |_| 0)).flatten()
            });
            close(&mut members, victim.ok_or(LimitReached(self.limits.names[1]))?);
        }
        if members.values().filter(|it| it.counts()).count() >= self.limits.max {
            self.tell();
            let victim = self.victim(&members, peer, shared).ok_or(LimitReached(self.limits.names[0]))?;
            close(&mut members, victim);
        }
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let member = Member::new(peer, shared, self.begun);
        members.insert(id, Arc::clone(&member));
        Ok(Place { connections: Arc::clone(self), id, member, patience })
    }

    /// The oldest that waits, of the peer that has the most connections of which one waits; a proxy's
    /// go last. None goes for a peer that has more connections than its own. By address, work of a peer that
    /// has more goes before one that waits.
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
        let waiting = waiting.min_by_key(|(id, it)| (rank(it), **id));
        match self.limits.slow {
            Slow::Any => {
                let working = members.iter().filter(|(_, it)| it.counts() && may_go(it));
                waiting.map(|(id, _)| *id).or_else(|| self.slowest(working, peers))
            }
            Slow::OfTheCrowded if of_newcomer > 0 => waiting.map(|(id, _)| *id),
            Slow::OfTheCrowded => {
                let working = self.slowest_of_the_crowded(members, &of_peer);
                let waiting = waiting.map(|(id, it)| (peers(it), *id));
                match (working, waiting) {
                    (Some((most, id)), Some((of_waiting, _))) if most > of_waiting => Some(id),
                    (_, Some((_, id))) | (Some((_, id)), None) => Some(id),
                    (None, None) => None,
                }
            }
        }
    }

    /// The slowest below its least rate, of the peer that has the most of which one is, and how many that has.
    fn slowest_of_the_crowded(
        &self,
        members: &HashMap<u64, Arc<Member>>,
        of_peer: &HashMap<Peer, usize>,
    ) -> Option<(usize, u64)> {
        let (now, Limits { max, crowded_bytes_per_second, least_wait, .. }) = (self.now(), self.limits);
        let slow = members.iter().filter_map(|(id, it)| {
            let places = of_peer.get(&it.peer).copied().filter(|places| *places > 1)?;
            let least = least_rate(crowded_bytes_per_second, places, max, of_peer.len() + 1);
            let rate = it.flow(now, least_wait).filter(|rate| it.counts() && *rate < least)?;
            Some((std::cmp::Reverse(places), rate, *id))
        });
        slow.min().map(|(places, _, id)| (places.0, id))
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

fn oldest<'a>(members: impl Iterator<Item = (&'a u64, &'a Arc<Member>)>) -> Option<u64> {
    members.filter(|(_, it)| it.waits()).min_by_key(|(id, it)| (it.since(), **id)).map(|(id, _)| *id)
}

/// Its place is free from now on; its task sees that and ends.
fn close(members: &mut HashMap<u64, Arc<Member>>, id: u64) {
    if let Some(member) = members.remove(&id) {
        member.closed.cancel();
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
mod tests;
