//! The command line over a model: one module a subcommand, each with its arguments and `run`.

pub mod boundary;
pub mod cells;
pub mod check;
pub mod compare;
pub mod conditions;
pub mod examples;
pub mod export;
pub mod grid;
pub mod merge;
pub mod optimise;
pub mod parameters;
pub mod plot;
pub mod report;
pub mod require;
pub mod run;
pub mod schema;
pub mod show;
pub mod status;

use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::program::call_program;
use crate::{Error, Exit, Swept, expect_random_numbers, survive_file_size_limits};
use cells::{Lines, clipped, short, span, table, word};
use grid::{GridArgs, ResultArgs, quoted};
use run::installed;
use sweep_plot::CommonFigures;

#[derive(Debug, Parser)]
#[command(after_help = Exit::table(), disable_help_subcommand = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Integrate every grid point, or go on after an interruption
    Run(run::Args),
    /// Check a grid file and show what it would do, without doing it
    Check(check::Args),
    /// Trace the curve where a ratio, or any number, is at its limit
    Boundary(boundary::Args),
    /// Find parameters at which numbers are least within limits
    Optimise(optimise::Args),
    /// Show what a result file holds: verdicts and extremes
    Show(show::Args),
    /// Draw a map or a boundary
    Plot(plot::Args),
    /// Write one page to print: verdict, worst values, pictures
    Report(report::Args),
    /// Check expressions on a result, and show the rows that break them
    Require(require::Args),
    /// Say what differs between two results
    Compare(compare::Args),
    /// Write a result as CSV or as an Excel workbook, with units
    Export(export::Args),
    /// Show how far a run is: done, missing, failed, running
    Status(status::Args),
    /// Join the finished shards of a run into its one result file
    Merge(merge::Args),
    /// List every parameter that can be set or swept
    Parameters(parameters::Args),
    /// Print the JSON Schema of grid files, for editors
    Schema(schema::Args),
}

/// The program of a model: does what this process's arguments say. `name` is how it is called.
pub fn main<M: Swept>(name: &'static str) -> ExitCode {
    call_program(name);
    let matches = Cli::command().name(name).bin_name(name).get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let exit = run::<M>(&cli.command).unwrap_or_else(|error| {
        error.report();
        error.exit()
    });
    exit.into()
}

fn run<M: Swept>(command: &Command) -> Result<Exit, Error> {
    survive_file_size_limits().map_err(Error::signals)?;
    expect_random_numbers()?;
    match command {
        Command::Run(args) => run::run::<M>(args),
        Command::Check(args) => check::run::<M>(args),
        Command::Boundary(args) => boundary::run::<M>(args),
        Command::Optimise(args) => optimise::run::<M>(args),
        Command::Show(args) => show::run(args, &show::Further::NONE),
        Command::Plot(args) => plot::run(args),
        Command::Report(args) => {
            report::run::<M>(args, &show::Further::NONE, &|_| Vec::new(), &CommonFigures)
        }
        Command::Require(args) => require::run(args),
        Command::Compare(args) => compare::run(args, M::BUILD),
        Command::Export(args) => export::run(args),
        Command::Status(args) => status::run::<M>(args),
        Command::Merge(args) => merge::run::<M>(args),
        Command::Parameters(args) => parameters::run::<M>(args),
        Command::Schema(args) => schema::run::<M>(args),
    }
}
