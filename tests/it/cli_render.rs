//! `triplanar render` as scripts see it.

use std::path::Path;
use std::process::Output;

use crate::support::service::{run, triplanar};

/// Runs it in `dir` with these arguments.
fn render(dir: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = triplanar();
    command.current_dir(dir).arg("render").args(arguments);
    let Output { status, stderr, .. } = run(command);
    (status.code(), String::from_utf8(stderr).expect("text"))
}

/// A disc that faces the front, with a knob at the patient's left, found in the axial plane, and its
/// rest in the sagittal one.
fn cloud(frame: &str, sign: i32) -> String {
    let mut rows = Vec::new();
    for x in -50_i32..=50 {
        for z in -50_i32..=50 {
            if x * x + z * z <= 2500 {
                let planes = if x > 25 { 1 } else { 2 };
                rows.push(format!("{} 0 {z} {planes}\n", sign * x));
            }
        }
    }
    format!(
        "ply\nformat ascii 1.0\ncomment frame {frame}\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nproperty uchar planes\nend_header\n{}",
        rows.len(),
        rows.concat()
    )
}

/// Mean column, as a share of the width, of the pixels that are rather red (axial).
fn red_side(path: &Path) -> f64 {
    let image = image::open(path).expect("a picture").to_rgb8();
    // The legend below has the colours, too.
    let rows = image.height() - 60;
    let red: Vec<f64> = image
        .enumerate_pixels()
        .filter(|(_, y, p)| *y < rows && p.0[0] > 90 && p.0[0] / 2 > p.0[1].max(p.0[2]))
        .map(|(x, ..)| f64::from(x))
        .collect();
    assert!(red.len() > 200, "{} red pixels", red.len());
    red.iter().sum::<f64>() / red.len() as f64 / f64::from(image.width())
}

#[test]
fn the_patients_left_is_at_the_right_of_the_front_view_whatever_the_frame() {
    let dir = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).expect("a file");
    write("lps.ply", cloud("lps", 1));
    write("ras.ply", cloud("ras", -1));
    for cloud in ["lps.ply", "ras.ply"] {
        for (view, is_right) in [("front", true), ("back", false)] {
            let arguments = [cloud, "-o", "p.png", "--view", view, "--height", "200"];
            let (code, stderr) = render(dir.path(), &arguments);
            assert_eq!(code, Some(0), "{stderr}");
            let side = red_side(&dir.path().join("p.png"));
            assert_eq!(side > 0.55, is_right, "{cloud} from {view}: {side}");
        }
    }
    let once = std::fs::read(dir.path().join("p.png")).expect("a picture");
    render(dir.path(), &["ras.ply", "-o", "q.png", "--view", "back", "--height", "200"]);
    let named = |name: &str| std::fs::read(dir.path().join(name)).expect("a picture");
    assert!(named("q.png") == once, "same input, same bytes");
}

#[test]
fn what_cannot_be_drawn_is_said() {
    let dir = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).expect("a file");
    write("a.ply", cloud("lps", 1));
    write("empty.obj", "v nan 0 0\n".to_owned());
    for (arguments, expected, words) in [
        (&["a.ply", "--colour", "error"][..], 3, "expected_error_mm"),
        (&["empty.obj", "--colour", "normal"], 3, "no usable point"),
        (&["nowhere.ply"], 3, "nowhere.ply"),
        (&["a.ply", "--view", "below"], 2, "front"),
        (&["a.ply", "--caption", "x", "--caption", "y"], 2, "captions"),
        (&["a.ply", "--max-error", "0"], 2, "above 0"),
    ] {
        let (code, stderr) = render(dir.path(), &[arguments, &["-o", "p.png"]].concat());
        assert_eq!(code, Some(expected), "{arguments:?}: {stderr}");
        assert!(stderr.contains(words), "{arguments:?}: {stderr}");
        assert!(!dir.path().join("p.png").exists(), "{arguments:?}: a picture was written");
    }
    let arguments = [
        "a.ply",
        "a.ply",
        "-o",
        "p.png",
        "--view",
        "front,left,top",
        "--colour",
        "normal",
        "--theme",
        "dark",
    ];
    assert_eq!(render(dir.path(), &arguments).0, Some(0));
}
