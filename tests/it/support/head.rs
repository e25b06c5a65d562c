//! A whole head that is quick to scan: 0.9 mm pixels, 2 mm slices. It leans, so that no axis is
//! another one's mirror, and only its left ear is there.

use std::path::Path;
use std::sync::OnceLock;

use serde_json::Value;
use triplanar::phantom::{Options, Phantom};

use super::service::{run, triplanar};

/// Voxels along z, y, x.
pub(crate) const SHAPE: [usize; 3] = [90, 250, 256];

/// The head, made once.
pub(crate) fn phantom() -> &'static Phantom {
    static PHANTOM: OnceLock<Phantom> = OnceLock::new();
    PHANTOM.get_or_init(|| {
        Phantom::new(Options {
            columns: SHAPE[2],
            rows: SHAPE[1],
            column_mm: 0.9,
            row_mm: 0.9,
            slices: SHAPE[0],
            slice_mm: 2.0,
            yaw_deg: 8.0,
            roll_deg: 5.0,
            ..Options::default()
        })
        .expect("valid options")
    })
}

/// Its instances as Part 10 files.
pub(crate) fn files() -> Vec<Vec<u8>> {
    phantom().instances().into_iter().map(|(_, bytes)| bytes).collect()
}

/// Its Series Instance UID.
pub(crate) fn uid() -> String {
    phantom().identity().series_instance_uid.to_string()
}

/// `triplanar reconstruct` of the files with these arguments more; the bytes of the file named by
/// `-o` there, the report, and what it printed.
pub(crate) fn reconstructed(dir: &Path, output: &str, arguments: &[&str]) -> (Vec<u8>, Value, String) {
    let input = dir.join("series");
    if !input.exists() {
        std::fs::create_dir(&input).expect("a folder");
        for (number, file) in files().iter().enumerate() {
            std::fs::write(input.join(number.to_string()), file).expect("a file");
        }
    }
    let mut command = triplanar();
    command.current_dir(dir).args(["reconstruct", "series", "--profile", "precise", "-o", output]);
    command.args(["--report", "report.json"]).args(arguments);
    let ended = run(command);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let report = std::fs::read(dir.join("report.json")).expect("the report");
    let bytes = std::fs::read(dir.join(output)).expect("the cloud");
    let said = String::from_utf8(ended.stdout).expect("text");
    (bytes, serde_json::from_slice(&report).expect("JSON"), said)
}
