//! How far a result can be trusted, in a few lines for a person.

use std::fmt;

use crate::pipeline::name_of;
use crate::pipeline::precise::Quality;

/// Prints verdict, coverage and agreement; nothing for a profile that does not judge.
pub(super) struct VerdictLines<'a>(pub(super) Option<&'a Quality>);

impl fmt::Display for VerdictLines<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(quality) = self.0 else { return Ok(()) };
        let doubts: Vec<_> = quality.doubts.iter().map(name_of).collect();
        let because = if doubts.is_empty() { String::new() } else { format!(": {}", doubts.join(", ")) };
        writeln!(f, "verdict      {}{because}", name_of(&quality.verdict))?;
        writeln!(
            f,
            "coverage     {:.1} % of the head's skin in view ({:.1} cm² missing)",
            100.0 * quality.coverage,
            quality.missing.iter().fold(0.0, |sum, m| sum + m.area_cm2)
        )?;
        writeln!(
            f,
            "agreement    mean {:.3} mm, 95 % within {:.3} mm",
            quality.agreement_mean_mm, quality.agreement_p95_mm
        )
    }
}
