//! A report in a few lines for a person.

use std::fmt;

use crate::geometry::Plane;
use crate::reconstruction::Report;

/// Prints as a table of the planes and the paper's figures.
pub(super) struct Summary<'a>(pub(super) &'a Report);

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.0;
        writeln!(f, "plane       slices  contours  accepted  rejected")?;
        for plane in &report.planes {
            let reasons: Vec<_> =
                plane.rejected.iter().map(|(reason, slices)| format!("{reason} {slices}")).collect();
            writeln!(
                f,
                "{:<10} {:>7} {:>9} {:>9}  {}",
                plane.plane.name(),
                plane.slices,
                plane.with_contour,
                plane.accepted,
                reasons.join(", ")
            )?;
        }
        let figures = &report.figures;
        writeln!(f, "\npoints")?;
        for plane in Plane::ALL {
            let (raw, downsampled) = (figures.raw[plane.index()], figures.downsampled[plane.index()]);
            writeln!(
                f,
                "  {:<9} {raw:>8} contour pixels, {downsampled:>7} after the voxel grid",
                plane.name()
            )?;
        }
        writeln!(
            f,
            "  merged {}, after radius filter {}, after statistical filter {}",
            figures.merged, figures.after_radius, figures.after_statistical
        )?;
        writeln!(
            f,
            "  unique {} ({:.2} %), additional over axial {} ({:.2} %)",
            figures.unique,
            100.0 * figures.unique_share,
            figures.additional_over_axial,
            100.0 * figures.additional_share
        )?;
        for warning in &report.warnings {
            writeln!(f, "warning: {}: {}", warning.code.name(), warning.detail)?;
        }
        for refused in &report.refused {
            writeln!(f, "refused: {} ({}, {} times)", refused.sop_instance_uid, refused.code, refused.times)?;
        }
        Ok(())
    }
}
