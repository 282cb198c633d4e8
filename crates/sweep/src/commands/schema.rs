//! `sweep schema` prints the JSON Schema of grid and machine files.

use crate::config::machine;
use sweep_engine::{Error, Exit, print};

/// Arguments of `sweep schema`.
#[derive(Debug, clap::Args)]
pub struct WasherSchemaArgs {
    /// The schema of machine files instead of grid files
    #[arg(long)]
    machine: bool,
}

/// Prints the schema.
///
/// # Errors
/// Returns an error if standard output cannot be written.
pub(crate) fn run(args: &WasherSchemaArgs) -> Result<Exit, Error> {
    let schema = if args.machine {
        machine::schema()
    } else {
        sweep_engine::config::schema::grid_schema::<crate::Washer>()
    };
    print(&format!("{schema:#}\n"))
}
