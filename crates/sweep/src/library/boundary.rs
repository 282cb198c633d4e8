//! The search for a boundary, with or without a file that keeps what it finds out.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use super::Effort;
use super::result::{ResultKind, ResultTable};
use crate::boundary::file::{job, table};
use crate::boundary::product::{BoundaryTask, Models, Stopped};
use crate::boundary::quantity::TracedQuantity;
use crate::boundary::{Standing, Traced, trace};
use crate::engine::ModelEngine;
use crate::exit::Error;
use crate::plan::Plan;
use crate::progress::Progress;
use crate::random_keys::draw_random_keys;
use crate::store::{OpenedTrials, Trials};
use sweep_files::{FileKind, Output};

/// What is asked of a boundary.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryOptions<'a> {
    /// `ratio_max`, `ratio_CHANNEL`, `min_gap_nonlinear_m` or `min_gap_linear_m`.
    pub quantity: &'a str,
    /// Width of the final brackets, in the second axis's unit, or as a fraction of its value if it
    /// is logarithmic; if `None`, 1/480 of the range.
    pub tolerance: Option<f64>,
    /// Cells along each axis of the lattice that guards against islands, 1 to 1000.
    pub lattice: u16,
    /// The file to write, which keeps what an interrupted search has found out; without one, it is
    /// lost.
    pub output: Option<&'a Path>,
    /// Whether to start over.
    pub fresh: bool,
}

/// Traces the boundary of a plan's grid; `None` if the interrupt was raised.
///
/// # Errors
/// A plan without a range to search, options that make no sense, and whatever keeps the file from
/// being written.
pub fn find_boundary(
    plan: &Plan,
    options: BoundaryOptions<'_>,
    effort: Effort<'_>,
) -> Result<Option<ResultTable>, Error> {
    draw_random_keys()?;
    let quantity: TracedQuantity = options.quantity.parse().map_err(|expected| Error::Option {
        option: "quantity",
        given: options.quantity.to_owned(),
        expected,
    })?;
    if !(1..=1000).contains(&options.lattice) {
        let given = options.lattice.to_string();
        return Err(Error::Option { option: "lattice", given, expected: "from 1 to 1000".into() });
    }
    let plan = &quantity.plan(plan)?;
    let task = BoundaryTask::new(plan, options.tolerance, usize::from(options.lattice))?;
    let job = job(plan, quantity, &task);
    let begin = |path| Output::begin(path, FileKind::Boundary);
    let file = options.output.map(begin).transpose()?;
    let trials = match options.output.map(|path| Trials::open(path, &job, options.fresh)) {
        None => None,
        Some(opened) => match opened? {
            OpenedTrials::Open(trials) => Some(*trials),
            OpenedTrials::Finished => {
                return options.output.map(ResultTable::read).transpose();
            }
        },
    };
    let (traced, trials) = search(plan, quantity, &task, trials, effort)?;
    let traced = match traced {
        Ok(traced) => traced,
        Err(Stopped::Failed(error)) => return Err(error.into()),
        Err(Stopped::Interrupted) => return Ok(None),
    };
    let found = table(&job, plan, quantity, &task, &traced);
    let found = ResultTable::of_table(ResultKind::Boundary, found)?;
    if let Some(file) = file {
        found.finish(file)?;
    }
    // What it says matters where a user watches the folder.
    let _ = trials.and_then(Trials::complete);
    Ok(Some(found))
}

/// Searches, with a memory of trials if there is one, and gives it back.
///
/// # Errors
/// No threads; `SWEEP_SIMD` naming nothing this machine has.
pub(crate) fn search(
    plan: &Plan,
    quantity: TracedQuantity,
    task: &BoundaryTask,
    trials: Option<Trials>,
    effort: Effort<'_>,
) -> Result<(Result<Traced, Stopped>, Option<Trials>), Error> {
    let engine = ModelEngine::new(plan)?;
    let there = trials.as_ref().map_or(0, |trials| trials.count() as u64);
    let rows = (task.firsts.len() * task.curves) as u64;
    let rows_done = AtomicU64::new(0);
    let progress = Mutex::new(Progress::of_search(effort.progress, rows, there));
    let shown = |points: u64| {
        // A thread that finds another showing it goes on.
        if let Ok(mut progress) = progress.try_lock() {
            progress.show_search(rows_done.load(Ordering::Relaxed), points);
        }
    };
    let threads = effort.threads()?;
    let models = Models::new(plan, engine, quantity, threads, effort.interrupt, &shown)?;
    let models = match trials {
        Some(trials) => models.keeping(trials),
        None => models,
    };
    let mut standing =
        |standing: &Standing| rows_done.store(standing.rows as u64, Ordering::Relaxed);
    let traced = trace(&models, &task.firsts, task.curves, &task.search, &mut standing);
    progress.lock().unwrap_or_else(PoisonError::into_inner).finish();
    Ok((traced, models.into_kept()))
}
