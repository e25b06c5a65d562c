//! Level-of-detail order: the first N points are a good coarse cloud, whatever N is.

use rayon::prelude::*;

use crate::geometry::Vec3;

/// Coarsest level: cells of 2⁷ leaves.
const COARSEST: u32 = 7;

/// An order of the points in which each level of an octree, coarsest first, gets one point for
/// each of its cells; within a level neighbours are spread over the whole cloud.
pub(super) fn by_detail(points: &[Vec3], leaf: f64) -> Vec<u32> {
    // Along a Morton curve the points of a cell of any level follow each other.
    let mut curve: Vec<(u64, u32)> =
        points.par_iter().enumerate().map(|(i, p)| (morton(*p, leaf), i as u32)).collect();
    curve.par_sort_unstable();
    let mut level = vec![COARSEST + 1; points.len()];
    for pair in curve.windows(2) {
        // The coarsest level on which a point begins a cell of its own.
        let differing = 64 - (pair[0].0 ^ pair[1].0).leading_zeros();
        level[pair[1].1 as usize] = differing.div_ceil(3).min(COARSEST + 1);
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (u32::MAX - level[i as usize], spread(i), i));
    order
}

/// The bits of the leaf's index along x, y and z in turn.
fn morton(p: Vec3, leaf: f64) -> u64 {
    let cell = |v: f64| ((v / leaf).floor() as i64 + (1 << 20)) as u64 & 0x1F_FFFF;
    let apart = |v: u64| {
        let v = (v | v << 32) & 0x001F_0000_0000_FFFF;
        let v = (v | v << 16) & 0x001F_0000_FF00_00FF;
        let v = (v | v << 8) & 0x100F_00F0_0F00_F00F;
        let v = (v | v << 4) & 0x10C3_0C30_C30C_30C3;
        (v | v << 2) & 0x1249_2492_4924_9249
    };
    apart(cell(p[0])) | apart(cell(p[1])) << 1 | apart(cell(p[2])) << 2
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

    #[test]
    fn each_level_has_one_point_for_each_of_its_cells() {
        let points: Vec<Vec3> =
            (0..900).map(|i| [f64::from(i % 30) - 15.0, f64::from(i / 30), 0.5]).collect();
        let order = by_detail(&points, 1.0);
        for edge in [8.0_f64, 4.0, 2.0] {
            let cell = |i: u32| points[i as usize].map(|v| (v / edge).floor() as i64);
            let mut cells: Vec<_> = (0..900).map(cell).collect();
            cells.sort_unstable();
            cells.dedup();
            let mut first: Vec<_> = order[..cells.len()].iter().map(|&i| cell(i)).collect();
            first.sort_unstable();
            first.dedup();
            assert_eq!(first, cells, "cells of {edge}");
        }
    }
}
