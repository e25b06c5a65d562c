//! A synthetic head CT whose skin is known exactly: what the demo and the tests look at.
//!
//! The head is an implicit surface (`anatomy`), not symmetric: its cranium is askew and it has one
//! ear, on its left, so that a mirrored cloud is seen. `scan` images it: partial volume, blur, noise, any orientation of
//! acquisition, gantry tilt; `files` writes the scan as DICOM. Nobody was scanned for it.

mod anatomy;
mod files;
mod options;
mod scan;
mod skin;
mod uids;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use ndarray::Array3;

pub use options::{Acquisition, InvalidOptions, Options, Order, PatientPosition};

use crate::dicom::uid::SopInstanceUid;
use crate::dicom::{SeriesIdentity, Volume};
use crate::geometry::{Grid, Vec3};
use anatomy::{Head, Pose};

/// A head with its scan.
#[derive(Debug, Clone)]
pub struct Phantom {
    options: Options,
    head: Head,
    pose: Pose,
    /// Measured when they are first asked for.
    voxels: OnceLock<Arc<Array3<i16>>>,
}

impl Phantom {
    /// The phantom of these options; equal options give equal bytes.
    ///
    /// # Errors
    /// An option outside its range, or two that exclude each other.
    pub fn new(options: Options) -> Result<Self, InvalidOptions> {
        options.check()?;
        let head = Head::new(options.seed);
        let pose = Pose::new(options.pitch_deg, options.roll_deg, options.yaw_deg);
        Ok(Self { options, head, pose, voxels: OnceLock::new() })
    }

    /// The same voxels, cut into images in another way.
    ///
    /// # Errors
    /// An acquisition that its options exclude.
    pub fn acquired_as(&self, acquisition: Acquisition) -> Result<Self, InvalidOptions> {
        let options = Options { acquisition, ..self.options.clone() };
        options.check()?;
        self.voxels();
        Ok(Self { options, ..self.clone() })
    }

    /// What it was made from.
    #[must_use]
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The identifiers that its instances carry.
    #[must_use]
    pub fn identity(&self) -> SeriesIdentity {
        uids::identity(&self.options)
    }

    /// mm from the true skin to a point in LPS mm, positive outside the head.
    ///
    /// First order (`f / |∇f|` of the implicit surface): within 1 % up to 3 mm from the skin,
    /// coarser beyond. Where the scan cuts the neck there is no skin.
    #[must_use]
    pub fn signed_distance(&self, lps: Vec3) -> f64 {
        self.head.skin(self.pose.to_head(lps)).0
    }

    /// The true skin's outward unit normal next to a point in LPS mm.
    #[must_use]
    pub fn normal(&self, lps: Vec3) -> Vec3 {
        self.pose.direction_to_lps(self.head.skin(self.pose.to_head(lps)).1)
    }

    /// Points on the true skin inside the scanned region, LPS mm, about one for each square of
    /// `spacing_mm`.
    #[must_use]
    pub fn skin_points(&self, spacing_mm: f64) -> Vec<Vec3> {
        skin::points(&self.head, &self.pose, &self.grid(), spacing_mm)
    }

    /// Where the scan's voxels are.
    #[must_use]
    pub fn grid(&self) -> Grid {
        scan::grid(&self.options)
    }

    /// The scan as a volume, as the reader of its files must give it.
    #[must_use]
    pub fn volume(&self) -> Volume {
        files::volume(&self.options, self.grid(), self.voxels().clone())
    }

    /// The scan as single-frame CT Image instances (PS3.3 A.3), Part 10 files in explicit VR
    /// little endian, in the order of their instance numbers.
    #[must_use]
    pub fn instances(&self) -> Vec<(SopInstanceUid, Vec<u8>)> {
        files::single_frames(&self.options, &self.grid(), self.voxels())
    }

    /// The scan as one Enhanced CT Image instance (PS3.3 A.38), a Part 10 file.
    #[must_use]
    pub fn enhanced_instance(&self) -> (SopInstanceUid, Vec<u8>) {
        files::multi_frame(&self.options, &self.grid(), self.voxels())
    }

    /// Writes [`Phantom::instances`] as `IM00001.dcm`, … into a folder, which is made if need be.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn write_series(&self, dir: &Path) -> io::Result<Vec<PathBuf>> {
        std::fs::create_dir_all(dir)?;
        let mut paths = Vec::new();
        for (number, (_, bytes)) in self.instances().iter().enumerate() {
            let path = dir.join(format!("IM{:05}.dcm", number + 1));
            std::fs::write(&path, bytes)?;
            paths.push(path);
        }
        Ok(paths)
    }

    fn voxels(&self) -> &Array3<i16> {
        self.voxels.get_or_init(|| Arc::new(scan::voxels(&self.options, &self.head, &self.pose)))
    }
}
