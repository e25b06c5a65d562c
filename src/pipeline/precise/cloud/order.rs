//! Level-of-detail order: the first N points are a good coarse cloud, whatever N is.

use rayon::prelude::*;

use crate::geometry::Vec3;
use crate::observer::stop::Asked;

/// Coarsest level: cells of 2⁷ leaves.
const COARSEST: u32 = 7;

/// So many points at the head of the order are each as far as can be from all before.
const FARTHEST: usize = 1000;
/// They are chosen from the coarsest level with at least so many times as many points.
const CHOICE: usize = 4;

/// An order of the points that begins with [`FARTHEST`] ones, each as far from those before it as any
/// can be; after them each level of an octree, coarsest first, gets one point for each of its cells,
/// and within a level neighbours are spread over the whole cloud.
pub(crate) fn by_detail(asked: Asked<'_>, points: &[Vec3], leaf: f64) -> Vec<u32> {
    // Along a Morton curve the points of a cell of any level follow each other.
    let placed = |(i, p): (usize, &Vec3)| {
        asked.ask_at(i);
        (morton(*p, leaf), i as u32)
    };
    let mut curve: Vec<(u64, u32)> = points.par_iter().enumerate().panic_fuse().map(placed).collect();
    // As in `cubes`, the sorts ask at those whose turn it is by their number.
    curve.par_sort_unstable_by(|a, b| {
        asked.ask_at(a.1 as usize);
        a.cmp(b)
    });
    let mut level = vec![COARSEST + 1; points.len()];
    for (number, pair) in curve.windows(2).enumerate() {
        asked.ask_at(number);
        // The coarsest level on which a point begins a cell of its own.
        let differing = 64 - (pair[0].0 ^ pair[1].0).leading_zeros();
        level[pair[1].1 as usize] = differing.div_ceil(3).min(COARSEST + 1);
    }
    asked.free(curve);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let by_level = |&i: &u32| {
        asked.ask_at(i as usize);
        (u32::MAX - level[i as usize], spread(i), i)
    };
    order.par_sort_unstable_by_key(by_level);
    let enough = (0..=COARSEST + 1).rev().find_map(|least| {
        let n = order.partition_point(|&i| level[i as usize] >= least);
        (n >= CHOICE * FARTHEST).then_some(n)
    });
    let choice = enough.unwrap_or(order.len());
    farthest_first(asked, points, &mut order[..choice]);
    let head = FARTHEST.min(choice);
    order[head..choice].par_sort_unstable_by_key(by_level);
    order
}

/// Puts [`FARTHEST`] points first, each of which is as far from those before it as any is.
fn farthest_first(asked: Asked<'_>, points: &[Vec3], order: &mut [u32]) {
    let place: Vec<[f32; 3]> = order.iter().map(|&i| points[i as usize].map(|v| v as f32)).collect();
    let mut rest: Vec<u32> = (0..order.len() as u32).collect();
    let mut squared = vec![f32::MAX; order.len()];
    let mut chosen = Vec::with_capacity(FARTHEST);
    let mut next = 0;
    while chosen.len() < FARTHEST && !rest.is_empty() {
        asked.ask();
        let last = rest.swap_remove(next);
        chosen.push(last);
        let [x, y, z] = place[last as usize];
        let mut most = -1.0;
        for (k, &i) in rest.iter().enumerate() {
            let p = place[i as usize];
            let d = (p[0] - x).powi(2) + (p[1] - y).powi(2) + (p[2] - z).powi(2);
            let nearest = &mut squared[i as usize];
            *nearest = nearest.min(d);
            if *nearest > most {
                (most, next) = (*nearest, k);
            }
        }
    }
    let ordered: Vec<u32> = chosen.into_iter().chain(rest).map(|i| order[i as usize]).collect();
    order.copy_from_slice(&ordered);
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
        let order = by_detail(Asked::default(), &points, 1.0);
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
    fn the_first_points_lie_as_far_apart_as_they_can() {
        // 10 000 points on a square of 100: n spots at best lie about 100 / √n apart.
        let points: Vec<Vec3> = (0..10_000).map(|i| [f64::from(i % 100), f64::from(i / 100), 0.0]).collect();
        let order = by_detail(Asked::default(), &points, 1.0);
        for n in [10_usize, 50, 200, 1000] {
            let first: Vec<Vec3> = order[..n].iter().map(|&i| points[i as usize]).collect();
            let apart = |a: &Vec3, b: &Vec3| (a[0] - b[0]).hypot(a[1] - b[1]);
            let least =
                (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| apart(&first[i], &first[j]));
            let least = least.fold(f64::MAX, f64::min);
            let best = 100.0 / (n as f64).sqrt();
            assert!(least > 0.6 * best, "two of the first {n} lie {least} apart");
        }
    }

    #[test]
    fn each_level_has_one_point_for_each_of_its_cells() {
        let points: Vec<Vec3> =
            (0..40_000).map(|i| [f64::from(i % 200) - 100.0, f64::from(i / 200), 0.5]).collect();
        let order = by_detail(Asked::default(), &points, 1.0);
        for edge in [4.0_f64, 2.0] {
            let cell = |i: u32| points[i as usize].map(|v| (v / edge).floor() as i64);
            let mut cells: Vec<_> = (0..40_000).map(cell).collect();
            cells.sort_unstable();
            cells.dedup();
            let mut first: Vec<_> = order[..cells.len() + FARTHEST].iter().map(|&i| cell(i)).collect();
            first.sort_unstable();
            first.dedup();
            assert_eq!(first, cells, "cells of {edge}");
        }
    }
}
