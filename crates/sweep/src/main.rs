//! The command.

use std::process::ExitCode;

use clap::Parser as _;
use sweep::cli::Cli;

fn main() -> ExitCode {
    let exit = Cli::parse().command.run().unwrap_or_else(|error| {
        error.report();
        error.exit()
    });
    exit.into()
}
