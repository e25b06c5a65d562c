//! The scan's own levels: air, soft tissue, noise.

use super::space::Space;

/// What the scan shows for air and for soft tissue, and how it scatters, HU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Levels {
    /// Air around the patient.
    pub(super) air: f32,
    /// Soft tissue.
    pub(super) tissue: f32,
    /// Standard deviation in soft tissue and air, the larger.
    pub(super) noise: f32,
}

const LOWEST: i32 = -1200;
const HIGHEST: i32 = 400;

impl Levels {
    /// Half-way from air to tissue: the skin.
    pub(super) fn middle(&self) -> f32 {
        f32::midpoint(self.air, self.tissue)
    }

    /// Three quarters of the way: above it a voxel is mostly tissue, and a gap narrower than a
    /// voxel still parts two bodies.
    pub(super) fn upper(&self) -> f32 {
        self.air + 0.75 * (self.tissue - self.air)
    }

    /// Below this there is no measurement (padding outside the scan circle).
    pub(super) fn padding(&self) -> f32 {
        self.air - (8.0 * self.noise).max(120.0)
    }

    /// From the histogram; `None` if it has no air or no soft tissue.
    pub(super) fn of(space: &Space) -> Option<Self> {
        let mut histogram = vec![0u64; (HIGHEST - LOWEST) as usize];
        let stride = (space.hu.len() / 8_000_000).max(1) | 1;
        for &v in space.hu.iter().step_by(stride) {
            let v = i32::from(v);
            if (LOWEST..HIGHEST).contains(&v) {
                histogram[(v - LOWEST) as usize] += 1;
            }
        }
        let air = peak(&histogram, -1100, -850)?;
        let tissue = peak(&histogram, -40, 140)?;
        let noise = spread(&histogram, air).max(1.0);
        Some(Self { air: air as f32, tissue: tissue.min(60) as f32, noise })
    }
}

/// The most frequent value between two, smoothed over ±4 HU.
fn peak(histogram: &[u64], from: i32, to: i32) -> Option<i32> {
    let at = |v: i32| histogram[(v - LOWEST) as usize];
    let smooth = |v: i32| (v - 4..=v + 4).map(at).sum::<u64>();
    (from..to).max_by_key(|&v| smooth(v)).filter(|&v| smooth(v) > 0)
}

/// Standard deviation of the values below a peak, mirrored (structure lies above it).
fn spread(histogram: &[u64], peak: i32) -> f32 {
    let (mut n, mut sum) = (0u64, 0f64);
    for v in (peak - 80).max(LOWEST)..=peak {
        let count = histogram[(v - LOWEST) as usize];
        n += count;
        sum += count as f64 * f64::from((v - peak) * (v - peak));
    }
    if n == 0 { 0.0 } else { (sum / n as f64).sqrt() as f32 }
}
