//! Who may work on an output: one whole run, or any number of shards of one run.
//!
//! Locks are the system's (`flock`), so a killed process frees its own; the files only say who
//! holds them. A whole run and a merge hold `lock` alone; shards share it, and each also holds
//! `shard-<i>.lock`, which says which are running. The same shard started twice is harmless and not
//! refused: a scheduler that lost sight of a node does exactly that, and must not wait for the lost
//! node's lock to expire.

use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::{Folder, Holder, LOCK, StoreError};
use sweep_files::{FileError, atomic, regular};

/// Most bytes of a holder's name.
const LONGEST_NAME: u64 = 300;

/// How long a lock is asked for before it counts as held: `sweep status` holds it for an instant
/// when it looks.
const ATTEMPTS: u32 = 5;
const PAUSE: Duration = Duration::from_millis(40);

/// A held lock; dropping it, or dying, lets go.
#[derive(Debug)]
pub struct Lock {
    _run: Option<File>,
    _shard: Option<File>,
    path: PathBuf,
    /// Set when the file system has no locks and the run goes on without.
    missing: bool,
}

impl Lock {
    /// Makes the folder if need be and takes the whole run's lock, or one shard's share of it.
    pub fn acquire(folder: &Folder, shard: Option<u64>) -> Result<Self, StoreError> {
        let path = folder.file(LOCK);
        for attempt in 0..ATTEMPTS {
            if attempt > 0 {
                std::thread::sleep(PAUSE);
            }
            fs::create_dir_all(&folder.path)
                .map_err(StoreError::io("make the folder", &folder.path))?;
            let mut file = match regular::open_or_create(&path) {
                Ok(file) => file,
                // A run that just finished removed the folder between the two lines above.
                Err(error) if error.kind() == io::ErrorKind::NotFound && attempt + 1 < ATTEMPTS => {
                    continue;
                }
                Err(error) => return Err(StoreError::io("open the lock", &path)(error)),
            };
            refuse_strangers(&mut file, &path)?;
            let taken = if shard.is_some() { file.try_lock_shared() } else { file.try_lock() };
            match taken {
                Ok(()) if !atomic::is_named(&file, &path) => continue,
                Ok(()) => {
                    let shard = match shard {
                        Some(shard) => take_shard(folder, shard)?,
                        None => sign(&mut file, &path).map(|()| None)?,
                    };
                    return Ok(Self { _run: Some(file), _shard: shard, path, missing: false });
                }
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) if no_locks_here(&error) => {
                    return Ok(Self { _run: None, _shard: None, path, missing: true });
                }
                Err(TryLockError::Error(error)) => {
                    return Err(StoreError::io("lock", &path)(error));
                }
            }
        }
        Err(StoreError::Busy { output: folder.output.clone(), holders: holders(folder) })
    }

    /// What a user should hear of a file system without locks.
    pub fn note(&self, folder: &Folder) -> Option<String> {
        let said = "is on a file system without locks: make sure that nothing else runs on this";
        self.missing.then(|| format!("{} {said} output", folder.path.display()))
    }

    /// Deletes the lock's file while it is still held, so that no one can take it over, then lets
    /// go.
    pub fn retire(self) -> Result<(), StoreError> {
        Ok(atomic::remove(&self.path)?)
    }
}

/// Everyone who holds the folder now, as far as it can be read without disturbing them.
pub(super) fn holders(folder: &Folder) -> Vec<Holder> {
    let names = regular::names(&folder.path).unwrap_or_default().into_iter();
    let lock = |name: OsString| Some((shard_of_name(name.to_str()?)?, folder.file(name)));
    let mut locks: Vec<(u64, PathBuf)> = names.filter_map(lock).collect();
    locks.sort_unstable();
    let held = locks.iter().filter_map(|(shard, path)| held_by(path, Some(*shard)));
    let mut found: Vec<Holder> = held.collect();
    // Shards share the folder's lock, and whoever last held it alone has left his name in it.
    if found.is_empty() {
        found.extend(held_by(&folder.file(LOCK), None));
    }
    found
}

/// A lock holds nothing, or the name that [`sign`] writes. Anything else is somebody's file.
fn refuse_strangers(file: &mut File, path: &Path) -> Result<(), StoreError> {
    if holds_name(file).map_err(StoreError::io("read", path))? {
        return Ok(());
    }
    Err(FileError::Refused {
        path: path.to_path_buf(),
        reason: "the file there is no lock of `sweep run`".to_owned(),
        help: "give another name with --out, or move that file away first",
    }
    .into())
}

/// Returns whether a file holds nothing, or the name that [`sign`] writes and no more.
fn holds_name(file: &mut File) -> io::Result<bool> {
    let mut text = Vec::new();
    file.take(LONGEST_NAME + 1).read_to_end(&mut text)?;
    let name = std::str::from_utf8(&text).ok().and_then(|text| text.strip_suffix('\n'));
    let is_name = name.and_then(|name| name.split_once(' ')).is_some_and(|(process, host)| {
        process.parse::<u32>().is_ok() && !host.contains(char::is_control)
    });
    Ok(text.is_empty() || is_name)
}

/// Returns whether the file at a path is a lock of a shard.
pub(super) fn is_signed(path: &Path) -> bool {
    regular::open(path).and_then(|mut file| holds_name(&mut file)).unwrap_or(false)
}

fn take_shard(folder: &Folder, shard: u64) -> Result<Option<File>, StoreError> {
    let path = folder.file(shard_name(shard));
    let mut file =
        regular::open_or_create(&path).map_err(StoreError::io("open the lock", &path))?;
    refuse_strangers(&mut file, &path)?;
    if file.try_lock().is_err() {
        return Ok(None);
    }
    sign(&mut file, &path)?;
    Ok(Some(file))
}

/// Writes this process's name into a lock it holds.
fn sign(file: &mut File, path: &Path) -> Result<(), StoreError> {
    let name = format!("{} {}\n", std::process::id(), super::provenance::host());
    file.set_len(0)
        .and_then(|()| file.rewind())
        .and_then(|()| file.write_all(name.as_bytes()))
        .map_err(StoreError::io("write the process id to", path))
}

/// Some cluster file systems are mounted without locks.
fn no_locks_here(error: &io::Error) -> bool {
    const ENOLCK: i32 = 37;
    error.kind() == io::ErrorKind::Unsupported
        || (cfg!(target_os = "linux") && error.raw_os_error() == Some(ENOLCK))
}

/// The shard that a lock is named after, if any.
pub(super) fn shard_of_name(name: &str) -> Option<u64> {
    let shard = name.strip_prefix("shard-")?.strip_suffix(".lock")?.parse().ok()?;
    (shard_name(shard) == name).then_some(shard)
}

/// The name of a shard's lock.
fn shard_name(shard: u64) -> String {
    format!("shard-{shard}.lock")
}

/// The holder named in a lock file, if someone holds it.
fn held_by(path: &Path, shard: Option<u64>) -> Option<Holder> {
    let file = regular::open(path).ok()?;
    if !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
        return None;
    }
    let mut text = String::new();
    file.take(LONGEST_NAME).read_to_string(&mut text).ok()?;
    let (pid, host) = text.trim_end().split_once(' ')?;
    Some(Holder { pid: pid.parse().ok()?, host: host.to_owned(), shard })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::synthetic;

    fn folder(home: &tempfile::TempDir) -> Folder {
        Folder::of(&home.path().join("x.parquet"), &synthetic::layout()).unwrap()
    }

    fn busy(result: Result<Lock, StoreError>) -> Vec<Holder> {
        match result {
            Err(StoreError::Busy { holders, .. }) => holders,
            other => panic!("expected a busy output, got {other:?}"),
        }
    }

    #[test]
    fn the_second_whole_run_is_told_the_first_ones_process() {
        let home = tempfile::tempdir().unwrap();
        let folder = folder(&home);
        let first = Lock::acquire(&folder, None).unwrap();
        let holders = busy(Lock::acquire(&folder, None));
        assert_eq!(holders[0].pid, std::process::id());
        assert_eq!(holders[0].shard, None);
        drop(first);
        Lock::acquire(&folder, None).unwrap();
    }

    #[test]
    fn shards_share_and_keep_a_whole_run_out() {
        let home = tempfile::tempdir().unwrap();
        let folder = folder(&home);
        let shards: Vec<Lock> =
            [1, 2, 2].iter().map(|&shard| Lock::acquire(&folder, Some(shard)).unwrap()).collect();
        let holders = busy(Lock::acquire(&folder, None));
        assert_eq!(holders.iter().map(|h| h.shard).collect::<Vec<_>>(), [Some(1), Some(2)]);
        drop(shards);
        let whole = Lock::acquire(&folder, None).unwrap();
        busy(Lock::acquire(&folder, Some(1)));
        drop(whole);
        assert!(super::holders(&folder).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_is_not_written_through_a_link_nor_over_a_strangers_file() {
        let home = tempfile::tempdir().unwrap();
        let folder = folder(&home);
        fs::create_dir_all(&folder.path).unwrap();
        let mine = home.path().join("thesis.tex");
        fs::write(&mine, "my thesis").unwrap();
        for (name, shard) in [(folder.file(LOCK), None), (folder.file("shard-3.lock"), Some(3))] {
            std::os::unix::fs::symlink(&mine, &name).unwrap();
            let error = Lock::acquire(&folder, shard).unwrap_err().to_string();
            assert!(error.contains("it is a symbolic link"), "{error}");
            fs::remove_file(&name).unwrap();
            fs::hard_link(&mine, &name).unwrap();
            let error = Lock::acquire(&folder, shard).unwrap_err();
            assert!(error.to_string().contains("is no lock of `sweep run`"), "{error}");
            assert!(error.is_refusal());
            fs::remove_file(&name).unwrap();
        }
        assert_eq!(fs::read_to_string(&mine).unwrap(), "my thesis");
        for text in [" my thesis", "2026 pages", "2026", "12 a\nnotes\n", "12 a\n\n"] {
            fs::write(folder.file(LOCK), text).unwrap();
            let error = Lock::acquire(&folder, None).unwrap_err();
            assert!(error.to_string().contains("is no lock of `sweep run`"), "{text}: {error}");
            assert_eq!(fs::read_to_string(folder.file(LOCK)).unwrap(), text);
        }
        fs::write(folder.file(LOCK), "12 node-7.example\n").unwrap();
        Lock::acquire(&folder, Some(3)).unwrap();
    }

    #[test]
    fn a_lock_that_was_removed_with_its_folder_is_not_taken_for_held() {
        let home = tempfile::tempdir().unwrap();
        let folder = folder(&home);
        let first = Lock::acquire(&folder, None).unwrap();
        let stale = regular::open_or_create(&folder.file(LOCK)).unwrap();
        first.retire().unwrap();
        stale.try_lock().unwrap();
        assert!(!atomic::is_named(&stale, &folder.file(LOCK)));
        Lock::acquire(&folder, None).unwrap();
    }
}
