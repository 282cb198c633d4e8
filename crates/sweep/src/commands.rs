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
    let sections = EXAMPLES.split("\n\n");
    let example_lines =
        sections.filter_map(|part| part.strip_prefix(name)?.strip_prefix(":\n")).next();
    let lines: Vec<&str> = example_lines.unwrap_or_default().lines().map(str::trim).collect();
    lines.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Returns the command line with the examples and the headings of its help.
pub(crate) fn command_line() -> clap::Command {
    let add_examples =
        |command: clap::Command, lines: Examples| match examples::format_examples(&lines) {
            Some(examples) => command.before_help(examples),
            None => command,
        };
    let program = add_examples(WasherCli::command(), find_examples("sweep"));
    let subcommand_names: Vec<String> =
        program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    let program = subcommand_names.into_iter().fold(program, |program, name| {
        program.mut_subcommand(&name, |command| add_examples(command, find_examples(&name)))
    });
    let template = format_help_template(&program);
    sort_by_group(program).help_template(template)
}

/// Sorts the subcommands by the order of [`COMMAND_GROUPS`], which manual pages and documents
/// follow.
fn sort_by_group(mut program: clap::Command) -> clap::Command {
    let mut sorted_subcommands: Vec<clap::Command> = program.get_subcommands().cloned().collect();
    sorted_subcommands.sort_by_key(|command| {
        COMMAND_GROUPS
            .iter()
            .flat_map(|(_, names)| *names)
            .position(|name| *name == command.get_name())
    });
    program
        .get_subcommands_mut()
        .zip(sorted_subcommands)
        .for_each(|(subcommand_slot, command)| *subcommand_slot = command);
    program
}

/// Returns the template of the program's help. clap has headings for arguments only, so the
/// template has the subcommands.
fn format_help_template(program: &clap::Command) -> String {
    let header_style = program.get_styles().get_header();
    let name_style = program.get_styles().get_literal();
    let mut template =
        String::from("{before-help}{about-with-newline}\n{usage-heading} {usage}\n\n");
    for (heading, names) in COMMAND_GROUPS {
        template += &format!("{header_style}{heading}:{header_style:#}\n");
        for name in names {
            let command = program.find_subcommand(name);
            let about = command.and_then(clap::Command::get_about).cloned().unwrap_or_default();
            template += &format!("  {name_style}{name:11}{name_style:#}  {about}\n");
        }
        template.push('\n');
    }
    template + &format!("{header_style}Options:{header_style:#}\n{{options}}{{after-help}}")
}

/// Returns the command line without hidden subcommands, for lists of all subcommands.
pub(crate) fn visible_command() -> clap::Command {
    let whole_command = command_line();
    let visible_subcommands =
        whole_command.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    clap::Command::new("sweep")
        .version(env!("CARGO_PKG_VERSION"))
        .about(whole_command.get_about().cloned().unwrap_or_default())
        .disable_help_subcommand(true)
        .args(whole_command.get_arguments().cloned())
        .subcommands(visible_subcommands)
}

/// Adds a suggestion to the error of an unknown subcommand, if clap has none: two swapped letters
/// make a short name too different for clap's similarity measure.
fn add_suggestion(mut error: clap::Error) -> clap::Error {
    let typed_name = match (error.kind(), error.get(ContextKind::InvalidSubcommand)) {
        (ErrorKind::InvalidSubcommand, Some(ContextValue::String(typed))) => typed.clone(),
        _ => return error,
    };
    let visible_program = visible_command();
    let names = visible_program.get_subcommands().map(clap::Command::get_name);
    if let (None, Some(name)) =
        (error.get(ContextKind::SuggestedSubcommand), nearest_name(&typed_name, names))
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
            command_line().try_get_matches().unwrap_or_else(|error| add_suggestion(error).exit());
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
            Self::Man(args) => man::run(args, command_line(), &find_examples),
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
        command_line().debug_assert();
    }

    #[test]
    fn an_error_for_a_misspelt_short_subcommand_suggests_its_name() {
        let error_message = |typed: &str| {
            add_suggestion(command_line().try_get_matches_from(["sweep", typed]).unwrap_err())
                .to_string()
        };
        assert!(error_message("rnu").contains("'run'"), "{}", error_message("rnu"));
        assert!(error_message("boundry").contains("'boundary'"), "{}", error_message("boundry"));
        assert!(!error_message("xyzzy").contains("similar"), "{}", error_message("xyzzy"));
    }

    #[test]
    fn every_output_option_has_a_long_and_a_short_flag() {
        let mut checked_count = 0;
        for subcommand in command_line().get_subcommands() {
            for flag in subcommand.get_arguments() {
                let long: Vec<&str> = flag.get_long_and_visible_aliases().unwrap_or_default();
                if long.contains(&"out") || flag.get_short() == Some('o') {
                    let name = subcommand.get_name();
                    assert!(long.contains(&"out"), "{name} --out");
                    assert_eq!(flag.get_short(), Some('o'), "{name} -o");
                    checked_count += 1;
                }
            }
        }
        assert!(checked_count > 5, "{checked_count}");
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
        let whole_command = command_line();
        let visible_subcommands =
            whole_command.get_subcommands().filter(|command| !command.is_hide_set());
        for name in visible_subcommands.map(clap::Command::get_name).chain(["sweep"]) {
            // The first example calls the command itself; further ones may use its output.
            let lines = find_examples(name);
            let call_start = format!("sweep {name}").replace("sweep sweep", "sweep ");
            assert!(lines.first().is_some_and(|[line, _]| line.starts_with(&call_start)), "{name}");
            for [line, _] in lines {
                let line = line.split(" 2>").next().unwrap_or_default();
                let parse_result = command_line().try_get_matches_from(split_words(line));
                assert!(parse_result.is_ok(), "{line}: {parse_result:?}");
            }
        }
    }

    #[test]
    fn no_example_is_wider_than_a_terminal_or_changed_by_folding() {
        for name in command_line().get_subcommands().map(clap::Command::get_name).chain(["sweep"]) {
            let lines = find_examples(name);
            let formatted_examples = examples::format_examples(&lines).unwrap_or_default();
            assert!(
                formatted_examples.lines().all(|line| line.len() <= examples::MAX_LINE_WIDTH),
                "{formatted_examples}"
            );
            // A shell joins folded lines.
            let unfolded_text = formatted_examples
                .replace("\\\n", "")
                .split_whitespace()
                .collect::<Vec<_>>()
                .join(" ");
            assert!(
                lines.iter().all(|[line, _]| unfolded_text.contains(line)),
                "{formatted_examples}"
            );
        }
    }

    #[test]
    fn help_lists_every_visible_command_once_under_a_heading() {
        let whole_command = command_line();
        let visible_subcommands =
            whole_command.get_subcommands().filter(|command| !command.is_hide_set());
        let visible_names: Vec<&str> = visible_subcommands.map(clap::Command::get_name).collect();
        let grouped_names: Vec<&str> =
            COMMAND_GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        assert_eq!(visible_names, grouped_names);
        let help = command_line().render_help().to_string();
        let command_list =
            help.split("Run:\n").nth(1).and_then(|rest| rest.split("Options:").next());
        for line in command_list.expect("the list of commands").lines() {
            assert!(line.len() <= examples::MAX_LINE_WIDTH, "{line}");
        }
        assert!(help.contains("\nSet up:\n  init "), "{help}");
    }

    #[test]
    fn help_of_a_command_begins_with_its_examples() {
        let mut command = command_line();
        let run_command = command.find_subcommand_mut("run").unwrap();
        let help = run_command.render_help().to_string();
        let position_of =
            |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(position_of("--shard 3/16") < position_of("Usage:"));
    }

    #[test]
    fn help_names_the_file_that_a_command_writes() {
        for (name, file) in [("run", "NAME"), ("stability", "NAME-stability")] {
            let mut command = command_line();
            let help = command.find_subcommand_mut(name).unwrap().render_help().to_string();
            assert!(help.contains(&format!("[default: results/{file}.parquet]")), "{help}");
        }
    }

    #[test]
    fn help_shows_the_examples_before_the_usage_and_the_exit_codes_after() {
        let help = command_line().render_help().to_string();
        let position =
            |text: &str| help.find(text).unwrap_or_else(|| panic!("no {text} in\n{help}"));
        assert!(
            position("Examples:") < position("Usage:")
                && position("Usage:") < position("Exit codes:")
        );
    }
}
