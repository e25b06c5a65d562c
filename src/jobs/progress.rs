//! How far a reconstruction as a whole is, from how far its stage is.

use crate::observer::Stage;
use crate::pipeline::Profile;

/// The part of a run on a 512² head CT that each stage takes, in the order of [`Profile::stages`].
/// Measured; only the evenness of a progress bar depends on it.
fn shares(profile: Profile) -> &'static [f64] {
    match profile {
        Profile::Paper => &[0.35, 0.10, 0.20, 0.20, 0.05, 0.09, 0.01],
        Profile::Precise => &[0.20, 0.20, 0.15, 0.20, 0.24, 0.01],
    }
}

/// Part of the whole that is done, 0 to 1, when `fraction` of `stage` is.
pub(super) fn overall(profile: Profile, stage: Stage, fraction: f64) -> f64 {
    let stages = profile.stages().iter().zip(shares(profile));
    let parts = stages.map(|(&each, share)| match each.cmp(&stage) {
        std::cmp::Ordering::Less => *share,
        std::cmp::Ordering::Equal => share * fraction.clamp(0.0, 1.0),
        std::cmp::Ordering::Greater => 0.0,
    });
    parts.sum::<f64>().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_runs_from_0_to_1_and_never_back() {
        for profile in Profile::ALL {
            assert_eq!(profile.stages().len(), shares(profile).len());
            assert!(profile.stages().is_sorted());
            let mut last = 0.0;
            for stage in Stage::ALL {
                for fraction in [0.0, 0.5, 1.0] {
                    let now = overall(profile, stage, fraction);
                    assert!(now >= last - 1e-12, "{stage:?} {fraction}: {now} after {last}");
                    last = now;
                }
            }
            assert!((last - 1.0).abs() < 1e-9, "{last}");
        }
    }
}
