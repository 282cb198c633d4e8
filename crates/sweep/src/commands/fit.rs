//! `sweep fit GRID.toml MEASURED.csv --free NAME,...` estimates the parameters with which the model
//! follows a measurement.

use std::path::{Path, PathBuf};

use crate::config::{self, WasherGridInput};
use crate::fit::{self, Evaluations, FitContext, FitOptions, Measurement};
use lane_ode::Cancel;
use sweep_engine::commands::grid::{GridArgs, resume_command};
use sweep_engine::{Error, ExecutionArgs, Exit, Interrupt, Progress, show, tell, threads};
use sweep_files::{FileKind, MODEL_FILE_START, Output};

/// Arguments of `sweep fit`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG_HELP)]
pub struct FitArgs {
    #[command(flatten)]
    grid: GridArgs,
    /// Measured run: a CSV or Parquet file with columns time_s, optionally speed_rpm, and channels
    /// with their units; constants of this run alone follow after @
    #[arg(value_name = "FILE[@NAME=VALUE,...]", required = true)]
    measurement: Vec<String>,
    /// Quantity of a column of the files, as 'Acc front [g]=tub_front_y_m_per_s2', in place of that
    /// in [columns] of the grid file; may be repeated
    #[arg(long = "column", value_name = "HEADER=NAME", value_parser = parse_column)]
    columns: Vec<(String, String)>,
    #[command(flatten)]
    options: FitOptions,
    /// Machine file to write
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// File of curves to write, for `sweep plot`: measured and computed values, residuals and
    /// profiles; the curves of further measurements go to files with -2, -3, ... after the name
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    execution: ExecutionArgs,
    /// Start over, even if another fit with this --out was begun
    #[arg(long, requires = "out")]
    fresh: bool,
}

/// The end of `sweep fit --help`.
const LONG_HELP: &str = "\
Columns are channels of `sweep trace` with their units: tub_front_y_m, tub_yaw_rad, rates \
(tub_yaw_rad_per_s), accelerations (tub_front_y_m_per_s2), cabinet_force_y_n. Other units are \
converted: 'Tub yaw [deg]', time_ms. Further columns are left out. A missing sample is empty. The \
run begins at time 0, at rest; with speed_rpm, or pulses of a tachometer (tacho_pulses, or \
tacho_60_pulses for 60 a turn) or their number (tacho_60_count, tacho_60_count_per_row), the spin \
is the measured one, else the grid's. An offset of every column is fitted beside the parameters.

With --out, the evaluations of an interrupted fit are stored in FILE.partial, and the same command \
continues from there. docs/fit.md explains every line.";

/// Fits the parameters, and prints the report.
///
/// # Errors
/// Returns an error for mistakes in the grid file, the measurements or the options, for data that
/// do not determine the parameters, and if a file cannot be written.
pub(crate) fn run(args: &FitArgs) -> Result<Exit, Error> {
    let grid: WasherGridInput = args.grid.input().with_fixed(&args.grid.at);
    let mut cases = Vec::new();
    let columns = [args.columns.clone(), grid.load()?.reading_notes.columns].concat();
    for text in &args.measurement {
        let (path, constants) = split_constants(text);
        let measurement = Measurement::read(path, &columns)?;
        measurement.notes.iter().for_each(|note| tell(&format!("{}: {note}", measurement.name)));
        cases.push(fit::prepare_case(&grid, &constants, measurement)?);
    }
    for (header, _) in &args.columns {
        let has_header = |case: &fit::FitCase| {
            case.measurement.headers.iter().any(|own| own.starts_with(header))
        };
        if !cases.iter().any(has_header) {
            let known_headers: Vec<&String> =
                cases.iter().flat_map(|case| &case.measurement.headers).take(20).collect();
            let expected = format!("one of the files' columns, as in {known_headers:?}");
            return Err(Error::option("--column", header, expected));
        }
    }
    let machine_output =
        args.out.as_deref().map(|path| Output::begin(path, FileKind::ModelFile)).transpose()?;
    let case_count = cases.len();
    let paths_by_case =
        |path: &PathBuf| (0..case_count).map(|k| add_case_number(path, k)).collect::<Vec<_>>();
    let curve_paths: Vec<PathBuf> = args.curves.iter().flat_map(paths_by_case).collect();
    let curve_outputs = curve_paths.iter().map(|path| Output::begin(path, FileKind::Fit));
    let curve_outputs = curve_outputs.collect::<Result<Vec<_>, _>>()?;
    let interrupt = Interrupt::install().map_err(Error::signal_handlers)?;
    let progress = Progress::for_search(args.execution.progress, 0, "", 0);
    let report_progress =
        |evaluation_count: usize| progress.show_search(0, evaluation_count as u64);
    let cancel = Cancel::Flag(interrupt.flag());
    let output = args.out.as_deref();
    let context =
        FitContext { cancel, report_evaluations: &report_progress, output, fresh: args.fresh };
    let thread_count = threads::choose_count(args.execution.threads, &threads::read_variable)?;
    let fit_result =
        threads::build_pool(thread_count)?.install(|| fit::fit(cases, &args.options, &context))?;
    progress.finish();
    let Some(mut fit_result) = fit_result else {
        let kept_note = "with --out, its evaluations are kept";
        tell(&format!("interrupted: {kept_note}\n     go on  {}", resume_command()));
        return Ok(Exit::from_signal(interrupt.signal()));
    };
    if let (Some(path), Some(out)) = (&args.out, machine_output) {
        let (machine, _) = fit_result.problem.machine(0, &fit_result.x);
        let text = config::machine_file(&machine, &fit_result.problem.number_sources());
        out.finish(
            format!("{MODEL_FILE_START}fitted to {:?}\n{text}", args.measurement.join(" "))
                .as_bytes(),
        )?;
        tell(&format!("wrote {}", path.display()));
        if let Some(note) = fit_result.evaluations.take().and_then(Evaluations::complete) {
            tell(&note);
        }
    }
    for (case, (path, file)) in curve_paths.iter().zip(curve_outputs).enumerate() {
        file.finish(&fit_result.curve_table(case).into_bytes(path)?)?;
        tell(&format!("wrote {0}; next: sweep plot {0}", path.display()));
    }
    let report = &fit_result.report;
    show(&if args.json { format!("{:#}\n", serde_json::json!(report)) } else { report.to_text() })
}

/// Parses `HEADER=NAME`, a column's header and the name of its quantity. The header may contain an
/// equals sign.
fn parse_column(text: &str) -> Result<(String, String), String> {
    match text.rsplit_once('=') {
        Some((header, name)) if Measurement::is_known_name(name) => {
            Ok((header.to_owned(), name.to_owned()))
        }
        Some((_, name)) => Err(format!(
            "`{name}` is not a channel with its unit, time_s, speed_rpm, tacho_pulses or \
             tacho_count"
        )),
        None => Err("expected HEADER=NAME".to_owned()),
    }
}

/// Returns the path of a case's file of curves: the given path for the first case, and one with a
/// number for each further case.
fn add_case_number(path: &Path, case: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match case {
        0 => path.to_owned(),
        _ => path.with_file_name(format!("{stem}-{}.{extension}", case + 1)),
    }
}

/// Splits an argument into a path and the constants after `@`. The name of an existing file may
/// have an `@` itself.
fn split_constants(text: &str) -> (&Path, Vec<String>) {
    match text.rsplit_once('@') {
        Some((path, constants)) if !Path::new(text).exists() => {
            (Path::new(path), constants.split(',').map(str::to_owned).collect())
        }
        _ => (Path::new(text), Vec::new()),
    }
}
