//! Which cloud, as what, goes where.

use std::path::{Path, PathBuf};

use crate::cli::values::{self, Which};
use crate::cli::{Failed, output};
use crate::cloud::{self, Format};
use crate::geometry::Frame;
use crate::reconstruction::Product;

#[derive(Debug, clap::Args)]
pub(super) struct Destination {
    /// Where the cloud goes
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
}

impl Destination {
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

    /// Writes the cloud that is asked for, whole or not at all.
    pub(super) fn write(&self, product: &Product, format: Format) -> Result<(), Failed> {
        let (_, stored) = product
            .clouds
            .iter()
            .find(|(plane, _)| *plane == self.plane.0)
            .expect("a product has the merged cloud and those of all planes");
        // The service stores these bytes and makes the other formats from them, as here.
        if format == Format::PlyBinary && self.frame == Frame::Lps {
            return output::write(&self.output, stored);
        }
        let (cloud, metadata) = cloud::ply::decode(stored).map_err(Failed::internal)?;
        output::write(&self.output, &cloud::encode(&cloud, &metadata, format, self.frame))
    }
}
