//! The report in a few lines.

use crate::reconstruction::Report;

/// Prints the summary to standard output.
pub(super) fn print(report: &Report) {
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
        println!(
            "{:12} {} of {} slices accepted{}{}",
            plane.plane.name(),
            plane.accepted,
            plane.slices,
            if reasons.is_empty() { "" } else { "; rejected: " },
            reasons.join(", ")
        );
    }
    let figures = &report.figures;
    let outside: u64 = figures.outside_axial_box.iter().sum();
    if outside > 0 {
        println!("left out     {outside} contour pixels outside the axial slices' box");
    }
    println!("points       {} ({} after merging)", figures.after_statistical, figures.merged);
    println!("unique       {} ({:.2} %)", figures.unique, 100.0 * figures.unique_share);
    println!("over axial   {} ({:.2} %)", figures.additional_over_axial, 100.0 * figures.additional_share);
}
