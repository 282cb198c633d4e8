//! The plan file: the plan with which work in a folder began, and its differences from another
//! plan.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::differences::find_differences;
use super::{Folder, Job, PLAN_FILE, PlanDifference, StoreError};
use sweep_files::{atomic, regular};

/// The version of the format of `plan.json`. Folders of other formats are refused as of another
/// plan.
const PLAN_FORMAT: u32 = 3;

/// The content of `plan.json`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanFile {
    /// The version of the format of this file and of the parts in the folder.
    pub format: u32,
    /// The version of the program that began the run; another version might round differently.
    pub version: String,
    /// The version of the numerics; files of format 1 had none.
    #[serde(default)]
    pub numerics: u32,
    /// The hash of version, numerics and plan, hexadecimal; it is in the metadata of every part
    /// too.
    pub plan_hash: String,
    /// The number of points.
    pub points: u64,
    /// The number of points of each chunk but the last, which may have fewer.
    pub chunk_points: u64,
    /// The grid with all options applied, the full machine, and the method.
    pub plan: Value,
}

/// The outcome of reading `plan.json`.
pub(super) enum StoredPlan {
    /// There is no file.
    Nothing,
    /// The file is a valid plan.
    Plan(Box<PlanFile>),
    /// The file is not a valid plan.
    Damaged,
}

impl PlanFile {
    pub(super) fn new(job: &Job<'_>) -> Self {
        Self {
            format: PLAN_FORMAT,
            version: job.version.to_owned(),
            numerics: job.numerics,
            plan_hash: job.hash().to_hex().to_string(),
            points: job.points,
            chunk_points: super::chunk_points(job.points),
            plan: job.plan.clone(),
        }
    }

    /// Reads the plan of a run folder.
    pub(super) fn read(folder: &Folder) -> Result<StoredPlan, StoreError> {
        let path = folder.file(PLAN_FILE);
        let text = regular::none_if_missing(regular::read_json(&path));
        let Some(text) = text.map_err(StoreError::io("read", &path))? else {
            return Ok(StoredPlan::Nothing);
        };
        // A file of another format does not have to match its hash. It is refused with the
        // differences.
        let is_valid = |stored_plan: &Self| {
            let hash = plan_hash(&stored_plan.version, stored_plan.numerics, &stored_plan.plan);
            stored_plan.format != PLAN_FORMAT || hash.to_hex().as_str() == stored_plan.plan_hash
        };
        Ok(match serde_json::from_slice::<Self>(&text) {
            Ok(stored_plan) if is_valid(&stored_plan) => StoredPlan::Plan(Box::new(stored_plan)),
            _ => StoredPlan::Damaged,
        })
    }

    /// Writes the plan, unless another process has written one.
    pub(super) fn write_if_absent(&self, folder: &Folder) -> Result<(), StoreError> {
        let text = format_json(&json!(self));
        if text.len() as u64 >= regular::MAX_JSON_BYTES {
            return Err(StoreError::Refused(format!(
                "the plan is too long for {}: written out, it has more than {} MiB\n  = help: \
                 write values as a range, or points as a list in a file of their own",
                folder.path.display(),
                regular::MAX_JSON_BYTES >> 20
            )));
        }
        atomic::create(&folder.path, &folder.file(PLAN_FILE), &text)?;
        Ok(())
    }

    /// Returns the differences from another plan; none if both are the same.
    pub(super) fn differences(&self, other: &Self) -> Vec<PlanDifference> {
        if self == other {
            return Vec::new();
        }
        find_differences(&plan_with_versions(self), &plan_with_versions(other))
    }
}

/// Formats JSON with indentation and a final newline, for files that people may read.
pub(super) fn format_json(value: &Value) -> Vec<u8> {
    format!("{value:#}\n").into_bytes()
}

/// Returns the hash of a build and a plan.
pub(super) fn plan_hash(version: &str, numerics: u32, plan: &Value) -> blake3::Hash {
    blake3::hash(format!("{version}\n{numerics}\n{plan}").as_bytes())
}

/// Returns the plan with the other entries of the file added, so that differences of either have a
/// path.
fn plan_with_versions(file: &PlanFile) -> Value {
    let mut value = file.plan.clone();
    if let Value::Object(map) = &mut value {
        map.insert("sweep_version".into(), file.version.clone().into());
        map.insert("numerics".into(), file.numerics.into());
        map.insert("store_format".into(), file.format.into());
        map.insert("chunk_points".into(), file.chunk_points.into());
    }
    value
}

/// Renames an unreadable file to `*.damaged`, with a number if that name is taken, so that no file
/// is lost. Returns the new path.
pub(super) fn rename_damaged(path: &Path) -> Result<PathBuf, StoreError> {
    let numbered_path = |number: u64| {
        let mut name = path.as_os_str().to_owned();
        name.push(".damaged");
        if number > 1 {
            name.push(format!("-{number}"));
        }
        PathBuf::from(name)
    };
    let is_unused = |new_path: &PathBuf| fs::symlink_metadata(new_path).is_err();
    let new_path =
        (1..=u64::MAX).map(numbered_path).find(is_unused).unwrap_or_else(|| numbered_path(1));
    // Another shard of the same run may have renamed the file already.
    let result = regular::none_if_missing(fs::rename(path, &new_path));
    result.map_err(StoreError::io("set aside", path)).map(|_| new_path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_of_a_plan_read_back_from_json_is_the_same() {
        let plan = json!({ "x": 0.1 + 0.2, "y": 1e-300 / 3.0, "z": 2.0e-4, "n": 5e-324 });
        let read_back: Value =
            serde_json::from_slice(&serde_json::to_vec_pretty(&plan).unwrap()).unwrap();
        assert_eq!(plan_hash("1", 1, &plan), plan_hash("1", 1, &read_back));
        assert_ne!(plan_hash("1", 1, &plan), plan_hash("2", 1, &plan));
        assert_ne!(plan_hash("1", 1, &plan), plan_hash("1", 2, &plan));
    }
}
