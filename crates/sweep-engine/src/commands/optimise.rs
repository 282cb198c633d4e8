//! `sweep optimise STUDY.toml`: minimises numbers over parameters.

use std::path::{Path, PathBuf};
use std::time::Instant;

use super::cells::table as text_table;
use super::grid::typed;
use super::{Lines as _, installed, short, word};
use crate::config::section::counted;
use crate::optimise::file::{own_file, parameters, table, trial_columns};
use crate::optimise::search::{search, slacks};
use crate::optimise::study::{Objective, SearchedParameter, Study};
use crate::store::{Opened, Trials};
use crate::{Effort, EffortArgs, Error, Exit, Model, duration, tell};
use sweep_files::{FileKind, OWN_FILE, Output, atomic, key};
use sweep_results::{Cell, ResultTable, Slack};

/// Arguments of `sweep optimise`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
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
    effort: EffortArgs,
    /// Start over, even if the file exists or another study has started
    #[arg(long)]
    fresh: bool,
}

/// The text that `--help` adds.
const LONG: &str = "\
A study names a grid file, numbers to minimise or maximise, parameters with bounds, and \
conditions as in `sweep require`. Every candidate is evaluated at all points of the grid. \
docs/optimise.md describes study files.

With several objectives the search finds the Pareto front: the candidates that no other one \
dominates. The best candidate is the one nearest to the least value of each objective.

The file is a pure function of its input, whatever the number of threads and interruptions. An \
interrupted search leaves its evaluations in FILE.partial, and the same command continues from \
there.";

/// The number of candidates at which the summary begins to leave some out. Basis: half a screen.
/// Doubling it lists twice as many.
const LISTED: usize = 12;

/// Runs the search of a study, and prints a summary.
///
/// # Errors
/// Mistakes in the study and its grid file, and errors of evaluating candidates or writing a file.
pub fn run<M: Model>(args: &OptimiseArgs) -> Result<Exit, Error> {
    let study = Study::<M>::load(&args.study, &args.sets)?;
    let default = || PathBuf::from(format!("results/{}.parquet", study.name));
    let output = args.out.clone().unwrap_or_else(default);
    let file = Output::begin(&output, FileKind::Optimise)?;
    let own = own_output(&study, args, &output)?;
    let interrupt = installed()?;
    let mut trials = match Trials::open(&output, &study.job(), trial_columns(&study), args.fresh)? {
        Opened::Open(trials) => trials,
        Opened::Finished(()) => {
            let how = "it is there already (--fresh searches again)";
            let effort = args.effort.with(&interrupt);
            return summarise(&study, args.candidate, own, &output, how, effort);
        }
    };
    trials.take_notes().iter().for_each(|note| tell(note));
    let began = Instant::now();
    let effort = args.effort.with(&interrupt);
    let (tried, trials) = search(&study, Some(trials), effort)?;
    let wall_s = began.elapsed().as_secs_f64();
    let Some(tried) = tried else {
        let wall = duration(wall_s);
        let mut text = format!("{}: interrupted after {wall}\n", study.name);
        text.line("go on", typed());
        tell(text.trim_end());
        return Ok(Exit::interrupted(interrupt.signal()));
    };
    file.finish(&table(&study, &tried).into_bytes(&output)?)?;
    if let Some(note) = trials.and_then(Trials::complete) {
        tell(&note);
    }
    let candidates = tried.len() as u64;
    let rows = study.rows();
    let how = format!(
        "{candidates} candidates of {} in {}, {:.0} points/s",
        counted(rows as usize, "point"),
        duration(wall_s),
        (candidates * rows) as f64 / wall_s
    );
    summarise(&study, args.candidate, own, &output, &how, args.effort.with(&interrupt))
}

/// Returns a line for each condition with a candidate's slack: its distance from the limit,
/// negative if the condition is violated. The least slack comes first. Returns `None` after an
/// interrupt.
fn slack_lines<M: Model>(
    study: &Study<M>,
    values: &[f64],
    effort: Effort<'_>,
) -> Result<Option<String>, Error> {
    let Some(slacks) = slacks(study, values, effort)? else { return Ok(None) };
    let known = study.conditions.iter().zip(slacks);
    let mut known: Vec<(&str, Slack)> =
        known.filter_map(|(goal, slack)| Some((goal.text(), slack?))).collect();
    known.sort_by(|a, b| a.1.relative.total_cmp(&b.1.relative));
    let mut text = String::new();
    for (k, (condition, Slack { distance, relative })) in known.into_iter().enumerate() {
        let percent = short(100.0 * relative);
        let name = if k == 0 { "binds" } else { "" };
        text.line(name, format!("{condition}: slack {}, {percent} %", short(distance)));
    }
    Ok(Some(text))
}

/// Describes the candidate with the least violation, and the conditions that it violates. The
/// violation is the sum of the excesses over the conditions, each divided by the greatest excess of
/// all candidates. Returns the candidate's number with the description; `None` if no candidate has
/// all excesses.
fn nearest<M: Model>(study: &Study<M>, file: &ResultTable) -> Result<Option<(u64, String)>, Error> {
    let names: Vec<String> = (1..=study.conditions.len()).map(|k| format!("excess_{k}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut rows: Vec<(u64, Vec<f64>)> = Vec::new();
    file.file().each_row(&names, |row| {
        let excesses: Vec<f64> = (0..names.len()).map(|column| row.value(column)).collect();
        if excesses.iter().all(|excess| excess.is_finite()) {
            rows.push((row.index(), excesses));
        }
        Ok::<(), Error>(())
    })?;
    let greatest: Vec<f64> = (0..names.len())
        .map(|k| rows.iter().map(|(_, all)| all[k]).fold(f64::MIN_POSITIVE, f64::max))
        .collect();
    let broken =
        |all: &[f64]| -> f64 { all.iter().zip(&greatest).map(|(own, most)| own / most).sum() };
    let least = rows.iter().min_by(|a, b| broken(&a.1).total_cmp(&broken(&b.1)));
    let Some((candidate, excesses)) = least else { return Ok(None) };
    let mut text = String::new();
    text.line("nearest", format!("candidate {candidate}, which breaks"));
    for (goal, excess) in study.conditions.iter().zip(excesses).filter(|(_, excess)| **excess > 0.0)
    {
        text.line("", format!("{} by {}", goal.text(), short(*excess)));
    }
    Ok(Some((*candidate, text)))
}

/// Claims the path of the model's own file, if one is asked for, before the search.
fn own_output<'a, M: Model>(
    study: &Study<M>,
    args: &'a OptimiseArgs,
    output: &Path,
) -> Result<Option<(&'a Path, Output<'a>)>, Error> {
    let Some(path) = args.best.as_deref() else { return Ok(None) };
    let refused = |expected: &str| Err(Error::option("--best", path.display(), expected));
    if M::ABOUT.own_file.is_none() {
        return refused("a model with a file of its own");
    }
    let candidates = study.evolution.candidates;
    if let Some(candidate) = args.candidate.filter(|&one| one >= candidates) {
        let expected = format!("a number from 0 to {}", candidates - 1);
        return Err(Error::option("--candidate", candidate, expected));
    }
    let own = Output::begin(path, FileKind::Own)?;
    // The files may not exist yet, so the paths of their folders are compared.
    let place =
        |path: &Path| Some(atomic::parent(path).canonicalize().ok()?.join(path.file_name()?));
    if place(path) == place(output) {
        return refused("another file than that of all candidates");
    }
    Ok(Some((path, own)))
}

/// Prints a summary of the file of candidates, and writes the model's own file of a candidate if it
/// is requested.
fn summarise<M: Model>(
    study: &Study<M>,
    candidate: Option<u64>,
    own: Option<(&Path, Output<'_>)>,
    output: &Path,
    how: &str,
    effort: Effort<'_>,
) -> Result<Exit, Error> {
    let mut text = format!("{}: {how}\n", study.name);
    let file = ResultTable::open(output)?;
    let about = file.file().json(key::OPTIMISE).unwrap_or_default();
    let sought = parameters(study).iter().map(|axis| &*axis.parameter.name);
    let objectives = study.objectives.iter().map(|one| one.name.as_str());
    let names: Vec<&str> =
        ["candidate", "feasible", "on_front"].into_iter().chain(sought).chain(objectives).collect();
    let best = about["best"].as_u64();
    let chosen = candidate.or(best);
    let nearest = if best.is_none() { nearest(study, &file)? } else { None };
    let mut feasible = 0;
    let mut front = Vec::new();
    let mut nearest_cells = None;
    let mut values = None;
    // The least value of the first objective before and in the last third of the candidates.
    let mut least = [f64::INFINITY; 2];
    let mut late = 0;
    let first_late = study.evolution.first_late();
    file.file().each_row(&names, |row| {
        let cells: Vec<Cell> = (0..names.len()).map(|column| row.cell(column)).collect();
        if cells[1] == Cell::Flag(true) {
            feasible += 1;
            let number = cells.get(3 + study.parameters.len()).and_then(Cell::number);
            let own = &mut least[usize::from(row.index() >= first_late)];
            *own = own.min(number.map_or(f64::INFINITY, |one| study.objectives[0].sign * one));
        }
        if Some(row.index()) == chosen {
            let own = cells[3..].iter().take(study.parameters.len());
            values = own.map(Cell::number).collect::<Option<Vec<f64>>>();
        }
        if nearest.as_ref().is_some_and(|(candidate, _)| *candidate == row.index()) {
            nearest_cells = Some(cells.clone());
        }
        if cells[2] == Cell::Flag(true) {
            late += usize::from(row.index() >= first_late);
            front.push(cells);
        }
        Ok::<(), Error>(())
    })?;
    let all = file.rows();
    let several = study.objectives.len() > 1;
    let ended = match front.len() {
        count if several => format!(", {count} on the front"),
        count @ 2.. => format!(", {count} of them equally good"),
        _ => String::new(),
    };
    text.line("feasible", format!("{feasible} of {all}{ended}"));
    if let Some(best) = best {
        text.line("best", format!("candidate {best}"));
    }
    text.extend(nearest.map(|(_, described)| described));
    if let Some(values) = values.as_ref().filter(|_| !study.conditions.is_empty()) {
        text.extend(slack_lines(study, values, effort)?);
    }
    if least[0].is_finite() && first_late < all {
        let Objective { name, sign, .. } = &study.objectives[0];
        let farther = "; more may take it farther";
        let gained = match [least[0], least[0].min(least[1])].map(|one| short(sign * one)) {
            _ if several => format!("put {late} of {} on the front{farther}", front.len()),
            [before, after] if before == after => "found none better".to_owned(),
            [from, to] => format!("took {name} from {from} to {to}{farther}"),
        };
        text.line("search", format!("the last {} candidates {gained}", all - first_late));
    }
    front.sort_by(|a, b| {
        let of = |cells: &[Cell]| cells.get(3 + study.parameters.len()).and_then(Cell::number);
        of(a).unwrap_or(f64::NAN).total_cmp(&of(b).unwrap_or(f64::NAN))
    });
    let is_at_end = |(sought, value): &(&SearchedParameter, &f64)| {
        [0.0, 1.0].into_iter().any(|end| sought.bounds.between(end) == **value)
    };
    let bounded = study.parameters.iter().zip(values.iter().flatten());
    let ends: Vec<&str> = bounded
        .zip(parameters(study))
        .filter(|(bounded, _)| is_at_end(bounded))
        .map(|(_, axis)| &*axis.parameter.name)
        .collect();
    if !ends.is_empty() {
        text.line(
            "bounds",
            format!("reached by {}: a wider range may have better", ends.join(", ")),
        );
    }
    let apart = front.len().div_ceil(LISTED).max(1);
    let is_best = |cells: &[Cell]| cells[0].number() == about["best"].as_f64();
    // The best candidate is always listed, and the nearest one if none is feasible.
    let listed = front.iter().enumerate();
    let listed = listed.filter(|(k, cells)| k % apart == 0 || is_best(cells));
    let listed = listed.map(|(_, cells)| cells).chain(&nearest_cells);
    let shown = |cells: &[Cell]| cells.iter().take(1).chain(&cells[3..]).map(word).collect();
    let headings: Vec<String> =
        names.iter().take(1).chain(&names[3..]).map(|&name| name.to_owned()).collect();
    let listed: Vec<Vec<String>> = listed.map(|cells| shown(cells)).collect();
    text.push_str(&text_table(&headings, &listed, "  "));
    if let Some((path, file)) = own {
        let own = values.as_deref().and_then(|values| own_file(study, values));
        match chosen.zip(own) {
            Some((chosen, own)) => {
                let of = format!("candidate {chosen} of {}", study.name);
                file.finish(format!("{OWN_FILE}{of}\n{own}").as_bytes())?;
                text.line("wrote", path.display());
            }
            None => {
                text.line("best", format!("none is feasible; {} is not written", path.display()));
            }
        }
    }
    text.line("file", output.display());
    text.next("plot", output);
    tell(text.trim_end());
    // An empty front means that no candidate is feasible.
    Ok(if front.is_empty() { Exit::NotHeld } else { Exit::Done })
}
