//! `sweep run GRID.toml` computes a sweep, and with an option the time histories of its points.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::engine::ModelEngine;
use crate::plan::Plan;
use crate::trace::{MAX_POINT_TRACES, write_point_traces};
use lane_ode::Cancel;
use sweep_engine::commands::run as engine_run;
use sweep_engine::commands::run::{execute, exit_code, install_interrupt};
use sweep_engine::run::RunEnd;
use sweep_engine::{Error, Exit, Progress, tell, threads};
use sweep_files::{self as files, ParquetFile};

/// Arguments of `sweep run`.
#[derive(Debug, clap::Args)]
pub struct WasherRunArgs {
    #[command(flatten)]
    run: engine_run::RunArgs,
    /// Keep the decimated time histories of every point, too, in NAME.traces beside NAME.parquet:
    /// `sweep plot NAME.parquet --traces NAME.traces -o MAP.html` shows them on a click. They are
    /// computed after the map and take some three times as long
    #[arg(long)]
    keep_traces: bool,
}

/// Runs a grid.
///
/// # Errors
/// Returns an error for mistakes in the grid file, and if the run fails.
pub(crate) fn run(args: &WasherRunArgs) -> Result<Exit, Error> {
    let plan: Plan = args.run.target.grid.load()?;
    let engine = ModelEngine::new(&plan)?;
    if args.keep_traces && plan.points() > MAX_POINT_TRACES {
        let given = format!("with {} points", plan.points());
        let expected =
            format!("at most {MAX_POINT_TRACES}; `sweep trace` writes those of single points");
        return Err(Error::option("--keep-traces", given, expected));
    }
    let interrupt = install_interrupt()?;
    let further_options = if args.keep_traces { " --keep-traces" } else { "" };
    let report = execute(
        &args.run,
        &plan,
        &engine.for_plan(&plan).into_engine(),
        &interrupt,
        further_options,
    )?;
    let output = args.run.target.output(&plan);
    if args.keep_traces && matches!(report.end, RunEnd::AlreadyFinished(..) | RunEnd::Finished(_)) {
        let threads =
            threads::choose_count(args.run.control.execution.threads, &threads::read_variable)?;
        let folder = files::path_beside(&output, "traces");
        tell(&format!("traces of {} points go to {}", plan.points(), folder.display()));
        let progress = Progress::new(args.run.control.execution.progress, plan.points(), 0);
        let traced_points = AtomicU64::new(0);
        let count_point = || progress.show(traced_points.fetch_add(1, Ordering::Relaxed) + 1);
        let map = ParquetFile::open(&output)?;
        let cancel = Cancel::Flag(interrupt.flag());
        let result = write_point_traces(&engine, &map, &folder, threads, cancel, &count_point);
        progress.finish();
        result?;
        if let Some(signal) = interrupt.signal() {
            tell("interrupted; the map is kept, and the traces so far");
            return Ok(Exit::from_signal(Some(signal)));
        }
        tell(&format!("traces      {}", folder.display()));
    }
    Ok(exit_code(&args.run.control, &report))
}
