//! Where the shared test data is. A test that needs it says so, and is ignored where `build.rs` does
//! not find it:
//!
//! ```ignore
//! #[test]
//! #[cfg_attr(not(test_data), ignore = "no test data at TRIPLANAR_TEST_DATA")]
//! ```

use std::io::Read;
use std::path::{Path, PathBuf};

/// The folder of the shared test data, from `TRIPLANAR_TEST_DATA`, or `../shared/data` beside the
/// checkout.
///
/// # Panics
/// If it is absent: the test is not marked as one that needs it.
pub(crate) fn dir() -> PathBuf {
    let path = std::env::var_os("TRIPLANAR_TEST_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    assert!(path.join("series").is_dir(), "no test data at {}", path.display());
    path
}

/// The files of `series/<name>.zip` whose path begins with `folder` (empty: all): path and bytes,
/// sorted by path.
pub(crate) fn series(data: &Path, name: &str, folder: &str) -> Vec<(String, Vec<u8>)> {
    let file = std::fs::File::open(data.join("series").join(format!("{name}.zip"))).expect("the series' zip");
    let mut archive = zip::ZipArchive::new(file).expect("a zip");
    let mut files = Vec::new();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).expect("an entry");
        let path = entry.name().expect("its path").into_owned();
        if entry.is_file() && path.starts_with(folder) {
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).expect("its bytes");
            files.push((path, bytes));
        }
    }
    files.sort();
    assert!(!files.is_empty(), "no files below {folder:?} in {name}.zip");
    files
}
