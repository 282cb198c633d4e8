//! Recognition of the files in a run's folder that a run has written. The content decides, because
//! another program may have written a file of the same name.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::Path;

use super::lock;
use super::part;
use super::plan_file::{PlanFile, StoredPlan};
use super::provenance::{self, Session};
use super::shard::ShardLayout;
use super::{Folder, LOCK_FILE, PLAN_FILE, SHARDS_FILE, StoreError, part_index};
use sweep_files::{atomic, regular};

/// Deletes the files that a run has written, the plan first, because a folder without a plan does
/// not count as a run. The lock stays, and so do files of other programs and damaged files. Returns
/// the names of the files that stay, without the lock.
///
/// # Errors
/// [`StoreError::File`].
pub(super) fn delete_own_files(folder: &Folder) -> Result<Vec<OsString>, StoreError> {
    let names = regular::file_names(&folder.path).map_err(StoreError::io("list", &folder.path))?;
    let (own_names, foreign_names): (Vec<OsString>, Vec<OsString>) = names
        .into_iter()
        .filter(|name| name != LOCK_FILE)
        .partition(|name| is_run_file(folder, name));
    let is_plan = |name: &&OsString| *name == PLAN_FILE;
    for name in
        own_names.iter().filter(is_plan).chain(own_names.iter().filter(|name| !is_plan(name)))
    {
        atomic::remove(&folder.file(name))?;
    }
    atomic::sync_folder(&folder.path)?;
    Ok(foreign_names)
}

/// Returns whether a run has written a file of the folder, judged by name and content. Empty files
/// of such a name count too, because deleting them loses nothing.
fn is_run_file(folder: &Folder, name: &OsStr) -> bool {
    let path = folder.file(name);
    let (Some(name), Ok(metadata)) = (name.to_str(), fs::symlink_metadata(&path)) else {
        return false;
    };
    if !metadata.is_file() {
        return false;
    }
    let has_own_content = match name {
        PLAN_FILE => matches!(PlanFile::read(folder), Ok(StoredPlan::Plan(_))),
        SHARDS_FILE => matches!(ShardLayout::read(folder), Ok(Some(_))),
        _ if atomic::is_temporary(name) => true,
        _ if part_index(name).is_some() => part::is_part(&path),
        _ if lock::shard_of_lock_name(name).is_some() => lock::is_lock_file(&path),
        _ if provenance::is_session_name(name) => is_session_record(&path),
        _ => return false,
    };
    has_own_content || metadata.len() == 0
}

/// Returns whether a file is a process's record of its work.
fn is_session_record(path: &Path) -> bool {
    let text = regular::read_json(path).unwrap_or_default();
    serde_json::from_slice::<Session>(&text).is_ok()
}
