//! A run or a search whose result is not there yet, found by the result's name alone: without the
//! grid file nobody knows its columns, but its plan and its chunks say how far it is.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::chunk;
use super::lock;
use super::open::chunks_there;
use super::plan_file::{Found, PlanFile};
use super::trial_records;
use super::{Folder, Holder, StoreError, TRIALS, chunk_name};
use sweep_files::regular;

/// Most bytes of a chunk that are looked at. Basis: a chunk of a map has a megabyte. Doubling it
/// doubles the memory that a foreign file of a chunk's name may take.
const MOST_CHUNK_BYTES: u64 = 1 << 28;

/// How far a run or a search without a result is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unfinished {
    /// Where the result will be.
    #[serde(serialize_with = "super::status::shown")]
    pub output: PathBuf,
    /// Where its work is kept.
    #[serde(serialize_with = "super::status::shown")]
    pub folder: PathBuf,
    /// The name of its plan.
    pub name: String,
    /// Points of the whole result; none of a search, which does not know them beforehand.
    pub points: Option<u64>,
    /// Points, or trials of a search, that are kept.
    pub points_done: u64,
    /// Who is at work.
    pub running: Vec<Holder>,
}

/// Looks for the work on a result that is not there, by the result's path or by that of its folder;
/// nothing where there is a file, or no work on one.
///
/// # Errors
/// [`StoreError::File`].
pub fn unfinished(path: &Path) -> Result<Option<Unfinished>, StoreError> {
    let is_folder = path.is_dir() && path.extension().is_some_and(|ending| ending == "partial");
    let output = if is_folder { path.with_extension("") } else { path.to_path_buf() };
    if output.exists() || output.file_name().is_none() {
        return Ok(None);
    }
    let mut folder = output.clone().into_os_string();
    folder.push(".partial");
    let folder = Folder { output, path: folder.into() };
    let Found::Plan(plan) = PlanFile::read(&folder)? else { return Ok(None) };
    let Ok(hash) = blake3::Hash::from_hex(&plan.plan_hash) else { return Ok(None) };
    let trials = folder.file(TRIALS);
    let is_search = trials.exists();
    let mut points_done = 0;
    if is_search {
        points_done = trial_records::count(&trials, hash.as_bytes());
    } else {
        for chunk in chunks_there(&folder)? {
            points_done += count(&folder, chunk, &hash)?;
        }
    }
    Ok(Some(Unfinished {
        name: plan.plan["name"].as_str().unwrap_or_default().to_owned(),
        points: (!is_search).then_some(plan.points),
        points_done,
        running: lock::holders(&folder),
        output: folder.output,
        folder: folder.path,
    }))
}

/// Counts the points that are kept of a chunk.
fn count(folder: &Folder, chunk: u64, plan: &blake3::Hash) -> Result<u64, StoreError> {
    let path = folder.file(chunk_name(chunk));
    let mut bytes = Vec::new();
    let read =
        regular::open(&path).and_then(|file| file.take(MOST_CHUNK_BYTES).read_to_end(&mut bytes));
    // The run may have finished a moment ago.
    regular::if_there(read).map_err(StoreError::io("read", &path))?;
    Ok(chunk::count_points(plan, &bytes))
}

/// Refuses a result that is not there yet, and says how far it is.
///
/// # Errors
/// [`StoreError::Unfinished`], and as [`unfinished`].
pub fn refuse_unfinished(path: &Path) -> Result<(), StoreError> {
    match unfinished(path)? {
        Some(found) => Err(StoreError::Unfinished {
            progress: found.progress(),
            output: found.output,
            folder: found.folder,
        }),
        None => Ok(()),
    }
}

impl Unfinished {
    /// Says how far it is, in words.
    pub fn progress(&self) -> String {
        let done = self.points_done;
        match self.points {
            Some(points) => {
                let percent = 100.0 * done as f64 / points.max(1) as f64;
                format!("{done} of {points} points done ({percent:.1} %)")
            }
            None => format!("{done} trials of a search kept"),
        }
    }
}
