//! What the command line writes under the profile `precise`: normals, expected errors, a row for
//! every slice.

use serde_json::Value;
use triplanar::geometry::dot;

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
    for plane in ["triplanar", "axial", "sagittal", "coronal"] {
        let (whole, _) = ply(&reconstructed(dir.path(), "a.ply", &["--plane", plane]).0);
        let mut errors = whole["expected_error_mm"].clone();
        errors.sort_by(f64::total_cmp);
        let limit = f64::from(errors[errors.len() / 2] as f32);
        let text = (limit as f32).to_string();
        let arguments = ["--plane", plane, "--max-error-mm", &text];
        let (filtered, comments) = ply(&reconstructed(dir.path(), "b.ply", &arguments).0);
        assert!(comments.contains(&format!("max_error_mm {text}")), "{comments:?}");
        let keep: Vec<bool> = whole["expected_error_mm"].iter().map(|error| *error <= limit).collect();
        let kept = keep.iter().filter(|k| **k).count();
        assert!(kept > 0 && kept < keep.len(), "{kept} of {}", keep.len());
        for name in NAMES {
            let expected = whole[name].iter().zip(&keep).filter(|(_, keep)| **keep).map(|(value, _)| value);
            assert!(expected.eq(&filtered[name]), "{plane}: {name}");
        }
    }
}

#[test]
fn every_slice_has_its_row_and_its_stretches_sum_up() {
    let dir = tempfile::tempdir().expect("a folder");
    let (_, report, said) = reconstructed(dir.path(), "a.ply", &[]);
    let slices = report["slices"].as_array().expect("rows");
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("no number: {value}"));
    let mut at = 0;
    for (plane, count) in [("axial", SHAPE[0]), ("sagittal", SHAPE[2]), ("coronal", SHAPE[1])] {
        let (mut accepted_mm, mut rejected_mm, mut partly) = (0.0, 0.0, 0);
        for index in 0..count {
            let row = &slices[at];
            at += 1;
            assert_eq!((&row["plane"], &row["index"]), (&Value::from(plane), &Value::from(index)));
            let stretches = row["stretches"].as_array().expect("a list");
            let sum: f64 = stretches.iter().map(|stretch| number(&stretch["length_mm"])).sum();
            assert!((sum - number(&row["rejected_mm"])).abs() < 1e-6, "{row}");
            let decision = row["decision"].as_str().expect("a name");
            assert_eq!(row["accepted"], decision != "rejected");
            assert_eq!(row["accepted"], number(&row["accepted_mm"]) > 0.0);
            assert_eq!(decision == "partly", row["accepted"] == true && !stretches.is_empty());
            if decision == "rejected" {
                let longest = stretches
                    .iter()
                    .max_by(|a, b| number(&a["length_mm"]).total_cmp(&number(&b["length_mm"])));
                assert_eq!(row["reason"], longest.map_or(Value::from("no_contour"), |l| l["reason"].clone()));
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
        assert_eq!(summary["slices"], count);
        assert_eq!(summary["partly"], partly);
        assert!((number(&summary["accepted_mm"]) - accepted_mm).abs() < 1e-6 * accepted_mm);
        assert!((number(&summary["rejected_mm"]) - rejected_mm).abs() < 1e-6 * (1.0 + rejected_mm));
        assert!(accepted_mm > 10_000.0, "{plane}: {accepted_mm} mm of contour");
    }
    assert_eq!(slices.len(), at);
    let verdict = report["quality"]["verdict"].as_str().expect("a verdict");
    assert!(said.contains(&format!("verdict      {verdict}")) && said.contains("coverage"), "{said}");
    for doubt in report["quality"]["doubts"].as_array().expect("a list") {
        assert!(said.contains(doubt.as_str().expect("a name")), "{said}");
    }
    assert_eq!(report["parameters"]["profile"], "precise");
    let points = report["figures"]["after_statistical"].as_u64().expect("a count");
    assert!(said.contains(&format!("points       {points}")), "{said}");

    let arguments =
        ["reconstruct", "series", "--profile", "precise", "-o", "a.ply", "--report", "report.csv"];
    let mut command = triplanar();
    command.current_dir(dir.path()).args(arguments);
    assert!(run(command).status.success());
    let csv = std::fs::read_to_string(dir.path().join("report.csv")).expect("the report");
    let mut lines = csv.lines();
    let columns: Vec<_> = lines.next().expect("a header").split(',').collect();
    assert_eq!(columns[columns.len() - 4..], ["decision", "accepted_mm", "rejected_mm", "stretches"]);
    for (line, row) in lines.zip(slices) {
        let fields: Vec<_> = line.split(',').collect();
        assert_eq!(fields.len(), columns.len(), "{line}");
        let [.., decision, accepted, rejected, stretches] = fields[..] else { panic!("{line}") };
        assert_eq!(row["decision"], decision);
        assert_eq!(number(&row["accepted_mm"]), accepted.parse::<f64>().expect("a number"));
        let lengths = stretches.split('|').filter(|part| !part.is_empty()).map(|part| {
            let parts: Vec<_> = part.split(':').collect();
            assert_eq!(parts.len(), 4, "{line}");
            parts[1].parse::<f64>().expect("a number")
        });
        let sum: f64 = lengths.sum();
        assert!((sum - rejected.parse::<f64>().expect("a number")).abs() < 0.1, "{line}");
    }
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
