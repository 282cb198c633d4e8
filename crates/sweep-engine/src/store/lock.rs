//! The locks of an output. Either one process works on the whole run, or any number of processes
//! work on its shards.
//!
//! Locks are those of the system (`flock`), which releases the locks of a killed process; the files
//! hold the names of the processes. A whole run and a merge lock the file `lock` exclusively.
//! Shards share that lock, and each also locks a file `shard-<i>.lock`, which shows that the shard
//! is running. A shard that is started twice is harmless and not refused: a scheduler that has lost
//! contact with a node starts its shard again, and must not wait for the lock of that node.

use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::{Folder, LOCK_FILE, LockHolder, StoreError};
use sweep_files::{FileError, atomic, regular};

/// The maximum length of a lock file, bytes. Basis: a process id and the longest name of a host.
/// Doubling it accepts longer names.
const MAX_LOCK_BYTES: u64 = 300;

/// The number of attempts to lock a file before it counts as locked by another process. Basis:
/// `sweep status` holds the lock for less than a millisecond. Doubling it doubles the time after
/// which a run is refused.
const MAX_ATTEMPTS: u32 = 5;
/// The time between two attempts. Basis: five attempts take 0.2 s. Doubling it doubles that time.
const ATTEMPT_INTERVAL: Duration = Duration::from_millis(40);

/// A held lock. It is released when the value is dropped or the process ends.
#[derive(Debug)]
pub struct Lock {
    /// The locked file `lock`; `None` if the file system has no locks.
    _run_file: Option<File>,
    /// The locked file of the shard, if there is one and no other process has locked it.
    _shard_file: Option<File>,
    /// The path of the file `lock`.
    path: PathBuf,
    /// Whether the file system has no locks, so that the run goes on without one.
    is_unsupported: bool,
}

impl Lock {
    /// Creates the folder if it does not exist, and locks it: for the whole run, or for one shard.
    pub fn acquire(folder: &Folder, shard_index: Option<u64>) -> Result<Self, StoreError> {
        let path = folder.file(LOCK_FILE);
        for attempt in 0..MAX_ATTEMPTS {
            if attempt > 0 {
                std::thread::sleep(ATTEMPT_INTERVAL);
            }
            fs::create_dir_all(&folder.path)
                .map_err(StoreError::io("make the folder", &folder.path))?;
            let mut file = match regular::open_or_create(&path) {
                Ok(file) => file,
                // A run that has just finished may have removed the folder after the line above
                // created it.
                Err(error)
                    if error.kind() == io::ErrorKind::NotFound && attempt + 1 < MAX_ATTEMPTS =>
                {
                    continue;
                }
                Err(error) => return Err(StoreError::io("open the lock", &path)(error)),
            };
            refuse_foreign_file(&mut file, &path)?;
            let lock_result =
                if shard_index.is_some() { file.try_lock_shared() } else { file.try_lock() };
            match lock_result {
                Ok(()) if !atomic::is_at_path(&file, &path) => continue,
                Ok(()) => {
                    let shard_file = match shard_index {
                        Some(shard_index) => lock_shard(folder, shard_index)?,
                        None => write_holder(&mut file, &path).map(|()| None)?,
                    };
                    return Ok(Self {
                        _run_file: Some(file),
                        _shard_file: shard_file,
                        path,
                        is_unsupported: false,
                    });
                }
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) if is_unsupported(&error) => {
                    return Ok(Self {
                        _run_file: None,
                        _shard_file: None,
                        path,
                        is_unsupported: true,
                    });
                }
                Err(TryLockError::Error(error)) => {
                    return Err(StoreError::io("lock", &path)(error));
                }
            }
        }
        Err(StoreError::Busy { output: folder.output.clone(), holders: find_holders(folder) })
    }

    /// Returns a note for the user if the file system has no locks.
    pub fn note_missing_locks(&self, folder: &Folder) -> Option<String> {
        let lock_warning =
            "is on a file system without locks: make sure that nothing else runs on this output";
        self.is_unsupported.then(|| format!("{} {lock_warning}", folder.path.display()))
    }

    /// Deletes the lock's file, so that no process can take the lock over, and then releases the
    /// lock.
    pub fn delete(self) -> Result<(), StoreError> {
        Ok(atomic::remove(&self.path)?)
    }
}

/// Returns the processes that work in the folder now, as far as their names can be read.
pub(super) fn find_holders(folder: &Folder) -> Vec<LockHolder> {
    let names = regular::file_names(&folder.path).unwrap_or_default().into_iter();
    let shard_and_path =
        |name: OsString| Some((shard_of_lock_name(name.to_str()?)?, folder.file(name)));
    let mut shard_locks: Vec<(u64, PathBuf)> = names.filter_map(shard_and_path).collect();
    shard_locks.sort_unstable();
    let mut holders: Vec<LockHolder> =
        shard_locks.iter().filter_map(|(shard, path)| read_holder(path, Some(*shard))).collect();
    // While shards share the folder's lock, the lock's file names the last process that held the
    // lock alone.
    if holders.is_empty() {
        holders.extend(read_holder(&folder.file(LOCK_FILE), None));
    }
    holders
}

/// Refuses a file that is not a lock: one that is not empty and has no name by [`write_holder`].
fn refuse_foreign_file(file: &mut File, path: &Path) -> Result<(), StoreError> {
    if is_lock(file).map_err(StoreError::io("read", path))? {
        return Ok(());
    }
    Err(FileError::Refused {
        path: path.to_path_buf(),
        reason: "the file there is no lock of `sweep run`".to_owned(),
        help: "give another name with --out, or move that file away first",
    }
    .into())
}

/// Returns whether a file is a lock: it is empty, or has nothing but a name by [`write_holder`].
fn is_lock(file: &mut File) -> io::Result<bool> {
    let mut text = Vec::new();
    file.take(MAX_LOCK_BYTES + 1).read_to_end(&mut text)?;
    let holder_line = std::str::from_utf8(&text).ok().and_then(|text| text.strip_suffix('\n'));
    let is_holder_line =
        holder_line.and_then(|holder_line| holder_line.split_once(' ')).is_some_and(
            |(process, host)| process.parse::<u32>().is_ok() && !host.contains(char::is_control),
        );
    Ok(text.is_empty() || is_holder_line)
}

/// Returns whether the file at a path is a lock.
pub(super) fn is_lock_file(path: &Path) -> bool {
    regular::open(path).and_then(|mut file| is_lock(&mut file)).unwrap_or(false)
}

/// Locks the file of a shard; `None` if another process has locked it.
fn lock_shard(folder: &Folder, shard: u64) -> Result<Option<File>, StoreError> {
    let path = folder.file(shard_lock_name(shard));
    let mut file =
        regular::open_or_create(&path).map_err(StoreError::io("open the lock", &path))?;
    refuse_foreign_file(&mut file, &path)?;
    if file.try_lock().is_err() {
        return Ok(None);
    }
    write_holder(&mut file, &path)?;
    Ok(Some(file))
}

/// Writes the id and the host of this process into a locked file.
fn write_holder(file: &mut File, path: &Path) -> Result<(), StoreError> {
    let holder_line = format!("{} {}\n", std::process::id(), super::provenance::host_name());
    file.set_len(0)
        .and_then(|()| file.rewind())
        .and_then(|()| file.write_all(holder_line.as_bytes()))
        .map_err(StoreError::io("write the process id to", path))
}

/// Returns whether an error says that the file system has no locks, as on some clusters.
fn is_unsupported(error: &io::Error) -> bool {
    /// The number of the error "no locks available" on Linux.
    const ENOLCK: i32 = 37;
    error.kind() == io::ErrorKind::Unsupported
        || (cfg!(target_os = "linux") && error.raw_os_error() == Some(ENOLCK))
}

/// Returns the shard that the name of its lock file gives, if the name is one.
pub(super) fn shard_of_lock_name(name: &str) -> Option<u64> {
    let shard = name.strip_prefix("shard-")?.strip_suffix(".lock")?.parse().ok()?;
    (shard_lock_name(shard) == name).then_some(shard)
}

/// Returns the name of a shard's lock file.
fn shard_lock_name(shard: u64) -> String {
    format!("shard-{shard}.lock")
}

/// Returns the process that is named in a lock file, if the file is locked.
fn read_holder(path: &Path, shard: Option<u64>) -> Option<LockHolder> {
    let file = regular::open(path).ok()?;
    if !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
        return None;
    }
    let mut text = String::new();
    file.take(MAX_LOCK_BYTES).read_to_string(&mut text).ok()?;
    let (pid, host) = text.trim_end().split_once(' ')?;
    Some(LockHolder { pid: pid.parse().ok()?, host: host.to_owned(), shard })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::synthetic;

    fn test_run_folder(test_folder: &tempfile::TempDir) -> Folder {
        Folder::new(&test_folder.path().join("x.parquet"), &synthetic::layout()).unwrap()
    }

    fn busy_holders(result: Result<Lock, StoreError>) -> Vec<LockHolder> {
        match result {
            Err(StoreError::Busy { holders, .. }) => holders,
            other => panic!("expected a busy output, got {other:?}"),
        }
    }

    #[test]
    fn a_file_in_the_place_of_the_folder_is_kept_and_said_to_be_in_the_way() {
        let test_folder = tempfile::tempdir().unwrap();
        let folder = test_run_folder(&test_folder);
        fs::write(&folder.path, "my thesis").unwrap();
        let message = Lock::acquire(&folder, None).unwrap_err().to_string();
        assert!(message.contains("a file of that name is in the way"), "{message}");
        assert_eq!(fs::read_to_string(&folder.path).unwrap(), "my thesis");
    }

    #[test]
    fn a_second_run_is_refused_with_the_process_of_the_first() {
        let test_folder = tempfile::tempdir().unwrap();
        let folder = test_run_folder(&test_folder);
        let first_lock = Lock::acquire(&folder, None).unwrap();
        let holders = busy_holders(Lock::acquire(&folder, None));
        assert_eq!(holders[0].pid, std::process::id());
        assert_eq!(holders[0].shard, None);
        drop(first_lock);
        Lock::acquire(&folder, None).unwrap();
    }

    #[test]
    fn shards_run_side_by_side_but_not_beside_a_whole_run() {
        let test_folder = tempfile::tempdir().unwrap();
        let folder = test_run_folder(&test_folder);
        let shard_locks: Vec<Lock> =
            [1, 2, 2].iter().map(|&shard| Lock::acquire(&folder, Some(shard)).unwrap()).collect();
        let holders = busy_holders(Lock::acquire(&folder, None));
        assert_eq!(
            holders.iter().map(|holder| holder.shard).collect::<Vec<_>>(),
            [Some(1), Some(2)]
        );
        drop(shard_locks);
        let run_lock = Lock::acquire(&folder, None).unwrap();
        busy_holders(Lock::acquire(&folder, Some(1)));
        drop(run_lock);
        assert!(super::find_holders(&folder).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_overwrites_neither_the_target_of_a_link_nor_a_foreign_file() {
        let test_folder = tempfile::tempdir().unwrap();
        let folder = test_run_folder(&test_folder);
        fs::create_dir_all(&folder.path).unwrap();
        let foreign_file = test_folder.path().join("thesis.tex");
        fs::write(&foreign_file, "my thesis").unwrap();
        for (name, shard) in
            [(folder.file(LOCK_FILE), None), (folder.file("shard-3.lock"), Some(3))]
        {
            std::os::unix::fs::symlink(&foreign_file, &name).unwrap();
            let error = Lock::acquire(&folder, shard).unwrap_err().to_string();
            assert!(error.contains("it is a symbolic link"), "{error}");
            fs::remove_file(&name).unwrap();
            fs::hard_link(&foreign_file, &name).unwrap();
            let error = Lock::acquire(&folder, shard).unwrap_err();
            assert!(error.to_string().contains("is no lock of `sweep run`"), "{error}");
            assert!(error.is_refusal());
            fs::remove_file(&name).unwrap();
        }
        assert_eq!(fs::read_to_string(&foreign_file).unwrap(), "my thesis");
        for text in [" my thesis", "2026 pages", "2026", "12 a\nnotes\n", "12 a\n\n"] {
            fs::write(folder.file(LOCK_FILE), text).unwrap();
            let error = Lock::acquire(&folder, None).unwrap_err();
            assert!(error.to_string().contains("is no lock of `sweep run`"), "{text}: {error}");
            assert_eq!(fs::read_to_string(folder.file(LOCK_FILE)).unwrap(), text);
        }
        fs::write(folder.file(LOCK_FILE), "12 node-7.example\n").unwrap();
        Lock::acquire(&folder, Some(3)).unwrap();
    }

    #[test]
    fn a_deleted_lock_file_does_not_block_a_new_lock() {
        let test_folder = tempfile::tempdir().unwrap();
        let folder = test_run_folder(&test_folder);
        let first_lock = Lock::acquire(&folder, None).unwrap();
        let deleted_file = regular::open_or_create(&folder.file(LOCK_FILE)).unwrap();
        first_lock.delete().unwrap();
        deleted_file.try_lock().unwrap();
        assert!(!atomic::is_at_path(&deleted_file, &folder.file(LOCK_FILE)));
        Lock::acquire(&folder, None).unwrap();
    }
}
