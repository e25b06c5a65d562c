//! The rows of a report as CSV.

use std::fmt::{Display, Write as _};

use super::ReportRow;

const COLUMNS: &str = "plane,index,accepted,reason,measured,limit,contour_area,solidity,contour_points,\
                       carried_area_before,carried_area_after,position_mm,sop_instance_uid";

/// RFC 4180: a header line, then a line a slice, ended by CR LF. No field needs quotes: names,
/// numbers and UIDs hold neither comma nor quote. An absent value is an empty field.
pub(super) fn csv(rows: &[ReportRow]) -> String {
    let mut out = format!("{COLUMNS}\r\n");
    for row in rows {
        let reason = row.reason.map(|reason| reason.name());
        write!(
            out,
            "{},{},{},{},{},{},{},{},{},{},{},{},{}\r\n",
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
        )
        .expect("writing to a string");
    }
    out
}

fn field<T: Display>(value: Option<&T>) -> String {
    value.map(ToString::to_string).unwrap_or_default()
}
