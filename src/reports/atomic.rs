//! Files appear whole or not at all: written under a temporary name in the same folder, then renamed.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file that could not be written.
#[derive(Debug, Error)]
#[error("{}: cannot write: {source}; check that the folder exists, is writable and has room", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What the system said.
    #[source]
    pub source: io::Error,
}

/// Calls `write` with a buffered writer of a temporary file beside `path`, then renames it to `path`.
///
/// # Errors
/// When the folder cannot be written, `write` fails, or the rename fails; `path` is then as it was before.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), WriteError> {
    let run = || -> io::Result<()> {
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".medial-");
        #[cfg(unix)]
        {
            // A temporary file is private by default; an output must follow the user's umask like any other file.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder)?;
        let mut buffer = BufWriter::with_capacity(1 << 16, file);
        write(&mut buffer)?;
        let file = buffer.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    };
    run().map_err(|source| WriteError {
        path: path.to_owned(),
        source,
    })
}

/// Writes bytes or text whole; see [`write_atomically`].
///
/// # Errors
/// As [`write_atomically`].
pub fn write_bytes(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), WriteError> {
    write_atomically(path, |w| w.write_all(bytes.as_ref()))
}

/// Writes a value as indented JSON with a last newline.
///
/// # Errors
/// As [`write_atomically`]; a value that serde cannot serialise is reported as an I/O error of the file.
pub fn write_json<T: serde::Serialize + ?Sized>(path: &Path, value: &T) -> Result<(), WriteError> {
    write_atomically(path, |w| {
        serde_json::to_writer_pretty(&mut *w, value)?;
        w.write_all(b"\n")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_litter() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("a.txt");
        write_bytes(&path, "old").expect("writes");
        let failed = write_atomically(&path, |w| {
            w.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(failed.expect_err("fails").to_string().contains("a.txt"));
        assert_eq!(std::fs::read_to_string(&path).expect("reads"), "old");
        assert_eq!(std::fs::read_dir(dir.path()).expect("lists").count(), 1);
        assert!(write_bytes(&dir.path().join("no/such/folder"), "x").is_err());
    }
}
