//! Writing files that are whole or not there.

use std::fs::Permissions;
use std::io::{self, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

use super::Failed;

/// Writes `bytes` beside `path` and moves them there once they are on the disk.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failed> {
    write_beside(path, bytes)
        .map_err(|error| Failed::internal(format!("{} can't be written: {error}", path.display())))
}

fn write_beside(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    // As any new file; the process's umask takes away what it should not have.
    let permissions = Permissions::from_mode(0o666);
    let mut file = tempfile::Builder::new().permissions(permissions).tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}
