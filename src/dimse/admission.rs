//! How many associations there may be, in all and from one address.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};

/// Counts the associations and knows the limits.
#[derive(Debug)]
pub(crate) struct Admission {
    max_total: usize,
    max_per_peer: usize,
    open: Mutex<HashMap<IpAddr, usize>>,
}

/// A place among the open associations; free again when dropped.
#[derive(Debug)]
pub(crate) struct Slot {
    admission: Arc<Admission>,
    peer: IpAddr,
}

/// The limit that stood in the way: the setting's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LimitReached(pub(crate) &'static str);

impl Admission {
    pub(crate) fn new(max_total: usize, max_per_peer: usize) -> Arc<Self> {
        Arc::new(Self { max_total, max_per_peer, open: Mutex::default() })
    }

    /// A place for an association from `peer`, if there is one.
    pub(crate) fn admit(self: &Arc<Self>, peer: IpAddr) -> Result<Slot, LimitReached> {
        let peer = peer.to_canonical();
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        if open.values().sum::<usize>() >= self.max_total {
            return Err(LimitReached("dimse.max_associations"));
        }
        let of_peer = open.entry(peer).or_default();
        if *of_peer >= self.max_per_peer {
            return Err(LimitReached("dimse.max_associations_per_peer"));
        }
        *of_peer += 1;
        Ok(Slot { admission: Arc::clone(self), peer })
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let mut open = self.admission.open.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(of_peer) = open.get_mut(&self.peer) {
            *of_peer -= 1;
            if *of_peer == 0 {
                open.remove(&self.peer);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_hold_in_all_and_per_peer_and_places_come_free() {
        let admission = Admission::new(3, 2);
        let (a, b) = (IpAddr::from([10, 0, 0, 1]), IpAddr::from([10, 0, 0, 2]));
        let first = admission.admit(a).unwrap();
        let _second = admission.admit(a).unwrap();
        assert_eq!(admission.admit(a).unwrap_err(), LimitReached("dimse.max_associations_per_peer"));
        let _third = admission.admit(b).unwrap();
        assert_eq!(admission.admit(b).unwrap_err(), LimitReached("dimse.max_associations"));
        drop(first);
        admission.admit(a).unwrap();
    }
}
