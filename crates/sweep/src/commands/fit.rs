//! `sweep fit GRID.toml MEASURED.csv --free NAME,...`: the numbers that make the model follow a
//! measurement.

use std::path::{Path, PathBuf};

use crate::config::{self, WasherGridInput};
use crate::fit::{self, Evaluations, FitContext, FitOptions, Measurement};
use lane_ode::Cancel;
use sweep_engine::commands::grid::{GridArgs, resume_command};
use sweep_engine::{Error, ExecutionArgs, Exit, Interrupt, Progress, show, tell, threads};
use sweep_files::{FileKind, OWN_FILE, Output};

/// Arguments of `sweep fit`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
pub struct FitArgs {
    #[command(flatten)]
    grid: GridArgs,
    /// Measured run: a CSV or Parquet file of time_s, perhaps speed_rpm, and channels with their
    /// units; after @ constants of its own
    #[arg(value_name = "FILE[@NAME=VALUE,...]", required = true)]
    measurement: Vec<String>,
    /// A column of the files and what it holds, as 'Acc front [g]=tub_front_y_m_per_s2'; over
    /// [columns] of the grid file; may be repeated
    #[arg(long = "column", value_name = "HEADER=NAME", value_parser = header_and_name)]
    columns: Vec<(String, String)>,
    #[command(flatten)]
    options: FitOptions,
    /// Machine file to write
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// File of curves to write, for `sweep plot`: measured, model and residual, and profiles; of
    /// further files under -2 and so on
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
const LONG: &str = "\
Columns are channels of `sweep trace` with their units: tub_front_y_m, tub_yaw_rad, rates \
(tub_yaw_rad_per_s), accelerations (tub_front_y_m_per_s2), cabinet_force_y_n. Other units are \
converted: 'Tub yaw [deg]', time_ms. Further columns are left out. A missing sample is empty. The \
run begins at time 0, at rest; with speed_rpm, or pulses of a tachometer (tacho_pulses, or \
tacho_60_pulses for 60 a turn) or their number (tacho_60_count, tacho_60_count_per_row), the spin \
is the measured one, else the grid's. An offset of every column is fitted beside the parameters.

With --out, what an interrupted fit has found out stays in FILE.partial, and the same command goes \
on from there. docs/fit.md explains every line.";

/// Fits, and prints.
///
/// # Errors
/// Mistakes in the grid file, the measurements or the options; data that cannot tell; and a machine
/// file that cannot be written.
pub(crate) fn run(args: &FitArgs) -> Result<Exit, Error> {
    let grid: WasherGridInput = args.grid.input().with_fixed(&args.grid.at);
    let mut cases = Vec::new();
    let columns = [args.columns.clone(), grid.load()?.reading_notes.columns].concat();
    for text in &args.measurement {
        let (path, constants) = parted(text);
        let measurement = Measurement::read(path, &columns)?;
        measurement.notes.iter().for_each(|note| tell(&format!("{}: {note}", measurement.name)));
        cases.push(fit::case(&grid, &constants, measurement)?);
    }
    for (header, _) in &args.columns {
        let has = |case: &fit::FitCase| {
            case.measurement.headers.iter().any(|own| own.starts_with(header))
        };
        if !cases.iter().any(has) {
            let all: Vec<&String> =
                cases.iter().flat_map(|case| &case.measurement.headers).take(20).collect();
            let expected = format!("one of the files' columns, as in {all:?}");
            return Err(Error::option("--column", header, expected));
        }
    }
    let out = args.out.as_deref().map(|path| Output::begin(path, FileKind::Own)).transpose()?;
    let count = cases.len();
    let paths = |path: &PathBuf| (0..count).map(|k| numbered(path, k)).collect::<Vec<_>>();
    let curves: Vec<PathBuf> = args.curves.iter().flat_map(paths).collect();
    let begun = curves.iter().map(|path| Output::begin(path, FileKind::Fit));
    let begun = begun.collect::<Result<Vec<_>, _>>()?;
    let interrupt = Interrupt::install().map_err(Error::signals)?;
    let progress = Progress::for_search(args.execution.progress, 0, "", 0);
    let report_progress = |made: usize| progress.show_search(0, made as u64);
    let cancel = Cancel::Flag(interrupt.flag());
    let output = args.out.as_deref();
    let context =
        FitContext { cancel, count_evaluations: &report_progress, output, fresh: args.fresh };
    let threads = threads::count(args.execution.threads, &threads::process)?;
    let fitted = threads::pool(threads)?.install(|| fit::fit(cases, &args.options, &context))?;
    progress.finish();
    let Some(mut fitted) = fitted else {
        let kept = "with --out, what was found out is kept";
        tell(&format!("interrupted: {kept}\n     go on  {}", resume_command()));
        return Ok(Exit::interrupted(interrupt.signal()));
    };
    if let (Some(path), Some(out)) = (&args.out, out) {
        let (machine, _) = fitted.problem.machine(0, &fitted.x);
        let text = config::machine_file(&machine, &fitted.problem.written());
        out.finish(
            format!("{OWN_FILE}fitted to {:?}\n{text}", args.measurement.join(" ")).as_bytes(),
        )?;
        tell(&format!("wrote {}", path.display()));
        if let Some(note) = fitted.evaluations.take().and_then(Evaluations::complete) {
            tell(&note);
        }
    }
    for (case, (path, file)) in curves.iter().zip(begun).enumerate() {
        file.finish(&fitted.curves(case).into_bytes(path)?)?;
        tell(&format!("wrote {0}; next: sweep plot {0}", path.display()));
    }
    let report = &fitted.report;
    show(&if args.json { format!("{:#}\n", serde_json::json!(report)) } else { report.text() })
}

/// Returns a header and the name of what its column holds. Headers may have an equals sign.
fn header_and_name(text: &str) -> Result<(String, String), String> {
    match text.rsplit_once('=') {
        Some((header, name)) if Measurement::is_name(name) => {
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
fn numbered(path: &Path, case: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    match case {
        0 => path.to_owned(),
        _ => path.with_file_name(format!("{stem}-{}.{ending}", case + 1)),
    }
}

/// Splits an argument into a path and the constants after `@`. The name of an existing file may
/// have an `@` itself.
fn parted(text: &str) -> (&Path, Vec<String>) {
    match text.rsplit_once('@') {
        Some((path, constants)) if !Path::new(text).exists() => {
            (Path::new(path), constants.split(',').map(str::to_owned).collect())
        }
        _ => (Path::new(text), Vec::new()),
    }
}
