//! What the tests find on this machine. A test that lacks it is *ignored*, with the reason, and never
//! counts as passed; libtest can't do that at run time.

use std::path::{Path, PathBuf};

/// What the tests read of the folder of test data.
const FOLDERS: [&str; 4] = ["series", "syntax", "published_program", "truth"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    test_data();
    right_to_mount();
}

/// `cfg(test_data)`: the shared series are there, at `TRIPLANAR_TEST_DATA` or beside the checkout.
fn test_data() {
    println!("cargo::rustc-check-cfg=cfg(test_data)");
    for name in ["TRIPLANAR_TEST_DATA", "TRIPLANAR_REQUIRE_TEST_DATA"] {
        println!("cargo::rerun-if-env-changed={name}");
    }
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let data =
        std::env::var_os("TRIPLANAR_TEST_DATA").map_or_else(|| root.join("../../shared/data"), PathBuf::from);
    let folders = FOLDERS.map(|folder| data.join(folder));
    let missing: Vec<_> = folders.iter().filter(|folder| !folder.is_dir()).collect();
    // Cargo would run this again and again for a path that does not exist.
    for folder in folders.iter().filter(|folder| folder.is_dir()) {
        println!("cargo::rerun-if-changed={}", folder.display());
    }
    if missing.is_empty() {
        println!("cargo::rustc-cfg=test_data");
        return;
    }
    assert!(
        std::env::var_os("TRIPLANAR_REQUIRE_TEST_DATA").is_none_or(|value| value != "1"),
        "TRIPLANAR_REQUIRE_TEST_DATA=1, and these are missing: {missing:?}"
    );
}

/// `cfg(may_mount)`: a test may mount a small file system of its own (CAP_SYS_ADMIN).
fn right_to_mount() {
    println!("cargo::rustc-check-cfg=cfg(may_mount)");
    const SYS_ADMIN: u64 = 1 << 21;
    let status = std::fs::read_to_string(Path::new("/proc/self/status")).unwrap_or_default();
    let capabilities = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let bits = capabilities.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
    if bits.is_some_and(|bits| bits & SYS_ADMIN != 0) {
        println!("cargo::rustc-cfg=may_mount");
    }
}
