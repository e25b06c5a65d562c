//! The ends of the stack: slices that hold nothing were added to the scan. Read as air, they would make
//! skin of where it cuts the patient.

use std::f64::consts::TAU;
use std::ops::Range;

use ndarray::{Array3, ArrayView3, Axis, CowArray, Ix3, Slice};

use super::levels::Levels;
use super::sampler::{Sampler, along_coarsest};
use crate::dicom::Volume;
use crate::geometry::Grid;
use crate::observer::Observer;
use crate::observer::stop::Asked;
use crate::pipeline::precise::no_skin::NoSkin;

/// A vertex is rounder than a ball of this radius, mm: a slice next to an empty one that shows more tissue
/// than such a ball's cap between the two cuts the patient.
const FLATTEST_MM: f64 = 250.0;

/// The slices of a volume that hold something, along its coarsest axis.
///
/// # Errors
/// [`NoSkin::NoVolume`], [`NoSkin::NoLevels`].
pub(crate) fn without_empty_ends<'a>(
    volume: &'a Volume,
    observer: &dyn Observer,
) -> Result<Slices<'a>, NoSkin> {
    let grid = along_coarsest(&volume.grid);
    let all = 0..grid.slice_origins().len();
    let asked = Asked::of(observer);
    let whole = part(asked, volume, &grid, all.clone());
    let held = {
        let sampler = whole.sampler(observer).ok_or(NoSkin::NoVolume)?;
        let levels = Levels::of(&sampler).ok_or(NoSkin::NoLevels)?;
        held(&sampler, &levels)
    };
    Ok(if held == all { whole } else { part(asked, volume, &grid, held) })
}

/// The slices of the scan without those at an end that one value fills: all of them if air has no such
/// value, else those beside one that cuts the patient.
fn held(sampler: &Sampler, levels: &Levels) -> Range<usize> {
    let all = 0..sampler.shape[sampler.slice_axis()];
    let is_held = |slice: &usize| value(sampler, *slice).is_none();
    let (Some(first), Some(last)) = (all.clone().find(is_held), all.clone().rfind(is_held)) else {
        return all;
    };
    let gaps = sampler.gaps();
    let is_cut = |slice: usize, gap: usize| {
        let tissue = voxels(sampler, slice).filter(|&v| f32::from(v) >= levels.upper()).count();
        tissue as f64 * sampler.pixel_mm2() > TAU * FLATTEST_MM * gaps[gap]
    };
    let is_air = |slice: usize| value(sampler, slice).is_some_and(|v| levels.is_still_air(f32::from(v)));
    let start = if first > 0 && (!is_air(first - 1) || is_cut(first, first - 1)) { first } else { 0 };
    let end =
        if last + 1 < all.end && (!is_air(last + 1) || is_cut(last, last)) { last + 1 } else { all.end };
    start..end
}

/// The one value of a slice that holds no other.
fn value(sampler: &Sampler, slice: usize) -> Option<i16> {
    sampler.ask();
    let mut voxels = voxels(sampler, slice);
    let first = voxels.next()?;
    voxels.all(|v| v == first).then_some(first)
}

/// Some of the slices of a volume.
pub(crate) struct Slices<'a> {
    hu: CowArray<'a, i16, Ix3>,
    grid: Grid,
    /// The first of them in the volume, along the axis of the grid.
    pub(crate) first: usize,
}

/// The slices that are `held`, along the axis of a grid of the volume.
fn part<'a>(asked: Asked<'_>, volume: &'a Volume, grid: &Grid, held: Range<usize>) -> Slices<'a> {
    let mut shape = grid.shape();
    shape[grid.slice_axis() as usize] = held.len();
    let hu = volume.hu.slice_axis(Axis(grid.slice_axis() as usize), Slice::from(held.clone()));
    // Axial slices follow each other; others are copied.
    let hu = if hu.is_standard_layout() { hu.into() } else { copied(asked, hu).into() };
    let first = held.start;
    let origins = grid.slice_origins()[held].to_vec();
    Slices { hu, first, grid: Grid::new(grid.slice_axis(), origins, *grid.step(), shape) }
}

/// A copy, row after row.
fn copied(asked: Asked<'_>, hu: ArrayView3<'_, i16>) -> Array3<i16> {
    let mut voxels = Vec::with_capacity(hu.len());
    for (number, row) in hu.rows().into_iter().enumerate() {
        asked.ask_at(number);
        match row.as_slice() {
            Some(row) => voxels.extend_from_slice(row),
            None => voxels.extend(row),
        }
    }
    Array3::from_shape_vec(hu.dim(), voxels).expect("as many voxels as its shape has")
}

impl Slices<'_> {
    /// `None` where it is too small to hold a surface.
    pub(crate) fn sampler<'a>(&'a self, observer: &'a dyn Observer) -> Option<Sampler<'a>> {
        Some(Sampler::new(self.hu.as_slice()?, &self.grid)?.asking(observer))
    }
}

/// The voxels of a slice.
fn voxels<'a>(sampler: &'a Sampler, slice: usize) -> impl Iterator<Item = i16> + 'a {
    let [slow, fast] = [[1, 2], [0, 2], [0, 1]][sampler.slice_axis()];
    let first = slice * sampler.stride(sampler.slice_axis());
    let rows = (0..sampler.shape[slow]).map(move |i| first + i * sampler.stride(slow));
    rows.flat_map(move |row| {
        (0..sampler.shape[fast]).map(move |i| sampler.hu[row + i * sampler.stride(fast)])
    })
}
