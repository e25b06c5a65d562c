//! Slices whose pixels were lost or exchanged behind an intact header: an error or a doubt, never a
//! quiet cloud.

use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;
use triplanar::phantom::Options;

use crate::support::client::Client;
use crate::support::pacs;
use crate::support::phantom::{Series, series};
use crate::support::service::{Settings, run, triplanar};

const SIDE: usize = 160;
/// Bytes of a slice: 16 bits a pixel, not compressed, at the end of the file.
const BYTES: usize = 2 * SIDE * SIDE;

/// A whole head in few pixels.
pub(crate) fn head() -> &'static Series {
    static HEAD: OnceLock<Series> = OnceLock::new();
    HEAD.get_or_init(|| {
        series(Options {
            columns: SIDE,
            rows: SIDE,
            column_mm: 1.5,
            row_mm: 1.5,
            slices: 75,
            slice_mm: 2.5,
            pitch_deg: 6.0,
            ..Options::default()
        })
    })
}

/// The pixels of a slice.
fn pixels(files: &mut [Vec<u8>], slice: usize) -> &mut [u8] {
    let file = &mut files[slice];
    let start = file.len() - BYTES;
    &mut file[start..]
}

pub(crate) fn sop_instance_uid(file: &[u8]) -> String {
    let object = dicom_object::from_reader(file).expect("a DICOM file");
    object.meta().media_storage_sop_instance_uid().to_owned()
}

/// Exit code, standard error, and the report if there is one.
pub(crate) fn reconstruct(dir: &Path, files: &[Vec<u8>], profile: &str) -> (Option<i32>, String, Value) {
    let input = dir.join("in");
    std::fs::create_dir_all(&input).expect("a folder");
    for (number, file) in files.iter().enumerate() {
        std::fs::write(input.join(number.to_string()), file).expect("a file");
    }
    let mut command = triplanar();
    command.current_dir(dir).args([
        "reconstruct",
        "in",
        "-o",
        "c.ply",
        "--report",
        "r.json",
        "--profile",
        profile,
    ]);
    command.args(if profile == "paper" { &["--min-neighbours", "0"][..] } else { &[] });
    let done = run(command);
    let text = String::from_utf8([done.stdout, done.stderr].concat()).expect("text");
    let report = std::fs::read(dir.join("r.json"))
        .map_or(Value::Null, |json| serde_json::from_slice(&json).expect("JSON"));
    (done.status.code(), text, report)
}

fn doubtful_rows(report: &Value) -> Vec<Value> {
    let warnings = report["warnings"].as_array().expect("warnings");
    let told = warnings.iter().filter(|warning| warning["code"] == "inconsistent_levels");
    told.flat_map(|warning| warning["rows"].as_array().expect("rows").clone()).collect()
}

/// The exit code of the small head: the published tests are made for images of 512 pixels and accept
/// none of its slices, an empty cloud.
fn ends_with(profile: &str) -> i32 {
    if profile == "paper" { 5 } else { 0 }
}

#[test]
fn an_unharmed_series_is_not_doubted() {
    let dir = tempfile::tempdir().expect("a folder");
    for profile in ["paper", "precise"] {
        let (code, text, report) = reconstruct(dir.path(), &head().files, profile);
        assert_eq!(code, Some(ends_with(profile)), "{text}");
        assert_eq!(doubtful_rows(&report), Vec::<Value>::new(), "{profile}");
    }
}

#[test]
fn a_slice_that_is_zero_from_a_row_on_is_refused_by_name() {
    let mut files = head().files.clone();
    let slice = 40;
    pixels(&mut files, slice)[BYTES * 2 / 5..].fill(0);
    let dir = tempfile::tempdir().expect("a folder");
    for profile in ["paper", "precise"] {
        let (code, text, _) = reconstruct(dir.path(), &files, profile);
        assert_eq!(code, Some(4), "{profile}: {text}");
        assert!(text.contains("inconsistent_levels"), "{text}");
        assert!(text.contains(&sop_instance_uid(&files[slice])), "{text}");
        assert!(!text.contains(&sop_instance_uid(&files[slice + 1])), "its neighbour is named too: {text}");
    }
}

/// The pixels of some slices, each row moved to the right by so many pixels, what leaves it comes in
/// again.
fn aside(files: &mut [Vec<u8>], slices: std::ops::Range<usize>, moved: usize) {
    for slice in slices {
        pixels(files, slice).chunks_exact_mut(2 * SIDE).for_each(|row| row.rotate_right(2 * moved));
    }
}

#[test]
fn a_run_of_damaged_slices_is_told_however_long() {
    for run in [30..34, 30..36, 30..45] {
        // Columns lost: refused.
        let mut files = head().files.clone();
        for slice in run.clone() {
            pixels(&mut files, slice).chunks_exact_mut(2 * SIDE).for_each(|row| row[SIDE * 6 / 5..].fill(0));
        }
        let dir = tempfile::tempdir().expect("a folder");
        let (code, text, _) = reconstruct(dir.path(), &files, "precise");
        assert_eq!(code, Some(4), "{run:?}: {text}");
        assert!(text.contains("inconsistent_levels"), "{text}");
        assert!(text.contains(&sop_instance_uid(&files[run.start])), "{text}");
        // Moved by 9 mm: told of each.
        let mut files = head().files.clone();
        aside(&mut files, run.clone(), 6);
        let dir = tempfile::tempdir().expect("a folder");
        let (code, text, report) = reconstruct(dir.path(), &files, "precise");
        if code == Some(4) {
            assert!(text.contains("inconsistent_levels"), "{text}");
            continue;
        }
        let told = doubtful_rows(&report);
        let of = |slice: usize| {
            let uid = sop_instance_uid(&files[slice]);
            told.iter().any(|rows| rows["sop_instance_uid"] == uid.as_str())
        };
        assert!(run.clone().all(of), "{run:?}: {told:?}");
    }
}

#[test]
fn a_patient_who_moved_far_and_stayed_is_told() {
    for moved in [5, 8, 12] {
        let mut files = head().files.clone();
        aside(&mut files, 37..head().files.len(), moved);
        let dir = tempfile::tempdir().expect("a folder");
        let (code, text, report) = reconstruct(dir.path(), &files, "precise");
        assert_eq!(code, Some(0), "{text}");
        let told = doubtful_rows(&report);
        let shift = told.iter().find(|rows| rows["doubt"] == "shift").expect("a shift");
        // One beside the movement: which, is told by the order of the places.
        let beside = [36, 37].map(|slice| Value::from(sop_instance_uid(&files[slice])));
        assert!(beside.contains(&shift["sop_instance_uid"]), "{shift}");
        let mm = shift["measured"].as_f64().expect("mm");
        assert!((mm - 1.5 * moved as f64).abs() < 1.5, "{moved} pixels of 1.5 mm are told as {mm} mm");
        let doubts = report["quality"]["doubts"].to_string();
        assert!(doubts.contains("inconsistent_levels"), "{doubts}");
    }
}

#[test]
fn exchanged_slices_are_refused_and_both_named() {
    let mut files = head().files.clone();
    let (a, b) = (20, 55);
    let of_a = pixels(&mut files, a).to_vec();
    let of_b = pixels(&mut files, b).to_vec();
    pixels(&mut files, a).copy_from_slice(&of_b);
    pixels(&mut files, b).copy_from_slice(&of_a);
    let dir = tempfile::tempdir().expect("a folder");
    let (code, text, _) = reconstruct(dir.path(), &files, "precise");
    assert_eq!(code, Some(4), "{text}");
    for slice in [a, b] {
        assert!(text.contains(&sop_instance_uid(&files[slice])), "{text}");
    }
}

#[test]
fn like_slices_in_each_others_places_are_a_doubt_that_names_them() {
    let unharmed = &head().files;
    let copied = |to: usize, from: usize, files: &mut Vec<Vec<u8>>| {
        let of_from = pixels(&mut unharmed.clone(), from).to_vec();
        pixels(files, to).copy_from_slice(&of_from);
    };
    // One is there twice; two are exchanged; three are in reverse.
    for (places, named) in [
        (vec![(40, 41)], [40, 41]),
        (vec![(30, 31), (31, 30)], [30, 31]),
        (vec![(20, 22), (22, 20)], [20, 22]),
    ] {
        let mut files = unharmed.clone();
        places.iter().for_each(|&(to, from)| copied(to, from, &mut files));
        let dir = tempfile::tempdir().expect("a folder");
        let (_, text, report) = reconstruct(dir.path(), &files, "paper");
        assert!(text.contains("inconsistent_levels"), "{places:?}: {text}");
        if report.is_object() {
            let rows = doubtful_rows(&report);
            for slice in named {
                let uid = Value::from(sop_instance_uid(&files[slice]));
                assert!(rows.iter().any(|row| row["sop_instance_uid"] == uid), "{places:?}: {rows:#?}");
            }
        }
    }
}

/// The head with a few rows of one slice lost: [`ROWS`] of [`SLICE`].
fn few_rows_lost() -> Vec<Vec<u8>> {
    let mut files = head().files.clone();
    pixels(&mut files, SLICE)[ROWS.start * 2 * SIDE..ROWS.end * 2 * SIDE].fill(0);
    files
}
const SLICE: usize = 30;
const ROWS: std::ops::Range<usize> = 70..73;

#[test]
fn a_few_lost_rows_are_a_doubt_that_names_them() {
    let files = few_rows_lost();
    let dir = tempfile::tempdir().expect("a folder");
    for profile in ["paper", "precise"] {
        let (code, text, report) = reconstruct(dir.path(), &files, profile);
        assert_eq!(code, Some(ends_with(profile)), "{profile}: {text}");
        assert!(text.contains("warning      inconsistent_levels"), "{text}");
        let rows = doubtful_rows(&report);
        let uid = Value::from(sop_instance_uid(&files[SLICE]));
        assert!(!rows.is_empty() && rows.iter().all(|row| row["sop_instance_uid"] == uid), "{rows:#?}");
        let seen = rows.iter().any(|row| row["first_row"] == ROWS.start + 1);
        assert!(seen, "rows {} to {}: {rows:#?}", ROWS.start + 1, ROWS.end);
        if profile == "precise" {
            assert_ne!(report["quality"]["verdict"], "good");
            assert_eq!(report["quality"]["doubtful_slices"], 1);
            let doubts = report["quality"]["doubts"].as_array().expect("doubts");
            assert!(doubts.contains(&Value::from("inconsistent_levels")), "{doubts:?}");
            assert!(
                text.lines().any(|l| l.starts_with("verdict") && l.contains("inconsistent_levels")),
                "{text}"
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn over_http_damage_is_a_doubt_of_the_result_or_the_reason_of_its_failure() {
    let service = Settings::new().with("pipeline.profile", "precise").start();
    pacs::push(&service, &few_rows_lost()).await;
    let client = Client::new(service.http);
    let rows = client.settled(&head().uid, 1).await;
    assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
    let doubts = rows[0]["quality"]["doubts"].as_array().expect("doubts");
    assert!(doubts.contains(&Value::from("inconsistent_levels")), "{doubts:?}");
    let report: Value = client.json(&format!("/v1/series/{}/report", head().uid)).await;
    assert!(!doubtful_rows(&report).is_empty(), "{:#?}", report["warnings"]);
    drop(service);

    let mut files = head().files.clone();
    pixels(&mut files, SLICE)[BYTES / 3..].fill(0);
    let service = Settings::new().with("pipeline.profile", "precise").start();
    pacs::push(&service, &files).await;
    let rows = Client::new(service.http).settled(&head().uid, 1).await;
    assert_eq!(rows[0]["state"], "failed", "{rows:#?}");
    assert_eq!(rows[0]["error"]["code"], "inconsistent_levels", "{rows:#?}");
}
