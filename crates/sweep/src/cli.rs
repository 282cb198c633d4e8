//! The command line: one subcommand a module.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::commands::{
    boundary, check, completions, examples, init, man, merge, modes, parameters, plot, reference, run,
    schema, show, slurm, status, trace,
};
use crate::exit::{Error, Exit};
use crate::nearest::nearest;
use crate::panics;

/// Maps where a washing machine's linear suspension model can be trusted.
#[derive(Debug, Parser)]
#[command(
    name = "sweep",
    version,
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
    /// Write time histories of both models at one point
    Trace(trace::Args),
    /// Find the natural frequencies over spin speed, the resonance speeds and the mode shapes
    Modes(modes::Args),
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
    /// Write manual pages
    Man(man::Args),
    /// Print a page of the guide that is made from this program's tables
    #[command(hide = true)]
    Reference(reference::Args),
}

/// The command line with everything that its help shows.
#[must_use]
pub fn command() -> clap::Command {
    let with = |command: clap::Command, examples: Option<String>| match examples {
        Some(examples) => command.before_help(examples),
        None => command,
    };
    let program = with(Cli::command(), examples::of(""));
    let names: Vec<String> = program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    names.into_iter().fold(program, |program, name| {
        program.mut_subcommand(&name, |command| with(command, examples::of(&name)))
    })
}

/// The command line without what help hides, for what lists every subcommand.
#[must_use]
pub fn shown_command() -> clap::Command {
    let whole = command();
    let shown = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    clap::Command::new("sweep")
        .version(env!("CARGO_PKG_VERSION"))
        .about(whole.get_about().cloned().unwrap_or_default())
        .disable_help_subcommand(true)
        .args(whole.get_arguments().cloned())
        .subcommands(shown)
}

/// Adds the subcommand that was meant, where clap finds none near: it looks for likeness, of which a slip leaves
/// little in a name of three letters.
fn suggest(mut error: clap::Error) -> clap::Error {
    let typed = match (error.kind(), error.get(ContextKind::InvalidSubcommand)) {
        (ErrorKind::InvalidSubcommand, Some(ContextValue::String(typed))) => typed.clone(),
        _ => return error,
    };
    let shown = shown_command();
    let names = shown.get_subcommands().map(clap::Command::get_name);
    if let (None, Some(name)) = (error.get(ContextKind::SuggestedSubcommand), nearest(&typed, names)) {
        error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![name.to_owned()]));
    }
    error
}

impl Cli {
    /// Reads this process's command line; on a mistake, or when asked for help, tells and ends the process.
    #[must_use]
    pub fn read() -> Self {
        let matches = command().try_get_matches().unwrap_or_else(|error| suggest(error).exit());
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// Whatever kept the command from its end.
    pub fn run(&self) -> Result<Exit, Error> {
        panics::draw_random_keys()?;
        match self {
            Self::Run(args) => run::run(args),
            Self::Check(args) => check::run(args),
            Self::Merge(args) => merge::run(args),
            Self::Status(args) => status::run(args),
            Self::Slurm(args) => slurm::run(args),
            Self::Show(args) => show::run(args),
            Self::Trace(args) => trace::run(args),
            Self::Modes(args) => modes::run(args),
            Self::Boundary(args) => boundary::run(args),
            Self::Plot(args) => plot::run(args),
            Self::Parameters(args) => parameters::run(args),
            Self::Init(args) => init::run(args),
            Self::Schema(args) => schema::run(args),
            Self::Completions(args) => completions::run(args),
            Self::Man(args) => man::run(args),
            Self::Reference(args) => reference::run(args),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        command().debug_assert();
    }

    #[test]
    fn a_slip_in_a_short_subcommand_is_answered_by_its_name() {
        let refusal =
            |typed: &str| suggest(command().try_get_matches_from(["sweep", typed]).unwrap_err()).to_string();
        assert!(refusal("rnu").contains("'run'"), "{}", refusal("rnu"));
        assert!(refusal("boundry").contains("'boundary'"), "{}", refusal("boundry"));
        assert!(!refusal("xyzzy").contains("similar"), "{}", refusal("xyzzy"));
    }

    #[test]
    fn help_shows_the_examples_before_the_usage_and_the_exit_codes_after() {
        let help = command().render_help().to_string();
        let place = |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(place("Examples:") < place("Usage:") && place("Usage:") < place("Exit codes:"));
    }
}
