//! `sweep optimise STUDY.toml`: minimises numbers over parameters.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::cells::format_table;
use super::grid::resume_command;
use super::{Lines as _, format_cell, format_number, install_interrupt};
use crate::config::section::format_count;
use crate::optimise::file::{candidates_table, format_model_file, parameter_axes, trial_columns};
use crate::optimise::search::{compute_slacks, search};
use crate::optimise::study::{Objective, SearchedParameter, Study};
use crate::store::{OpenOutcome, Trials};
use crate::{Error, Execution, ExecutionArgs, Exit, Model, format_duration, tell};
use sweep_files::{FileKind, MODEL_FILE_START, Output, atomic, key};
use sweep_results::{Cell, ResultTable, Slack};

/// Arguments of `sweep optimise`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG_HELP)]
pub struct OptimiseArgs {
    /// Study file
    #[arg(value_name = "STUDY.toml")]
    study: PathBuf,
    /// Set a constant of the grid file that the study names, or fix an axis of it at a value; may
    /// be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    sets: Vec<String>,
    /// File of all candidates [default: results/NAME.parquet]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the model's own file (the file that its grids name) of the best candidate
    #[arg(long, value_name = "FILE")]
    best: Option<PathBuf>,
    /// With --best: write the file of this candidate instead
    #[arg(long, value_name = "N", requires = "best")]
    candidate: Option<u64>,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Start over, even if the file exists or another study has started
    #[arg(long)]
    fresh: bool,
}

/// The text that `--help` adds.
const LONG_HELP: &str = "\
A study names a grid file, numbers to minimise or maximise, parameters with bounds, and \
conditions as in `sweep require`. Every candidate is evaluated at all points of the grid. \
docs/optimise.md describes study files.

With several objectives the search finds the Pareto front: the candidates that no other one \
dominates. The best candidate is the one nearest to the least value of each objective.

The file is a pure function of its input, whatever the number of threads and interruptions. An \
interrupted search leaves its evaluations in FILE.partial, and the same command continues from \
there.";

/// The number of candidates at which the summary begins to leave some out. Basis: half of the lines
/// of a terminal. Doubling it lists twice as many.
const MAX_LISTED_CANDIDATES: usize = 12;

/// The slack, relative to the limit, up to which a condition is said to bind. Basis: a choice for
/// the reader of the summary, on which no result depends. Doubling it calls conditions binding that
/// are twice as far from their limits.
const BINDING_SLACK: f64 = 0.02;

/// Runs the search of a study, and prints a summary.
///
/// # Errors
/// Mistakes in the study and its grid file, and errors of evaluating candidates or writing a file.
pub fn run<M: Model>(args: &OptimiseArgs) -> Result<Exit, Error> {
    let study = Study::<M>::load(&args.study, &args.sets)?;
    let default_path = || PathBuf::from(format!("results/{}.parquet", study.name));
    let output = args.out.clone().unwrap_or_else(default_path);
    let output_file = Output::begin(&output, FileKind::Optimise)?;
    let model_file_output = claim_model_file(&study, args, &output)?;
    let interrupt = install_interrupt()?;
    let mut trials = match Trials::open(&output, &study.job(), trial_columns(&study), args.fresh)? {
        OpenOutcome::Open(trials) => trials,
        OpenOutcome::Finished(()) => {
            let search_note = "it is there already (--fresh searches again)";
            let execution = args.execution.with_interrupt(&interrupt);
            return summarise(
                &study,
                args.candidate,
                model_file_output,
                &output,
                search_note,
                execution,
            );
        }
    };
    trials.take_notes().iter().for_each(|note| tell(note));
    let start_time = Instant::now();
    let execution = args.execution.with_interrupt(&interrupt);
    let (candidates, trials) = search(&study, Some(trials), execution)?;
    let wall_s = start_time.elapsed().as_secs_f64();
    let Some(candidates) = candidates else {
        let wall_time = format_duration(wall_s);
        let mut text = format!("{}: interrupted after {wall_time}\n", study.name);
        text.line("go on", resume_command());
        tell(text.trim_end());
        return Ok(Exit::from_signal(interrupt.signal()));
    };
    output_file.finish(&candidates_table(&study, &candidates).into_bytes(&output)?)?;
    if let Some(note) = trials.and_then(Trials::complete) {
        tell(&note);
    }
    let candidate_count = candidates.len() as u64;
    let rows_per_candidate = study.rows_per_candidate();
    let search_note = format!(
        "{candidate_count} candidates of {} in {}, {:.0} points/s",
        format_count(rows_per_candidate as usize, "point"),
        format_duration(wall_s),
        (candidate_count * rows_per_candidate) as f64 / wall_s
    );
    summarise(
        &study,
        args.candidate,
        model_file_output,
        &output,
        &search_note,
        args.execution.with_interrupt(&interrupt),
    )
}

/// Returns a line for each condition with the slack of a candidate: the distance from the limit,
/// which is negative if the condition is violated. The least slack comes first. Returns `None`
/// after an interrupt.
fn slack_lines<M: Model>(
    study: &Study<M>,
    values: &[f64],
    execution: Execution<'_>,
) -> Result<Option<String>, Error> {
    let Some(slacks) = compute_slacks(study, values, execution)? else { return Ok(None) };
    let known_slacks = study.conditions.iter().zip(slacks);
    let known_slacks = known_slacks.filter_map(|(goal, slack)| Some((goal.text(), slack?)));
    Ok(Some(describe_slacks(known_slacks.collect())))
}

/// Returns a line for each condition with its slack, the least relative slack first. It binds if
/// this slack is at most [`BINDING_SLACK`], otherwise it is only the closest to its limit.
fn describe_slacks(mut known_slacks: Vec<(&str, Slack)>) -> String {
    known_slacks.sort_by(|a, b| a.1.relative.total_cmp(&b.1.relative));
    let mut text = String::new();
    for (k, (condition, Slack { distance, relative })) in known_slacks.into_iter().enumerate() {
        let percent = format_number(100.0 * relative);
        let name = match k {
            0 if relative <= BINDING_SLACK => "binds",
            0 => "closest",
            _ => "",
        };
        text.line(name, format!("{condition}: slack {}, {percent} %", format_number(distance)));
    }
    text
}

/// Describes the candidate with the least violation, and the conditions that it violates. The
/// violation is the sum of the excesses over the conditions, each divided by the greatest excess of
/// all candidates. Returns the candidate's number with the description; `None` if no candidate has
/// all excesses.
fn find_least_violating<M: Model>(
    study: &Study<M>,
    file: &ResultTable,
) -> Result<Option<(u64, String)>, Error> {
    let excess_columns: Vec<String> =
        (1..=study.conditions.len()).map(|k| format!("excess_{k}")).collect();
    let excess_columns: Vec<&str> = excess_columns.iter().map(String::as_str).collect();
    let mut rows: Vec<(u64, Vec<f64>)> = Vec::new();
    file.file().each_row(&excess_columns, |row| {
        let condition_excesses: Vec<f64> =
            (0..excess_columns.len()).map(|column| row.value(column)).collect();
        if condition_excesses.iter().all(|excess| excess.is_finite()) {
            rows.push((row.index(), condition_excesses));
        }
        Ok::<(), Error>(())
    })?;
    let greatest_excesses: Vec<f64> = (0..excess_columns.len())
        .map(|k| {
            rows.iter()
                .map(|(_, condition_excesses)| condition_excesses[k])
                .fold(f64::MIN_POSITIVE, f64::max)
        })
        .collect();
    let relative_violation = |condition_excesses: &[f64]| -> f64 {
        condition_excesses
            .iter()
            .zip(&greatest_excesses)
            .map(|(excess, greatest)| excess / greatest)
            .sum()
    };
    let least_violated =
        rows.iter().min_by(|a, b| relative_violation(&a.1).total_cmp(&relative_violation(&b.1)));
    let Some((candidate, condition_excesses)) = least_violated else { return Ok(None) };
    let mut text = String::new();
    text.line("nearest", format!("candidate {candidate}, which breaks"));
    for (goal, excess) in
        study.conditions.iter().zip(condition_excesses).filter(|(_, excess)| **excess > 0.0)
    {
        text.line("", format!("{} by {}", goal.text(), format_number(*excess)));
    }
    Ok(Some((*candidate, text)))
}

/// Claims the path of the model's own file before the search, if `--best` requests the file.
fn claim_model_file<'a, M: Model>(
    study: &Study<M>,
    args: &'a OptimiseArgs,
    output: &Path,
) -> Result<Option<(&'a Path, Output<'a>)>, Error> {
    let Some(path) = args.best.as_deref() else { return Ok(None) };
    let refuse_path = |expectation: &str| Err(Error::option("--best", path.display(), expectation));
    if M::ABOUT.model_file.is_none() {
        return refuse_path("a model with a file of its own");
    }
    let candidates = study.evolution.candidate_count;
    if let Some(candidate) = args.candidate.filter(|&candidate| candidate >= candidates) {
        let expectation = format!("a number from 0 to {}", candidates - 1);
        return Err(Error::option("--candidate", candidate, expectation));
    }
    let model_file_output = Output::begin(path, FileKind::ModelFile)?;
    // The files may not exist yet, so the paths of their folders are compared.
    let resolve_path =
        |path: &Path| Some(atomic::parent(path).canonicalize().ok()?.join(path.file_name()?));
    if resolve_path(path) == resolve_path(output) {
        return refuse_path("another file than that of all candidates");
    }
    Ok(Some((path, model_file_output)))
}

/// Prints a summary of the file of candidates, and writes the model's own file of a candidate if it
/// is requested.
fn summarise<M: Model>(
    study: &Study<M>,
    candidate: Option<u64>,
    model_file_output: Option<(&Path, Output<'_>)>,
    output: &Path,
    search_note: &str,
    execution: Execution<'_>,
) -> Result<Exit, Error> {
    let mut text = format!("{}: {search_note}\n", study.name);
    let file = ResultTable::open(output)?;
    let optimum_json = file.file().json(key::OPTIMISE).unwrap_or_default();
    let parameter_names = parameter_axes(study).iter().map(|axis| &*axis.parameter.name);
    let objective_names = study.objectives.iter().map(|objective| objective.name.as_str());
    let names: Vec<&str> = ["candidate", "feasible", "on_front"]
        .into_iter()
        .chain(parameter_names)
        .chain(objective_names)
        .collect();
    let best_candidate = optimum_json["best"].as_u64();
    let chosen_candidate = candidate.or(best_candidate);
    let least_violating =
        if best_candidate.is_none() { find_least_violating(study, &file)? } else { None };
    let mut feasible_count = 0;
    let mut front_cells = Vec::new();
    let mut least_violating_cells = None;
    let mut chosen_values = None;
    // The least value of the first objective before and in the last third of the candidates.
    let mut least_objective = [f64::INFINITY; 2];
    let mut late_front_count = 0;
    let first_of_last_third = study.evolution.first_of_last_third();
    file.file().each_row(&names, |row| {
        let cells: Vec<Cell> = (0..names.len()).map(|column| row.cell(column)).collect();
        if cells[1] == Cell::Flag(true) {
            feasible_count += 1;
            let objective = cells.get(3 + study.parameters.len()).and_then(Cell::number);
            let least_in_period =
                &mut least_objective[usize::from(row.index() >= first_of_last_third)];
            *least_in_period = least_in_period.min(
                objective.map_or(f64::INFINITY, |objective| study.objectives[0].sign * objective),
            );
        }
        if Some(row.index()) == chosen_candidate {
            let value_cells = cells[3..].iter().take(study.parameters.len());
            chosen_values = value_cells.map(Cell::number).collect::<Option<Vec<f64>>>();
        }
        if least_violating.as_ref().is_some_and(|(candidate, _)| *candidate == row.index()) {
            least_violating_cells = Some(cells.clone());
        }
        if cells[2] == Cell::Flag(true) {
            late_front_count += usize::from(row.index() >= first_of_last_third);
            front_cells.push(cells);
        }
        Ok::<(), Error>(())
    })?;
    let candidate_count = file.rows();
    let has_several_objectives = study.objectives.len() > 1;
    let front_note = match front_cells.len() {
        count if has_several_objectives => format!(", {count} on the front"),
        count @ 2.. => format!(", {count} of them equally good"),
        _ => String::new(),
    };
    text.line("feasible", format!("{feasible_count} of {candidate_count}{front_note}"));
    if let Some(best_candidate) = best_candidate {
        text.line("best", format!("candidate {best_candidate}"));
    }
    text.extend(least_violating.map(|(_, described)| described));
    if let Some(chosen_values) = chosen_values.as_ref().filter(|_| !study.conditions.is_empty()) {
        text.extend(slack_lines(study, chosen_values, execution)?);
    }
    if least_objective[0].is_finite() && first_of_last_third < candidate_count {
        let Objective { name, sign, .. } = &study.objectives[0];
        let more_advice = "; more may take it farther";
        let progress_text = match [least_objective[0], least_objective[0].min(least_objective[1])]
            .map(|value| format_number(sign * value))
        {
            _ if has_several_objectives => {
                format!("put {late_front_count} of {} on the front{more_advice}", front_cells.len())
            }
            [before, after] if before == after => "found none better".to_owned(),
            [from, to] => format!("took {name} from {from} to {to}{more_advice}"),
        };
        text.line(
            "search",
            format!(
                "the last {} candidates {progress_text}",
                candidate_count - first_of_last_third
            ),
        );
    }
    front_cells.sort_by(|a, b| {
        let first_objective =
            |cells: &[Cell]| cells.get(3 + study.parameters.len()).and_then(Cell::number);
        first_objective(a).unwrap_or(f64::NAN).total_cmp(&first_objective(b).unwrap_or(f64::NAN))
    });
    let is_at_bound = |(searched_parameter, value): &(&SearchedParameter, &f64)| {
        [0.0, 1.0].into_iter().any(|end| searched_parameter.bounds.interpolate(end) == **value)
    };
    let parameter_values = study.parameters.iter().zip(chosen_values.iter().flatten());
    let parameters_at_bounds: Vec<&str> = parameter_values
        .zip(parameter_axes(study))
        .filter(|(parameter_value, _)| is_at_bound(parameter_value))
        .map(|(_, axis)| &*axis.parameter.name)
        .collect();
    if !parameters_at_bounds.is_empty() {
        text.line(
            "bounds",
            format!(
                "reached by {}: a wider range may have better",
                parameters_at_bounds.join(", ")
            ),
        );
    }
    let listing_interval = front_cells.len().div_ceil(MAX_LISTED_CANDIDATES).max(1);
    let is_best = |cells: &[Cell]| cells[0].number() == optimum_json["best"].as_f64();
    // The best candidate is always listed, and the nearest one if none is feasible.
    let listed_candidates = front_cells.iter().enumerate();
    let listed_candidates =
        listed_candidates.filter(|(k, cells)| k % listing_interval == 0 || is_best(cells));
    let listed_candidates = listed_candidates.map(|(_, cells)| cells).chain(&least_violating_cells);
    let format_cells =
        |cells: &[Cell]| cells.iter().take(1).chain(&cells[3..]).map(format_cell).collect();
    let headings: Vec<String> =
        names.iter().take(1).chain(&names[3..]).map(|&name| name.to_owned()).collect();
    let listed_candidates: Vec<Vec<String>> =
        listed_candidates.map(|cells| format_cells(cells)).collect();
    text.push_str(&format_table(&headings, &listed_candidates, "  "));
    if let Some((path, file)) = model_file_output {
        let model_file_text = chosen_values
            .as_deref()
            .and_then(|chosen_values| format_model_file(study, chosen_values));
        match chosen_candidate.zip(model_file_text) {
            Some((chosen_candidate, model_file_text)) => {
                let candidate_origin = format!("candidate {chosen_candidate} of {}", study.name);
                file.finish(
                    format!("{MODEL_FILE_START}{candidate_origin}\n{model_file_text}").as_bytes(),
                )?;
                text.line("wrote", path.display());
            }
            None => {
                text.line("best", format!("none is feasible; {} is not written", path.display()));
            }
        }
    }
    text.line("file", output.display());
    text.suggest_command("plot", output);
    tell(text.trim_end());
    // An empty front means that no candidate is feasible.
    Ok(if front_cells.is_empty() { Exit::ConditionViolated } else { Exit::Done })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_far_from_its_limit_does_not_bind() {
        let far_condition = ("stop <= 50", Slack { distance: 40.0, relative: 0.8 });
        let near_condition = ("travel <= 0.05", Slack { distance: 1e-4, relative: 2e-3 });
        assert!(
            describe_slacks(vec![far_condition, near_condition]).starts_with("     binds  travel")
        );
        assert!(describe_slacks(vec![far_condition]).starts_with("   closest  stop"));
        assert_eq!(describe_slacks(Vec::new()), "");
    }
}
