//! How far a reconstruction as a whole is, from how far its stage is.

use crate::pipeline::Stage;

/// The part of a run on a 512² head CT that each stage takes, in the order of [`Stage::ALL`].
/// Measured; only the evenness of a progress bar depends on it.
const SHARES: [f64; 7] = [0.35, 0.10, 0.20, 0.20, 0.05, 0.09, 0.01];

/// Part of the whole that is done, 0 to 1, when `fraction` of `stage` is.
pub(super) fn overall(stage: Stage, fraction: f64) -> f64 {
    let mut done = 0.0;
    for (share, each) in SHARES.into_iter().zip(Stage::ALL) {
        if each == stage {
            return (done + share * fraction.clamp(0.0, 1.0)).min(1.0);
        }
        done += share;
    }
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_runs_from_0_to_1_and_never_back() {
        let mut last = 0.0;
        for stage in Stage::ALL {
            for fraction in [0.0, 0.5, 1.0] {
                let now = overall(stage, fraction);
                assert!(now >= last - 1e-12, "{stage:?} {fraction}: {now} after {last}");
                last = now;
            }
        }
        assert!((last - 1.0).abs() < 1e-9, "{last}");
    }
}
