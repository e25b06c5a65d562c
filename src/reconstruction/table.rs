//! The rows of a report as CSV.

use std::fmt::{Display, Write as _};

use super::ReportRow;
use crate::pipeline::precise::Stretch;
use crate::pipeline::{Reason, name_of};

const COLUMNS: &str = "plane,index,accepted,reason,measured,limit,contour_area,solidity,contour_points,\
                       carried_area_before,carried_area_after,position_mm,sop_instance_uid,\
                       decision,accepted_mm,rejected_mm,stretches";

/// RFC 4180: a header line, then a line a slice, ended by CR LF. No field needs quotes: names,
/// numbers and UIDs hold neither comma nor quote. An absent value is an empty field.
///
/// `stretches` holds each rejected stretch as `reason:length_mm:measured:limit`, joined by `|`; its
/// numbers have three decimals.
pub(super) fn csv(rows: &[ReportRow]) -> String {
    let mut out = format!("{COLUMNS}\r\n");
    for row in rows {
        let reason = row.reason.map(|reason| reason.name());
        write!(
            out,
            "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\r\n",
            row.plane.name(),
            row.index,
            row.accepted,
            field(reason.as_ref()),
            field(row.measured.as_ref()),
            field(row.limit.as_ref()),
            field(row.contour_area.as_ref()),
            field(row.solidity.as_ref()),
            row.contour_points,
            field(row.carried_area_before.as_ref()),
            field(row.carried_area_after.as_ref()),
            row.position_mm,
            field(row.sop_instance_uid.as_ref()),
            name_of(&row.decision),
            field(row.accepted_mm.as_ref()),
            field(row.rejected_mm.as_ref()),
            row.stretches.iter().map(stretch).collect::<Vec<_>>().join("|"),
        )
        .expect("writing to a string");
    }
    out
}

fn stretch(stretch: &Stretch) -> String {
    let Stretch { reason, length_mm, measured, limit } = stretch;
    format!("{}:{length_mm:.3}:{measured:.3}:{limit:.3}", Reason::Stretch(*reason).name())
}

fn field<T: Display>(value: Option<&T>) -> String {
    value.map(ToString::to_string).unwrap_or_default()
}
