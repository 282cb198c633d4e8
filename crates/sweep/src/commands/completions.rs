//! `sweep completions SHELL`.

use clap_complete::Shell;

use crate::cli;
use crate::exit::{Error, Exit, print};

/// Arguments of `sweep completions`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Shell to complete for
    shell: Shell,
}

/// Prints the completion script.
///
/// # Errors
/// When standard output cannot be written.
pub fn run(args: &Args) -> Result<Exit, Error> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut cli::command(), "sweep", &mut script);
    print(&String::from_utf8_lossy(&script))
}
