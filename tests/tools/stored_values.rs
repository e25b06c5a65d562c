//! Prints what the files of a folder decode to: for each, its name and the SHA-256 of all stored
//! values as little-endian 32-bit numbers, frame by frame and row by row; or `error` and why there
//! are none. `tests/interop/jpeg_lossless.py` compares them with other decoders.
//!
//! ```text
//! cargo run --release --example stored_values -- FOLDER
//! ```

use std::error::Error;

use sha2::{Digest, Sha256};
use triplanar::dicom::pixels::stored_values;
use triplanar::dicom::scan::Limits;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: stored_values FOLDER")?;
    let mut paths: Vec<_> =
        std::fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>()?;
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match stored_values(&std::fs::read(&path)?, &Limits::default()) {
            Ok(frames) => {
                let mut digest = Sha256::new();
                for value in frames.iter().flatten() {
                    digest.update(value.to_le_bytes());
                }
                println!("{name} {}", hex::encode(digest.finalize()));
            }
            Err(error) => println!("{name} error {error}"),
        }
    }
    Ok(())
}
