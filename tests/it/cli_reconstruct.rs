//! `triplanar reconstruct` as scripts see it: what it writes and how it exits.

use std::io::Write as _;
use std::path::Path;
use std::process::Output;

use triplanar::phantom::Options;

use crate::support::phantom::{Series, series, small};
use crate::support::service::{run, triplanar};

fn write(dir: &Path, files: &[Vec<u8>]) {
    std::fs::create_dir_all(dir).expect("a folder");
    for (number, file) in files.iter().enumerate() {
        std::fs::write(dir.join(number.to_string()), file).expect("a file");
    }
}

fn zip(path: &Path, files: &[Vec<u8>]) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).expect("a file"));
    for (number, file) in files.iter().enumerate() {
        zip.start_file(format!("a/b/{number}.dcm"), zip::write::SimpleFileOptions::default())
            .expect("an entry");
        zip.write_all(file).expect("its bytes");
    }
    zip.finish().expect("a zip");
}

/// Runs it in `dir` with these arguments.
fn reconstruct(dir: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = triplanar();
    command.current_dir(dir).arg("reconstruct").args(arguments);
    let Output { status, stdout, stderr } = run(command);
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (status.code(), text(stdout), text(stderr))
}

/// No whole head, and slices that would be too far apart for the published radius filter.
const COARSE: [&str; 4] = ["--profile", "paper", "--min-neighbours", "0"];

/// Few slices of another series.
fn other() -> Series {
    series(Options { seed: 2, slices: 10, slice_mm: 6.0, columns: 64, rows: 64, ..Options::default() })
}

#[test]
fn a_folder_and_a_zip_give_the_same_files_and_the_extension_tells_the_format() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("in/deep/er"), &small().files);
    std::fs::write(dir.path().join("in/readme.txt"), "no DICOM").expect("a file");
    zip(&dir.path().join("in.zip"), &small().files);
    let report = ["--report", "r.json"];
    for (input, output) in [("in", "folder.ply"), ("in.zip", "zip.ply")] {
        let arguments = [&[input, "-o", output][..], &COARSE, &report].concat();
        let (code, stdout, stderr) = reconstruct(dir.path(), &arguments);
        assert_eq!(code, Some(0), "{stderr}");
        assert!(stdout.contains(&small().uid) && stdout.contains("points"), "{stdout}");
    }
    let file = |name: &str| std::fs::read(dir.path().join(name)).expect(name);
    assert!(file("folder.ply") == file("zip.ply"), "other bytes from a zip");
    let report: serde_json::Value = serde_json::from_slice(&file("r.json")).expect("JSON");
    let rows = report["slices"].as_array().expect("rows").len();
    assert_eq!(rows, small().files.len() + 512 + 512, "a row for every slice of every plane");
    assert!(!String::from_utf8(file("r.json")).expect("text").contains("PHANTOM"), "a patient's name");

    let arguments =
        [&["in", "-o", "c.npy", "--frame", "ras", "--plane", "axial", "--report", "r.csv"][..], &COARSE];
    assert_eq!(reconstruct(dir.path(), &arguments.concat()).0, Some(0));
    assert!(file("c.npy").starts_with(b"\x93NUMPY"));
    assert_eq!(String::from_utf8(file("r.csv")).expect("text").lines().count(), rows + 1);
}

#[test]
fn several_series_are_listed_and_one_is_chosen_by_its_uid() {
    let dir = tempfile::tempdir().expect("a folder");
    let other = other();
    write(&dir.path().join("in/1"), &small().files);
    write(&dir.path().join("in/2"), &other.files);
    let (code, _, stderr) = reconstruct(dir.path(), &["in", "-o", "c.ply"]);
    assert_eq!(code, Some(2), "{stderr}");
    assert!(
        stderr.contains("--series") && stderr.contains(&other.uid) && stderr.contains(&small().uid),
        "{stderr}"
    );
    let arguments = [&["in", "-o", "c.ply", "--series", &small().uid][..], &COARSE].concat();
    assert_eq!(reconstruct(dir.path(), &arguments).0, Some(0));
}

#[test]
fn files_that_are_not_used_are_told_and_stand_in_the_report() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("in"), &small().files);
    std::fs::write(dir.path().join("in/readme.txt"), "no DICOM").expect("a file");
    let half = &small().files[0][..small().files[0].len() / 2];
    std::fs::write(dir.path().join("in/torn.dcm"), half).expect("a file");
    write(&dir.path().join("in/other"), &other().files[..2]);
    let arguments = [&["in", "-o", "c.ply", "--report", "r.json"][..], &COARSE].concat();
    let (code, stdout, stderr) = reconstruct(dir.path(), &arguments);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(stdout.lines().any(|line| line.starts_with("not used     4 files")), "{stdout}");
    let report = std::fs::read_to_string(dir.path().join("r.json")).expect("the report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let unused = report["unused"].as_array().expect("a list").iter();
    let unused: Vec<_> =
        unused.map(|file| (file["name"].as_str().unwrap(), file["code"].as_str().unwrap())).collect();
    let expected = [
        ("other/0", "other-series"),
        ("other/1", "other-series"),
        ("readme.txt", "not-dicom"),
        ("torn.dcm", "malformed-data-set"),
    ];
    assert_eq!(unused, expected);
}

#[test]
fn each_failure_has_its_exit_code_and_leaves_no_cloud() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("good"), &small().files);
    let mut gap = small().files.clone();
    gap.remove(gap.len() / 2);
    write(&dir.path().join("gap"), &gap);
    write(&dir.path().join("few"), &small().files[..3]);
    write(&dir.path().join("none"), &[b"no DICOM".to_vec()]);
    std::fs::write(dir.path().join("broken.zip"), b"PK\x03\x04 and nothing").expect("a file");
    for (what, arguments, expected, words) in [
        ("a missing folder", &["nowhere"][..], 3, "nowhere"),
        ("no DICOM", &["none"], 3, "no DICOM instance"),
        ("a broken zip", &["broken.zip"], 3, "zip"),
        ("too few slices", &["few"], 4, "too_few_slices: 3 slices, intake.min_slices is 10"),
        ("a gap", &["gap"], 4, "missing_slice"),
        (
            "nothing found",
            &["good", "--profile", "paper", "--hu-min", "3000", "--hu-max", "3000", "--report", "r.json"],
            5,
            "empty_cloud",
        ),
        ("a bad parameter", &["good", "--leaf", "0"], 2, "leaf_mm"),
        ("one without effect", &["good", "--hu-min", "-300"], 2, "hu_min has no effect under"),
        ("an unknown series", &["good", "--series", "1.2.3"], 2, "1.2.3"),
    ] {
        let (code, _, stderr) = reconstruct(dir.path(), &[arguments, &["-o", "c.ply"]].concat());
        assert_eq!(code, Some(expected), "{what}: {stderr}");
        assert!(stderr.contains(words), "{what}: {stderr}");
        assert!(!dir.path().join("c.ply").exists(), "{what}: a cloud was written");
    }
    let report = std::fs::read_to_string(dir.path().join("r.json")).expect("the report of an empty cloud");
    assert!(report.contains("\"empty_cloud\"") && report.contains("\"no_contour\""));
    let (code, _, stderr) = reconstruct(dir.path(), &["good", "-o", "c.stl"]);
    assert_eq!((code, stderr.contains("--format")), (Some(2), true), "{stderr}");
}
