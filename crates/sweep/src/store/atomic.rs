//! Files that are whole or absent, after a power cut too: write under a temporary name, sync, rename, sync the folder.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use tempfile::NamedTempFile;

use super::error::StoreError;

/// Prefix and suffix of files in the making; what still carries them when no run is on is rubbish.
const PREFIX: &str = ".sweep-";
const SUFFIX: &str = ".tmp";

/// A file in the making inside `folder`; it disappears unless [`publish`]ed.
pub(crate) fn begin(folder: &Path) -> Result<NamedTempFile, StoreError> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    // Results are for sharing: the umask decides who reads them, not the private default of temporary files.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder).map_err(StoreError::io("create a file in", folder))
}

/// Syncs a file, gives it its name on the same file system, and syncs that name.
pub(crate) fn publish(file: NamedTempFile, target: &Path) -> Result<(), StoreError> {
    file.as_file().sync_all().map_err(StoreError::io("sync", target))?;
    file.persist(target).map_err(|error| StoreError::io("rename a finished file to", target)(error.error))?;
    sync_folder(parent(target))
}

/// Writes a file whole, over an older one if there is one. The temporary name lives in `folder`.
pub(crate) fn write(folder: &Path, target: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let mut file = begin(folder)?;
    file.write_all(bytes).map_err(StoreError::io("write", target))?;
    publish(file, target)
}

/// Writes a file whole unless it exists; says whether this process was the one that wrote it.
pub(crate) fn create(folder: &Path, target: &Path, bytes: &[u8]) -> Result<bool, StoreError> {
    let mut file = begin(folder)?;
    file.write_all(bytes).map_err(StoreError::io("write", target))?;
    file.as_file().sync_all().map_err(StoreError::io("sync", target))?;
    match file.persist_noclobber(target) {
        Ok(_) => sync_folder(parent(target)).map(|()| true),
        Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) => Err(StoreError::io("rename a finished file to", target)(error.error)),
    }
}

/// Makes renames and removals in a folder last.
pub(crate) fn sync_folder(folder: &Path) -> Result<(), StoreError> {
    let synced = File::open(folder).and_then(|folder| folder.sync_all());
    match synced {
        // Some network file systems cannot sync a folder; there is nothing more to ask of them.
        Err(error) if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => {
            Ok(())
        }
        other => other.map_err(StoreError::io("sync the folder", folder)),
    }
}

/// Deletes what interrupted writers left behind in a folder that this process alone uses.
pub(crate) fn sweep_leftovers(folder: &Path) -> Result<(), StoreError> {
    for entry in fs::read_dir(folder).map_err(StoreError::io("list", folder))? {
        let entry = entry.map_err(StoreError::io("list", folder))?;
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        if name.starts_with(PREFIX) && name.ends_with(SUFFIX) {
            let path = entry.path();
            remove(&path)?;
        }
    }
    Ok(())
}

/// Deletes a file; one that is already gone is fine.
pub(crate) fn remove(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(StoreError::io("delete", path)(error)),
        _ => Ok(()),
    }
}

/// The folder a path lives in.
pub(crate) fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exit::Exit;

    #[test]
    fn create_leaves_the_first_and_write_replaces() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("x");
        assert!(create(folder.path(), &target, b"first").unwrap());
        assert!(!create(folder.path(), &target, b"second").unwrap());
        assert_eq!(fs::read(&target).unwrap(), b"first");
        write(folder.path(), &target, b"third").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"third");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary stays behind");
    }

    #[test]
    fn leftovers_go_and_everything_else_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (_, left) = begin(folder.path()).unwrap().keep().unwrap();
        fs::write(folder.path().join("notes.tmp"), "mine").unwrap();
        sweep_leftovers(folder.path()).unwrap();
        assert!(!left.exists());
        assert!(folder.path().join("notes.tmp").exists());
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_the_umask_lets_them() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write(folder.path(), &ours, b"").unwrap();
        File::create(&plain).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn a_vanished_folder_is_named_with_advice() {
        let error = write(Path::new("/nonexistent/x.partial"), Path::new("/nonexistent/x"), b"").unwrap_err();
        let text = error.to_string();
        assert!(text.contains("/nonexistent/x.partial") && text.contains("bring it back"), "{text}");
        assert_eq!(error.exit(), Exit::Failed);
    }
}
