//! [`Figures`] in a row.

use super::{Schema, Unreadable, of_0_1, stored};
use crate::pipeline::Figures;

const SCHEMA: Schema = Schema { what: "figures", steps: &[of_0_1] };

stored! {
    /// Schema 1.
    FiguresV1 is Figures {
        raw: [u64; 3],
        #[serde(default)]
        outside_axial_box: [u64; 3],
        downsampled: [u64; 3],
        merged: u64,
        after_radius: u64,
        after_statistical: u64,
        unique: u64,
        unique_share: f64,
        additional_over_axial: i64,
        additional_share: f64,
    }
}

/// As it is stored now.
pub(crate) fn write(figures: &Figures) -> String {
    super::text(&SCHEMA.write::<FiguresV1, _>(figures))
}

/// As any version stored it.
pub(crate) fn read(json: &str) -> Result<Figures, Unreadable> {
    SCHEMA.read::<FiguresV1, _>(json.as_bytes())
}
