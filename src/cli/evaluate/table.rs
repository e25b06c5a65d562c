//! Figures for eyes.

use std::fmt::{self, Display};

use super::source::{FrameFrom, Source};
use crate::evaluation::icp::{End, Registration};
use crate::evaluation::{Coverage, Distances, Evaluation, Kind, Sign, Unique};

/// Lines of a name and what is to be said of it.
#[derive(Debug, Default)]
pub(crate) struct Table(Vec<(String, String)>);

impl Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self.0.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        self.0.iter().try_for_each(|(name, text)| writeln!(f, "{name:width$}  {text}"))
    }
}

impl Table {
    /// One line.
    pub(crate) fn line(&mut self, name: impl Into<String>, text: impl Into<String>) {
        self.0.push((name.into(), text.into()));
    }

    /// What was read, and what was assumed.
    pub(crate) fn source(&mut self, name: &str, source: &Source) {
        let frame = source.frame.name();
        let from = match source.frame_from {
            FrameFrom::File => "as the file says",
            FrameFrom::Flag => "as asked for",
            FrameFrom::FlagAgainstFile => "as asked for, against what the file says",
            FrameFrom::Assumed => "assumed: the file does not say",
        };
        let what = match source.kind {
            Kind::Cloud => format!("{} points", source.points),
            Kind::Mesh => format!("{} triangles of {} points", source.triangles, source.points),
        };
        self.line(name, format!("{}: {what}, {frame} ({from})", source.file));
        if source.dropped_points > 0 {
            self.line("", format!("{} points are not usable and left out", source.dropped_points));
        }
    }

    /// All figures of an evaluation.
    pub(crate) fn evaluation(&mut self, evaluation: &Evaluation) {
        if let Some(over) = &evaluation.over_axial {
            self.unique("unique points", &over.unique);
            let share = per_cent(over.additional_share);
            self.line("additional points", format!("{} ({share} over axial)", over.additional));
            self.coverage("coverage, axial", &over.axial_coverage);
        }
        self.coverage("coverage", &evaluation.coverage);
        self.distances("distance", &evaluation.distances, evaluation.sign, "the truth");
        self.registration(evaluation.registration.as_ref());
    }

    /// Unique points.
    pub(crate) fn unique(&mut self, name: impl Into<String>, unique: &Unique) {
        let share = per_cent(unique.share);
        self.line(name, format!("{} ({share}) with none within {} mm", unique.points, unique.distance_mm));
    }

    /// Coverage.
    pub(crate) fn coverage(&mut self, name: impl Into<String>, coverage: &Coverage) {
        let (near, far) = (per_cent(coverage.within_1_mm), per_cent(coverage.within_1_5_mm));
        self.line(name, format!("{near} within 1 mm, {far} within 1.5 mm"));
    }

    /// Distances to `target` without registration.
    pub(crate) fn distances(
        &mut self,
        name: impl Into<String>,
        distances: &Distances,
        sign: Sign,
        target: &str,
    ) {
        let Distances { mean_mm, rms_mm, p95_mm, p99_mm, max_mm, .. } = distances;
        self.line(
            name,
            format!(
                "mean {mean_mm:.3}, rms {rms_mm:.3}, p95 {p95_mm:.3}, p99 {p99_mm:.3}, max {max_mm:.3} mm"
            ),
        );
        let bias = match (distances.bias_mm, sign) {
            (Some(bias), Sign::Normals) => format!("bias {bias:+.3} mm (along {target}'s normals)"),
            (Some(bias), _) => format!("bias {bias:+.3} mm (positive outside)"),
            (None, _) => "no bias: nothing tells which side is outside".to_owned(),
        };
        self.line("", format!("{bias}; {} farther than 2 mm", per_cent(distances.stray_share)));
    }

    /// The registration, or that there is none.
    pub(crate) fn registration(&mut self, registration: Option<&Registration>) {
        let Some(r) = registration else {
            self.line("rms after ICP", "none: fewer than 4 points");
            return;
        };
        self.line("rms after ICP", format!("{:.4} mm (before: {:.4})", r.rms_mm, r.initial_rms_mm));
        let end = match r.end {
            End::Converged => "converged",
            End::NoDecrease => "ended where it would have risen",
            End::IterationLimit => "NOT FINAL: ended at the limit",
        };
        self.line(
            "",
            format!(
                "{} points ({} overlap, {} farthest removed), {} iterations, {end}",
                r.points_used,
                per_cent(r.settings.overlap),
                r.points_removed,
                r.iterations
            ),
        );
        if r.is_doubtful {
            let why = if r.lacks_points() {
                let share = per_cent(r.used_share);
                format!("only {share} of the points took part; the others were removed as far")
            } else if r.moved_far() {
                let extent = r.extent_mm;
                format!("they lay elsewhere (their own extent is {extent:.0} mm): the same frame and unit?")
            } else {
                "they, or what is nearest to them, lie on a line or in one place".to_owned()
            };
            self.line("", format!("DOUBTFUL: {why}"));
        }
        let [x, y, z] = r.shift_mm;
        self.line(
            "motion of ICP",
            format!(
                "{:.3} degrees, {:.3} mm (left {x:+.3}, posterior {y:+.3}, superior {z:+.3})",
                r.rotation_deg, r.shift_length_mm
            ),
        );
    }
}

fn per_cent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}
