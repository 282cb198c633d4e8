//! Traces of every point of a map, a file each, which `sweep run --keep-traces` writes.

use std::path::Path;

use lane_ode::Cancel;
use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};
use sweep_engine::store::read;
use sweep_engine::{StoreError, threads};
use sweep_files::{self as files, FileKind, ParquetFile, key, regular};
use washer_model::InitialDeviation;
use washer_row::MethodKind;

use super::{Models, TraceExtras, TraceSettings, trace_one_point};
use crate::engine::ModelEngine;

/// Maximum number of points with a file each. Basis: a file of some 300 kB, so 3 GB in all;
/// doubling it doubles the disk space that one option may take.
pub(crate) const MAX_POINT_TRACES: u64 = 10_000;

/// Number of time steps in each file, over the whole run. Basis: the width in pixels of the chart
/// that shows it. Doubling it doubles the size of the files.
const INTERVALS_PER_FILE: f64 = 2000.0;

/// Writes the trace of every point of `result` into `folder` as `point-<index>.parquet`, until
/// `cancel` is requested. A point without equilibrium gets no file. `on_point` is called after each
/// point.
///
/// The trace of a row that was computed with capped modes is integrated in the same way, in a
/// fraction of the time that `sweep trace` takes.
///
/// # Errors
/// Returns an error if `result` cannot be read, if a file cannot be written, and if no threads can
/// be started.
pub(crate) fn write_point_traces(
    engine: &ModelEngine<'_>,
    result: &ParquetFile,
    folder: &Path,
    threads: usize,
    cancel: Cancel<'_>,
    on_point: &(dyn Fn() + Sync),
) -> Result<(), StoreError> {
    let plan = engine.plan();
    files::create_folder_without_leftovers(folder)?;
    remove_point_traces(folder)?;
    let method_names = read::read_methods(result)?;
    threads::build_pool(threads)?.install(|| {
        method_names.into_par_iter().enumerate().try_for_each(|(point, method)| {
            let point = point as u64;
            if cancel.is_requested() {
                return Ok(());
            }
            let names = plan.axes.iter().map(|axis| axis.parameter.name.to_string());
            let parameters = names.zip(plan.axis_values(point)).collect();
            let method_kind = method.and_then(|name| MethodKind::named(&name));
            let settings = TraceSettings {
                every_s: Some(plan.end_s / INTERVALS_PER_FILE),
                models: Models::Both,
                start: InitialDeviation::default(),
                extras: TraceExtras::default(),
                capped: method_kind.and_then(|method_kind| engine.capped_run(method_kind)),
            };
            let trace_result = trace_one_point(plan, point, parameters, &settings, cancel);
            if cancel.is_requested() {
                return Ok(());
            }
            // A point without equilibrium is an error here; its row in the map reports that.
            if let Ok(trace_result) = trace_result {
                let path = folder.join(format!("point-{point}.parquet"));
                files::write(&path, FileKind::Trace, &trace_result.table.into_bytes(&path)?)?;
            }
            on_point();
            Ok(())
        })
    })
}

/// Removes the files of an earlier run from the folder: their points may be points of another grid.
fn remove_point_traces(folder: &Path) -> Result<(), StoreError> {
    for name in regular::file_names(folder).map_err(StoreError::io("list", folder))? {
        let is_point_trace = name.to_str().is_some_and(|name| {
            let point_number =
                name.strip_prefix("point-").and_then(|rest| rest.strip_suffix(".parquet"));
            point_number.is_some_and(|point_number| point_number.parse::<u64>().is_ok())
        });
        let path = folder.join(&name);
        if is_point_trace
            && ParquetFile::open(&path).is_ok_and(|file| file.value(key::TRACE).is_some())
        {
            std::fs::remove_file(&path).map_err(StoreError::io("remove", &path))?;
        }
    }
    Ok(())
}
