//! `triplanar evaluate` and `triplanar compare` as scripts see them.

use std::path::Path;
use std::process::Output;

use crate::support::service::{run, triplanar};

/// Runs it in `dir` with these arguments.
fn triplanar_in(dir: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = triplanar();
    command.current_dir(dir).args(arguments);
    let Output { status, stdout, stderr } = run(command);
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (status.code(), text(stdout), text(stderr))
}

fn figures(dir: &Path, arguments: &[&str]) -> serde_json::Value {
    let (code, stdout, stderr) = triplanar_in(dir, &[arguments, &["--json", "-"]].concat());
    assert_eq!(code, Some(0), "{stderr}");
    serde_json::from_str(&stdout).expect("nothing but JSON")
}

/// A box of 100 × 140 × 60 mm with a step on the patient's left front, as OBJ: no motion maps it to
/// itself, and mirroring shows. Corners about the middle, LPS mm.
fn truth_obj() -> String {
    // Outline in x y, counter-clockwise from above: the left front corner (x > 0, y < 0) is cut out.
    let outline = [(-50, -70), (10, -70), (10, -30), (50, -30), (50, 70), (-50, 70)];
    let mut text = String::from("# a box with a step\n");
    for z in [-30, 30] {
        outline.iter().for_each(|(x, y)| text.push_str(&format!("v {x} {y} {z}\n")));
    }
    for n in 0..6 {
        let (a, b) = (n + 1, (n + 1) % 6 + 1);
        text.push_str(&format!("f {a} {b} {} {}\n", b + 6, a + 6));
    }
    // Top and bottom as two convex parts each.
    for face in ["7 8 9 12", "9 10 11 12", "6 3 2 1", "6 5 4 3"] {
        text.push_str(&format!("f {face}\n"));
    }
    text
}

/// Points every 2 mm on the box's surface, `outward` mm off its upright sides, its top and bottom,
/// and away from the edges.
fn points(outward: f64) -> Vec<[f64; 3]> {
    let mut points = Vec::new();
    let steps = |from: i32, to: i32| ((from + 2)..=(to - 2)).step_by(2).map(f64::from);
    let sides: [(bool, f64, f64, i32, i32); 6] = [
        (false, -70.0, -1.0, -50, 10),
        (true, 10.0, 1.0, -70, -30),
        (false, -30.0, -1.0, 10, 50),
        (true, 50.0, 1.0, -30, 70),
        (false, 70.0, 1.0, -50, 50),
        (true, -50.0, -1.0, -70, 70),
    ];
    for (is_x, place, sign, from, to) in sides {
        for along in steps(from, to) {
            for z in steps(-30, 30) {
                let off = place + sign * outward;
                points.push(if is_x { [off, along, z] } else { [along, off, z] });
            }
        }
    }
    for x in steps(-50, 50) {
        for y in steps(-70, 70) {
            if x <= 8.0 || y >= -28.0 {
                points.push([x, y, 30.0 + outward]);
                points.push([x, y, -30.0 - outward]);
            }
        }
    }
    points
}

fn ply(points: &[[f64; 3]], comment: &str) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\n{comment}element vertex {}\nproperty float x\nproperty float y\n\
         property float z\nend_header\n",
        points.len()
    );
    points.iter().for_each(|[x, y, z]| text.push_str(&format!("{x} {y} {z}\n")));
    text
}

/// By 1 degree about z, then by (0.5, −0.4, 0.3) mm.
fn moved([x, y, z]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = 1_f64.to_radians().sin_cos();
    [x * cos - y * sin + 0.5, x * sin + y * cos - 0.4, z + 0.3]
}

#[test]
fn figures_of_a_box_are_those_it_was_made_with() {
    let dir = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).expect("a file");
    write("truth.obj", truth_obj());
    let (inner, outer) = (points(-0.25), points(0.75));
    write("inner.ply", ply(&inner, ""));
    write("outer.ply", ply(&outer, "comment frame lps\n"));
    let axial: Vec<_> = outer.iter().copied().filter(|p| p[2].abs() < 29.5).collect();
    write("axial.ply", ply(&axial, ""));

    let found = figures(dir.path(), &["evaluate", "inner.ply", "--truth", "truth.obj"]);
    let number = |pointer: &str| found.pointer(pointer).and_then(serde_json::Value::as_f64).expect(pointer);
    assert!((number("/distances/bias_mm") + 0.25).abs() < 1e-6 && number("/distances/max_mm") < 0.250_01);
    assert!((number("/distances/rms_mm") - 0.25).abs() < 1e-6);
    assert_eq!(found["sign"], "faces");
    assert_eq!(found["truth"]["kind"], "mesh");
    assert_eq!(found["truth"]["triangles"], 20);
    assert_eq!(found["cloud"]["frame_from"], "assumed");
    assert!(found["over_axial"].is_null());
    assert!(number("/coverage/within_1_5_mm") > 0.9);
    assert_eq!(found["registration"]["settings"]["overlap"], 0.9);

    let arguments = ["evaluate", "outer.ply", "--truth", "truth.obj", "--axial", "axial.ply"];
    let found = figures(dir.path(), &arguments);
    let number = |pointer: &str| found.pointer(pointer).and_then(serde_json::Value::as_f64).expect(pointer);
    assert!((number("/distances/bias_mm") - 0.75).abs() < 1e-6);
    assert_eq!(found["cloud"]["frame_from"], "file");
    assert_eq!(found["over_axial"]["additional"], outer.len() as i64 - axial.len() as i64);
    // Top and bottom, 2.75 mm from the outermost axial points.
    assert_eq!(found["over_axial"]["unique"]["points"], (outer.len() - axial.len()) as i64);

    let (code, table, stderr) = triplanar_in(dir.path(), &[&arguments[..], &["--json", "f.json"]].concat());
    assert_eq!(code, Some(0), "{stderr}");
    for words in
        ["unique points", "additional points", "bias +0.750 mm", "rms after ICP", "lps (as the file says)"]
    {
        assert!(table.contains(words), "{words}: {table}");
    }
    let file = std::fs::read(dir.path().join("f.json")).expect("the figures");
    assert_eq!(serde_json::from_slice::<serde_json::Value>(&file).expect("JSON"), found);
}

/// An egg of a head's size with a nose, and an ear at the patient's left, points 4 mm apart.
fn egg() -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5_f64.sqrt());
    let bump = |u: [f64; 3], at: [f64; 3], height: f64| {
        height * (-30.0 * (1.0 - u.iter().zip(at).map(|(a, b)| a * b).sum::<f64>())).exp()
    };
    (0..7000)
        .map(|n| {
            let z = 1.0 - (2.0 * f64::from(n) + 1.0) / 7000.0;
            let (sin, cos) = (golden * f64::from(n)).sin_cos();
            let flat = (1.0 - z * z).sqrt();
            let u = [flat * cos, flat * sin, z];
            let r = 1.0 + bump(u, [0.0, -1.0, 0.0], 0.25) + bump(u, [0.98, 0.2, 0.0], 0.2);
            [75.0 * r * u[0], 95.0 * r * u[1], 110.0 * r * u[2]]
        })
        .collect()
}

#[test]
fn a_moved_cloud_comes_back_and_a_mirrored_one_does_not() {
    let dir = tempfile::tempdir().expect("a folder");
    let write = |name: &str, points: Vec<[f64; 3]>| {
        std::fs::write(dir.path().join(name), ply(&points, "")).expect("a file");
    };
    write("truth.ply", egg());
    write("moved.ply", egg().into_iter().map(moved).collect());
    write("mirrored.ply", egg().into_iter().map(|[x, y, z]| [-x, y, z]).collect());
    let evaluate = |cloud: &str| {
        figures(dir.path(), &["evaluate", cloud, "--truth", "truth.ply"])["registration"].clone()
    };
    let found = evaluate("moved.ply");
    assert!(found["rms_mm"].as_f64().expect("rms") < 0.01, "{found}");
    assert!((found["rotation_deg"].as_f64().expect("angle") - 1.0).abs() < 0.01, "{found}");
    assert!(found["initial_rms_mm"].as_f64().expect("rms") > 0.5);
    assert!(evaluate("mirrored.ply")["rms_mm"].as_f64().expect("rms") > 1.0);
}

#[test]
fn a_fit_of_half_a_cloud_is_called_doubtful() {
    // Farthest-point removal drops the sides across the motion; CloudCompare 2.11 ends at the same
    // motion, 0.637 degrees, of the 1 degree that it was.
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("truth.obj"), truth_obj()).expect("a file");
    let cloud = ply(&points(0.0).into_iter().map(moved).collect::<Vec<_>>(), "");
    std::fs::write(dir.path().join("moved.ply"), cloud).expect("a file");
    let (code, table, _) = triplanar_in(dir.path(), &["evaluate", "moved.ply", "--truth", "truth.obj"]);
    assert_eq!(code, Some(0));
    assert!(
        table.contains("DOUBTFUL: only 46.69 % of the points") && table.contains("0.637 degrees"),
        "{table}"
    );
}

#[test]
fn the_frame_is_the_files_unless_a_flag_says_otherwise() {
    let dir = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).expect("a file");
    let lps = points(0.0);
    let ras: Vec<_> = lps.iter().map(|[x, y, z]| [-x, -y, *z]).collect();
    write("lps.ply", ply(&lps, ""));
    write("ras.ply", ply(&ras, "comment frame ras\n"));
    write("silent.ply", ply(&ras, ""));
    let rms = |arguments: &[&str]| {
        let found = figures(dir.path(), &[&["compare"], arguments].concat());
        (found["a_to_b"]["distances"]["rms_mm"].as_f64().expect("rms"), found["b"]["frame_from"].clone())
    };
    assert_eq!(rms(&["lps.ply", "ras.ply"]), (0.0, "file".into()));
    assert!(rms(&["lps.ply", "silent.ply"]).0 > 1.0);
    assert_eq!(rms(&["lps.ply", "silent.ply", "--frame-b", "ras"]), (0.0, "flag".into()));
    let (off, from) = rms(&["lps.ply", "ras.ply", "--frame-b", "lps"]);
    assert!(off > 1.0 && from == "flag_against_file");
    let found = figures(dir.path(), &["evaluate", "silent.ply", "--truth", "lps.ply", "--frame", "ras"]);
    assert_eq!(found["distances"]["rms_mm"], 0.0);
    assert!(found["distances"]["bias_mm"].is_null(), "a cloud has no sides");
    let (_, table, _) = triplanar_in(dir.path(), &["compare", "lps.ply", "silent.ply"]);
    for words in ["Hausdorff", "unique in A", "A covered by B", "assumed"] {
        assert!(table.contains(words), "{words}: {table}");
    }
}

#[test]
fn what_cannot_be_measured_ends_with_its_exit_code_and_what_to_do() {
    let dir = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).expect("a file");
    write("good.ply", &ply(&points(0.0), ""));
    write("empty.ply", &ply(&[], ""));
    write("cut.ply", &ply(&points(0.0), "")[..500]);
    write("odd.vtk", "# vtk");
    write("none.ply", &ply(&[[f64::NAN; 3]; 5], ""));
    let in_metres: Vec<_> = points(0.0).into_iter().map(|p| p.map(|v| v / 1000.0)).collect();
    write("metres.ply", &ply(&in_metres, ""));
    for (arguments, expected, words) in [
        (&["evaluate", "nowhere.ply", "--truth", "good.ply"][..], 3, "nowhere.ply"),
        (&["evaluate", "cut.ply", "--truth", "good.ply"], 3, "damaged"),
        (&["evaluate", "good.ply", "--truth", "odd.vtk"], 3, ".npy"),
        (&["evaluate", "empty.ply", "--truth", "good.ply"], 3, "the cloud holds no usable point"),
        (&["evaluate", "good.ply", "--truth", "none.ply"], 3, "the truth holds no usable point"),
        (&["evaluate", "good.ply", "--truth", "good.ply", "--axial", "empty.ply"], 3, "the axial cloud"),
        (&["compare", "good.ply", "empty.ply"], 3, "the second cloud"),
        (
            &["evaluate", "metres.ply", "--truth", "good.ply"],
            3,
            "good.ply is 1000 times as large as metres.ply",
        ),
        (&["evaluate", "good.ply", "--truth", "good.ply", "--axial", "metres.ply"], 3, "not in mm"),
        (&["compare", "good.ply", "metres.ply"], 3, "not in mm"),
        (&["evaluate", "good.ply"], 2, "--truth"),
        (&["evaluate", "good.ply", "--truth", "good.ply", "--overlap", "0"], 2, "a share above 0"),
        (&["compare", "good.ply", "good.ply", "--json", "no/such/folder.json"], 1, "can't be written"),
    ] {
        let (code, _, stderr) = triplanar_in(dir.path(), arguments);
        assert_eq!(code, Some(expected), "{arguments:?}: {stderr}");
        assert!(stderr.contains(words), "{arguments:?}: {stderr}");
    }
}
