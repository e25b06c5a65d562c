//! `triplanar phantom`.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{Failed, output, values};
use crate::cloud::{Format, Metadata, PointCloud, encode};
use crate::dicom::SeriesIdentity;
use crate::geometry::{Frame, Plane, PlaneSet};
use crate::phantom::{Acquisition, Options, Order, PatientPosition, Phantom};

/// Write a synthetic head CT series whose skin is known exactly
///
/// Beside DIR go DIR.json (the options and the scanned region) and DIR.skin.npy (points of the true
/// skin, LPS mm).
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Where the DICOM files go; must be empty or not exist
    dir: PathBuf,
    /// Which head
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rows and columns; the published thresholds are made for 512
    #[arg(long, default_value_t = 512)]
    matrix: usize,
    /// Distance of pixels, mm
    #[arg(long, default_value_t = 0.45)]
    pixel: f64,
    /// Distance of rows, mm, if it differs
    #[arg(long, value_name = "MM")]
    row: Option<f64>,
    /// Number of axial slices
    #[arg(long, default_value_t = 145)]
    slices: usize,
    /// Distance of axial slices, mm
    #[arg(long, default_value_t = 1.25)]
    step: f64,
    /// Standard deviation of the noise, HU
    #[arg(long, default_value_t = 8.0)]
    noise: f64,
    /// Standard deviation of the blur, mm
    #[arg(long, default_value_t = 0.5)]
    blur: f64,
    /// Nod, degrees; positive lifts the chin
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pitch: f64,
    /// Lean, degrees; positive to the left shoulder
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    roll: f64,
    /// Turn, degrees; positive to the left
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    yaw: f64,
    /// Gantry tilt, degrees
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    tilt: f64,
    /// Leave the head holder out
    #[arg(long)]
    no_holder: bool,
    /// Put a couch top below
    #[arg(long)]
    couch: bool,
    /// Plane of the images
    #[arg(long, value_parser = values::plane(), default_value = "axial")]
    plane: Plane,
    /// How the patient lies
    #[arg(long, value_enum, default_value = "hfs")]
    position: PatientPosition,
    /// Order of the images along the patient's axis
    #[arg(long, value_enum, default_value = "ascending")]
    order: Order,
    /// One Enhanced CT file instead of one file a slice
    #[arg(long)]
    enhanced: bool,
}

impl Args {
    fn options(&self) -> Options {
        Options {
            seed: self.seed,
            columns: self.matrix,
            rows: self.matrix,
            column_mm: self.pixel,
            row_mm: self.row.unwrap_or(self.pixel),
            slices: self.slices,
            slice_mm: self.step,
            noise_hu: self.noise,
            blur_mm: self.blur,
            pitch_deg: self.pitch,
            roll_deg: self.roll,
            yaw_deg: self.yaw,
            tilt_deg: self.tilt,
            holder: !self.no_holder,
            couch: self.couch,
            acquisition: Acquisition { plane: self.plane, position: self.position, order: self.order },
            ..Options::default()
        }
    }
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let phantom = Phantom::new(args.options()).map_err(Failed::usage)?;
    let dir = args.dir.as_path();
    let is_taken = std::fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_some());
    if is_taken {
        return Err(Failed::usage(format!("{} is not empty", dir.display())));
    }
    std::fs::create_dir_all(dir).map_err(|error| unwritable(dir, &error))?;
    let [case_path, skin_path] = [beside(dir, "json"), beside(dir, "skin.npy")];
    for path in [&dir.join("probe"), &case_path, &skin_path] {
        output::check(path)?;
    }
    let files = write_images(&phantom, dir, args.enhanced).map_err(|error| unwritable(dir, &error))?;
    let identity = phantom.identity();
    let skin = skin_npy(&phantom, &identity);
    output::write(&case_path, &case(&phantom, &identity))?;
    output::write(&skin_path, &skin)?;
    output::print(format_args!(
        "series       {}\nimages       {files} in {}\ntrue skin    {}\n",
        identity.series_instance_uid,
        dir.display(),
        skin_path.display()
    ))
}

fn unwritable(dir: &Path, error: &std::io::Error) -> Failed {
    Failed::internal(format!("{} can't be written: {error}", dir.display()))
}

fn write_images(phantom: &Phantom, dir: &Path, enhanced: bool) -> std::io::Result<usize> {
    if !enhanced {
        return Ok(phantom.write_series(dir)?.len());
    }
    std::fs::write(dir.join("ENHANCED.dcm"), phantom.enhanced_instance().1)?;
    Ok(1)
}

/// `DIR.extension`, whatever dots DIR has. A DIR that ends in `.` or `..` is called what it is.
fn beside(dir: &Path, extension: &str) -> PathBuf {
    let dir = match dir.file_name() {
        Some(_) => dir.to_owned(),
        None => dir.canonicalize().unwrap_or_else(|_| dir.to_owned()),
    };
    let mut name = dir.components().as_path().as_os_str().to_owned();
    name.push(".");
    name.push(extension);
    name.into()
}

/// The options and the corners of the scan.
#[derive(Serialize)]
struct Case<'a> {
    options: &'a Options,
    series_instance_uid: String,
    /// LPS mm of the voxels at both ends of the volume's diagonal.
    corners_mm: [[f64; 3]; 2],
    software: &'static str,
}

fn case(phantom: &Phantom, identity: &SeriesIdentity) -> Vec<u8> {
    let grid = phantom.grid();
    let case = Case {
        options: phantom.options(),
        series_instance_uid: identity.series_instance_uid.to_string(),
        corners_mm: [grid.lps([0; 3]), grid.lps(grid.shape().map(|n| n - 1))],
        software: crate::SOFTWARE,
    };
    let mut out = serde_json::to_vec_pretty(&case).expect("plain numbers and names");
    out.push(b'\n');
    out
}

/// Distance of the points of the true skin, mm.
const SKIN_SPACING: f64 = 1.0;

fn skin_npy(phantom: &Phantom, identity: &SeriesIdentity) -> Vec<u8> {
    #[expect(clippy::cast_possible_truncation)]
    let points: Vec<_> = phantom.skin_points(SKIN_SPACING).iter().map(|p| p.map(|c| c as f32)).collect();
    let (planes, unique) = (vec![PlaneSet::EMPTY; points.len()], vec![false; points.len()]);
    let cloud = PointCloud { points, planes, unique, ..PointCloud::default() };
    let metadata = Metadata {
        series_instance_uid: identity.series_instance_uid.clone(),
        frame_of_reference_uid: identity.frame_of_reference_uid.clone(),
        plane: None,
        max_error_mm: None,
        software: crate::SOFTWARE.to_owned(),
        parameters_json: String::new(),
    };
    encode(&cloud, &metadata, Format::Npy, Frame::Lps)
}
