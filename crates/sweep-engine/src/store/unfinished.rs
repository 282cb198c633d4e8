//! The progress of a run or a search that has no result yet. It is read from the plan and the parts
//! in the folder, without the grid file.

use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray as _;
use arrow_array::types::UInt64Type;
use serde::Serialize;

use super::lock;
use super::open::list_part_indices;
use super::part;
use super::plan_file::{PlanFile, StoredPlan};
use super::point_parts::{is_part_of_run, row_number_column};
use super::{Folder, LockHolder, StoreError, part_name};
use sweep_files::ParquetFile;

/// The progress of a run or a search that has no result yet.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnfinishedWork {
    /// The path that the result will have.
    #[serde(serialize_with = "super::status::serialize_path")]
    pub output: PathBuf,
    /// The folder of the unfinished work.
    #[serde(serialize_with = "super::status::serialize_path")]
    pub folder: PathBuf,
    /// The name of the run or the search.
    pub name: String,
    /// The number of points of the whole result; `None` for a search, which does not know it
    /// beforehand.
    pub points: Option<u64>,
    /// The number of stored points, or of stored trials of a search.
    pub points_done: u64,
    /// The processes that work on it.
    pub running: Vec<LockHolder>,
}

/// Looks for the unfinished work on a result. `path` is that of the result or of the folder.
/// Returns `None` if the result exists, or if there is no unfinished work.
///
/// # Errors
/// [`StoreError::File`].
pub fn find_unfinished(path: &Path) -> Result<Option<UnfinishedWork>, StoreError> {
    let is_folder =
        path.is_dir() && path.extension().is_some_and(|extension| extension == "partial");
    let output = if is_folder { path.with_extension("") } else { path.to_path_buf() };
    if output.exists() || output.file_name().is_none() {
        return Ok(None);
    }
    let mut folder = output.clone().into_os_string();
    folder.push(".partial");
    let folder = Folder { output, path: folder.into() };
    let StoredPlan::Plan(stored_plan) = PlanFile::read(&folder)? else { return Ok(None) };
    let Ok(hash) = blake3::Hash::from_hex(&stored_plan.plan_hash) else { return Ok(None) };
    let mut points_done = 0;
    let mut is_search = false;
    for index in list_part_indices(&folder)? {
        // The run may have deleted its parts since they were listed.
        let Some((part, entry)) = part::open_part_of_plan(&folder.file(part_name(index)), &hash)?
        else {
            continue;
        };
        if is_part_of_run(&entry) {
            points_done += count_points(&part);
        } else {
            is_search = true;
            points_done += part.rows();
        }
    }
    Ok(Some(UnfinishedWork {
        name: stored_plan.plan["name"].as_str().unwrap_or_default().to_owned(),
        points: (!is_search).then_some(stored_plan.points),
        points_done,
        running: lock::find_holders(&folder),
        output: folder.output,
        folder: folder.path,
    }))
}

/// Counts the points of a part, whose rows are sorted by point.
fn count_points(part: &ParquetFile) -> u64 {
    let fields = part.schema().fields();
    let column_name =
        row_number_column(|column_name| fields.iter().any(|field| field.name() == column_name));
    let column_index = fields.iter().position(|field| field.name() == column_name);
    let batches = column_index.and_then(|column_index| part.batches(vec![column_index]).ok());
    let mut last_number = None;
    let mut count = 0;
    for batch in batches.into_iter().flatten().flatten() {
        let numbers = batch.column(0).as_primitive_opt::<UInt64Type>();
        for number in numbers.into_iter().flatten() {
            count += u64::from(number != last_number);
            last_number = number;
        }
    }
    count
}

/// Refuses a result that is unfinished, with its progress.
///
/// # Errors
/// [`StoreError::Unfinished`], and the errors of [`find_unfinished`].
pub fn refuse_unfinished(path: &Path) -> Result<(), StoreError> {
    match find_unfinished(path)? {
        Some(unfinished_work) => Err(StoreError::Unfinished {
            progress: unfinished_work.progress(),
            output: unfinished_work.output,
            folder: unfinished_work.folder,
        }),
        None => Ok(()),
    }
}

impl UnfinishedWork {
    /// Returns the progress in words.
    pub fn progress(&self) -> String {
        let points_done = self.points_done;
        match self.points {
            Some(points) => {
                let done_percent = 100.0 * points_done as f64 / points.max(1) as f64;
                format!("{points_done} of {points} points done ({done_percent:.1} %)")
            }
            None => format!("{points_done} trials of a search kept"),
        }
    }
}
