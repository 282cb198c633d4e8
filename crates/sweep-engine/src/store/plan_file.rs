//! The frozen plan: what a run folder was begun with, and where another plan differs from it.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::differences::differences;
use super::{Folder, Job, PLAN, PlanDifference, StoreError};
use sweep_files::{atomic, regular};

/// Format of `plan.json`; a folder of another format is another plan.
const FORMAT: u32 = 3;

/// What `plan.json` says.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanFile {
    /// Layout of this file and of the parts beside it.
    pub format: u32,
    /// Version of the program that began the run; another one might round differently.
    pub version: String,
    /// Version of its numerics; files of format 1 had none.
    #[serde(default)]
    pub numerics: u32,
    /// Hash of version, numerics and plan, hexadecimal, as in every part.
    pub plan_hash: String,
    /// Rows of the result.
    pub points: u64,
    /// Points a chunk; the last one may hold fewer.
    pub chunk_points: u64,
    /// Grid as run, full machine, method.
    pub plan: Value,
}

/// What is in the plan's place in a run folder.
pub(super) enum Found {
    /// No plan was frozen here.
    Nothing,
    /// A plan, whole.
    Plan(Box<PlanFile>),
    /// A file that is not a whole plan.
    Damaged,
}

impl PlanFile {
    pub(super) fn of(job: &Job<'_>) -> Self {
        Self {
            format: FORMAT,
            version: job.version.to_owned(),
            numerics: job.numerics,
            plan_hash: job.hash().to_hex().to_string(),
            points: job.points,
            chunk_points: super::chunk_points(job.points),
            plan: job.plan.clone(),
        }
    }

    /// Reads the plan of a run folder.
    pub(super) fn read(folder: &Folder) -> Result<Found, StoreError> {
        let path = folder.file(PLAN);
        let text = regular::if_there(regular::read_json(&path));
        let Some(text) = text.map_err(StoreError::io("read", &path))? else {
            return Ok(Found::Nothing);
        };
        // A file of another format need not match its hash: the run is refused with what differs.
        let whole = |found: &Self| {
            let hash = plan_hash(&found.version, found.numerics, &found.plan);
            found.format != FORMAT || hash.to_hex().as_str() == found.plan_hash
        };
        Ok(match serde_json::from_slice::<Self>(&text) {
            Ok(found) if whole(&found) => Found::Plan(Box::new(found)),
            _ => Found::Damaged,
        })
    }

    /// Writes the plan unless another process was first.
    pub(super) fn freeze(&self, folder: &Folder) -> Result<(), StoreError> {
        let text = pretty(&json!(self));
        if text.len() as u64 >= regular::LONGEST_JSON_BYTES {
            return Err(StoreError::Refused(format!(
                "the plan is too long for {}: written out, it has more than {} MiB\n  = help: \
                 write values as a range, or points as a list in a file of their own",
                folder.path.display(),
                regular::LONGEST_JSON_BYTES >> 20
            )));
        }
        atomic::create(&folder.path, &folder.file(PLAN), &text)?;
        Ok(())
    }

    /// Where the plans part; empty if they are the same.
    pub(super) fn differences(&self, is: &Self) -> Vec<PlanDifference> {
        if self == is {
            return Vec::new();
        }
        differences(&comparable(self), &comparable(is))
    }
}

/// Pretty JSON with a final newline, for files that people may look into.
pub(super) fn pretty(value: &Value) -> Vec<u8> {
    format!("{value:#}\n").into_bytes()
}

/// Hash of the build that runs and the plan it runs.
pub(super) fn plan_hash(version: &str, numerics: u32, plan: &Value) -> blake3::Hash {
    blake3::hash(format!("{version}\n{numerics}\n{plan}").as_bytes())
}

/// The plan with the facts beside it, for showing differences of either by path.
fn comparable(file: &PlanFile) -> Value {
    let mut value = file.plan.clone();
    if let Value::Object(map) = &mut value {
        map.insert("sweep_version".into(), file.version.clone().into());
        map.insert("numerics".into(), file.numerics.into());
        map.insert("store_format".into(), file.format.into());
        map.insert("chunk_points".into(), file.chunk_points.into());
    }
    value
}

/// Moves something unreadable out of the way, keeping it for whoever wants to look, under a name
/// that nothing has yet: what was kept before stays too.
pub(super) fn set_aside(path: &Path) -> Result<PathBuf, StoreError> {
    let named = |number: u64| {
        let mut name = path.as_os_str().to_owned();
        name.push(".damaged");
        if number > 1 {
            name.push(format!("-{number}"));
        }
        PathBuf::from(name)
    };
    let is_free = |aside: &PathBuf| fs::symlink_metadata(aside).is_err();
    let aside = (1..=u64::MAX).map(named).find(is_free).unwrap_or_else(|| named(1));
    // Another shard of the same run may have set it aside first.
    let renamed = regular::if_there(fs::rename(path, &aside));
    renamed.map_err(StoreError::io("set aside", path)).map(|_| aside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_survive_the_file_so_the_hash_does() {
        let plan = json!({ "x": 0.1 + 0.2, "y": 1e-300 / 3.0, "z": 2.0e-4, "n": 5e-324 });
        let back: Value =
            serde_json::from_slice(&serde_json::to_vec_pretty(&plan).unwrap()).unwrap();
        assert_eq!(plan_hash("1", 1, &plan), plan_hash("1", 1, &back));
        assert_ne!(plan_hash("1", 1, &plan), plan_hash("2", 1, &plan));
        assert_ne!(plan_hash("1", 1, &plan), plan_hash("1", 2, &plan));
    }
}
