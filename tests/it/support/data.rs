//! Where the shared test data is. Without it, the tests that need it are skipped, aloud.

use std::io::Read;
use std::path::{Path, PathBuf};

/// The folder of the shared test data, from `TRIPLANAR_TEST_DATA`, or `../shared/data` beside the
/// checkout. `None` (after a line on standard error) where it is absent.
///
/// # Panics
/// If it is absent although `TRIPLANAR_REQUIRE_TEST_DATA=1` says that it must be there.
pub(crate) fn dir() -> Option<PathBuf> {
    let path = std::env::var_os("TRIPLANAR_TEST_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    if path.join("series").is_dir() && path.join("syntax").is_dir() {
        return Some(path);
    }
    assert!(
        std::env::var_os("TRIPLANAR_REQUIRE_TEST_DATA").is_none_or(|value| value != "1"),
        "TRIPLANAR_REQUIRE_TEST_DATA=1, and there is no test data at {}",
        path.display()
    );
    let thread = std::thread::current();
    eprintln!("skipped: {}: no test data at {}", thread.name().unwrap_or("a test"), path.display());
    None
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
