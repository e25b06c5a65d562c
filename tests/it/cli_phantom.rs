//! `triplanar phantom` and `triplanar token`.

use crate::support::service::{run, triplanar};

#[test]
fn a_phantom_comes_with_its_truth_and_never_overwrites() {
    let dir = tempfile::tempdir().expect("a folder");
    let make = || {
        let mut command = triplanar();
        command.current_dir(dir.path());
        command
            .args(["phantom", "head.1", "--matrix", "64", "--pixel", "3.6", "--slices", "20", "--step", "9"]);
        run(command)
    };
    let output = make();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::read_dir(dir.path().join("head.1")).expect("the series").count(), 20);
    let case = std::fs::read(dir.path().join("head.1.json")).expect("the case");
    let case: serde_json::Value = serde_json::from_slice(&case).expect("JSON");
    assert_eq!(case["options"]["slices"], 20);
    let skin = std::fs::read(dir.path().join("head.1.skin.npy")).expect("the true skin");
    assert!(skin.starts_with(b"\x93NUMPY") && skin.len() > 100_000);
    let again = make();
    assert_eq!(again.status.code(), Some(2), "a folder with files in it is left alone");
}
