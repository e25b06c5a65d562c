//! `triplanar demo` as a newcomer sees it.

use crate::support::service::{run, triplanar};
use crate::support::vertices::ply;

#[test]
fn the_demo_leaves_cloud_report_and_picture_and_says_where() {
    let dir = tempfile::tempdir().expect("a folder");
    let mut command = triplanar();
    command.current_dir(dir.path()).args(["demo", "--once"]);
    let ended = run(command);
    let said = String::from_utf8(ended.stdout).expect("text");
    assert_eq!(ended.status.code(), Some(0), "{said}\n{}", String::from_utf8_lossy(&ended.stderr));
    for (name, file) in [("cloud", "skin.ply"), ("report", "report.json"), ("picture", "skin.png")] {
        let path = format!("triplanar-demo/{file}");
        let line = said.lines().find(|line| line.starts_with(name)).unwrap_or_default();
        assert_eq!(line.split_whitespace().last(), Some(&*format!("./{path}")), "{name}:\n{said}");
        assert!(dir.path().join(path).is_file(), "{name}");
    }
    let file = |name: &str| std::fs::read(dir.path().join("triplanar-demo").join(name)).expect("a file");
    let (cloud, _) = ply(&file("skin.ply"));
    let report: serde_json::Value = serde_json::from_slice(&file("report.json")).expect("JSON");
    assert_eq!(report["figures"]["merged"], cloud["x"].len(), "report and cloud are of one reconstruction");
    let picture = image::load_from_memory(&file("skin.png")).expect("a PNG").to_rgb8();
    let colours: std::collections::HashSet<_> = picture.pixels().map(|pixel| pixel.0).collect();
    assert!(picture.width() > 500 && colours.len() > 100, "{} colours", colours.len());
}

#[test]
fn a_demo_that_can_leave_nothing_says_so_at_once() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("file"), "").expect("a file");
    let mut command = triplanar();
    command.current_dir(dir.path()).args(["demo", "--once", "--output", "file/out"]);
    let ended = run(command);
    let (said, stderr) = (String::from_utf8_lossy(&ended.stdout), String::from_utf8_lossy(&ended.stderr));
    assert_eq!(ended.status.code(), Some(1), "{said}{stderr}");
    assert!(stderr.contains("file/out") && !said.contains("making"), "{said}{stderr}");
}
