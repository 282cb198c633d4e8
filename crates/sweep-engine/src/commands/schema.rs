//! `schema`: the JSON Schema of grid files.

use crate::config::schema::grid_schema;
use crate::{Error, Exit, Model, print};

/// Arguments of `schema`.
#[derive(Debug, clap::Args)]
pub struct SchemaArgs {}

/// Prints the schema of a model's grid files.
///
/// # Errors
/// Standard output that cannot be written.
pub fn run<M: Model>(_: &SchemaArgs) -> Result<Exit, Error> {
    print(&format!("{:#}\n", grid_schema::<M>()))
}
