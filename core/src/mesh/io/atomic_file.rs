//! Reading of whole files, and atomic writing: a write leaves either the old file or the complete
//! new one.

use crate::{Error, Result};
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Makes temporary names unique within the process.
static NEXT_TEMPORARY_NUMBER: AtomicU64 = AtomicU64::new(0);

/// Reads a whole file.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    if path.is_dir() {
        let text = "is a folder; name a file in it";
        return Err(Error::io("read", path, io::Error::new(ErrorKind::IsADirectory, text)));
    }
    fs::read(path).map_err(|e| Error::io("read", path, e))
}

/// Writes `bytes` to a temporary name in the same folder and renames it to `path`, so that a
/// failure (no space, no permission) leaves no partial file and keeps the old one.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomically(path, |file| file.write_all(bytes))
        .map_err(|e| Error::io("write", path, add_advice(e)))
}

/// Opens a temporary file (or a device), lets `fill` write to it and renames it to `path`.
fn write_atomically(path: &Path, fill: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    // Links are followed, and devices and pipes are written in place, because renaming would
    // replace them.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    match fs::metadata(&target) {
        Ok(found) if found.is_dir() => {
            return Err(io::Error::new(ErrorKind::IsADirectory, "is a folder; name a file"));
        }
        Ok(found) if !found.is_file() => {
            return OpenOptions::new().write(true).open(&target).and_then(|mut f| fill(&mut f));
        }
        _ => {}
    }
    let temporary = temporary_name(&target);
    let written = OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&temporary)
        .and_then(|mut file| fill(&mut file).and_then(|()| file.sync_all()))
        .and_then(|()| fs::rename(&temporary, &target));
    if written.is_err() {
        // Only the first failure is reported; a failure to remove the rest would add nothing.
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// A hidden name in the folder of `target`.
fn temporary_name(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let number = NEXT_TEMPORARY_NUMBER.fetch_add(1, Ordering::Relaxed);
    target.with_file_name(format!(".{name}.{}.{number}.partial", std::process::id()))
}

/// Adds advice for the user to frequent errors.
fn add_advice(error: io::Error) -> io::Error {
    let advice = match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "free some space or write to another disk"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose a folder that you may write to"
        }
        ErrorKind::NotFound => "create the folder first",
        _ => return error,
    };
    io::Error::new(error.kind(), format!("{error}; {advice}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        write_bytes(&path, b"old").unwrap();
        let failure = write_atomically(&path, |file| {
            file.write_all(b"half of the n")?;
            Err(ErrorKind::StorageFull.into())
        });
        assert_eq!(failure.unwrap_err().kind(), ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["mesh.ply"]);
        write_bytes(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["mesh.ply"]);
    }

    fn assert_write_fails(path: &Path, says: &str) {
        let error = write_bytes(path, &[0; 4096]).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }

    #[test]
    fn no_space_no_folder_and_a_folder_as_target_say_so() {
        let folder = tempfile::tempdir().unwrap();
        assert_write_fails(&folder.path().join("none/mesh.ply"), "create the folder first");
        assert_write_fails(folder.path(), "is a folder");
        if Path::new("/dev/full").exists() {
            assert_write_fails(Path::new("/dev/full"), "free some space");
        }
        assert!(names(folder.path()).is_empty());
        let denied = add_advice(ErrorKind::PermissionDenied.into()).to_string();
        assert!(denied.contains("a folder that you may write to"), "{denied}");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a"), folder.path().join("b"));
        write_bytes(&file, b"1").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_bytes(&link, b"2").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"2");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }
}
