//! Which cloud, as what, goes where.

use std::path::{Path, PathBuf};

use crate::cli::values::{self, Which};
use crate::cli::{Exit, Failed, output};
use crate::cloud::{self, Format, MaxError, NoErrors, Unfiltered, ply};
use crate::geometry::{Frame, Plane};
use crate::pipeline::Profile;
use crate::reconstruction::Product;

#[derive(Debug, clap::Args)]
pub(super) struct Destination {
    /// Where the cloud goes; a file that is there stays as it is unless there is a cloud
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Format of the cloud; told by the file's extension if not given
    #[arg(long, value_parser = values::format())]
    format: Option<Format>,
    /// The merged cloud, or that of one plane
    #[arg(long, value_parser = values::which(), default_value = "triplanar")]
    plane: Which,
    /// Patient frame of the coordinates, mm
    #[arg(long, value_parser = values::frame(), default_value = "lps")]
    frame: Frame,
    /// Only the points whose expected error is at most this (profile `precise`)
    #[arg(long, value_name = "MM")]
    max_error_mm: Option<MaxError>,
}

/// A cloud that was written.
pub(super) enum Written {
    /// All of its points.
    Whole,
    /// So many of them: those within the largest error.
    Filtered(usize),
}

impl Destination {
    /// The plane whose cloud is asked for; `None` for the merged one.
    pub(super) fn plane(&self) -> Option<Plane> {
        self.plane.0
    }

    pub(super) fn path(&self) -> &Path {
        &self.output
    }

    /// The format that is asked for.
    pub(super) fn format(&self) -> Result<Format, Failed> {
        let extension = self.output.extension().and_then(|extension| extension.to_str());
        self.format.or_else(|| Format::from_extension(extension?)).ok_or_else(|| {
            Failed::usage(format!(
                "the extension of {} tells no format: name it .ply, .pcd, .raw or .npy, or give --format",
                self.output.display()
            ))
        })
    }

    /// Refuses what clouds of that profile can't give, before they are made.
    pub(super) fn check(&self, profile: Profile) -> Result<(), Failed> {
        match (self.max_error_mm, profile) {
            (Some(_), Profile::Paper) => Err(Failed::usage(format!("--max-error-mm: {NoErrors}"))),
            _ => Ok(()),
        }
    }

    /// Writes the cloud that is asked for, whole or not at all. One without a point is not written.
    pub(super) fn write(&self, product: &Product, format: Format) -> Result<Written, Failed> {
        let (_, stored) = product
            .clouds
            .iter()
            .find(|(plane, _)| *plane == self.plane.0)
            .expect("a product has the merged cloud and those of all planes");
        if let (Some(plane), true) = (self.plane(), ply::is_empty(stored)) {
            let message = format!("empty_cloud: no point was found in the {} slices", plane.name());
            return Err(Failed::new(Exit::EmptyCloud, message));
        }
        // The service stores these bytes and makes the other formats from them, as here.
        if (format, self.frame, self.max_error_mm) == (Format::PlyBinary, Frame::Lps, None) {
            return output::write(&self.output, stored).map(|()| Written::Whole);
        }
        let (mut cloud, mut metadata) = ply::decode(stored).map_err(Failed::internal)?;
        if let Some(max_error) = self.max_error_mm {
            max_error.apply(&mut cloud, &mut metadata).map_err(|error| match error {
                Unfiltered::NoErrors(error) => Failed::usage(error),
                nothing_left => Failed::new(Exit::EmptyCloud, format!("empty_cloud: {nothing_left}")),
            })?;
        }
        output::write(&self.output, &cloud::encode(&cloud, &metadata, format, self.frame))?;
        Ok(self.max_error_mm.map_or(Written::Whole, |_| Written::Filtered(cloud.len())))
    }
}
