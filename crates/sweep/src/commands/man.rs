//! `sweep man DIR`: manual pages, for packagers.

use std::path::PathBuf;

use crate::cli;
use crate::exit::{Error, Exit};

/// Arguments of `sweep man`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder to write them to; made if it is not there
    folder: PathBuf,
}

/// Writes a page for the program and one for each command.
///
/// # Errors
/// A folder that cannot be written to.
pub fn run(args: &Args) -> Result<Exit, Error> {
    let failed = |source| Error::File { action: "write manual pages to", path: args.folder.clone(), source };
    std::fs::create_dir_all(&args.folder).map_err(failed)?;
    clap_mangen::generate_to(cli::command(), &args.folder).map_err(failed)?;
    Ok(Exit::Done)
}
