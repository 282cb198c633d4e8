//! `sweep stability GRID.toml --speed FROM:TO:STEP`: periodic responses and whether they are
//! stable.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use super::examples::Examples;
use super::grid::{GridArgs, quoted};
use super::run::line;
use crate::engine::simd_from_environment;
use crate::exit::{Error, Exit, tell};
use crate::interrupt::Interrupt;
use crate::progress::{Progress, ProgressMode, duration};
use crate::speeds::{Speeds, turning};
use crate::stability::{answers, check, file, tongues};
use crate::store::StoreError;
use crate::threads;
use sweep_files::{FileKind, Output, ParquetFile};

/// Shown by `--help`.
pub(super) const EXAMPLES: Examples = &[
    [
        "sweep stability my.toml --speed 60:400:1",
        "where a dwell at constant speed would shake itself up",
    ],
    ["sweep show results/first-stability.parquet", "the unstable speeds, and why"],
];

/// Arguments of `sweep stability`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = LONG)]
pub struct Args {
    #[command(flatten)]
    grid: GridArgs,
    /// Constant spin speeds, in rpm, above 0
    #[arg(long, value_name = "FROM:TO:STEP", value_parser = turning, allow_hyphen_values = true)]
    speed: Speeds,
    /// Stability file [default: results/NAME-stability.parquet]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Worker threads [default: SLURM_CPUS_PER_TASK, else the cores of this machine]
    #[arg(long, value_name = "N", value_parser = threads::parse)]
    threads: Option<usize>,
    /// How progress is shown: auto (a bar on a terminal, else a line a minute), plain (a line every
    /// 5 s) or none
    #[arg(long, value_name = "auto|plain|none", default_value = "auto")]
    progress: ProgressMode,
}

/// What `--help` adds.
const LONG: &str = "\
A row for every point of the grid and every speed: the periodic response of both models while the \
drum turns at that speed for ever, and how fast a small disturbance of the nonlinear one grows. \
The spin profile, the window and the integrator of the grid file do not matter here.

The file is a pure function of its input, whatever the number of threads. It is written whole at \
the end: after an interruption the command starts over.";

/// Finds the responses and writes them.
///
/// # Errors
/// Mistakes in the grid file or the options, and whatever keeps the file from being written.
pub(crate) fn run(args: &Args) -> Result<Exit, Error> {
    let plan = args.grid.load()?;
    let speeds = args.speed.values();
    check(&plan, &args.speed.to_string(), speeds.len())?;
    let default = || PathBuf::from(format!("results/{}-stability.parquet", plan.name));
    let path = args.out.clone().unwrap_or_else(default);
    let threads = threads::count(args.threads, &|name| std::env::var(name).ok())?;
    let simd = simd_from_environment()?;
    let output = Output::begin(&path, FileKind::Stability)?;
    let interrupt = Interrupt::install().map_err(|source| Error::File {
        action: "install signal handlers for",
        path: PathBuf::from("this process"),
        source,
    })?;
    let began = Instant::now();
    let rows = plan.points() * speeds.len() as u64;
    let progress = Mutex::new(Progress::new(args.progress, rows, 0));
    let found =
        threads::pool(threads)?.install(|| answers(&plan, simd, &speeds, &progress, &interrupt));
    progress.lock().unwrap_or_else(PoisonError::into_inner).finish();
    let wall = duration(began.elapsed().as_secs_f64());
    let Some(answers) = found else {
        tell(&format!("{}: interrupted after {wall}; nothing was written", plan.name));
        return Ok(match interrupt.signal() {
            Some(15) => Exit::Terminated,
            _ => Exit::Interrupted,
        });
    };
    let bytes = file::bytes(&plan, &speeds, &answers);
    output.finish(&bytes.map_err(StoreError::parquet("write", &path))?)?;
    let shown = path.display().to_string();
    let mut text =
        format!("{}: {} points at {} speeds in {wall}\n", plan.name, plan.points(), speeds.len());
    for (name, words) in tongues::summary(&ParquetFile::open(&path)?)?.lines() {
        line(&mut text, name, &words);
    }
    line(&mut text, "file", &shown);
    line(&mut text, "next", &format!("sweep show {}", quoted(&shown)));
    tell(text.trim_end());
    Ok(Exit::Done)
}
