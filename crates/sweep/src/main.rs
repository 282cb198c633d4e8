//! The command.

use std::process::ExitCode;

use sweep::cli::Cli;

fn main() -> ExitCode {
    let exit = Cli::read().command.run().unwrap_or_else(|error| {
        error.report();
        error.exit()
    });
    exit.into()
}
