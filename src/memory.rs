//! One budget of memory for what is large: the volumes of jobs, decoding, answers.
//!
//! Whoever needs memory takes a [`Share`] first and gives it back by dropping it. A share that the
//! budget has no room for now is refused at once ([`NoMemory`]): nobody waits for memory while holding
//! some, so nobody waits for ever.

mod machine;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use machine::available_bytes;

/// A budget, shared by all who hold a clone.
#[derive(Debug, Clone)]
pub struct Memory(Arc<Budget>);

#[derive(Debug)]
struct Budget {
    total: u64,
    used: Mutex<u64>,
}

/// Part of a budget; dropped, it is given back.
#[derive(Debug)]
pub struct Share {
    memory: Memory,
    bytes: u64,
}

/// The budget has no room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{needed} bytes of memory are needed; the budget is {total} bytes (memory.budget_bytes)")]
pub struct NoMemory {
    /// Bytes of the share as it would have been.
    pub needed: u64,
    /// Bytes of the budget.
    pub total: u64,
}

impl NoMemory {
    /// The same for one that holds so many bytes already and keeps them.
    #[must_use]
    pub fn beside(self, held: u64) -> Self {
        Self { needed: self.needed.saturating_add(held), ..self }
    }

    /// Whether it would not fit if nobody else used any.
    #[must_use]
    pub fn never_fits(&self) -> bool {
        self.needed > self.total
    }
}

impl Memory {
    /// A budget of so many bytes.
    #[must_use]
    pub fn new(total: u64) -> Self {
        Self(Arc::new(Budget { total, used: Mutex::new(0) }))
    }

    /// No bound.
    #[must_use]
    pub fn unlimited() -> Self {
        Self::new(u64::MAX)
    }

    /// A share of nothing, to grow.
    #[must_use]
    pub fn share(&self) -> Share {
        Share { memory: self.clone(), bytes: 0 }
    }

    /// A share of so many bytes.
    ///
    /// # Errors
    /// [`NoMemory`]: there is no room now, or never.
    pub fn take(&self, bytes: u64) -> Result<Share, NoMemory> {
        let mut share = self.share();
        share.grow(bytes)?;
        Ok(share)
    }

    /// Bytes of the whole budget.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.total
    }

    /// Bytes that are taken now.
    #[must_use]
    pub fn used(&self) -> u64 {
        *self.lock()
    }

    fn lock(&self) -> MutexGuard<'_, u64> {
        self.0.used.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PartialEq for Memory {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Memory {}

impl Share {
    /// Takes so many bytes more.
    ///
    /// # Errors
    /// [`NoMemory`]; the share stays as it is.
    pub fn grow(&mut self, more: u64) -> Result<(), NoMemory> {
        let total = self.memory.0.total;
        let needed = self.bytes.saturating_add(more);
        let mut used = self.memory.lock();
        let after = used.saturating_add(more);
        if after > total {
            return Err(NoMemory { needed, total });
        }
        *used = after;
        drop(used);
        self.bytes = needed;
        Ok(())
    }

    /// Bytes of it.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        let mut used = self.memory.lock();
        *used = used.saturating_sub(self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_given_than_there_is_and_what_is_dropped_comes_back() {
        let memory = Memory::new(100);
        let mut one = memory.take(60).unwrap();
        assert_eq!(memory.take(41).unwrap_err(), NoMemory { needed: 41, total: 100 });
        assert!(!memory.take(41).unwrap_err().never_fits());
        one.grow(40).unwrap();
        assert_eq!(one.grow(1), Err(NoMemory { needed: 101, total: 100 }));
        assert!(one.grow(1).unwrap_err().never_fits());
        assert_eq!((one.bytes(), memory.used()), (100, 100), "a refusal takes nothing");
        drop(one);
        assert_eq!(memory.used(), 0);
        assert!(memory.take(101).unwrap_err().never_fits());
        let held = memory.take(60).unwrap();
        assert!(!memory.take(41).unwrap_err().never_fits(), "others may give theirs back");
        assert!(memory.take(41).unwrap_err().beside(held.bytes()).never_fits(), "who asks keeps its own");
    }
}
