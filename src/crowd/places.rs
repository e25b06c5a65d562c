//! Places that are taken and given back, so many in all and so many for one peer.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::Peer;

/// Counts the places that are taken, and knows the limits.
#[derive(Debug)]
pub(crate) struct Places {
    max: usize,
    max_per_peer: usize,
    /// The settings' names.
    names: [&'static str; 2],
    taken: Mutex<HashMap<Peer, usize>>,
}

/// A place; free again when dropped.
#[derive(Debug)]
pub(crate) struct Slot {
    places: Arc<Places>,
    peer: Peer,
}

/// The limit that stood in the way: the setting's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LimitReached(pub(crate) &'static str);

impl Places {
    /// `names`: of the settings of both limits.
    pub(crate) fn new(max: usize, max_per_peer: usize, names: [&'static str; 2]) -> Arc<Self> {
        Arc::new(Self { max, max_per_peer, names, taken: Mutex::default() })
    }

    /// A place for `peer`, if there is one.
    pub(crate) fn take(self: &Arc<Self>, peer: Peer) -> Result<Slot, LimitReached> {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if taken.values().sum::<usize>() >= self.max {
            return Err(LimitReached(self.names[0]));
        }
        let of_peer = taken.entry(peer).or_default();
        if *of_peer >= self.max_per_peer {
            return Err(LimitReached(self.names[1]));
        }
        *of_peer += 1;
        Ok(Slot { places: Arc::clone(self), peer })
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut taken = self.places.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(of_peer) = taken.get_mut(&self.peer) {
            *of_peer -= 1;
            if *of_peer == 0 {
                taken.remove(&self.peer);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::IpAddr;

    use super::*;

    #[test]
    fn limits_hold_in_all_and_per_peer_and_places_come_free() {
        let places = Places::new(3, 2, ["all", "one"]);
        let [a, b] = [[10, 0, 0, 1], [10, 0, 0, 2]].map(|it| Peer::from(IpAddr::from(it)));
        let first = places.take(a).unwrap();
        let _second = places.take(a).unwrap();
        assert_eq!(places.take(a).unwrap_err(), LimitReached("one"));
        let _third = places.take(b).unwrap();
        assert_eq!(places.take(b).unwrap_err(), LimitReached("all"));
        drop(first);
        places.take(a).unwrap();
    }
}
