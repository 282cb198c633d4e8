//! The command line. Each subcommand of this program has a module, and so has each general one to
//! which this program adds options.

mod check;
mod completions;
mod explain;
mod fit;
mod held;
mod init;
mod man;
mod modes;
mod plot;
#[cfg(test)]
mod reference;
mod run;
mod schema;
mod show;
mod slurm;
mod trace;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::dwell::AttractorSearch;
use sweep_engine::commands::examples::Examples;
use sweep_engine::commands::{
    Arguments, GeneralCommand, boundary, compare, examples, export, merge, optimise, parameters,
    report, require, show as show_engine, status,
};
use sweep_engine::{Error, Exit, nearest_name};
use washer_plot::WasherFigures;

/// The headings of help, each with its subcommands.
const COMMAND_GROUPS: [(&str, &[&str]); 5] = [
    ("Run", &["run", "check"]),
    ("Ask", &["boundary", "trace", "modes", "stability", "dwell", "explain", "fit", "optimise"]),
    ("Look", &["show", "plot", "report", "require", "compare", "export"]),
    ("Cluster", &["status", "merge", "slurm"]),
    ("Set up", &["init", "parameters", "schema", "man", "completions"]),
];

/// Examples of the program and of every subcommand.
const EXAMPLES: &str = include_str!("commands/examples.txt");

/// Maps where a washing machine's linear suspension model can be trusted.
#[derive(Debug, Parser)]
#[command(
    name = "sweep",
    version,
    after_help = Exit::format_codes(),
    subcommand_required = true,
    arg_required_else_help = true,
    disable_help_subcommand = true,
)]
pub struct WasherCli {
    /// The subcommand.
    #[command(subcommand)]
    pub command: Command,
}

/// The arguments of general subcommands, with the options that this program adds.
#[derive(Debug)]
pub enum WasherArguments {}

impl Arguments for WasherArguments {
    type Run = run::WasherRunArgs;
    type Check = check::WasherCheckArgs;
    type Plot = plot::WasherPlotArgs;
    type Status = held::JobArgs<status::StatusArgs>;
    type Merge = held::JobArgs<merge::MergeArgs>;
    type Schema = schema::WasherSchemaArgs;
}

/// A subcommand.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// A subcommand of every model's program.
    #[command(flatten)]
    General(GeneralCommand<WasherArguments>),
    /// Write time histories of both models at one point
    Trace(trace::TraceArgs),
    /// Find resonance speeds, mode shapes and frequencies over speed
    Modes(modes::ModesArgs),
    /// Find periodic responses at held speeds, and their stability
    #[command(after_long_help = held::STABILITY_LONG_HELP)]
    #[command(mut_arg("out", |out| out.help(format_out_help("stability"))))]
    Stability(held::HeldSpeedArgs<held::ResponseOptions>),
    /// Find the motions in which the machine ends at held speeds
    #[command(after_long_help = held::DWELL_LONG_HELP)]
    #[command(mut_arg("out", |out| out.help(format_out_help("dwell"))))]
    Dwell(held::HeldSpeedArgs<AttractorSearch>),
    /// Explain why the linear model fails at one point
    Explain(explain::ExplainArgs),
    /// Estimate the parameters of a machine from measured run-ups
    Fit(fit::FitArgs),
    /// Print the script that submits a run to a Slurm cluster
    Slurm(slurm::SlurmArgs),
    /// Write a commented grid file, or a machine file, to start from
    Init(init::InitArgs),
    /// Write manual pages
    Man(man::ManArgs),
    /// Print shell completions
    Completions(completions::CompletionsArgs),
}

/// Returns the help of `--out` for a command about held speeds, whose default is not that of a run.
fn format_out_help(verb: &str) -> String {
    format!("Result file [default: results/NAME-{verb}.parquet]")
}

/// Returns the examples of a subcommand, or those of the program for the name `sweep`.
fn find_examples(name: &str) -> Examples {
    let parts = EXAMPLES.split("\n\n");
    let lines_text = parts.filter_map(|part| part.strip_prefix(name)?.strip_prefix(":\n")).next();
    let lines: Vec<&str> = lines_text.unwrap_or_default().lines().map(str::trim).collect();
    lines.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Returns the command line with the examples and the headings of its help.
pub(crate) fn command() -> clap::Command {
    let add_examples =
        |command: clap::Command, lines: Examples| match examples::format_examples(&lines) {
            Some(examples) => command.before_help(examples),
            None => command,
        };
    let program = add_examples(WasherCli::command(), find_examples("sweep"));
    let names: Vec<String> =
        program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    let program = names.into_iter().fold(program, |program, name| {
        program.mut_subcommand(&name, |command| add_examples(command, find_examples(&name)))
    });
    let template = format_help_template(&program);
    sort_by_group(program).help_template(template)
}

/// Sorts the subcommands by the order of [`COMMAND_GROUPS`], which manual pages and documents
/// follow.
fn sort_by_group(mut program: clap::Command) -> clap::Command {
    let mut sorted: Vec<clap::Command> = program.get_subcommands().cloned().collect();
    sorted.sort_by_key(|command| {
        COMMAND_GROUPS
            .iter()
            .flat_map(|(_, names)| *names)
            .position(|name| *name == command.get_name())
    });
    program.get_subcommands_mut().zip(sorted).for_each(|(slot, command)| *slot = command);
    program
}

/// Returns the template of the program's help. clap has headings for arguments only, so the
/// template has the subcommands.
fn format_help_template(program: &clap::Command) -> String {
    let header = program.get_styles().get_header();
    let name_style = program.get_styles().get_literal();
    let mut text = String::from("{before-help}{about-with-newline}\n{usage-heading} {usage}\n\n");
    for (heading, names) in COMMAND_GROUPS {
        text += &format!("{header}{heading}:{header:#}\n");
        for name in names {
            let command = program.find_subcommand(name);
            let about = command.and_then(clap::Command::get_about).cloned().unwrap_or_default();
            text += &format!("  {name_style}{name:11}{name_style:#}  {about}\n");
        }
        text.push('\n');
    }
    text + &format!("{header}Options:{header:#}\n{{options}}{{after-help}}")
}

/// Returns the command line without hidden subcommands, for lists of all subcommands.
pub(crate) fn visible_command() -> clap::Command {
    let whole = command();
    let shown = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    clap::Command::new("sweep")
        .version(env!("CARGO_PKG_VERSION"))
        .about(whole.get_about().cloned().unwrap_or_default())
        .disable_help_subcommand(true)
        .args(whole.get_arguments().cloned())
        .subcommands(shown)
}

/// Adds a suggestion to the error of an unknown subcommand, if clap has none: two swapped letters
/// make a short name too different for clap's similarity measure.
fn add_suggestion(mut error: clap::Error) -> clap::Error {
    let typed = match (error.kind(), error.get(ContextKind::InvalidSubcommand)) {
        (ErrorKind::InvalidSubcommand, Some(ContextValue::String(typed))) => typed.clone(),
        _ => return error,
    };
    let shown = visible_command();
    let names = shown.get_subcommands().map(clap::Command::get_name);
    if let (None, Some(name)) =
        (error.get(ContextKind::SuggestedSubcommand), nearest_name(&typed, names))
    {
        error
            .insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![name.to_owned()]));
    }
    error
}

impl WasherCli {
    /// Parses this process's command line. On a mistake or a request for help it prints a message
    /// and ends the process.
    pub fn read() -> Self {
        let matches =
            command().try_get_matches().unwrap_or_else(|error| add_suggestion(error).exit());
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }
}

impl Command {
    /// Runs the subcommand.
    ///
    /// # Errors
    /// Returns the errors of the subcommand.
    pub fn run(&self) -> Result<Exit, Error> {
        match self {
            Self::General(general) => run_general(general),
            Self::Slurm(args) => slurm::run(args),
            Self::Trace(args) => trace::run(args),
            Self::Modes(args) => modes::run(args),
            Self::Stability(args) => args.run(),
            Self::Dwell(args) => args.run(),
            Self::Explain(args) => explain::run(args),
            Self::Fit(args) => fit::run(args),
            Self::Init(args) => init::run(args),
            Self::Completions(args) => completions::run(args, visible_command()),
            Self::Man(args) => man::run(args, command(), &find_examples),
        }
    }
}

/// Runs a general subcommand with the model of the washing machine.
fn run_general(command: &GeneralCommand<WasherArguments>) -> Result<Exit, Error> {
    match command {
        GeneralCommand::Run(args) => run::run(args),
        GeneralCommand::Check(args) => check::run(args),
        GeneralCommand::Boundary(args) => boundary::run::<crate::Washer>(args),
        GeneralCommand::Optimise(args) => optimise::run::<crate::Washer>(args),
        GeneralCommand::Show(args) => show_engine::run(args, &show::MODEL_SUMMARY),
        GeneralCommand::Plot(args) => plot::run(args),
        GeneralCommand::Report(args) => {
            let figures = WasherFigures::default();
            report::run(args, &show::MODEL_SUMMARY, &crate::live::resonance_rows, &figures)
        }
        GeneralCommand::Require(args) => require::run(args),
        GeneralCommand::Compare(args) => compare::run::<crate::Washer>(args),
        GeneralCommand::Export(args) => export::run(args),
        GeneralCommand::Status(args) => args.show_status(),
        GeneralCommand::Merge(args) => args.merge(),
        GeneralCommand::Parameters(args) => parameters::run::<crate::Washer>(args),
        GeneralCommand::Schema(args) => schema::run(args),
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
    fn an_error_for_a_misspelt_short_subcommand_suggests_its_name() {
        let error_message = |typed: &str| {
            add_suggestion(command().try_get_matches_from(["sweep", typed]).unwrap_err())
                .to_string()
        };
        assert!(error_message("rnu").contains("'run'"), "{}", error_message("rnu"));
        assert!(error_message("boundry").contains("'boundary'"), "{}", error_message("boundry"));
        assert!(!error_message("xyzzy").contains("similar"), "{}", error_message("xyzzy"));
    }

    #[test]
    fn every_output_option_has_a_long_and_a_short_flag() {
        let mut count = 0;
        for subcommand in command().get_subcommands() {
            for flag in subcommand.get_arguments() {
                let long: Vec<&str> = flag.get_long_and_visible_aliases().unwrap_or_default();
                if long.contains(&"out") || flag.get_short() == Some('o') {
                    let name = subcommand.get_name();
                    assert!(long.contains(&"out"), "{name} --out");
                    assert_eq!(flag.get_short(), Some('o'), "{name} -o");
                    count += 1;
                }
            }
        }
        assert!(count > 5, "{count}");
    }

    /// Returns the words of a line by a shell's rules: single quotes keep spaces.
    fn split_words(line: &str) -> Vec<String> {
        let mut words = Vec::new();
        for (index, part) in line.split('\'').enumerate() {
            match index % 2 {
                0 => words.extend(part.split_whitespace().map(str::to_owned)),
                _ => words.push(part.to_owned()),
            }
        }
        words
    }

    #[test]
    fn every_visible_command_has_examples_and_every_example_parses() {
        let whole = command();
        let shown = whole.get_subcommands().filter(|command| !command.is_hide_set());
        for name in shown.map(clap::Command::get_name).chain(["sweep"]) {
            // The first example calls the command itself; further ones may use its output.
            let lines = find_examples(name);
            let call = format!("sweep {name}").replace("sweep sweep", "sweep ");
            assert!(lines.first().is_some_and(|[line, _]| line.starts_with(&call)), "{name}");
            for [line, _] in lines {
                let line = line.split(" 2>").next().unwrap_or_default();
                let parsed = command().try_get_matches_from(split_words(line));
                assert!(parsed.is_ok(), "{line}: {parsed:?}");
            }
        }
    }

    #[test]
    fn no_example_is_wider_than_a_terminal_or_changed_by_folding() {
        for name in command().get_subcommands().map(clap::Command::get_name).chain(["sweep"]) {
            let lines = find_examples(name);
            let shown = examples::format_examples(&lines).unwrap_or_default();
            assert!(shown.lines().all(|line| line.len() <= examples::MAX_LINE_WIDTH), "{shown}");
            // A shell joins folded lines.
            let words = shown.replace("\\\n", "").split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(lines.iter().all(|[line, _]| words.contains(line)), "{shown}");
        }
    }

    #[test]
    fn help_lists_every_visible_command_once_under_a_heading() {
        let whole = command();
        let shown = whole.get_subcommands().filter(|command| !command.is_hide_set());
        let shown: Vec<&str> = shown.map(clap::Command::get_name).collect();
        let grouped: Vec<&str> =
            COMMAND_GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        assert_eq!(shown, grouped);
        let help = command().render_help().to_string();
        let list = help.split("Run:\n").nth(1).and_then(|rest| rest.split("Options:").next());
        for line in list.expect("the list of commands").lines() {
            assert!(line.len() <= examples::MAX_LINE_WIDTH, "{line}");
        }
        assert!(help.contains("\nSet up:\n  init "), "{help}");
    }

    #[test]
    fn help_of_a_command_begins_with_its_examples() {
        let mut command = command();
        let run = command.find_subcommand_mut("run").unwrap();
        let help = run.render_help().to_string();
        let position =
            |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(position("--shard 3/16") < position("Usage:"));
    }

    #[test]
    fn help_names_the_file_that_a_command_writes() {
        for (name, file) in [("run", "NAME"), ("stability", "NAME-stability")] {
            let mut command = command();
            let help = command.find_subcommand_mut(name).unwrap().render_help().to_string();
            assert!(help.contains(&format!("[default: results/{file}.parquet]")), "{help}");
        }
    }

    #[test]
    fn help_shows_the_examples_before_the_usage_and_the_exit_codes_after() {
        let help = command().render_help().to_string();
        let position =
            |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(
            position("Examples:") < position("Usage:")
                && position("Usage:") < position("Exit codes:")
        );
    }
}
