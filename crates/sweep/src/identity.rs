//! The build of the program that made a file. The build and the plan decide the file's bytes.

use sweep_engine::Build;

/// The version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The version of everything that decides the bytes of a result: the models, the integrators, the
/// metrics and the columns. It is raised with every change to these bytes.
///
/// Builds of one `VERSION` and one `NUMERICS_VERSION` write the same bytes for the same input;
/// chunks of others are never mixed with theirs. `tests/command/goldens.rs` fails when bytes change
/// and this number does not; `scripts/release/raise_numerics.sh` raises it and writes the new
/// hashes.
pub const NUMERICS_VERSION: u32 = 39;

/// The build of this program.
pub(crate) const BUILD: Build = Build { version: VERSION, numerics: NUMERICS_VERSION };
