//! One CT Image instance for each slice (PS3.3 A.3).

use dicom_core::VR;
use dicom_dictionary_std::{tags, uids as dictionary};
use ndarray::Array3;
use rayon::prelude::*;

use super::super::{Options, uids};
use super::attributes::{append_stored, common};
use super::layout::Layout;
use super::{INTERCEPT, in_order};
use crate::dicom::uid::SopInstanceUid;
use crate::geometry::{Grid, norm};

pub(in crate::phantom) fn single_frames(
    options: &Options,
    grid: &Grid,
    voxels: &Array3<i16>,
) -> Vec<(SopInstanceUid, Vec<u8>)> {
    let layout = Layout::new(options, grid);
    let order = in_order(options, grid.slice_origins().len());
    order
        .par_iter()
        .enumerate()
        .map(|(number, &index)| {
            let uid = uids::single_frame(options, index);
            let bytes = file(options, &layout, voxels, index, number + 1, &uid);
            (uid, bytes)
        })
        .collect()
}

fn file(
    options: &Options,
    layout: &Layout<'_>,
    voxels: &Array3<i16>,
    index: usize,
    number: usize,
    uid: &SopInstanceUid,
) -> Vec<u8> {
    let (rows, columns) = layout.size();
    let mut words = Vec::with_capacity(rows * columns);
    append_stored(&mut words, layout.image(&voxels.view(), index));
    common(options, rows, columns)
        .text(tags::IMAGE_TYPE, VR::CS, "ORIGINAL\\PRIMARY\\AXIAL")
        .text(tags::INSTANCE_NUMBER, VR::IS, number.to_string())
        .text(tags::KVP, VR::DS, "120")
        .text(tags::CONVOLUTION_KERNEL, VR::SH, "SOFT")
        .decimals(tags::GANTRY_DETECTOR_TILT, &[options.tilt_deg])
        .decimals(tags::SLICE_THICKNESS, &[norm(layout.slice_step())])
        .decimals(tags::IMAGE_POSITION_PATIENT, &layout.position(index))
        .decimals(tags::IMAGE_ORIENTATION_PATIENT, &layout.orientation())
        .decimals(tags::PIXEL_SPACING, &layout.pixel_spacing())
        .text(tags::WINDOW_CENTER, VR::DS, "40")
        .text(tags::WINDOW_WIDTH, VR::DS, "400")
        .text(tags::RESCALE_INTERCEPT, VR::DS, INTERCEPT.to_string())
        .text(tags::RESCALE_SLOPE, VR::DS, "1")
        .text(tags::RESCALE_TYPE, VR::LO, "HU")
        .pixels(words)
        .into_file(dictionary::CT_IMAGE_STORAGE, uid)
}
