//! The command line of a model's program. Each subcommand has a module with its arguments and a
//! function `run`.

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

use std::fmt;
use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::program::set_program;
use crate::{Error, Exit, Model, check_random_numbers, survive_file_size_limits};
use cells::{Lines, format_cell, format_number, format_range, format_table, shorten};
use grid::{GridArgs, ResultArgs, quote_for_shell};
use run::install_interrupt;
use sweep_plot::CommonFigures;

/// The arguments of the general subcommands to which a program may add options.
pub trait Arguments {
    /// The arguments of `run`.
    type Run: clap::Args + fmt::Debug;
    /// The arguments of `check`.
    type Check: clap::Args + fmt::Debug;
    /// The arguments of `plot`.
    type Plot: clap::Args + fmt::Debug;
    /// The arguments of `status`.
    type Status: clap::Args + fmt::Debug;
    /// The arguments of `merge`.
    type Merge: clap::Args + fmt::Debug;
    /// The arguments of `schema`.
    type Schema: clap::Args + fmt::Debug;
}

/// The arguments of a program that adds no options.
#[derive(Debug)]
pub enum BaseArguments {}

impl Arguments for BaseArguments {
    type Run = run::RunArgs;
    type Check = check::CheckArgs;
    type Plot = plot::PlotArgs;
    type Status = status::StatusArgs;
    type Merge = merge::MergeArgs;
    type Schema = schema::SchemaArgs;
}

/// A general subcommand, which the program of every model has.
#[derive(Debug, Subcommand)]
pub enum GeneralCommand<A: Arguments> {
    /// Integrate every grid point, or continue after an interruption
    Run(A::Run),
    /// Check a grid file and describe its run, without running it
    Check(A::Check),
    /// Trace the curve where a ratio, or any number, is at its limit
    Boundary(boundary::BoundaryArgs),
    /// Find the parameters that minimise numbers under conditions
    Optimise(optimise::OptimiseArgs),
    /// Summarise a result file: verdicts, extremes, metrics
    Show(show::ShowArgs),
    /// Draw a result file
    Plot(A::Plot),
    /// Write one page to print: verdict, worst values, pictures
    Report(report::ReportArgs),
    /// Check expressions on a result, and show rows that violate them
    Require(require::RequireArgs),
    /// Show the differences between two results
    Compare(compare::CompareArgs),
    /// Write a result as CSV or as an Excel workbook, with units
    Export(export::ExportArgs),
    /// Show the progress of a run: done, missing, failed, running
    Status(A::Status),
    /// Join the finished shards of a run into its one result file
    Merge(A::Merge),
    /// List every parameter that can be set or swept
    Parameters(parameters::ParametersArgs),
    /// Print the JSON Schema of input files, for editors
    Schema(A::Schema),
}

#[derive(Debug, Parser)]
#[command(after_help = Exit::format_codes(), disable_help_subcommand = true)]
struct Cli {
    #[command(subcommand)]
    command: GeneralCommand<BaseArguments>,
}

/// Runs the command that this process's arguments give, and returns its exit code. `name` is the
/// name of the program.
pub fn main<M: Model>(name: &'static str) -> ExitCode {
    set_program(name);
    let matches = Cli::command().name(name).bin_name(name).get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let exit = run::<M>(&cli.command).unwrap_or_else(|error| {
        error.report();
        error.exit_code()
    });
    exit.into()
}

fn run<M: Model>(command: &GeneralCommand<BaseArguments>) -> Result<Exit, Error> {
    survive_file_size_limits().map_err(Error::signal_handlers)?;
    check_random_numbers()?;
    match command {
        GeneralCommand::Run(args) => run::run::<M>(args),
        GeneralCommand::Check(args) => check::run::<M>(args),
        GeneralCommand::Boundary(args) => boundary::run::<M>(args),
        GeneralCommand::Optimise(args) => optimise::run::<M>(args),
        GeneralCommand::Show(args) => show::run(args, &show::ModelSummary::NONE),
        GeneralCommand::Plot(args) => plot::run(args),
        GeneralCommand::Report(args) => {
            report::run::<M>(args, &show::ModelSummary::NONE, &|_| Vec::new(), &CommonFigures)
        }
        GeneralCommand::Require(args) => require::run(args),
        GeneralCommand::Compare(args) => compare::run::<M>(args),
        GeneralCommand::Export(args) => export::run(args),
        GeneralCommand::Status(args) => status::run::<M>(args),
        GeneralCommand::Merge(args) => merge::run::<M>(args),
        GeneralCommand::Parameters(args) => parameters::run::<M>(args),
        GeneralCommand::Schema(args) => schema::run::<M>(args),
    }
}
