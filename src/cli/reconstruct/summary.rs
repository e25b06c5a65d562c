//! The report in a few lines.

use std::fmt;

use crate::cli::verdict::VerdictLines;
use crate::geometry::Plane;
use crate::pipeline::Profile;
use crate::reconstruction::Report;

/// Prints the summary of the merged cloud, or of a plane's own.
pub(super) struct Summary<'a> {
    pub(super) report: &'a Report,
    /// The plane whose cloud was asked for; `None` for the merged one.
    pub(super) plane: Option<Plane>,
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { report, plane } = self;
        writeln!(f, "profile      {}", report.parameters.profile.name())?;
        writeln!(f, "series       {}", report.identity.series_instance_uid)?;
        let [nz, ny, nx] = report.volume.shape;
        let [z, y, x] = report.volume.step_mm;
        writeln!(f, "volume       {nx} x {ny} x {nz} voxels of {x:.3} x {y:.3} x {z:.3} mm")?;
        for warning in &report.warnings {
            writeln!(f, "warning      {}: {}", warning.code.name(), warning.detail)?;
        }
        if !report.unused.is_empty() {
            let files = report.unused.len();
            writeln!(f, "not used     {files} files of the input (the report lists them)")?;
        }
        planes(f, report)?;
        write!(f, "{}", VerdictLines(report.quality.as_ref()))?;
        let outside: u64 = report.figures.outside_axial_box.iter().sum();
        if outside > 0 {
            writeln!(f, "left out     {outside} contour pixels outside the axial slices' box")?;
        }
        points(f, report, *plane)
    }
}

fn planes(f: &mut fmt::Formatter<'_>, report: &Report) -> fmt::Result {
    for plane in &report.planes {
        let reasons: Vec<_> =
            plane.rejected.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
        let partly = if plane.partly > 0 { format!(" ({} partly)", plane.partly) } else { String::new() };
        writeln!(
            f,
            "{:12} {} of {} slices accepted{partly}{}{}",
            plane.plane.name(),
            plane.accepted,
            plane.slices,
            if reasons.is_empty() { "" } else { "; rejected: " },
            reasons.join(", ")
        )?;
        let stretches: Vec<_> =
            plane.stretches_mm.iter().map(|(reason, mm)| format!("{reason} {mm:.0} mm")).collect();
        if !stretches.is_empty() {
            writeln!(f, "{:12} of its contours rejected: {}", "", stretches.join(", "))?;
        }
    }
    Ok(())
}

fn points(f: &mut fmt::Formatter<'_>, report: &Report, plane: Option<Plane>) -> fmt::Result {
    let figures = &report.figures;
    let all = figures.after_statistical;
    if let Some(plane) = plane {
        let own = figures.downsampled[plane.index()];
        return writeln!(f, "points       {own} of the plane {} alone ({all} of all planes)", plane.name());
    }
    if report.parameters.profile == Profile::Paper {
        writeln!(f, "points       {all} ({} after merging)", figures.merged)?;
    } else {
        writeln!(f, "points       {all}")?;
    }
    writeln!(f, "unique       {} ({:.2} %)", figures.unique, 100.0 * figures.unique_share)?;
    let (additional, share) = (figures.additional_over_axial, 100.0 * figures.additional_share);
    writeln!(f, "over axial   {additional} ({share:.2} %)")
}
