//! The command line: one subcommand a module.

use clap::{Parser, Subcommand};

use crate::commands::{
    boundary, check, completions, init, merge, parameters, plot, run, schema, show, slurm, status,
};
use crate::exit::{Error, Exit};

/// Printed before everything else by `--help`: most readers want to see one line that works.
const EXAMPLES: &str = "\
Examples:
  sweep init my.toml                         a commented grid file to start from
  sweep check my.toml                        every mistake in it, or what it would do
  sweep check my.toml --set tub_mass_kg=20   the same with another tub
  sweep parameters                           every number that can be set or swept";

/// Maps where a washing machine's linear suspension model can be trusted.
#[derive(Debug, Parser)]
#[command(
    name = "sweep",
    version,
    before_help = EXAMPLES,
    after_help = Exit::table(),
    subcommand_required = true,
    arg_required_else_help = true,
    disable_help_subcommand = true,
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Integrate every grid point with both models, into one Parquet file; resumes what was interrupted
    Run(run::Args),
    /// Check a grid file and show what it would do, without doing it
    Check(check::Args),
    /// Join the finished shards of a run into its one result file
    Merge(merge::Args),
    /// Show how far a run is: done, missing, failed, running
    Status(status::Args),
    /// Print the script that submits a run to a Slurm cluster: an array of shards, then their merge
    Slurm(slurm::Args),
    /// Show what a result file holds: counts, verdicts, extremes, provenance
    Show(show::Args),
    /// Trace the curve where the ratio is at its limit, without filling the grid
    Boundary(boundary::Args),
    /// Draw the figure that fits a file: map, boundary, time histories or Campbell diagram
    Plot(plot::Args),
    /// List every parameter that can be set or swept
    Parameters(parameters::Args),
    /// Write a commented grid file, or a machine file, to start from
    Init(init::Args),
    /// Print the JSON Schema of grid or machine files, for editors
    Schema(schema::Args),
    /// Print shell completions
    Completions(completions::Args),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// Whatever kept the command from its end.
    pub fn run(&self) -> Result<Exit, Error> {
        match self {
            Self::Run(args) => run::run(args),
            Self::Check(args) => check::run(args),
            Self::Merge(args) => merge::run(args),
            Self::Status(args) => status::run(args),
            Self::Slurm(args) => slurm::run(args),
            Self::Show(args) => show::run(args),
            Self::Boundary(args) => boundary::run(args),
            Self::Plot(args) => plot::run(args),
            Self::Parameters(args) => parameters::run(args),
            Self::Init(args) => init::run(args),
            Self::Schema(args) => schema::run(args),
            Self::Completions(args) => completions::run(args),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_line_of_the_examples_parses() {
        for line in EXAMPLES.lines().skip(1) {
            let command = line.trim().split("  ").next().unwrap_or_default();
            let parsed = Cli::try_parse_from(command.split_whitespace());
            assert!(parsed.is_ok(), "{command}: {parsed:?}");
        }
    }

    #[test]
    fn help_shows_the_examples_before_the_usage_and_the_exit_codes_after() {
        let help = Cli::command().render_help().to_string();
        let place = |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(place("Examples:") < place("Usage:") && place("Usage:") < place("Exit codes:"));
    }
}
