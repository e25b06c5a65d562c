//! Output files: whether they can be written is asked before the work begins, and they are whole or
//! as they were.

use std::ffi::OsString;
use std::fmt::Display;
use std::fs::{self, File, Permissions};
use std::io::{self, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::Failed;

/// Bytes that the disk must take for an output to be begun: a small cloud. A large one has some MB.
const ROOM: usize = 1 << 20;

/// Refuses a path at which nothing can be written: no folder, no permission, no room. What is at the
/// path stays as it is.
pub(super) fn check(path: &Path) -> Result<(), Failed> {
    let probe = |path| match Target::of(path)? {
        Target::File(target) => beside(&target)?.write_all(&vec![0; ROOM]),
        Target::Device => Ok(()),
    };
    probe(path).map_err(|error| cannot_write(path, &error))
}

/// Writes `bytes` beside `path` and moves them there once they are on the disk.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failed> {
    let write = |path| match Target::of(path)? {
        Target::File(target) => {
            let mut file = beside(&target)?;
            file.write_all(bytes)?;
            file.as_file().sync_all()?;
            file.persist(target)?;
            Ok(())
        }
        Target::Device => File::options().write(true).open(path)?.write_all(bytes),
    };
    write(path).map_err(|error| cannot_write(path, &error))
}

/// What an output's path leads to.
enum Target {
    /// A file, or none yet; links are resolved where it exists.
    File(PathBuf),
    /// A device or a pipe: nothing may take its place.
    Device,
}

impl Target {
    fn of(path: &Path) -> io::Result<Self> {
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            Ok(found) if !found.is_file() => Ok(Self::Device),
            Ok(_) => {
                // A file that is protected must not be replaced although its folder would let us.
                File::options().write(true).open(path)?;
                Ok(Self::File(fs::canonicalize(path)?))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Self::File(path.to_owned())),
            Err(error) => Err(error),
        }
    }
}

/// A new file in the same folder, that is gone unless it is moved.
fn beside(target: &Path) -> io::Result<NamedTempFile> {
    if target.file_name().is_none() || target.as_os_str().as_encoded_bytes().ends_with(b"/") {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"));
    }
    // As any new file; the process's umask takes away what it should not have.
    let permissions = Permissions::from_mode(0o666);
    tempfile::Builder::new().permissions(permissions).tempfile_in(folder_of(target))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn cannot_write(path: &Path, error: &io::Error) -> Failed {
    Failed::internal(format!("{} can't be written: {error}", path.display()))
}

/// Refuses an output in the place of an input or of another output.
pub(super) fn all_differ<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failed> {
    let mut taken: Vec<PathBuf> = inputs.into_iter().map(place).collect();
    for output in outputs {
        let is_device = fs::metadata(output).is_ok_and(|found| !found.is_file());
        if !is_device && taken.contains(&place(output)) {
            let message = format!("{} is given twice: name another output", output.display());
            return Err(Failed::usage(message));
        }
        taken.push(place(output));
    }
    Ok(())
}

/// The path without links, as far as it exists.
fn place(path: &Path) -> PathBuf {
    if let Ok(whole) = fs::canonicalize(path) {
        return whole;
    }
    let name = path.file_name().map_or_else(OsString::new, OsString::from);
    fs::canonicalize(folder_of(path)).map_or_else(|_| path.to_owned(), |folder| folder.join(name))
}

/// Prints to standard output. A reader that has gone, as `head` does, is no failure; a full disk is.
pub(super) fn print(text: impl Display) -> Result<(), Failed> {
    let mut out = io::stdout().lock();
    match out.write_all(text.to_string().as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failed::internal(format!("standard output can't be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// A line on standard error. Where that can't be written there is no other place to say so; the exit code stays.
pub(super) fn tell(line: impl Display) {
    let _untold = writeln!(io::stderr(), "{line}");
}
