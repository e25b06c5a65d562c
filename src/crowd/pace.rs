//! The least rate at which a peer must send, or take, bytes.

use std::time::Duration;

/// What a pace without a least rate leaves: a year.
const NO_LIMIT: Duration = Duration::from_secs(31_536_000);

/// Time that a peer may still let us wait. Bytes earn it, waiting costs it: a peer that is on average
/// slower than the least rate runs out of it. Our own work between two bytes costs nothing.
#[derive(Debug, Clone)]
pub(crate) struct Pace {
    bytes_per_second: u64,
    grace: Duration,
    left: Duration,
}

impl Pace {
    /// `bytes_per_second`: the least rate, 0 for none. `grace`: the time that a peer has at first,
    /// and at most.
    pub(crate) fn new(bytes_per_second: u64, grace: Duration) -> Self {
        Self { bytes_per_second, grace, left: grace }
    }

    /// The time that the peer may still let us wait.
    pub(crate) fn left(&self) -> Duration {
        if self.bytes_per_second == 0 { NO_LIMIT } else { self.left }
    }

    /// The peer let us wait so long, and then moved so many bytes.
    pub(crate) fn moved(&mut self, waited: Duration, bytes: usize) {
        if self.bytes_per_second == 0 {
            return;
        }
        let earned = Duration::from_secs_f64(bytes as f64 / self.bytes_per_second as f64);
        self.left = self.left.saturating_sub(waited).saturating_add(earned).min(self.grace);
    }

    /// Something new begins: the whole grace again.
    pub(crate) fn restart(&mut self) {
        self.left = self.grace;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_drips_runs_out_of_time_and_who_keeps_the_rate_does_not() {
        let second = Duration::from_secs(1);
        let mut pace = Pace::new(1_000, 10 * second);
        for _ in 0..9 {
            pace.moved(second, 1);
        }
        assert!(pace.left() > Duration::ZERO && pace.left() < 2 * second);
        pace.moved(second, 1);
        pace.moved(second, 1);
        assert_eq!(pace.left(), Duration::from_millis(1));
        let mut pace = Pace::new(1_000, 10 * second);
        for _ in 0..1_000 {
            pace.moved(second, 1_000);
        }
        assert_eq!(pace.left(), 10 * second);
        let mut none = Pace::new(0, second);
        none.moved(100 * second, 0);
        assert_eq!(none.left(), NO_LIMIT);
    }
}
