//! The command.

use std::process::ExitCode;

use lane_ode::Simd;
use sweep::{Error, Exit, WasherCli, check_random_numbers, survive_file_size_limits};

fn main() -> ExitCode {
    let exit = run().unwrap_or_else(|error| {
        error.report();
        error.exit_code()
    });
    exit.into()
}

fn run() -> Result<Exit, Error> {
    let cli = WasherCli::read();
    Simd::check_processor().map_err(Error::model)?;
    survive_file_size_limits().map_err(Error::signal_handlers)?;
    check_random_numbers()?;
    cli.command.run()
}
