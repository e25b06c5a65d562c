//! A report in a few lines for a person.

use std::fmt;

use crate::cli::verdict::VerdictLines;
use crate::geometry::Plane;
use crate::pipeline::Profile;
use crate::reconstruction::Report;

/// Prints as a table of the planes and the paper's figures.
pub(super) struct Summary<'a>(pub(super) &'a Report);

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let report = self.0;
        writeln!(f, "profile {}", report.parameters.profile.name())?;
        writeln!(f, "plane       slices  contours  accepted    partly  rejected")?;
        for plane in &report.planes {
            let reasons: Vec<_> =
                plane.rejected.iter().map(|(reason, slices)| format!("{reason} {slices}")).collect();
            writeln!(
                f,
                "{:<10} {:>7} {:>9} {:>9} {:>9}  {}",
                plane.plane.name(),
                plane.slices,
                plane.with_contour,
                plane.accepted,
                plane.partly,
                reasons.join(", ")
            )?;
            for (reason, mm) in &plane.stretches_mm {
                writeln!(f, "{:<10} {mm:.0} mm of its contours rejected: {reason}", "")?;
            }
        }
        let figures = &report.figures;
        writeln!(f, "\npoints")?;
        let (raw_name, thinned) = match report.parameters.profile {
            Profile::Paper => ("contour pixels", "after the voxel grid"),
            Profile::Precise => ("crossings", "one a leaf"),
        };
        for plane in Plane::ALL {
            let (raw, downsampled) = (figures.raw[plane.index()], figures.downsampled[plane.index()]);
            writeln!(f, "  {:<9} {raw:>8} {raw_name}, {downsampled:>7} {thinned}", plane.name())?;
        }
        match report.parameters.profile {
            Profile::Paper => writeln!(
                f,
                "  merged {}, after radius filter {}, after statistical filter {}",
                figures.merged, figures.after_radius, figures.after_statistical
            )?,
            Profile::Precise => writeln!(f, "  all planes {}", figures.merged)?,
        }
        writeln!(
            f,
            "  unique {} ({:.2} %), additional over axial {} ({:.2} %)",
            figures.unique,
            100.0 * figures.unique_share,
            figures.additional_over_axial,
            100.0 * figures.additional_share
        )?;
        if report.quality.is_some() {
            write!(f, "\n{}", VerdictLines(report.quality.as_ref()))?;
        }
        for warning in &report.warnings {
            writeln!(f, "warning: {}: {}", warning.code.name(), warning.detail)?;
        }
        for refused in &report.refused {
            writeln!(f, "refused: {} ({}, {} times)", refused.sop_instance_uid, refused.code, refused.times)?;
        }
        Ok(())
    }
}
