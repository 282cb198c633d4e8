//! A run's files. Nothing computed is lost, and only the plan decides the bytes of the result.
//!
//! A run on `x.parquet` works in the folder `x.parquet.partial`:
//!
//! | file | what |
//! |---|---|
//! | `plan.json` | the frozen plan, written first (`plan_file`) |
//! | `shards.json` | into how many shards the run was dealt, if it was (`shard`) |
//! | `part-<index>.parquet` | finished rows of a chunk (`point_parts`), or trials (`trials`) |
//! | `*.damaged` | what was not as it had been written; kept |
//! | `session-*.json` | how long each process worked on it, and where ([`provenance`]) |
//! | `lock`, `shard-<i>.lock` | who is at work (`lock`) |
//!
//! When every part is there they are joined into the one Parquet file (`merge`), and the folder
//! goes, unless it holds what the run did not write (`own`) or has set aside. The store knows
//! points, axis names and outcomes; it does not know the engine that makes them.

mod differences;
mod error;
mod lock;
mod merge;
mod open;
mod own;
mod part;
mod plan_file;
mod point_parts;
pub mod provenance;
pub mod read;
pub mod schema;
mod shard;
mod status;
#[cfg(test)]
pub mod synthetic;
#[cfg(test)]
mod tests;
mod trials;
mod unfinished;

use std::path::{Path, PathBuf};

use serde_json::Value;

pub use differences::PlanDifference;
pub use error::{Holder, StoreError};
use lock::Lock;
pub use merge::write_map;
pub use open::{OpenOptions, OpenRun, Opened};
pub use provenance::Session;
pub use read::{ResultFile, Tally};
pub use schema::{BATCH_ROWS, Column, Done, Holds, Layout, ResultRows, Row};
pub use shard::{Shard, ShardRequest, list as shard_list};
pub use status::{FolderStatus, State, status};
pub use trials::{Key, TrialColumns, Trials, WRITE_INTERVAL};
pub use unfinished::{Unfinished, refuse_unfinished, unfinished};

use sweep_parameter::RatioLimits;

use crate::config::section::counted;
use crate::{Axis, Model, Plan};
use sweep_files::{self as files, FileKind};

/// The values of the axes at a point of the grid, first axis first.
pub type PointValues<'a> = Box<dyn Fn(u64) -> Vec<f64> + Send + Sync + 'a>;

/// What the store must know of a plan.
pub struct Job<'a> {
    /// Grid as run, full machine and method. Two runs are the same when this, `version` and
    /// `numerics` are.
    pub plan: Value,
    /// Version of the program; other versions may round differently, so their chunks do not mix.
    pub version: &'a str,
    /// Version of its numerics: so may other builds of one version.
    pub numerics: u32,
    /// Rows of the result.
    pub points: u64,
    /// What the columns depend on.
    pub layout: Layout,
    /// A row is reliable when its ratios are between these.
    pub limits: RatioLimits,
    /// Axis values by point.
    pub axis_values: PointValues<'a>,
}

impl<'a> Job<'a> {
    /// What the store must know of this plan, as run by this build of its program.
    pub fn of<M: Model>(plan: &'a Plan<M>) -> Self {
        Self {
            plan: plan.to_json(),
            version: M::ABOUT.build.version,
            numerics: M::ABOUT.build.numerics,
            points: plan.points(),
            layout: M::layout(plan),
            limits: plan.reliability.limits,
            axis_values: Box::new(|point| plan.axis_values(point)),
        }
    }

    /// Hash of version, numerics and plan.
    pub fn hash(&self) -> blake3::Hash {
        plan_file::plan_hash(self.version, self.numerics, &self.plan)
    }
}

/// The axes of a plan as columns.
pub fn axis_columns<M: Model>(plan: &Plan<M>) -> Vec<Column> {
    let column = |axis: &Axis<M>| {
        let parameter = &axis.parameter;
        Column::new(&*parameter.name, parameter.unit, parameter.description, Holds::Axis)
    };
    plan.axes.iter().map(column).collect()
}

/// Points a chunk holds (the last may hold fewer), from the number of points alone.
///
/// A power of two, so that chunks fill whole SIMD lane groups: 8 for the smallest grids, so that
/// every core gets some; then 32 to 4096, for about a thousand chunks; then 4096 each, for chunks
/// of a megabyte.
pub fn chunk_points(points: u64) -> u64 {
    const SMALL_GRID: u64 = 128;
    const CHUNKS: u64 = 1024;
    if points <= SMALL_GRID {
        return 8;
    }
    points.div_ceil(CHUNKS).clamp(32, 4096).next_power_of_two()
}

/// What to say of shards that get no chunk, if there are any.
pub fn idle_shards(points: u64, shards: u64) -> Option<String> {
    let (of_chunk, chunks) = (chunk_points(points), points.div_ceil(chunk_points(points)));
    (shards > chunks).then(|| {
        let idle = shards - chunks;
        let has = format!("{} of {of_chunk} points", counted(chunks as usize, "chunk"));
        format!("note: with {has}, the run leaves {idle} of the {shards} shards without work")
    })
}

// The files of a folder that have one name: those of every run, and of shards.
const PLAN: &str = "plan.json";
const LOCK: &str = "lock";
const SHARDS: &str = "shards.json";

/// The paths of one run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folder {
    /// The finished file.
    pub output: PathBuf,
    /// The folder of the unfinished run, beside it.
    pub path: PathBuf,
}

impl Folder {
    /// Those of the run with this output. Neither it nor its sidecar is anything but absent or
    /// ours.
    pub fn of(output: &Path, layout: &Layout) -> Result<Self, StoreError> {
        let folder = Self::beside(output, layout.kind)?;
        files::judge(&folder.sidecar(), folder.account())?;
        Ok(folder)
    }

    fn beside(output: &Path, kind: FileKind<'_>) -> Result<Self, StoreError> {
        files::judge(output, kind)?;
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".partial");
        Ok(Self { output: output.to_path_buf(), path: output.with_file_name(name) })
    }

    /// A file of the folder.
    fn file(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path.join(name)
    }

    /// The sidecar that says how the run went.
    fn sidecar(&self) -> PathBuf {
        files::beside(&self.output, "run.json")
    }

    /// What kind of file that is.
    fn account(&self) -> FileKind<'_> {
        FileKind::Account { of: self.output.file_name().unwrap_or_default() }
    }
}

/// Returns the name of the part of this index: a chunk's, or one of a search's.
fn part_name(index: u64) -> String {
    format!("part-{index:08}.parquet")
}

/// Returns the index of the part that a file is named after, if any.
fn part_index(name: &str) -> Option<u64> {
    let index = name.strip_prefix("part-")?.strip_suffix(".parquet")?.parse().ok()?;
    (part_name(index) == name).then_some(index)
}
