//! Keys of a Parquet file's own key-value metadata.

/// The plan as JSON: grid as run, full machine, method.
pub const PLAN: &str = "sweep.plan";
/// Hash over identity and plan, hexadecimal.
pub const PLAN_HASH: &str = "sweep.plan_hash";
/// Version of the program.
pub const VERSION: &str = "sweep.version";
/// Version of the program's numerics: what decides the numbers besides the plan.
pub const NUMERICS: &str = "sweep.numerics";
/// JSON object: column name to `type`, `unit`, `description`, and [`WORSE`] and [`LIMIT`] if
/// the column can be bad.
pub const COLUMNS: &str = "sweep.columns";
/// Direction in which a column is bad: `greater` or `less`.
pub const WORSE: &str = "worse";
/// The value up to which a column is good, if that has a meaning of its own.
pub const LIMIT: &str = "limit";
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
/// Place of a part of unfinished work. In parts alone.
pub const PART: &str = "sweep.part";
/// BLAKE3 hash of the whole file with zeros in this place, hexadecimal.
pub const DIGEST: &str = "sweep.digest";
