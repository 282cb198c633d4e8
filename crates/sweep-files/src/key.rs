//! Keys of a Parquet file's own key-value metadata.

/// The plan as JSON: the grid as run, the full machine and the method.
pub const PLAN: &str = "sweep.plan";
/// The hexadecimal hash of the program's identity and the plan.
pub const PLAN_HASH: &str = "sweep.plan_hash";
/// Version of the program.
pub const VERSION: &str = "sweep.version";
/// The version of the program's numerics. Results depend on it and on the plan only.
pub const NUMERICS: &str = "sweep.numerics";
/// A JSON object with the metadata of each column by its name: `type`, `unit`, `description`, and
/// [`WORSE`] and [`LIMIT`] if the column can be bad.
pub const COLUMNS: &str = "sweep.columns";
/// Direction in which a column is bad: `greater` or `less`.
pub const WORSE: &str = "worse";
/// The limit between good and bad values of a column, if it has a meaning independent of the plan.
pub const LIMIT: &str = "limit";
/// The mark `true` of a column whose worst value and rows beyond the limit are in summaries.
pub const SUMMARY: &str = "summary";
/// Settings and result of a boundary: quantity, limit, tolerance, lattice, trials, rounds. In
/// boundary files alone.
pub const BOUNDARY: &str = "sweep.boundary";
/// Point, instants, method and end of a trace. In traces alone.
pub const TRACE: &str = "sweep.trace";
/// Resonances and shapes. In modes files alone.
pub const MODES: &str = "sweep.modes";
/// Speeds, and the meaning of rows. In files of `sweep stability` alone.
pub const STABILITY: &str = "sweep.stability";
/// Speeds and starts. In files of `sweep dwell` alone.
pub const DWELL: &str = "sweep.dwell";
/// Objectives, conditions and the best candidate of a study. In files of `sweep optimise` alone.
pub const OPTIMISE: &str = "sweep.optimise";
/// Result of a fit. In the curves of `sweep fit` alone.
pub const FIT: &str = "sweep.fit";
/// The files that were compared, and the differences of their plans. In files of differences alone.
pub const DIFFERENCES: &str = "sweep.differences";
/// The position of a part among those of unfinished work. In parts alone.
pub const PART: &str = "sweep.part";
/// BLAKE3 hash of the whole file with zeros in this place, hexadecimal.
pub const DIGEST: &str = "sweep.digest";
