//! The files of a run. Finished rows survive a crash, and the bytes of the result depend on the
//! plan alone.
//!
//! A run on `x.parquet` works in the folder `x.parquet.partial`:
//!
//! | file | content |
//! |---|---|
//! | `plan.json` | the plan with which the run began; written first, never changed (`plan_file`) |
//! | `shards.json` | the number of shards, if the run is divided into shards (`shard`) |
//! | `part-<index>.parquet` | finished rows of a chunk (`point_parts`), or trials (`trials`) |
//! | `*.damaged` | files that were not as a run had written them; kept for inspection |
//! | `session-*.json` | duration and host of each process that worked on the run ([`provenance`]) |
//! | `lock`, `shard-<i>.lock` | the processes that work on the run (`lock`) |
//!
//! When all parts exist, they are joined into the result, a single Parquet file (`merge`). Then the
//! folder is deleted, unless it holds files that the run did not write (`own_files`) or has renamed
//! to `*.damaged`. The store knows points, axis names and rows, but not the engine that computes
//! them.

mod differences;
mod error;
mod lock;
mod merge;
mod open;
mod own_files;
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
pub use error::{LockHolder, StoreError};
use lock::Lock;
pub use merge::write_map;
pub use open::{OpenOptions, OpenOutcome, OpenRun};
pub use provenance::Session;
pub use read::{ResultFile, Tally};
pub use schema::{BATCH_ROWS, BatchBuilder, CellType, DeclaredColumn, Layout, PointRows, RowCells};
pub use shard::{Shard, ShardRequest, format_numbers as format_shard_numbers};
pub use status::{FolderStatus, RunStage, read_status};
pub use trials::{TrialColumns, TrialKey, Trials, WRITE_INTERVAL};
pub use unfinished::{UnfinishedWork, find_unfinished, refuse_unfinished};

use sweep_parameter::RatioLimits;

use crate::config::section::format_count;
use crate::{Axis, Model, Plan};
use sweep_files::{self as files, FileKind};

/// A function that returns the values of the axes at a point of the grid, in the order of the axes.
pub type PointValues<'a> = Box<dyn Fn(u64) -> Vec<f64> + Send + Sync + 'a>;

/// The facts about a plan that the store needs.
pub struct Job<'a> {
    /// The grid with all options applied, the full machine, and the method. Two runs are the same
    /// if their `plan`, `version` and `numerics` are the same.
    pub plan: Value,
    /// The version of the program. Other versions may round differently, so chunks of two versions
    /// are never mixed.
    pub version: &'a str,
    /// The version of the numerics. It distinguishes builds of the same program version whose
    /// numbers may differ.
    pub numerics: u32,
    /// The number of points.
    pub points: u64,
    /// The columns of the result.
    pub layout: Layout,
    /// The limits between which the ratios of a reliable row lie.
    pub limits: RatioLimits,
    /// The values of the axes at each point.
    pub axis_values: PointValues<'a>,
}

impl<'a> Job<'a> {
    /// Returns the job of a plan, as this build of the program runs it.
    pub fn new<M: Model>(plan: &'a Plan<M>) -> Self {
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

    /// Returns the hash of version, numerics and plan.
    pub fn hash(&self) -> blake3::Hash {
        plan_file::plan_hash(self.version, self.numerics, &self.plan)
    }
}

/// Returns the columns of a plan's axes.
pub fn axis_columns<M: Model>(plan: &Plan<M>) -> Vec<DeclaredColumn> {
    let column = |axis: &Axis<M>| {
        let parameter = &axis.parameter;
        DeclaredColumn::new(&*parameter.name, parameter.unit, parameter.description, CellType::Axis)
    };
    plan.axes.iter().map(column).collect()
}

/// Returns the number of points of each chunk except the last, which may have fewer. It depends
/// only on the number of all points.
///
/// It is a power of two, so that chunks fill all SIMD lanes: 8 for the smallest grids, so that
/// every core gets chunks; 32 to 4096 for larger grids, which makes about a thousand chunks; and
/// 4096 for the largest grids, whose chunks take a megabyte.
pub fn chunk_points(points: u64) -> u64 {
    /// The number of points up to which a grid is small. Basis: with chunks of 32 points, smaller
    /// grids would leave cores without work. Doubling it gives grids of twice that size the small
    /// chunks.
    const SMALL_GRID: u64 = 128;
    /// The desired number of chunks. Basis: an interruption loses a thousandth of the rows, and the
    /// overhead of a file is small against its rows. Doubling it halves the chunks.
    const DESIRED_CHUNKS: u64 = 1024;
    if points <= SMALL_GRID {
        return 8;
    }
    points.div_ceil(DESIRED_CHUNKS).clamp(32, 4096).next_power_of_two()
}

/// Returns a note about shards that get no chunk, if there are any.
pub fn note_idle_shards(points: u64, shards: u64) -> Option<String> {
    let points_per_chunk = chunk_points(points);
    let chunks = points.div_ceil(points_per_chunk);
    (shards > chunks).then(|| {
        let idle_count = shards - chunks;
        let chunks_text =
            format!("{} of {points_per_chunk} points", format_count(chunks as usize, "chunk"));
        format!(
            "note: with {chunks_text}, the run leaves {idle_count} of the {shards} shards without \
             work"
        )
    })
}

/// The name of the file of the plan in a run's folder.
const PLAN_FILE: &str = "plan.json";
/// The name of the lock of a run's folder.
const LOCK_FILE: &str = "lock";
/// The name of the file of the number of shards in a run's folder.
const SHARDS_FILE: &str = "shards.json";

/// The paths of a run's result and of its folder of unfinished work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folder {
    /// The path of the result.
    pub output: PathBuf,
    /// The path of the folder of unfinished work, beside the result.
    pub path: PathBuf,
}

impl Folder {
    /// Returns the paths of the run with this output. Files that already exist at the output or its
    /// sidecar must be of this program.
    pub fn new(output: &Path, layout: &Layout) -> Result<Self, StoreError> {
        let folder = Self::next_to_output(output, layout.kind)?;
        files::check_replaceable(&folder.sidecar_path(), folder.sidecar_kind())?;
        Ok(folder)
    }

    fn next_to_output(output: &Path, kind: FileKind<'_>) -> Result<Self, StoreError> {
        files::check_replaceable(output, kind)?;
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".partial");
        Ok(Self { output: output.to_path_buf(), path: output.with_file_name(name) })
    }

    /// Returns the path of a file in the folder.
    fn file(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path.join(name)
    }

    /// Returns the path of the sidecar: the JSON file beside the result that describes how the run
    /// went.
    fn sidecar_path(&self) -> PathBuf {
        files::path_beside(&self.output, "run.json")
    }

    /// Returns the kind of the sidecar.
    fn sidecar_kind(&self) -> FileKind<'_> {
        FileKind::Sidecar { result_name: self.output.file_name().unwrap_or_default() }
    }
}

/// Returns the name of the part with this index, which is the index of a chunk, or the number of a
/// search's part.
fn part_name(index: u64) -> String {
    format!("part-{index:08}.parquet")
}

/// Returns the index of the part that a file is named after, if any.
fn part_index(name: &str) -> Option<u64> {
    let index = name.strip_prefix("part-")?.strip_suffix(".parquet")?.parse().ok()?;
    (part_name(index) == name).then_some(index)
}
