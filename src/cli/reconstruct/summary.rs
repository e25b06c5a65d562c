//! The report in a few lines.

use crate::cli::verdict::VerdictLines;
use crate::pipeline::Profile;
use crate::reconstruction::Report;

/// Prints the summary to standard output.
pub(super) fn print(report: &Report) {
    println!("profile      {}", report.parameters.profile.name());
    println!("series       {}", report.identity.series_instance_uid);
    let [nz, ny, nx] = report.volume.shape;
    let [z, y, x] = report.volume.step_mm;
    println!("volume       {nx} x {ny} x {nz} voxels of {x:.3} x {y:.3} x {z:.3} mm");
    for warning in &report.warnings {
        println!("warning      {}: {}", warning.code.name(), warning.detail);
    }
    if !report.unused.is_empty() {
        println!("not used     {} files of the input (the report lists them)", report.unused.len());
    }
    for plane in &report.planes {
        let reasons: Vec<_> =
            plane.rejected.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
        let partly = if plane.partly > 0 { format!(" ({} partly)", plane.partly) } else { String::new() };
        println!(
            "{:12} {} of {} slices accepted{partly}{}{}",
            plane.plane.name(),
            plane.accepted,
            plane.slices,
            if reasons.is_empty() { "" } else { "; rejected: " },
            reasons.join(", ")
        );
        let stretches: Vec<_> =
            plane.stretches_mm.iter().map(|(reason, mm)| format!("{reason} {mm:.0} mm")).collect();
        if !stretches.is_empty() {
            println!("{:12} of its contours rejected: {}", "", stretches.join(", "));
        }
    }
    print!("{}", VerdictLines(report.quality.as_ref()));
    let figures = &report.figures;
    let outside: u64 = figures.outside_axial_box.iter().sum();
    if outside > 0 {
        println!("left out     {outside} contour pixels outside the axial slices' box");
    }
    if report.parameters.profile == Profile::Paper {
        println!("points       {} ({} after merging)", figures.after_statistical, figures.merged);
    } else {
        println!("points       {}", figures.after_statistical);
    }
    println!("unique       {} ({:.2} %)", figures.unique, 100.0 * figures.unique_share);
    println!("over axial   {} ({:.2} %)", figures.additional_over_axial, 100.0 * figures.additional_share);
}
