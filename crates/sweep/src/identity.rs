//! The build of the program that made a file. With the plan it decides the file's bytes.

use sweep_engine::Build;

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Version of everything that decides a byte of a result: the models, the integrators, what is
/// derived from their motions, the columns. It is raised with every change to such bytes.
///
/// Builds of one `VERSION` and one `NUMERICS_VERSION` write the same bytes for the same input;
/// chunks of others are never mixed with theirs. `tests/command/goldens.rs` fails when bytes change
/// and this number does not; `scripts/release/raise_numerics.sh` raises it and writes the new
/// hashes.
pub const NUMERICS_VERSION: u32 = 32;

/// Both.
pub(crate) const BUILD: Build = Build { version: VERSION, numerics: NUMERICS_VERSION };
