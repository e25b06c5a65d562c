//! Instances → volume → clouds and report.

use super::{Failure, Product, Report, pictures};
use crate::cloud::{self, Format, Metadata, PointCloud};
use crate::dicom::Volume;
use crate::dicom::series::{self, ReadLimits, Warning};
use crate::dicom::source::InstanceSource;
use crate::geometry::{Frame, Plane};
use crate::observer::stop::{Asked, unless_stopped};
use crate::observer::{Observer, Stage};
use crate::pipeline::{self, Parameters, PipelineError, Reconstruction};

/// Reconstructs the instances of one series.
///
/// The same instances and parameters give the same bytes, on any number of threads.
///
/// # Errors
/// [`Failure`], with the report where the pipeline got far enough to have one.
pub fn run(
    source: &dyn InstanceSource,
    parameters: &Parameters,
    limits: &ReadLimits,
    observer: &dyn Observer,
) -> Result<Product, Failure> {
    reconstructed(source, parameters, limits, observer, false)
}

/// The same, with what the pictures of its slices are drawn from.
///
/// # Errors
/// As [`run`].
pub fn run_with_pictures(
    source: &dyn InstanceSource,
    parameters: &Parameters,
    limits: &ReadLimits,
    observer: &dyn Observer,
) -> Result<Product, Failure> {
    reconstructed(source, parameters, limits, observer, true)
}

fn reconstructed(
    source: &dyn InstanceSource,
    parameters: &Parameters,
    limits: &ReadLimits,
    observer: &dyn Observer,
    with_pictures: bool,
) -> Result<Product, Failure> {
    // Given back when the result is made.
    let mut memory = limits.memory.share();
    let pictures_bytes = if with_pictures { pictures::MOST_BYTES as u64 } else { 0 };
    let mut admit = |voxels: u64| {
        let bytes = voxels.saturating_mul(parameters.profile.bytes_a_voxel());
        memory.grow(bytes.saturating_add(pictures_bytes)).map(|()| memory.bytes())
    };
    let (volume, warnings) =
        series::read_admitted(source, limits, observer, &mut admit).map_err(Failure::from_series)?;
    let reconstruction = pipeline::reconstruct(&volume, parameters, observer)
        .map_err(|error| from_pipeline(error, &volume, parameters, &warnings, with_pictures))?;
    observer.progress(Stage::Writing, 0.0);
    let asked = Asked::of(observer);
    let made = || {
        let product = product(asked, &volume, parameters, &reconstruction, warnings, with_pictures);
        reconstruction.free(asked);
        asked.free(volume.hu.into_raw_vec_and_offset().0);
        product
    };
    unless_stopped(made).map_err(|_stopped| Failure::cancelled())
}

/// What is stored of a reconstruction.
fn product(
    asked: Asked<'_>,
    volume: &Volume,
    parameters: &Parameters,
    reconstruction: &Reconstruction,
    warnings: Vec<Warning>,
    with_pictures: bool,
) -> Product {
    let pictures = drawn_from(asked, volume, reconstruction, with_pictures);
    asked.ask();
    let report = Report {
        quality: reconstruction.quality.clone(),
        warnings,
        ..Report::new(volume, parameters, &reconstruction.figures, &reconstruction.slices)
    };
    let stored = |plane: Option<Plane>, cloud: &PointCloud| {
        let metadata = metadata(volume, parameters, plane);
        let encoded = cloud::encode_asking(cloud, &metadata, Format::PlyBinary, Frame::Lps, |vertex| {
            asked.ask_at(vertex);
        });
        (plane, encoded)
    };
    let [axial, sagittal, coronal] = &reconstruction.uniplanar;
    let clouds = [
        stored(None, &reconstruction.triplanar),
        stored(Some(Plane::Axial), axial),
        stored(Some(Plane::Sagittal), sagittal),
        stored(Some(Plane::Coronal), coronal),
    ];
    Product { clouds, report, pictures }
}

/// What pictures are drawn from. Nothing is written but to memory: there is nothing to fail.
fn drawn_from(
    asked: Asked<'_>,
    volume: &Volume,
    reconstruction: &Reconstruction,
    wanted: bool,
) -> Option<Vec<u8>> {
    wanted.then(|| pictures::write(asked, volume, reconstruction).expect("memory can be written"))
}

fn metadata(volume: &Volume, parameters: &Parameters, plane: Option<Plane>) -> Metadata {
    Metadata {
        series_instance_uid: volume.identity.series_instance_uid.clone(),
        frame_of_reference_uid: volume.identity.frame_of_reference_uid.clone(),
        plane,
        max_error_mm: None,
        software: crate::SOFTWARE.to_owned(),
        parameters_json: serde_json::to_string(parameters).expect("parameters are plain numbers and names"),
    }
}

fn from_pipeline(
    error: PipelineError,
    volume: &Volume,
    parameters: &Parameters,
    warnings: &[Warning],
    with_pictures: bool,
) -> Failure {
    let (code, detail) = (error.code(), error.to_string());
    match error {
        PipelineError::Cancelled => Failure::cancelled(),
        PipelineError::TooCostly { .. } => Failure::lasting(code, detail),
        PipelineError::EmptyCloud { partial, .. } | PipelineError::NoSkin { partial, .. } => {
            let report = Report {
                quality: partial.quality.clone(),
                warnings: warnings.to_vec(),
                ..Report::new(volume, parameters, &partial.figures, &partial.slices)
            };
            let pictures = drawn_from(Asked::default(), volume, &partial, with_pictures);
            Failure { pictures, ..Failure::without_cloud(code, detail, report) }
        }
    }
}
