//! Level-of-detail order: the first N points are a good coarse cloud, whatever N is.

use std::collections::HashSet;

use crate::geometry::Vec3;

/// Coarsest level, in leaves.
const COARSEST: u32 = 7;

/// An order of the points in which each level of an octree, coarsest first, gets one point for
/// each of its cells; within a level neighbours are spread over the whole cloud.
#[expect(clippy::cast_possible_truncation)]
pub(super) fn by_detail(points: &[Vec3], leaf: f64) -> Vec<u32> {
    let mut level = vec![0u32; points.len()];
    for step in (0..=COARSEST).rev() {
        let edge = leaf * f64::from(1u32 << step);
        let mut taken: HashSet<[i32; 3]> = HashSet::new();
        let cell = |p: Vec3| p.map(|v| (v / edge).floor() as i32);
        for (p, _) in points.iter().zip(&level).filter(|(_, l)| **l > step) {
            taken.insert(cell(*p));
        }
        for (p, l) in points.iter().zip(&mut level) {
            if *l == 0 && taken.insert(cell(*p)) {
                *l = step + 1;
            }
        }
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_by_key(|&i| (u32::MAX - level[i as usize], spread(i), i));
    order
}

/// A fixed permutation-like mixing of an index (the finaliser of `SplitMix64`).
fn spread(i: u32) -> u64 {
    let z = (u64::from(i) + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_points_are_spread_over_the_whole_cloud() {
        let points: Vec<Vec3> = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0]).collect();
        let order = by_detail(&points, 1.0);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..400).collect::<Vec<u32>>(), "every point once");
        let first: Vec<Vec3> = order[..40].iter().map(|&i| points[i as usize]).collect();
        for p in &points {
            let near = first.iter().any(|q| (p[0] - q[0]).hypot(p[1] - q[1]) < 6.0);
            assert!(near, "none of the first 40 lies near {p:?}");
        }
    }
}
