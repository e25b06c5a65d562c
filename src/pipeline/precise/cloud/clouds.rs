//! The clouds of a skin: of all planes together, and of each alone.

use rayon::prelude::*;

use super::leaves::{Leaf, Rivals};
use super::order;
use super::point::SkinPoint;
use crate::geometry::{Plane, PlaneSet, Vec3};
use crate::pipeline::precise::border::crossing::Crossing;
use crate::pipeline::precise::confidence::agreement::{Agreement, Neighbourhood};
use crate::pipeline::precise::confidence::error::Confidence;
use crate::pipeline::precise::scan::edge_spread::EdgeSpread;
use crate::pipeline::precise::scan::sampler::Sampler;

/// The clouds that are made: of all planes, and of each.
const MERGED_AND_PLANES: [Option<Plane>; 4] =
    [None, Some(Plane::Axial), Some(Plane::Sagittal), Some(Plane::Coronal)];

/// The downsampled clouds.
pub(crate) struct Clouds {
    /// Of all planes.
    pub(crate) points: Vec<SkinPoint>,
    /// Of each plane alone.
    pub(crate) uniplanar: [Vec<SkinPoint>; 3],
    /// Crossings of each plane.
    pub(crate) measured: [u64; 3],
    /// Place and agreement of the points of the merged cloud.
    pub(crate) agreements: Vec<(Vec3, Agreement)>,
}

impl Clouds {
    /// One point for each leaf, of all crossings and of each plane's, with its error, in
    /// level-of-detail order.
    pub(crate) fn of(sampler: &Sampler, edge_spread: &EdgeSpread, all: &[Crossing], leaf: f64) -> Self {
        let is_of = |c: &Crossing, plane: Option<Plane>| plane.is_none_or(|plane| c.planes.contains(plane));
        let rivals = Rivals::of(sampler.asked(), all);
        let thinned = |plane: &Option<Plane>| {
            sampler.ask();
            rivals.thin(leaf, |c| is_of(c, *plane))
        };
        let thinned: Vec<Vec<Leaf>> = MERGED_AND_PLANES.par_iter().panic_fuse().map(thinned).collect();
        // Most crossings that stand for a leaf do so in several clouds.
        let of_all = thinned.iter().flatten().enumerate().inspect(|(number, _)| sampler.ask_at(*number));
        let mut chosen: Vec<u32> = of_all.map(|(_, leaf)| leaf.crossing).collect();
        chosen.par_sort_unstable_by(|a, b| {
            sampler.ask_at(*a as usize);
            a.cmp(b)
        });
        chosen.dedup_by(|a, b| {
            sampler.ask_at(*a as usize);
            a == b
        });
        sampler.ask();
        let neighbourhood = Neighbourhood::of(sampler.asked(), all);
        let confidence = Confidence::of(sampler, edge_spread);
        let stated: Vec<(Agreement, f64)> = chosen
            .par_iter()
            .panic_fuse()
            .map(|&i| {
                sampler.ask();
                let c = &all[i as usize];
                let agreement = neighbourhood.agreement(i as usize);
                (agreement, confidence.error(c, &agreement))
            })
            .collect();
        let state = |leaf: &Leaf| &stated[chosen.partition_point(|&i| i < leaf.crossing)];
        let cloud = |(leaves, plane): (&Vec<Leaf>, &Option<Plane>)| -> Vec<SkinPoint> {
            sampler.ask();
            let place = |(number, leaf): (usize, &Leaf)| {
                sampler.ask_at(number);
                all[leaf.crossing as usize].place
            };
            let places: Vec<Vec3> = leaves.iter().enumerate().map(place).collect();
            let point = |i: &u32| {
                sampler.ask_at(*i as usize);
                let leaf = &leaves[*i as usize];
                let planes = plane.map_or(leaf.planes, PlaneSet::from);
                let (agreement, error) = state(leaf);
                SkinPoint::of(&all[leaf.crossing as usize], agreement.normal, *error, planes)
            };
            let order = order::by_detail(sampler.asked(), &places, leaf);
            sampler.asked().free(places);
            order.par_iter().panic_fuse().map(point).collect()
        };
        let clouds: Vec<Vec<SkinPoint>> =
            thinned.par_iter().zip(&MERGED_AND_PLANES).panic_fuse().map(cloud).collect();
        let mut clouds = clouds.into_iter();
        let mut next = || clouds.next().unwrap_or_default();
        let agreement = |leaf: &Leaf| {
            sampler.ask_at(leaf.crossing as usize);
            (all[leaf.crossing as usize].place, state(leaf).0)
        };
        let in_planes = |(number, c): (usize, &Crossing)| {
            sampler.ask_at(number);
            Plane::ALL.map(|plane| u64::from(c.planes.contains(plane)))
        };
        let sum = |a: [u64; 3], b: [u64; 3]| std::array::from_fn(|i| a[i] + b[i]);
        let made = Self {
            points: next(),
            uniplanar: Plane::ALL.map(|_| next()),
            measured: all.par_iter().enumerate().panic_fuse().map(in_planes).reduce(|| [0; 3], sum),
            agreements: thinned[0].par_iter().panic_fuse().map(agreement).collect(),
        };
        sampler.asked().free(stated);
        neighbourhood.free(sampler.asked());
        rivals.free();
        made
    }
}
