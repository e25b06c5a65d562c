//! Where an edge is on a grid line: the place where HU crosses half-way from air to tissue.
//!
//! A scanner shows a step as the step blurred by its point spread. In units of the probit of the
//! HU between the two levels such an edge is a straight line, so a few voxels on both sides tell
//! its place to a small part of a voxel; where the voxels are wider than the edge, its known width
//! takes the place of the second voxel.

/// The inverse of the normal distribution's cumulative function (Acklam's rational
/// approximation, relative error 1.2e-9).
pub(crate) fn probit(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const B: [f64; 5] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
    ];
    const C: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const D: [f64; 4] =
        [7.784_695_709_041_462e-3, 3.224_671_290_700_398e-1, 2.445_134_137_142_996, 3.754_408_661_907_416];
    let horner = |c: &[f64], x: f64| c.iter().fold(0.0, |sum, &k| sum * x + k);
    if p < 0.02425 {
        let q = (-2.0 * p.ln()).sqrt();
        horner(&C, q) / (horner(&D, q) * q + 1.0)
    } else if p > 1.0 - 0.02425 {
        -probit(1.0 - p)
    } else {
        let q = p - 0.5;
        let r = q * q;
        horner(&A, r) * q / (horner(&B, r) * r + 1.0)
    }
}

/// The share of a blurred step that lies beyond a number of standard deviations (Zelen and
/// Severo's approximation, to 1e-5).
pub(crate) fn upper_tail(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.33267 * x);
    (-0.5 * x * x).exp() * 0.398_942_3 * t * (0.436_183_6 + t * (-0.120_167_6 + t * 0.937_298))
}

/// Voxels on a line across an edge, from tissue to air, one voxel apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Profile {
    /// Share of tissue: 1 at the tissue's level, 0 at the air's. Position of entry i is
    /// i − 2: entries 2 and 3 lie on either side of the edge.
    pub(crate) shares: [f64; 6],
    /// Expected slope in probits per voxel.
    pub(crate) slope: f64,
    /// Standard deviation of a share.
    pub(crate) noise: f64,
    /// Lower shares tell nothing: the air was clipped.
    pub(crate) least_share: Option<f64>,
}

/// Where the edge is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Edge {
    /// In voxels from entry 2 of the profile, toward the air.
    pub(crate) place: f64,
    /// Expected standard deviation of `place` from noise and from the width that is not known,
    /// in voxels.
    pub(crate) deviation: f64,
}

/// How well the expected width is known, as a share of it.
const WIDTH_UNCERTAINTY: f64 = 0.25;
/// How far an edge strays from the model, in probits.
const MODEL: f64 = 0.06;

/// Weighted fit of a line to the probits of the shares, with the expected slope as one more
/// observation: first of the two voxels on either side, then of their neighbours too as far as
/// the edge reaches them (beyond it they show the next layer, fat or foam).
pub(crate) fn fit(profile: &Profile) -> Edge {
    let first = fit_of(profile, |_| false);
    if (first.place - 0.5).abs() > 1.5 {
        return first;
    }
    fit_of(profile, |x| ((x - first.place) * profile.slope).abs() < REACH)
}

/// How far from its middle the edge is looked at, in probits.
const REACH: f64 = 1.5;

fn fit_of(profile: &Profile, reached: impl Fn(f64) -> bool) -> Edge {
    let mut sums = [0.0; 5];
    for (i, &share) in profile.shares.iter().enumerate() {
        let x = i as f64 - 2.0;
        if i != 2 && i != 3 && !reached(x) || profile.least_share.is_some_and(|least| share < least) {
            continue;
        }
        let u = probit(share.clamp(0.004, 0.996));
        let density = (-0.5 * u * u).exp() * 0.398_942_280_401_432_7;
        let sigma = profile.noise / density + MODEL * (1.0 + u * u * u * u);
        let w = 1.0 / (sigma * sigma);
        sums[0] += w;
        sums[1] += w * x;
        sums[2] += w * x * x;
        sums[3] += w * u;
        sums[4] += w * u * x;
    }
    // u = a − k·x, with k expected to be the slope.
    let [sw, sx, sxx, su, sux] = sums;
    let prior = 1.0 / (WIDTH_UNCERTAINTY * profile.slope).powi(2);
    let (m00, m01, m11) = (sw, -sx, sxx + prior);
    let (r0, r1) = (su, -sux + prior * profile.slope);
    let det = m00 * m11 - m01 * m01;
    let a = (r0 * m11 - r1 * m01) / det;
    let k = ((m00 * r1 - m01 * r0) / det).max(0.2 * profile.slope);
    let place = a / k;
    let (v00, v01, v11) = (m11 / det, -m01 / det, m00 / det);
    let variance = (v00 - 2.0 * place * v01 + place * place * v11) / (k * k);
    Edge { place, deviation: variance.max(0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// P(Z < x), by the trapezoid rule.
    fn normal(x: f64) -> f64 {
        let steps = 4000;
        let h = (x + 8.0) / f64::from(steps);
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        (0..steps)
            .map(|i| {
                let a = -8.0 + f64::from(i) * h;
                0.5 * h * (density(a) + density(a + h))
            })
            .sum()
    }

    /// Tables of the normal distribution.
    #[test]
    fn probit_inverts_the_normal_distribution() {
        for (p, x) in [(0.5, 0.0), (0.841_344_746, 1.0), (0.022_750_132, -2.0), (0.975, 1.959_963_985)] {
            assert!((probit(p) - x).abs() < 1e-6, "probit({p}) is {}, not {x}", probit(p));
        }
    }

    #[test]
    fn a_blurred_step_is_found_whatever_its_place_and_width() {
        for voxels_per_sigma in [0.5, 1.0, 2.0] {
            for place in [0.05, 0.3, 0.5, 0.8, 0.95] {
                let shares = std::array::from_fn(|i| {
                    let x = i as f64 - 2.0;
                    normal((place - x) * voxels_per_sigma)
                });
                let found = fit(&Profile { shares, slope: voxels_per_sigma, noise: 0.01, least_share: None });
                let error = (found.place - place).abs();
                assert!(error < 0.01, "edge at {place} found {error} voxels away at {voxels_per_sigma}");
            }
        }
    }
}
