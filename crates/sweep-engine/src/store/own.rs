//! Which files of a run's folder a run has written, by what they hold: a name alone is anybody's.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::Read as _;
use std::path::Path;

use super::chunk;
use super::lock;
use super::plan_file::{Found, PlanFile};
use super::provenance::{self, Session};
use super::shard::ShardLayout;
use super::trial_records;
use super::{Folder, LOCK, PLAN, SHARDS, StoreError, TRIALS, chunk_of_name};
use sweep_files::{atomic, regular};

/// Deletes what a run wrote, the plan first: without it a folder is no run. The lock stays, and so
/// do strangers' files and what was set aside, whose names this gives. `plan` is the hash of the
/// plan that is run here; trials are known by it, or by that of the plan in the folder.
///
/// # Errors
/// [`StoreError::File`].
pub(super) fn clear(folder: &Folder, plan: &blake3::Hash) -> Result<Vec<OsString>, StoreError> {
    let mut plans = vec![*plan];
    if let Found::Plan(found) = PlanFile::read(folder)? {
        plans.extend(blake3::Hash::from_hex(&found.plan_hash).ok());
    }
    let names = regular::names(&folder.path).map_err(StoreError::io("list", &folder.path))?;
    let (own, others): (Vec<OsString>, Vec<OsString>) = names
        .into_iter()
        .filter(|name| name != LOCK)
        .partition(|name| is_own(folder, name, &plans));
    let is_plan = |name: &&OsString| *name == PLAN;
    for name in own.iter().filter(is_plan).chain(own.iter().filter(|name| !is_plan(name))) {
        atomic::remove(&folder.file(name))?;
    }
    atomic::sync_folder(&folder.path)?;
    Ok(others)
}

/// Returns whether a file of the folder has a name that a run gives, and content that a run writes
/// under it. An empty file of such a name holds nothing that could be lost.
fn is_own(folder: &Folder, name: &OsStr, plans: &[blake3::Hash]) -> bool {
    let path = folder.file(name);
    let (Some(name), Ok(found)) = (name.to_str(), fs::symlink_metadata(&path)) else {
        return false;
    };
    if !found.is_file() {
        return false;
    }
    let holds_own = match name {
        PLAN => matches!(PlanFile::read(folder), Ok(Found::Plan(_))),
        SHARDS => matches!(ShardLayout::read(folder), Ok(Some(_))),
        TRIALS => plans.iter().any(|plan| trial_records::has_any(&path, plan.as_bytes())),
        _ if atomic::is_temporary(name) => true,
        _ if chunk_of_name(name).is_some() => begins(&path, &chunk::MAGIC),
        _ if lock::shard_of_name(name).is_some() => lock::is_signed(&path),
        _ if provenance::is_session(name) => is_record(&path),
        _ => return false,
    };
    holds_own || found.len() == 0
}

/// Returns whether a file begins with these bytes.
fn begins(path: &Path, with: &[u8]) -> bool {
    let mut start = vec![0; with.len()];
    let read = regular::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == with
}

/// Returns whether a file is a process's record of its work.
fn is_record(path: &Path) -> bool {
    let text = regular::read_json(path).unwrap_or_default();
    serde_json::from_slice::<Session>(&text).is_ok()
}
