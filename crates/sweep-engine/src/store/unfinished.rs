//! A run or a search whose result is not there yet, found by the result's name alone: without the
//! grid file nobody knows its columns, but its plan and its parts say how far it is.

use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray as _;
use arrow_array::types::UInt64Type;
use serde::Serialize;

use super::lock;
use super::open::parts_there;
use super::part;
use super::plan_file::{Found, PlanFile};
use super::point_parts::{is_of_points, number_name};
use super::{Folder, Holder, StoreError, part_name};
use sweep_files::ParquetFile;

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
    let mut points_done = 0;
    let mut is_search = false;
    for index in parts_there(&folder)? {
        // The run may have finished a moment ago.
        let Some((part, place)) = part::open_any(&folder.file(part_name(index)), &hash)? else {
            continue;
        };
        if is_of_points(&place) {
            points_done += count_points(&part);
        } else {
            is_search = true;
            points_done += part.rows();
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

/// Counts the points of a run's part, whose rows are in their order.
fn count_points(part: &ParquetFile) -> u64 {
    let fields = part.schema().fields();
    let name = number_name(|name| fields.iter().any(|field| field.name() == name));
    let position = fields.iter().position(|field| field.name() == name);
    let batches = position.and_then(|position| part.batches(vec![position]).ok());
    let mut last = None;
    let mut count = 0;
    for batch in batches.into_iter().flatten().flatten() {
        let numbers = batch.column(0).as_primitive_opt::<UInt64Type>();
        for number in numbers.into_iter().flatten() {
            count += u64::from(number != last);
            last = number;
        }
    }
    count
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
