//! Files that are whole or absent, after a power cut too: write under a temporary name, sync,
//! rename, sync the folder.

use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use tempfile::NamedTempFile;

use crate::{FileError, regular};

/// Beginning of the name of a temporary file.
const TEMPORARY_PREFIX: &str = ".sweep-";
/// Ending of the name of a temporary file.
const TEMPORARY_SUFFIX: &str = ".tmp";

/// Greatest number of attempts to make a temporary file. An attempt fails if another process has a
/// file of this name, or removes the new file before it is locked. Basis: both are rare. Doubling
/// it makes no difference.
const MAX_ATTEMPTS: u32 = 5;

/// Number of hexadecimal digits of each of the two parts of a temporary file's name. Basis: with 48
/// bits, two processes of a cluster do not choose the same name, and no name that a user chooses
/// passes the check of its second part. Doubling it makes longer names.
const HASH_DIGITS: usize = 12;

/// Whether a name is that of a temporary file. The second part of such a name is a hash of the
/// first, so that no user's file is taken for a temporary one.
pub fn is_temporary(name: &str) -> bool {
    let token_and_check =
        name.strip_prefix(TEMPORARY_PREFIX).and_then(|rest| rest.strip_suffix(TEMPORARY_SUFFIX));
    let token_and_check = token_and_check.and_then(|joined_parts| joined_parts.split_once('-'));
    token_and_check
        .is_some_and(|(token, check)| token.len() == HASH_DIGITS && check == hash_digits(token))
}

/// Makes a name of a temporary file that this process has not made before.
pub fn temporary_name() -> String {
    /// The number of names that this process has made.
    static NAME_COUNT: AtomicU64 = AtomicU64::new(0);
    let sequence = NAME_COUNT.fetch_add(1, Ordering::Relaxed);
    let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
    let token = hash_digits(&format!("{} {now_ns} {sequence}", std::process::id()));
    format!("{TEMPORARY_PREFIX}{token}-{}{TEMPORARY_SUFFIX}", hash_digits(&token))
}

/// Computes the first digits of a text's hash.
fn hash_digits(text: &str) -> String {
    let hash = blake3::hash(text.as_bytes()).to_hex();
    hash.chars().take(HASH_DIGITS).collect()
}

/// Makes a temporary file in `folder`, which is deleted unless it is [`publish`]ed. The file is
/// locked while its process lives, so that [`clear_leftovers`] deletes only the files of killed
/// processes.
///
/// # Errors
/// [`FileError::Io`].
pub fn create_temporary(folder: &Path) -> Result<NamedTempFile, FileError> {
    let mut attempt = 1;
    loop {
        let name = temporary_name();
        let mut builder = tempfile::Builder::new();
        builder.prefix(&name).rand_bytes(0);
        // Results are for sharing: the umask decides who reads them, not the private default of
        // temporary files.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = match builder.tempfile_in(folder) {
            Err(error)
                if error.kind() == io::ErrorKind::AlreadyExists && attempt < MAX_ATTEMPTS =>
            {
                attempt += 1;
                continue;
            }
            created => created.map_err(FileError::io("create a file in", folder))?,
        };
        let is_lost = match file.as_file().try_lock() {
            Ok(()) => !is_at_path(file.as_file(), file.path()),
            Err(TryLockError::WouldBlock) => true,
            // On a file system without locks, [`clear_leftovers`] deletes no file.
            Err(TryLockError::Error(_)) => false,
        };
        if !is_lost || attempt == MAX_ATTEMPTS {
            return Ok(file);
        }
        attempt += 1;
    }
}

/// Whether an open file is the file at a path.
#[cfg(unix)]
pub fn is_at_path(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(open), Ok(named)) => (open.dev(), open.ino()) == (named.dev(), named.ino()),
        _ => false,
    }
}

/// Whether the path exists. On systems other than Unix an open file cannot be deleted, so that a
/// file at the path is the open one.
#[cfg(not(unix))]
pub fn is_at_path(_file: &File, path: &Path) -> bool {
    path.exists()
}

/// Syncs a finished file, renames it to `target` on the same file system, and syncs the target's
/// folder.
///
/// # Errors
/// [`FileError::Io`].
pub fn publish(file: NamedTempFile, target: &Path) -> Result<(), FileError> {
    file.as_file().sync_all().map_err(FileError::io("sync", target))?;
    file.persist(target)
        .map_err(|error| FileError::io("rename a finished file to", target)(error.error))?;
    sync_folder(parent(target))
}

/// Writes a file in one step, and replaces an older one. The temporary file is made in `folder`.
///
/// This function is for files in a run's own folder; files that a user has named are written by
/// [`crate::Output`].
///
/// # Errors
/// [`FileError::Io`].
pub fn write(folder: &Path, target: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut file = create_temporary(folder)?;
    file.write_all(bytes).map_err(FileError::io("write", target))?;
    publish(file, target)
}

/// Writes a file in one step, unless there is already one. Returns whether it was written.
///
/// # Errors
/// [`FileError::Io`].
pub fn create(folder: &Path, target: &Path, bytes: &[u8]) -> Result<bool, FileError> {
    let mut file = create_temporary(folder)?;
    file.write_all(bytes).map_err(FileError::io("write", target))?;
    file.as_file().sync_all().map_err(FileError::io("sync", target))?;
    match file.persist_noclobber(target) {
        Ok(_) => sync_folder(parent(target)).map(|()| true),
        Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => Ok(false),
        Err(error) => Err(FileError::io("rename a finished file to", target)(error.error)),
    }
}

/// Syncs a folder, so that renames and removals in it are kept after a power cut.
///
/// # Errors
/// [`FileError::Io`].
pub fn sync_folder(folder: &Path) -> Result<(), FileError> {
    let result = File::open(folder).and_then(|folder| folder.sync_all());
    match result {
        // Some network file systems cannot sync a folder; this is no error.
        Err(error)
            if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) =>
        {
            Ok(())
        }
        other => other.map_err(FileError::io("sync the folder", folder)),
    }
}

/// Deletes the temporary files in a folder that killed processes have left: those on which no
/// process has a lock. A file that cannot be deleted does no harm, so that no failure is an error.
pub fn clear_leftovers(folder: &Path) {
    let folder_entries = regular::file_names(folder).unwrap_or_default();
    for name in folder_entries.iter().filter(|name| name.to_str().is_some_and(is_temporary)) {
        let path = folder.join(name);
        if let Ok(file) = regular::open_to_write(&path)
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(&path);
        }
    }
}

/// Deletes a file, if there is one.
///
/// # Errors
/// [`FileError::Io`].
pub fn remove(path: &Path) -> Result<(), FileError> {
    regular::none_if_missing(fs::remove_file(path)).map_err(FileError::io("delete", path))?;
    Ok(())
}

/// Returns the folder of a path.
pub fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn create_keeps_an_existing_file_and_write_replaces_it() {
        let folder = tempfile::tempdir().unwrap();
        let target_path = folder.path().join("x");
        assert!(create(folder.path(), &target_path, b"first").unwrap());
        assert!(!create(folder.path(), &target_path, b"second").unwrap());
        assert_eq!(fs::read(&target_path).unwrap(), b"first");
        write(folder.path(), &target_path, b"third").unwrap();
        assert_eq!(fs::read(&target_path).unwrap(), b"third");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary stays behind");
    }

    #[test]
    fn a_change_of_any_character_makes_another_name_than_a_temporary_file_has() {
        let temporary_names = [temporary_name(), temporary_name()];
        assert_ne!(temporary_names[0], temporary_names[1]);
        for name in temporary_names {
            assert!(is_temporary(&name), "{name}");
            for at in TEMPORARY_PREFIX.len()..name.len() - TEMPORARY_SUFFIX.len() {
                let mut other_name = name.clone().into_bytes();
                other_name[at] ^= 1;
                let other_name = String::from_utf8(other_name).unwrap();
                assert!(!is_temporary(&other_name), "{other_name}");
            }
        }
    }

    #[test]
    fn only_unlocked_temporary_files_are_cleared() {
        let folder = tempfile::tempdir().unwrap();
        let leftover = folder.path().join(temporary_name());
        let locked_file = create_temporary(folder.path()).unwrap();
        fs::write(&leftover, "half a file").unwrap();
        let foreign_names = ["notes.tmp", ".sweep-notes.tmp", ".sweep-Xb7Qz1.tmp", ".sweep-.tmp"];
        for name in foreign_names {
            fs::write(folder.path().join(name), "mine").unwrap();
        }
        clear_leftovers(folder.path());
        assert!(!leftover.exists());
        assert!(locked_file.path().exists(), "its process lives");
        for name in foreign_names {
            assert!(folder.path().join(name).exists(), "{name}");
        }
        let path = locked_file.path().to_owned();
        // A killed process leaves the file without its lock.
        drop(locked_file.keep().unwrap());
        clear_leftovers(folder.path());
        assert!(!path.exists());
    }

    #[cfg(unix)]
    #[test]
    fn files_have_the_permissions_that_the_umask_allows() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let own_file = folder.path().join("ours");
        let plain_file = folder.path().join("plain");
        write(folder.path(), &own_file, b"").unwrap();
        File::create(&plain_file).unwrap();
        let permission_mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(permission_mode(&own_file), permission_mode(&plain_file));
    }

    #[test]
    fn the_error_for_a_missing_folder_names_it_and_advises() {
        let error = write(Path::new("/nonexistent/x.partial"), Path::new("/nonexistent/x"), b"")
            .unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("/nonexistent/x.partial") && text.contains("bring it back"),
            "{text}"
        );
        assert!(!error.is_refusal());
    }
}
