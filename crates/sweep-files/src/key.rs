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
/// Which way a column is bad: `greater` or `less`.
pub const WORSE: &str = "worse";
/// The value up to which a column is good, if that has a meaning of its own.
pub const LIMIT: &str = "limit";
/// What was traced: quantity, limit, tolerance, lattice, trials, rounds. In boundary files
/// alone.
pub const BOUNDARY: &str = "sweep.boundary";
/// Which point, how often, how integrated, and how it ended. In traces alone.
pub const TRACE: &str = "sweep.trace";
/// Resonances and shapes. In modes files alone.
pub const MODES: &str = "sweep.modes";
/// Speeds, and what the rows mean. In files of `sweep stability` alone.
pub const STABILITY: &str = "sweep.stability";
/// Speeds and starts. In files of `sweep dwell` alone.
pub const DWELL: &str = "sweep.dwell";
/// What was looked for, and which candidate is the best. In files of `sweep optimise` alone.
pub const OPTIMISE: &str = "sweep.optimise";
/// What a fit found. In the curves of `sweep fit` alone.
pub const FIT: &str = "sweep.fit";
/// Which files were compared, and where their plans part. In files of differences alone.
pub const DIFFERENCES: &str = "sweep.differences";
/// BLAKE3 hash of the whole file with zeros in this place, hexadecimal.
pub const DIGEST: &str = "sweep.digest";
