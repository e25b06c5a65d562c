//! What phantom, and how it is scanned.

use serde::{Deserialize, Serialize};

use crate::geometry::Plane;

/// Head and scan. The default is what the demo shows: 512 × 512 pixels of 0.45 mm (the published
/// thresholds are made for that), 145 slices of 1.25 mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Which head: sizes and proportions, and the noise.
    pub seed: u64,
    /// Voxels along x (right–left).
    pub columns: usize,
    /// Voxels along y (front–back).
    pub rows: usize,
    /// Distance of columns, mm.
    pub column_mm: f64,
    /// Distance of rows, mm.
    pub row_mm: f64,
    /// Axial slices.
    pub slices: usize,
    /// Distance of axial slices along the patient's axis, mm.
    pub slice_mm: f64,
    /// LPS z of the top slice, mm (of its centre, if tilted); the vertex is near 80.
    pub top_mm: f64,
    /// LPS x and y of the images' centre, mm.
    pub centre_mm: [f64; 2],
    /// Standard deviation of the noise, HU.
    pub noise_hu: f64,
    /// Standard deviation of the scanner's blur, mm.
    pub blur_mm: f64,
    /// Nod: positive lifts the chin.
    pub pitch_deg: f64,
    /// Towards a shoulder: positive to the left one.
    pub roll_deg: f64,
    /// Turn: positive turns the nose to the patient's left.
    pub yaw_deg: f64,
    /// Gantry tilt: the image planes lean by this angle, the table still moves along z.
    pub tilt_deg: f64,
    /// The shell that the head lies in.
    pub holder: bool,
    /// A flat couch top below, which the field of view cuts off at both sides.
    pub couch: bool,
    /// How the voxels are sent as images.
    pub acquisition: Acquisition,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            columns: 512,
            rows: 512,
            column_mm: 0.45,
            row_mm: 0.45,
            slices: 145,
            slice_mm: 1.25,
            top_mm: 84.0,
            centre_mm: [0.0, -5.0],
            noise_hu: 8.0,
            blur_mm: 0.5,
            pitch_deg: 0.0,
            roll_deg: 0.0,
            yaw_deg: 0.0,
            tilt_deg: 0.0,
            holder: true,
            couch: false,
            acquisition: Acquisition::default(),
        }
    }
}

/// How the voxels of the scan are cut into images. The voxels are the same for every acquisition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Acquisition {
    /// The plane of the images.
    pub plane: Plane,
    /// How the patient lies: turns the images' axes.
    pub position: PatientPosition,
    /// Which end comes first.
    pub order: Order,
}

impl Default for Acquisition {
    fn default() -> Self {
        Self { plane: Plane::Axial, position: PatientPosition::Hfs, order: Order::Ascending }
    }
}

/// Patient Position (0018,5100).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum PatientPosition {
    /// Head first, supine.
    #[default]
    Hfs,
    /// Head first, prone.
    Hfp,
    /// Feet first, supine.
    Ffs,
    /// Feet first, prone.
    Ffp,
}

impl PatientPosition {
    /// The attribute's value.
    pub(super) fn code(self) -> &'static str {
        match self {
            Self::Hfs => "HFS",
            Self::Hfp => "HFP",
            Self::Ffs => "FFS",
            Self::Ffp => "FFP",
        }
    }

    /// The sign of the patient's x, y and z axis in the scanner's axes, which are those of a
    /// patient who lies head first and supine (PS3.3 C.7.3.1.1.2).
    pub(super) fn signs(self) -> [f64; 3] {
        match self {
            Self::Hfs => [1.0, 1.0, 1.0],
            Self::Hfp => [-1.0, -1.0, 1.0],
            Self::Ffs => [-1.0, 1.0, -1.0],
            Self::Ffp => [1.0, -1.0, -1.0],
        }
    }
}

/// The order of instance numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// Along the patient's x, y or z.
    #[default]
    Ascending,
    /// Against it.
    Descending,
}

/// An option that can't be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("phantom: {0}")]
pub struct InvalidOptions(&'static str);

impl Options {
    /// Whether a phantom can be made of them.
    pub(super) fn check(&self) -> Result<(), InvalidOptions> {
        let require = |ok: bool, what| if ok { Ok(()) } else { Err(InvalidOptions(what)) };
        let counts = [self.columns, self.rows, self.slices];
        require(counts.iter().all(|n| (2..=4096).contains(n)), "columns, rows and slices must be 2 to 4096")?;
        let spacings = [self.column_mm, self.row_mm, self.slice_mm];
        require(spacings.iter().all(|mm| (0.05..=50.0).contains(mm)), "distances must be 0.05 to 50 mm")?;
        let angles = [self.pitch_deg, self.roll_deg, self.yaw_deg];
        require(angles.iter().all(|a| a.abs() <= 180.0), "pitch, roll and yaw must be within 180 degrees")?;
        require(self.tilt_deg.abs() <= 40.0, "the tilt must be within 40 degrees")?;
        require((0.0..=500.0).contains(&self.noise_hu), "the noise must be 0 to 500 HU")?;
        require((0.0..=10.0).contains(&self.blur_mm), "the blur must be 0 to 10 mm")?;
        let places = [self.top_mm, self.centre_mm[0], self.centre_mm[1]];
        require(places.iter().all(|mm| mm.abs() <= 1000.0), "top and centre must be within 1000 mm")?;
        require(
            self.tilt_deg == 0.0 || self.acquisition.plane == Plane::Axial,
            "a tilted gantry gives axial images alone",
        )
    }
}
