//! What the command line writes under the profile `precise`: normals, expected errors, a row for
//! every slice.

use serde_json::Value;
use triplanar::geometry::dot;

use crate::support::data;
use crate::support::head::{SHAPE, phantom, reconstructed};
use crate::support::service::{run, triplanar};
use crate::support::vertices::{Columns, pcd, ply};

const NAMES: [&str; 9] = ["x", "y", "z", "nx", "ny", "nz", "expected_error_mm", "planes", "unique"];

fn rows(cloud: &Columns, names: [&str; 3]) -> Vec<[f64; 3]> {
    let [a, b, c] = names.map(|name| &cloud[name]);
    a.iter().zip(b).zip(c).map(|((a, b), c)| [*a, *b, *c]).collect()
}

#[test]
fn every_format_carries_the_same_normals_and_errors_and_ras_turns_them() {
    let dir = tempfile::tempdir().expect("a folder");
    let file = |name: &str, more: &[&str]| reconstructed(dir.path(), name, more).0;
    let (binary, comments) = ply(&file("a.ply", &[]));
    assert!(NAMES.iter().all(|name| binary.contains_key(*name)) && binary.len() == NAMES.len());
    assert!(!comments.iter().any(|line| line.starts_with("max_error_mm")), "{comments:?}");
    let (ascii, _) = ply(&file("b.ply", &["--format", "ply_ascii"]));
    assert!(ascii == binary, "ascii and binary PLY differ");
    let (mut of_pcl, _) = pcd(&file("c.pcd", &[]));
    for axis in ["x", "y", "z"] {
        let normal = of_pcl.remove(&format!("normal_{axis}")).expect("PCL's name");
        of_pcl.insert(format!("n{axis}"), normal);
    }
    assert!(of_pcl == binary, "PLY and PCD differ");

    let (ras, _) = ply(&file("d.ply", &["--frame", "ras"]));
    for name in NAMES {
        let sign = if ["x", "y", "nx", "ny"].contains(&name) { -1.0 } else { 1.0 };
        assert!(ras[name].iter().zip(&binary[name]).all(|(a, b)| *a == sign * b), "{name} in RAS");
    }

    // The phantom tells right from left, and in from out.
    let (places, normals) = (rows(&binary, ["x", "y", "z"]), rows(&binary, ["nx", "ny", "nz"]));
    let near = |sign: f64| {
        let places = places.iter().map(|[x, y, z]| [sign * x, *y, *z]);
        places.filter(|place| phantom().signed_distance(*place).abs() < 1.0).count()
    };
    assert!(near(1.0) * 100 > places.len() * 99, "{} of {} on the skin", near(1.0), places.len());
    assert!(near(-1.0) * 100 < places.len() * 60, "a mirrored cloud would do as well");
    let outward = places.iter().zip(&normals).filter(|(p, n)| dot(**n, phantom().normal(**p)) > 0.9).count();
    assert!(outward * 100 > normals.len() * 95, "{outward} of {} normals point outward", normals.len());
    assert!(normals.iter().all(|n| (dot(*n, *n) - 1.0).abs() < 1e-4), "a normal that is no unit vector");
    assert!(binary["expected_error_mm"].iter().all(|error| (1e-4..5.0).contains(error)));
    assert!(binary["planes"].iter().all(|planes| (1.0..=7.0).contains(planes)));
}

#[test]
fn a_filtered_cloud_is_the_whole_one_without_the_points_beyond() {
    let dir = tempfile::tempdir().expect("a folder");
    // One plane's cloud here; the service's test filters others.
    let of = ["--plane", "sagittal"];
    let (whole, _) = ply(&reconstructed(dir.path(), "a.ply", &of).0);
    let mut errors = whole["expected_error_mm"].clone();
    errors.sort_by(f64::total_cmp);
    let limit = errors[errors.len() / 2];
    let text = (limit as f32).to_string();
    let arguments = [of, ["--max-error-mm", &text]].concat();
    let (filtered, comments) = ply(&reconstructed(dir.path(), "b.ply", &arguments).0);
    assert!(comments.contains(&format!("max_error_mm {text}")), "{comments:?}");
    let keep: Vec<bool> = whole["expected_error_mm"].iter().map(|error| *error <= limit).collect();
    let kept = keep.iter().filter(|k| **k).count();
    assert!(kept > 0 && kept < keep.len(), "{kept} of {}", keep.len());
    for name in NAMES {
        let expected = whole[name].iter().zip(&keep).filter(|(_, keep)| **keep).map(|(value, _)| value);
        assert!(expected.eq(&filtered[name]), "{name}");
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

/// Adds up what each row says and holds it against the row's own sums and its plane's.
fn check_plane(report: &Value, plane: &str, count: usize) {
    let slices = report["slices"].as_array().expect("rows");
    let rows: Vec<_> = slices.iter().filter(|row| row["plane"] == plane).collect();
    assert_eq!(rows.len(), count, "{plane}");
    let (mut accepted_mm, mut rejected_mm, mut partly) = (0.0, 0.0, 0);
    for (index, row) in rows.into_iter().enumerate() {
        assert_eq!(row["index"], index);
        let stretches = row["stretches"].as_array().expect("a list");
        let sum: f64 = stretches.iter().map(|stretch| number(&stretch["length_mm"])).sum();
        assert!((sum - number(&row["rejected_mm"])).abs() < 1e-6, "{row}");
        let decision = row["decision"].as_str().expect("a name");
        assert_eq!(row["accepted"], decision != "rejected");
        assert_eq!(row["accepted"], number(&row["accepted_mm"]) > 0.0);
        assert_eq!(decision == "partly", row["accepted"] == true && !stretches.is_empty());
        if decision == "rejected" {
            let lengths = stretches.iter().map(|stretch| number(&stretch["length_mm"]));
            let longest = lengths.fold(0.0, f64::max);
            let is_longest = |s: &&Value| number(&s["length_mm"]) == longest && s["reason"] == row["reason"];
            let found = stretches.iter().any(|s| is_longest(&s));
            assert!(found || (stretches.is_empty() && row["reason"] == "no_contour"), "{row}");
            assert!(row["measured"].is_number() && row["limit"].is_number(), "{row}");
        } else {
            assert!(row["reason"].is_null() && row["contour_points"].as_u64() > Some(0), "{row}");
        }
        assert!(row["position_mm"].is_number());
        assert_eq!(row["sop_instance_uid"].is_string(), plane == "axial");
        accepted_mm += number(&row["accepted_mm"]);
        rejected_mm += sum;
        partly += u64::from(decision == "partly");
    }
    let summary = report["planes"].as_array().expect("planes").iter().find(|p| p["plane"] == plane);
    let summary = summary.expect("a summary");
    assert_eq!((&summary["slices"], &summary["partly"]), (&Value::from(count), &Value::from(partly)));
    assert!((number(&summary["accepted_mm"]) - accepted_mm).abs() < 1e-6 * accepted_mm);
    assert!((number(&summary["rejected_mm"]) - rejected_mm).abs() < 1e-6 * (1.0 + rejected_mm));
    let by_reason = summary["stretches_mm"].as_object().expect("by reason").values().map(number).sum::<f64>();
    assert!((by_reason - rejected_mm).abs() < 1e-6 * (1.0 + rejected_mm));
    assert!(accepted_mm > 1_000.0, "{plane}: {accepted_mm} mm of contour");
}

/// The table says the same, stretch by stretch.
fn check_csv(csv: &str, report: &Value) {
    let mut lines = csv.lines();
    let columns: Vec<_> = lines.next().expect("a header").split(',').collect();
    assert_eq!(columns[columns.len() - 4..], ["decision", "accepted_mm", "rejected_mm", "stretches"]);
    let slices = report["slices"].as_array().expect("rows");
    assert_eq!(csv.lines().count(), slices.len() + 1);
    for (line, row) in lines.zip(slices) {
        let fields: Vec<_> = line.split(',').collect();
        assert_eq!(fields.len(), columns.len(), "{line}");
        let [.., decision, accepted, rejected, stretches] = fields[..] else { panic!("{line}") };
        assert_eq!(row["decision"], decision);
        assert_eq!(number(&row["accepted_mm"]), accepted.parse::<f64>().expect("a number"));
        assert_eq!(number(&row["rejected_mm"]), rejected.parse::<f64>().expect("a number"));
        let told: Vec<_> = stretches.split('|').filter(|part| !part.is_empty()).collect();
        let expected = row["stretches"].as_array().expect("a list");
        assert_eq!(told.len(), expected.len(), "{line}");
        for (told, expected) in told.into_iter().zip(expected) {
            let [reason, numbers @ ..] = &told.split(':').collect::<Vec<_>>()[..] else { panic!("{line}") };
            assert_eq!(expected["reason"], *reason);
            for (told, name) in numbers.iter().zip(["length_mm", "measured", "limit"]) {
                let told: f64 = told.parse().expect("a number");
                assert!((told - number(&expected[name])).abs() < 0.001, "{line}: {name}");
            }
        }
    }
}

#[test]
fn every_slice_has_its_row_and_the_summary_says_what_the_report_does() {
    let dir = tempfile::tempdir().expect("a folder");
    let (_, report, said) = reconstructed(dir.path(), "a.ply", &[]);
    for (plane, count) in [("axial", SHAPE[0]), ("sagittal", SHAPE[2]), ("coronal", SHAPE[1])] {
        check_plane(&report, plane, count);
    }
    assert_eq!(report["parameters"]["profile"], "precise");
    let verdict = report["quality"]["verdict"].as_str().expect("a verdict");
    assert!(said.contains(&format!("verdict      {verdict}")) && said.contains("coverage"), "{said}");
    for doubt in report["quality"]["doubts"].as_array().expect("a list") {
        assert!(said.contains(doubt.as_str().expect("a name")), "{said}");
    }
    let points = report["figures"]["after_statistical"].as_u64().expect("a count");
    assert!(said.contains(&format!("points       {points}")), "{said}");
}

#[test]
#[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
fn rejected_stretches_of_a_real_head_sum_up_in_the_report_and_in_its_table() {
    let data = data::dir();
    let dir = tempfile::tempdir().expect("a folder");
    let series = data.join("series/ge_hispeed_tilt_variable.zip");
    let reported = |name: &str| {
        let mut command = triplanar();
        command.current_dir(dir.path()).arg("reconstruct").arg(&series);
        command.args(["--profile", "precise", "-o", "a.ply", "--report", name]);
        let ended = run(command);
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        std::fs::read_to_string(dir.path().join(name)).expect("the report")
    };
    let report: Value = serde_json::from_str(&reported("report.json")).expect("JSON");
    for (plane, count) in [("axial", 28), ("sagittal", 512), ("coronal", 512)] {
        check_plane(&report, plane, count);
    }
    let slices = report["slices"].as_array().expect("rows");
    assert!(slices.iter().any(|row| row["decision"] == "partly"), "the holder touches the head");
    check_csv(&reported("report.csv"), &report);
}

#[test]
fn under_paper_there_is_no_error_to_filter_by() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut command = triplanar();
    command.current_dir(dir.path());
    command.args(["reconstruct", ".", "-o", "a.ply", "--profile", "paper", "--max-error-mm", "0.1"]);
    let ended = run(command);
    assert_eq!(ended.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&ended.stderr).contains("expected error"));
}
