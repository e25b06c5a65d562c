//! CT slice to binary mask (paper, section 2.1, Algorithm 1).

use std::ops::Range;

use ndarray::{Array3, ArrayView2, Axis, Slice};

use super::bitmap::{BLACK, Bitmap, WHITE};
use crate::geometry::Plane;
use crate::pipeline::parameters::Parameters;
use crate::pipeline::slices;

/// Sagittal slices that are masked together: as many voxels as a cache line holds.
const SAGITTAL_BLOCK: usize = 32;

/// White where `hu_min ≤ HU ≤ hu_max`.
#[must_use]
pub fn mask(slice: ArrayView2<'_, i16>, parameters: &Parameters) -> Bitmap {
    let (height, width) = slice.dim();
    let tissue = tissue(parameters);
    let mut mask = Bitmap::new(width, height);
    for (row, values) in slice.rows().into_iter().enumerate() {
        let pixels = mask.row_mut(row).iter_mut();
        match values.to_slice() {
            Some(values) => pixels.zip(values).for_each(|(pixel, &hu)| *pixel = tissue(hu)),
            None => pixels.zip(values).for_each(|(pixel, &hu)| *pixel = tissue(hu)),
        }
    }
    mask
}

/// How many slices of a plane are best masked together by [`masks`].
#[must_use]
pub(super) fn block(plane: Plane) -> usize {
    if plane == Plane::Sagittal { SAGITTAL_BLOCK } else { 1 }
}

/// The masks of the slices `indices` of a plane of the volume `V[[z, y, x]]`.
///
/// Neighbours of a sagittal slice's pixel lie far apart in memory, its neighbour slices' pixels
/// side by side; so a block of sagittal slices costs little more than one.
pub(super) fn masks(
    hu: &Array3<i16>,
    plane: Plane,
    indices: Range<usize>,
    parameters: &Parameters,
) -> Vec<Bitmap> {
    if plane == Plane::Sagittal {
        return sagittal(hu, indices, parameters);
    }
    let slices = indices.filter_map(|index| slices::view(hu, plane, index));
    slices.map(|slice| mask(slice, parameters)).collect()
}

fn sagittal(hu: &Array3<i16>, indices: Range<usize>, parameters: &Parameters) -> Vec<Bitmap> {
    let (height, width, _) = hu.dim();
    let tissue = tissue(parameters);
    let mut masks = vec![Bitmap::new(width, height); indices.len()];
    let mut block = Vec::with_capacity(width * indices.len());
    for (z, axial) in hu.axis_iter(Axis(0)).enumerate() {
        block.clear();
        for row in axial.slice_axis(Axis(1), Slice::from(indices.clone())).rows() {
            match row.to_slice() {
                Some(row) => block.extend(row.iter().map(|&hu| tissue(hu))),
                None => block.extend(row.iter().map(|&hu| tissue(hu))),
            }
        }
        for (column, mask) in masks.iter_mut().enumerate() {
            let pixels = block.iter().skip(column).step_by(indices.len());
            for (pixel, &value) in mask.row_mut(height - 1 - z).iter_mut().zip(pixels) {
                *pixel = value;
            }
        }
    }
    masks
}

fn tissue(parameters: &Parameters) -> impl Fn(i16) -> u8 + use<> {
    let bound = |hu: i32| i16::try_from(hu).unwrap_or(if hu < 0 { i16::MIN } else { i16::MAX });
    let (min, max) = (bound(parameters.hu_min), bound(parameters.hu_max));
    move |hu| if min <= hu && hu <= max { WHITE } else { BLACK }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tissue_is_white_from_hu_min_to_hu_max_inclusive() {
        let slice = ndarray::array![[-201_i16, -200, 0, 220, 221, i16::MIN, i16::MAX]];
        let mask = mask(slice.view(), &Parameters::paper());
        let white: Vec<bool> = (0..7).map(|column| mask.is_white(0, column)).collect();
        assert_eq!(white, [false, true, true, true, false, false, false]);
    }

    #[test]
    fn masks_made_together_are_those_made_alone() {
        let hu =
            Array3::from_shape_fn((5, 4, 70), |(z, y, x)| ((z * 31 + y * 17 + x * 7) % 600) as i16 - 300);
        let parameters = Parameters::paper();
        for plane in Plane::ALL {
            let count = slices::count([5, 4, 70], plane);
            let together: Vec<Bitmap> = (0..count)
                .step_by(block(plane))
                .flat_map(|start| masks(&hu, plane, start..(start + block(plane)).min(count), &parameters))
                .collect();
            let alone: Vec<Bitmap> = (0..count)
                .map(|index| mask(slices::view(&hu, plane, index).expect("a slice"), &parameters))
                .collect();
            assert_eq!(together, alone, "{plane:?}");
        }
    }
}
