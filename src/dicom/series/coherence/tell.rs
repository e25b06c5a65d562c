//! Findings in words: an error, or a warning that names instances, rows and figures.

use super::super::check::rescale_of;
use super::super::slice::Slice;
use super::super::warning::{DoubtfulRows, RowsDoubt};
use super::super::{SeriesError, Warning, WarningCode};
use super::{Finding, Kind};

/// Slices that a text names before it only counts.
const NAMED: usize = 3;

/// Warns of what was found in `slices`; gives their indices.
///
/// # Errors
/// `inconsistent_levels`, if what was found in a slice is beyond all that a scan of a patient shows.
pub(in crate::dicom::series) fn tell(
    findings: &[Finding],
    slices: &[Slice],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<usize>, SeriesError> {
    let mut doubtful: Vec<usize> = findings.iter().map(|finding| finding.slice).collect();
    doubtful.dedup();
    if doubtful.is_empty() {
        return Ok(doubtful);
    }
    let mut severe: Vec<usize> = findings.iter().filter(|f| f.severe).map(|f| f.slice).collect();
    severe.dedup();
    if !severe.is_empty() {
        let mut instances: Vec<_> = severe.iter().map(|&z| slices[z].sop_instance_uid.clone()).collect();
        instances.sort();
        instances.dedup();
        let all_steps = findings.iter().filter(|f| f.severe).all(|f| f.kind == Kind::Step);
        let what = if all_steps {
            "their RescaleSlope (0028,1053), RescaleIntercept (0028,1052) or bits are not those of their values; have \
             them corrected, and send these instances again"
        } else {
            "their data is damaged, or of another place; send these instances again"
        };
        let detail = format!("{}: {what}", words(findings, &severe, slices));
        return Err(SeriesError::new(WarningCode::InconsistentLevels.name(), detail, instances));
    }
    let detail = format!(
        "{}, as the slices of damaged data do; look at them, and send these instances again",
        words(findings, &doubtful, slices)
    );
    let rows = findings.iter().map(|finding| rows(finding, slices)).collect();
    warnings.push(Warning { rows, ..Warning::new(WarningCode::InconsistentLevels, detail) });
    Ok(doubtful)
}

fn rows(finding: &Finding, slices: &[Slice]) -> DoubtfulRows {
    let slice = &slices[finding.slice];
    DoubtfulRows {
        sop_instance_uid: slice.sop_instance_uid.clone(),
        frame: slice.frame_index + 1,
        first_row: finding.rows.start + 1,
        last_row: finding.rows.end,
        doubt: match finding.kind {
            Kind::Place => RowsDoubt::Place,
            Kind::Run => RowsDoubt::Run,
            Kind::Shift => RowsDoubt::Shift,
            Kind::Order => RowsDoubt::Order,
            Kind::Jump => RowsDoubt::Jump,
            Kind::Patch => RowsDoubt::Patch,
            Kind::Air => RowsDoubt::Air,
            Kind::Tissue => RowsDoubt::Tissue,
            Kind::Constant => RowsDoubt::Constant,
            Kind::Repeated => RowsDoubt::Repeated,
            Kind::Stream => RowsDoubt::Stream,
            Kind::Step => RowsDoubt::Step,
        },
        measured: finding.measured,
        limit: finding.limit,
    }
}

/// The first of the slices with what is furthest beyond its limit in each.
fn words(findings: &[Finding], of: &[usize], slices: &[Slice]) -> String {
    let beyond = |f: &&Finding| f.measured / f.limit.max(f64::MIN_POSITIVE);
    let worst =
        |z: &usize| findings.iter().filter(|f| f.slice == *z).max_by(|a, b| beyond(a).total_cmp(&beyond(b)));
    let named: Vec<String> = of.iter().take(NAMED).filter_map(worst).map(|f| described(f, slices)).collect();
    let more = of.len().saturating_sub(NAMED);
    let more = if more > 0 { format!("; and {more} more") } else { String::new() };
    let goes = if of.len() == 1 { "slice does" } else { "slices do" };
    format!("{} {goes} not go with those before and after: {}{more}", of.len(), named.join("; "))
}

fn described(finding: &Finding, slices: &[Slice]) -> String {
    let Finding { slice, kind, rows, measured, limit, .. } = finding;
    let slice = &slices[*slice];
    let uid = &slice.sop_instance_uid;
    let frame = if slice.frame_index > 0 || slices.iter().filter(|s| s.source == slice.source).count() > 1 {
        format!(" frame {}", slice.frame_index + 1)
    } else {
        String::new()
    };
    let what = match kind {
        Kind::Place => {
            format!(
                "air and tissue change {measured:.1} times as much as from slice to slice and back, limit {limit:.1}"
            )
        }
        Kind::Run => {
            format!(
                "with slices beside it, it changes air and tissue {measured:.1} times as much as from slice to \
                 slice, and the next slices change them back, limit {limit:.1}"
            )
        }
        Kind::Shift => {
            format!(
                "from here on all lies {measured:.0} mm aside, limit {limit:.0} mm: the patient has moved"
            )
        }
        Kind::Order => {
            format!(
                "the slices are {:.0} % more alike if two are exchanged, limit {:.0} %",
                100.0 * measured,
                100.0 * limit
            )
        }
        Kind::Jump => format!("{measured:.0} columns change at one row, limit {limit:.0}"),
        Kind::Patch => {
            format!(
                "{measured:.0} pixels have values that are nowhere near in the neighbours, limit {limit:.0}"
            )
        }
        Kind::Air => format!("air is {measured:.0} HU off the neighbours', limit {limit:.0}"),
        Kind::Tissue => format!("soft tissue is {measured:.0} HU off the neighbours', limit {limit:.0}"),
        Kind::Step => {
            let rescale = rescale_of(slice);
            format!(
                "with slope {} and intercept {} its levels are {measured:.0} HU off those of the other slices, limit \
                 {limit:.0}",
                rescale.slope, rescale.intercept
            )
        }
        Kind::Constant => {
            format!("{measured:.0} rows more than in the neighbours have one value, limit {limit:.0}")
        }
        Kind::Repeated => "all pixels are those of another slice".to_owned(),
        Kind::Stream => {
            format!(
                "a block of the compressed frame ends {measured:.0} bytes off its data's end, limit {limit:.0}"
            )
        }
    };
    format!("instance {uid}{frame} rows {} to {}: {what}", rows.start + 1, rows.end)
}
