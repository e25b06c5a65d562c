//! How fast a peer has sent of late, over the time that we waited for it: what we take to work costs it
//! nothing.

use std::time::Duration;

/// Waiting time, ms, after which what came before counts no more; a pause between two series is shorter.
const WINDOW: u64 = 10_000;

/// Bytes that a peer sent and the time that it let us wait for them.
#[derive(Debug, Default)]
pub(super) struct Flow {
    /// Of the window at hand.
    now: Sum,
    /// Of the one before.
    before: Sum,
    /// Since when we wait for its next bytes, ms.
    waits_since: Option<u64>,
}

#[derive(Debug, Default, Clone, Copy)]
struct Sum {
    waited: u64,
    bytes: u64,
}

impl Flow {
    /// We wait for bytes from `now` on.
    pub(super) fn waits(&mut self, now: u64) {
        self.waits_since = Some(now);
    }

    /// So many came.
    pub(super) fn came(&mut self, now: u64, bytes: usize) {
        self.now.waited += self.waits_since.take().map_or(0, |since| now.saturating_sub(since));
        self.now.bytes += bytes as u64;
        if self.now.waited >= WINDOW {
            self.before = std::mem::take(&mut self.now);
        }
    }

    /// Bytes a second of late, if we wait now and have waited for at least `measured`.
    pub(super) fn rate(&self, now: u64, measured: Duration) -> Option<u64> {
        let waits = now.saturating_sub(self.waits_since?);
        // What waits for longer than a window has sent nothing of late.
        let before = if self.now.waited + waits < WINDOW { self.before } else { Sum::default() };
        let waited = self.now.waited + waits + before.waited;
        let bytes = self.now.bytes + before.bytes;
        (u128::from(waited) >= measured.as_millis()).then(|| bytes.saturating_mul(1000) / waited.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MEASURED: Duration = Duration::from_secs(5);

    #[test]
    fn the_time_of_our_own_work_costs_nothing() {
        let mut flow = Flow::default();
        for second in 0..60 {
            flow.waits(second * 1_000);
            flow.came(second * 1_000 + 100, 100_000);
        }
        assert_eq!(flow.rate(60_000, MEASURED), None, "it waits for us");
        flow.waits(60_000);
        assert_eq!(flow.rate(60_000, MEASURED), Some(1_000_000));
    }

    #[test]
    fn what_came_long_ago_does_not_count() {
        let mut flow = Flow::default();
        flow.waits(0);
        flow.came(1, 1 << 30);
        for second in 0..30 {
            flow.waits(second * 1_000);
            flow.came((second + 1) * 1_000, 1_400);
        }
        flow.waits(30_000);
        assert_eq!(flow.rate(30_001, MEASURED), Some(1_399));
        let mut pause = Flow::default();
        pause.waits(0);
        pause.came(3_000, 3_000_000);
        pause.waits(3_000);
        assert_eq!(pause.rate(7_000, MEASURED), Some(428_571), "a pause is no end");
        assert_eq!(pause.rate(4_000, MEASURED), None);
    }
}
