//! One Enhanced CT Image instance with a frame for each slice (PS3.3 A.38): what is the same for
//! all frames in the shared functional groups, position and number in each frame's own (C.7.6.16).

use dicom_core::VR;
use dicom_dictionary_std::{tags, uids as dictionary};
use ndarray::Array3;

use super::super::{Options, uids};
use super::attributes::{Attributes, append_stored, common};
use super::layout::Layout;
use super::{INTERCEPT, in_order};
use crate::dicom::uid::SopInstanceUid;
use crate::geometry::{Grid, norm};

pub(in crate::phantom) fn multi_frame(
    options: &Options,
    grid: &Grid,
    voxels: &Array3<i16>,
) -> (SopInstanceUid, Vec<u8>) {
    let layout = Layout::new(options, grid);
    let order = in_order(options, grid.slice_origins().len());
    let (rows, columns) = layout.size();
    let mut words = Vec::with_capacity(voxels.len());
    for &index in &order {
        append_stored(&mut words, layout.image(&voxels.view(), index));
    }
    let frames = order.iter().enumerate().map(|(number, &index)| own_groups(&layout, index, number + 1));
    let uid = uids::multi_frame(options);
    let bytes = common(options, rows, columns)
        .text(tags::IMAGE_TYPE, VR::CS, "ORIGINAL\\PRIMARY\\VOLUME\\NONE")
        .text(tags::INSTANCE_NUMBER, VR::IS, "1")
        .text(tags::CONTENT_DATE, VR::DA, "20250101")
        .text(tags::CONTENT_TIME, VR::TM, "120000")
        .text(tags::NUMBER_OF_FRAMES, VR::IS, order.len().to_string())
        .items(tags::DIMENSION_ORGANIZATION_SEQUENCE, [])
        .items(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, [shared_groups(&layout)])
        .items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE, frames)
        .pixels(words)
        .into_file(dictionary::ENHANCED_CT_IMAGE_STORAGE, &uid);
    (uid, bytes)
}

/// Frame type, pixel measures, orientation and rescale (PS3.3 C.8.15.3.1, C.7.6.16.2.1, .2.4, .2.9).
fn shared_groups(layout: &Layout<'_>) -> Attributes {
    let frame_type = Attributes::default().text(tags::FRAME_TYPE, VR::CS, "ORIGINAL\\PRIMARY\\VOLUME\\NONE");
    let measures = Attributes::default()
        .decimals(tags::PIXEL_SPACING, &layout.pixel_spacing())
        .decimals(tags::SLICE_THICKNESS, &[norm(layout.slice_step())]);
    let orientation = Attributes::default().decimals(tags::IMAGE_ORIENTATION_PATIENT, &layout.orientation());
    let rescale = Attributes::default()
        .text(tags::RESCALE_INTERCEPT, VR::DS, INTERCEPT.to_string())
        .text(tags::RESCALE_SLOPE, VR::DS, "1")
        .text(tags::RESCALE_TYPE, VR::LO, "HU");
    Attributes::default()
        .items(tags::CT_IMAGE_FRAME_TYPE_SEQUENCE, [frame_type])
        .items(tags::PIXEL_MEASURES_SEQUENCE, [measures])
        .items(tags::PLANE_ORIENTATION_SEQUENCE, [orientation])
        .items(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE, [rescale])
}

/// Number and position of a frame (PS3.3 C.7.6.16.2.2, .2.3).
fn own_groups(layout: &Layout<'_>, index: usize, number: usize) -> Attributes {
    let content = Attributes::default()
        .text(tags::STACK_ID, VR::SH, "1")
        .long(tags::IN_STACK_POSITION_NUMBER, &[number])
        .long(tags::DIMENSION_INDEX_VALUES, &[1, number]);
    let position = Attributes::default().decimals(tags::IMAGE_POSITION_PATIENT, &layout.position(index));
    Attributes::default()
        .items(tags::FRAME_CONTENT_SEQUENCE, [content])
        .items(tags::PLANE_POSITION_SEQUENCE, [position])
}
