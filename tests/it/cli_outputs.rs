//! What the commands say of results that are empty, of outputs that can't be written, and of
//! failures: exit code, message, and the files that are there afterwards.

use std::os::unix::fs::{PermissionsExt as _, symlink};
use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::support::head;
use crate::support::phantom::small;
use crate::support::service::{run, triplanar};

/// Runs it in `dir` with these arguments.
fn triplanar_in(dir: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = triplanar();
    command.current_dir(dir).args(arguments);
    let Output { status, stdout, stderr } = run(command);
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (status.code(), text(stdout), text(stderr))
}

fn write(dir: &Path, files: &[Vec<u8>]) {
    std::fs::create_dir_all(dir).expect("a folder");
    for (number, file) in files.iter().enumerate() {
        std::fs::write(dir.join(number.to_string()), file).expect("a file");
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON")
}

/// Names in a folder, sorted.
fn names(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).expect("a folder");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("text")).collect();
    names.sort();
    names
}

#[test]
fn a_filter_that_keeps_nothing_ends_with_the_code_of_an_empty_cloud() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("in"), &head::files());
    std::fs::write(dir.path().join("c.ply"), "of an earlier run").expect("a file");
    let arguments = ["reconstruct", "in", "-o", "c.ply", "--max-error-mm", "0.000001", "--report", "r.json"];
    let (code, _, stderr) = triplanar_in(dir.path(), &arguments);
    assert_eq!(code, Some(5), "{stderr}");
    let says = stderr.contains("empty_cloud") && stderr.contains("0.000001 mm") && stderr.contains("least");
    assert!(says, "{stderr}");
    let kept = std::fs::read(dir.path().join("c.ply")).expect("the earlier file");
    assert_eq!(kept, b"of an earlier run", "it is no result of this run");
    let report = json(&dir.path().join("r.json"));
    assert!(report["slices"].as_array().is_some_and(|rows| rows.len() > 100), "the report has its rows");
    assert_eq!(names(dir.path()), ["c.ply", "in", "r.json"]);
}

#[test]
fn the_count_that_is_printed_is_that_of_the_file() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("in"), &head::files());
    let mut counts = Vec::new();
    for plane in ["triplanar", "axial", "sagittal"] {
        let arguments = ["reconstruct", "in", "-o", "c.bin", "--format", "raw", "--plane", plane];
        let (code, stdout, stderr) = triplanar_in(dir.path(), &arguments);
        assert_eq!(code, Some(0), "{stderr}");
        let line = stdout.lines().find(|line| line.starts_with("points")).expect("a count");
        let printed: u64 = line.split_whitespace().nth(1).expect("a number").parse().expect("a number");
        let bytes = std::fs::metadata(dir.path().join("c.bin")).expect("a cloud").len();
        assert_eq!(printed * 12, bytes, "{plane}: {line}");
        counts.push(printed);
    }
    assert!(counts[1] < counts[0] && counts[2] < counts[0], "{counts:?}");
}

#[test]
fn a_plane_without_a_point_is_an_empty_cloud() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("in"), &small().files);
    // So few slices give the published algorithm axial contours alone.
    let coarse = ["--profile", "paper", "--min-neighbours", "0", "--plane", "sagittal"];
    let arguments = [&["reconstruct", "in", "-o", "c.ply", "--report", "r.json"][..], &coarse].concat();
    let (code, _, stderr) = triplanar_in(dir.path(), &arguments);
    assert_eq!((code, stderr.contains("empty_cloud")), (Some(5), true), "{stderr}");
    assert_eq!(names(dir.path()), ["in", "r.json"]);
}

#[test]
fn an_output_that_cannot_be_written_is_told_before_the_work() {
    let dir = tempfile::tempdir().expect("a folder");
    // Nothing of these inputs can be read: whoever reads them first ends with another code.
    std::fs::create_dir(dir.path().join("in")).expect("a folder");
    std::fs::create_dir(dir.path().join("folder.png")).expect("a folder");
    std::fs::create_dir(dir.path().join("folder.ply")).expect("a folder");
    std::fs::write(dir.path().join("file"), "").expect("a file");
    for arguments in [
        &["reconstruct", "in", "-o", "nowhere/c.ply"][..],
        &["reconstruct", "in", "-o", "folder.ply"],
        &["reconstruct", "in", "-o", "file/c.ply"],
        &["reconstruct", "in", "-o", "c.ply", "--report", "nowhere/r.json"],
        &["render", "none.ply", "-o", "nowhere/p.png"],
        &["render", "none.ply", "-o", "folder.png"],
        &["evaluate", "none.ply", "--truth", "none.npy", "--json", "nowhere/f.json"],
        &["compare", "none.ply", "none.npy", "--json", "nowhere/f.json"],
        &["phantom", "file/out"],
    ] {
        let (code, _, stderr) = triplanar_in(dir.path(), arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {stderr}");
        assert!(stderr.contains("can't be written"), "{arguments:?}: {stderr}");
    }
    for arguments in [
        &["reconstruct", "in", "-o", "c.ply", "--report", "./c.ply"][..],
        &["reconstruct", "file", "-o", "file", "--format", "ply"],
        &["evaluate", "file", "--truth", "none.npy", "--json", "file"],
        &["compare", "none.ply", "file", "--json", "file"],
    ] {
        let (code, _, stderr) = triplanar_in(dir.path(), arguments);
        assert_eq!((code, stderr.contains("given twice")), (Some(2), true), "{arguments:?}: {stderr}");
    }
    // The truth beside the images could not be written: not one image is.
    std::fs::create_dir(dir.path().join("out.json")).expect("a folder");
    let (code, _, stderr) = triplanar_in(dir.path(), &["phantom", "out", "--slices", "10", "--matrix", "32"]);
    assert_eq!(code, Some(1), "{stderr}");
    assert_eq!(names(&dir.path().join("out")), [""; 0], "nothing was written");
    assert!(names(dir.path()).iter().all(|name| !name.starts_with('.')), "{:?}", names(dir.path()));
}

#[test]
fn a_device_and_what_a_link_leads_to_are_written_and_not_replaced() {
    let dir = tempfile::tempdir().expect("a folder");
    let phantom = ["phantom", "in", "--slices", "10", "--matrix", "64", "--pixel", "4", "--step", "6"];
    assert_eq!(triplanar_in(dir.path(), &phantom).0, Some(0));
    std::fs::write(dir.path().join("figures"), "").expect("a file");
    symlink("figures", dir.path().join("link")).expect("a link");
    for output in ["/dev/null", "link"] {
        let compare = ["compare", "in.skin.npy", "in.skin.npy", "--json", output];
        let (code, _, stderr) = triplanar_in(dir.path(), &compare);
        assert_eq!(code, Some(0), "{stderr}");
    }
    assert!(!std::fs::metadata("/dev/null").expect("the device").is_file());
    assert!(std::fs::symlink_metadata(dir.path().join("link")).expect("a link").is_symlink());
    assert_eq!(json(&dir.path().join("figures"))["hausdorff_mm"], 0.0);
}

#[test]
fn a_phantom_in_this_folder_has_its_truth_beside_it() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(dir.path().join("head")).expect("a folder");
    let phantom = ["phantom", ".", "--slices", "10", "--matrix", "32", "--pixel", "8"];
    let (code, stdout, stderr) = triplanar_in(&dir.path().join("head"), &phantom);
    assert_eq!(code, Some(0), "{stderr}");
    assert_eq!(names(dir.path()), ["head", "head.json", "head.skin.npy"], "{stdout}");
}

#[test]
fn a_failure_leaves_a_report_that_tells_it_and_an_input_without_ct_is_code_3() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut gap = small().files.clone();
    gap.remove(gap.len() / 2);
    write(&dir.path().join("gap"), &gap);
    write(&dir.path().join("few"), &small().files[..3]);
    // The modality's value is two letters in each file: MR is no CT.
    let mr = small().files.iter().map(|file| replaced(file, b"CS\x02\0CT", b"CS\x02\0MR"));
    write(&dir.path().join("mr"), &mr.collect::<Vec<_>>());
    std::fs::create_dir(dir.path().join("empty")).expect("a folder");
    write(&dir.path().join("texts"), &[b"no DICOM".to_vec()]);
    for (input, expected, error) in [
        ("gap", 4, "missing_slice"),
        ("few", 4, "too_few_slices"),
        ("mr", 3, "not_ct"),
        ("empty", 3, "no_instances"),
        ("texts", 3, "no_instances"),
        ("nowhere", 3, "unreadable"),
    ] {
        std::fs::write(dir.path().join("r.json"), "of an earlier run").expect("a file");
        let arguments = ["reconstruct", input, "-o", "c.ply", "--report", "r.json"];
        let (code, _, stderr) = triplanar_in(dir.path(), &arguments);
        assert_eq!(code, Some(expected), "{input}: {stderr}");
        let report = json(&dir.path().join("r.json"));
        assert_eq!(report["error"]["code"], error, "{input}: {report:#}");
        assert!(report["error"]["detail"].as_str().is_some_and(|detail| stderr.contains(detail)));
        assert!(!dir.path().join("c.ply").exists(), "{input}");
    }
    let arguments = ["reconstruct", "gap", "-o", "c.ply", "--report", "r.csv"];
    assert_eq!(triplanar_in(dir.path(), &arguments).0, Some(4));
    let csv = std::fs::read_to_string(dir.path().join("r.csv")).expect("a report");
    assert!(csv.starts_with("plane,index,") && csv.lines().count() == 1, "{csv}");

    let help = triplanar_in(dir.path(), &["--help"]).1;
    for line in ["\n  0  done", "\n  3  the input can't be read, or holds no CT series", "\n  5  no skin"] {
        assert!(help.contains(line), "{line:?} is not in the help:\n{help}");
    }
}

fn replaced(file: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    let places: Vec<_> = (0..file.len() - from.len()).filter(|&at| file[at..].starts_with(from)).collect();
    assert!(!places.is_empty(), "the phantom's files say that they are CT");
    for at in places {
        file[at..at + from.len()].copy_from_slice(to);
    }
    file
}

#[test]
fn a_comparison_names_the_cloud_whose_normals_give_the_sign() {
    let dir = tempfile::tempdir().expect("a folder");
    let cloud = |height: f64| {
        let points = (0..100).map(|i| format!("{} {} {height} 0 0 1\n", i % 10, i / 10));
        format!(
            "ply\nformat ascii 1.0\nelement vertex 100\nproperty float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty float ny\nproperty float nz\nend_header\n{}",
            points.collect::<String>()
        )
    };
    std::fs::write(dir.path().join("a.ply"), cloud(0.0)).expect("a file");
    std::fs::write(dir.path().join("b.ply"), cloud(0.5)).expect("a file");
    let (code, stdout, stderr) = triplanar_in(dir.path(), &["compare", "a.ply", "b.ply"]);
    assert_eq!(code, Some(0), "{stderr}");
    for words in ["bias -0.500 mm (along B's normals)", "bias +0.500 mm (along A's normals)"] {
        assert!(stdout.contains(words), "{stdout}");
    }
    assert!(!stdout.contains("truth"), "a comparison knows no truth:\n{stdout}");
}

#[test]
fn the_format_ply_is_the_binary_one() {
    let dir = tempfile::tempdir().expect("a folder");
    write(&dir.path().join("in"), &small().files);
    for (output, format) in [("a.cloud", "ply"), ("b.cloud", "ply_binary")] {
        let arguments = ["reconstruct", "in", "-o", output, "--format", format];
        let coarse = ["--profile", "paper", "--min-neighbours", "0"];
        let (code, _, stderr) = triplanar_in(dir.path(), &[&arguments[..], &coarse].concat());
        assert_eq!(code, Some(0), "{stderr}");
    }
    let file = |name: &str| std::fs::read(dir.path().join(name)).expect("a cloud");
    assert!(file("a.cloud") == file("b.cloud") && file("a.cloud").starts_with(b"ply\nformat binary"));
    let mode = std::fs::metadata(dir.path().join("a.cloud")).expect("a cloud").permissions().mode();
    assert_eq!(mode & 0o600, 0o600);
}
