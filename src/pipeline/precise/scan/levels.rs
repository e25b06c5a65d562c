//! The scan's own levels: air, soft tissue, noise.

use super::sampler::Sampler;

/// What the scan shows for air and for soft tissue, and how it scatters, HU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Levels {
    /// Air around the patient.
    pub(crate) air: f32,
    /// Soft tissue.
    pub(crate) tissue: f32,
    /// Standard deviation in air; in soft tissue where the air is clipped.
    pub(crate) noise: f32,
    /// Set if the scan shows no measured air.
    pub(crate) clipped: Option<Clipped>,
}

/// Air of one value in a scan with noise: something filled it, and the foot of every edge with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Clipped {
    /// The value, HU.
    pub(crate) value: f32,
    /// The lowest value that was left as measured, HU.
    pub(crate) foot: f32,
}

/// Air by the definition of the Hounsfield unit, for scans that show none (PS3.3 section C.11.1.1.2).
const DEFINED_AIR: i32 = -1000;
/// Soft tissue that scatters less comes with air that does not scatter either, HU.
const LEAST_NOISE: f32 = 3.0;
/// Noise of voxels so far apart is taken for independent, voxels.
const APART: usize = 3;
/// Voxels that differ from the tissue's level by more are none of it, HU.
const TISSUE_REACH: f32 = 60.0;
/// Values that edges alone have, HU; each is about as frequent as any other.
const OF_EDGES: [i32; 2] = [-700, -300];

/// Where air is looked for, HU.
const AIR: [i32; 2] = [-1100, -850];
/// Where soft tissue is looked for, HU.
const TISSUE: [i32; 2] = [-40, 140];
/// Measured air is at least one voxel in so many of the most frequent value's.
const LEAST_SHARE: u64 = 50;
/// Air of a scan without noise is within so much of its level, HU.
const AS_AIR: f32 = 8.0;
const LOWEST: i32 = -1200;
const HIGHEST: i32 = 400;

impl Levels {
    /// Half-way from air to tissue: the skin.
    pub(crate) fn middle(&self) -> f32 {
        f32::midpoint(self.air, self.tissue)
    }

    /// Three quarters of the way: above it a voxel is mostly tissue, and a gap narrower than a
    /// voxel still parts two bodies.
    pub(crate) fn upper(&self) -> f32 {
        self.air + 0.75 * (self.tissue - self.air)
    }

    /// Below this there is no measurement (padding outside the scan circle).
    pub(crate) fn padding(&self) -> f32 {
        self.air - (8.0 * self.noise).max(120.0)
    }

    /// From the histogram; `None` if it has no air or no soft tissue.
    pub(crate) fn of(sampler: &Sampler) -> Option<Self> {
        let mut histogram = vec![0u64; (HIGHEST - LOWEST) as usize];
        let stride = (sampler.hu.len() / 8_000_000).max(1) | 1;
        for (number, &v) in sampler.hu.iter().step_by(stride).enumerate() {
            sampler.ask_at(number);
            let v = i32::from(v);
            if (LOWEST..HIGHEST).contains(&v) {
                histogram[(v - LOWEST) as usize] += 1;
            }
        }
        let found = peak(&histogram, AIR)?;
        let filled = histogram.clone();
        despike(&mut histogram);
        let beside = peak(&histogram, AIR).filter(|p| p.count * LEAST_SHARE >= found.count);
        // Air without noise is itself a spike.
        if beside.is_none() {
            histogram = filled;
        }
        let air = beside.unwrap_or(found).at;
        let tissue = peak(&histogram, TISSUE)?.at;
        let (tissue, mut noise) = (tissue.min(60) as f32, spread(&histogram, air));
        let mut clipped = None;
        if noise < LEAST_NOISE {
            let in_tissue = tissue_noise(sampler, tissue);
            if in_tissue >= LEAST_NOISE {
                noise = in_tissue;
                clipped = Some(Clipped { value: air as f32, foot: foot(&histogram, air) as f32 });
            }
        }
        let air = if clipped.is_some() { air.max(DEFINED_AIR) } else { air };
        Some(Self { air: air as f32, tissue, noise: noise.max(1.0), clipped })
    }

    /// Whether a value can be that of air although the voxels all around have it too.
    pub(crate) fn is_still_air(&self, value: f32) -> bool {
        let air = self.clipped.map_or(self.air, |clipped| clipped.value);
        (self.clipped.is_some() || self.noise <= LEAST_NOISE) && (value - air).abs() <= AS_AIR
    }

    /// The lowest share of tissue between these levels that was left as measured; `None` if all were.
    pub(crate) fn least_share(&self, tissue: f32, air: f32) -> Option<f64> {
        self.clipped.map(|clipped| f64::from((clipped.foot - air) / (tissue - air)))
    }
}

/// A value far more frequent than those beside it is no measurement: scanners and archives fill what
/// lies outside the scan circle with one value. It gets as many as they.
fn despike(histogram: &mut [u64]) {
    for v in 2..histogram.len() - 2 {
        let beside = [histogram[v - 2], histogram[v - 1], histogram[v + 1], histogram[v + 2]];
        let most = beside.into_iter().max().unwrap_or(0);
        if histogram[v] > 3 * most + 8 {
            histogram[v] = beside.iter().sum::<u64>() / 4;
        }
    }
}

/// The most frequent value of a range, HU, smoothed over ±4 HU; where one value alone has most of
/// them, that one.
#[derive(Debug, Clone, Copy)]
struct Peak {
    at: i32,
    count: u64,
}

fn peak(histogram: &[u64], [from, to]: [i32; 2]) -> Option<Peak> {
    let at = |v: i32| histogram[(v - LOWEST) as usize];
    let smooth = |v: i32| (v - 4..=v + 4).map(at).sum::<u64>();
    let highest = (from..to).map(|at| Peak { at, count: smooth(at) }).max_by_key(|p| p.count);
    let highest = highest.filter(|p| p.count > 0)?;
    // Air without noise is as frequent anywhere within 4 HU of its one value.
    let alone = (highest.at - 4..=highest.at + 4).find(|&v| 2 * at(v) > highest.count);
    Some(Peak { at: alone.unwrap_or(highest.at), ..highest })
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

/// Standard deviation in soft tissue, from the median difference of voxels on a line.
fn tissue_noise(sampler: &Sampler, tissue: f32) -> f32 {
    let row = sampler.shape[2];
    let stride = (sampler.hu.len() / row / 8000).max(1);
    let is_tissue = |v: i16| (f32::from(v) - tissue).abs() <= TISSUE_REACH;
    // How many differ by so much: both are within reach of the tissue's level.
    let mut apart = [0u64; 2 * TISSUE_REACH as usize + 1];
    for row in sampler.hu.chunks_exact(row).step_by(stride) {
        sampler.ask();
        let pairs = row.iter().zip(row.iter().skip(APART));
        for (a, b) in pairs.filter(|(a, b)| is_tissue(**a) && is_tissue(**b)) {
            apart[usize::from(a.abs_diff(*b))] += 1;
        }
    }
    let count: u64 = apart.iter().sum();
    let mut up_to = 0;
    let median = apart.iter().position(|n| {
        up_to += n;
        up_to > count / 2
    });
    // The median of a normal distribution's absolute value is 0.6745 standard deviations.
    median.map_or(0.0, |median| (median as f64 / 0.6745 / 2_f64.sqrt()) as f32)
}

/// The lowest value above clipped air from which on there are about as many as on edges, HU.
fn foot(histogram: &[u64], air: i32) -> i32 {
    let count = |[from, to]: [i32; 2]| (from..to).map(|v| histogram[(v - LOWEST) as usize]).sum::<u64>();
    let usual = count(OF_EDGES) as f64 / f64::from(OF_EDGES[1] - OF_EDGES[0]);
    (air + 1..OF_EDGES[0]).find(|&v| count([v, v + 8]) as f64 >= 4.0 * usual).unwrap_or(air)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn histogram(values: &[(i32, u64)]) -> Vec<u64> {
        let mut histogram = vec![0; (HIGHEST - LOWEST) as usize];
        for &(v, n) in values {
            histogram[(v - LOWEST) as usize] += n;
        }
        histogram
    }

    #[test]
    fn a_fill_value_is_no_measured_air() {
        let noisy: Vec<(i32, u64)> =
            (-1030_i32..-970).map(|v| (v, 1000 - 30 * u64::from(v.abs_diff(-1000)))).collect();
        let mut filled = histogram(&noisy);
        filled[(-1024 - LOWEST) as usize] += 500_000;
        despike(&mut filled);
        assert_eq!(peak(&filled, AIR).expect("air").at, -1000);
    }

    #[test]
    fn edges_of_a_scan_with_clipped_air_begin_where_it_was_cut() {
        let edges: Vec<(i32, u64)> =
            (-900..0).map(|v| (v, 40)).chain([(-1000, 500_000), (-960, 3)]).collect();
        assert_eq!(foot(&histogram(&edges), -1000), -904);
    }

    #[test]
    fn air_without_noise_is_its_one_value() {
        let still = histogram(&[(-1000, 500_000), (-995, 20)]);
        assert_eq!(peak(&still, AIR).expect("air").at, -1000);
        assert!(spread(&still, -1000) < f32::EPSILON);
    }
}
