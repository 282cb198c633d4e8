//! One module a subcommand, each with its arguments and `run`.

use std::path::PathBuf;

use crate::config::{self, Diagnostics};
use crate::plan::Plan;

pub mod check;
pub mod completions;
pub mod init;
pub mod parameters;
pub mod schema;

/// A grid file and changes to its constants, as most commands take them.
#[derive(Debug, clap::Args)]
pub struct Grid {
    /// Grid file
    #[arg(value_name = "GRID.toml")]
    pub grid: PathBuf,
    /// Set a constant, over the grid file's [set]; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub sets: Vec<String>,
}

impl Grid {
    /// The plan.
    ///
    /// # Errors
    /// Every mistake in the grid file, its machine file and the constants.
    pub fn load(&self) -> Result<Plan, Diagnostics> {
        config::load(&self.grid, &self.sets)
    }
}
