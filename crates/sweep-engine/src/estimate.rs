//! The estimate of a run's time and memory, as `check` shows it.

use std::time::Instant;

use crate::engine::evaluate_points;
use crate::method::Steps;
use crate::store::read::{NameCounts, count_name};
use crate::{Error, Interrupt, Model, Plan, RunContext, threads};

/// The estimated time, memory and disk space of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The instruction set.
    pub simd: String,
    /// The number of worker threads.
    pub threads: usize,
    /// The time from start to end, if each thread has a core for itself.
    pub wall_s: f64,
    /// The time of one core for one point.
    pub core_s_per_point: f64,
    /// The numbers of points that were integrated for the estimate, by status.
    pub sample_statuses: NameCounts,
    /// The time up to which these points were integrated; at most the plan's `end_s`.
    pub sampled_s: f64,
    /// The peak memory.
    pub memory_bytes: f64,
    /// The disk space of the run's folder.
    pub disk_bytes: f64,
    /// An upper bound of the disk space of the result.
    pub result_bytes: f64,
    /// The integration method and the choice of its time steps, in words.
    pub method: String,
    /// The words that follow the limit in the sentence on the verdict; empty if ratios are those of
    /// the largest deviations.
    pub criterion: &'static str,
    /// The model's notes on the plan, each with its heading.
    pub notes: Vec<(&'static str, String)>,
}

/// The number of points that a default estimate evaluates. Basis: the lanes of the widest
/// instruction set. Doubling it doubles the time of an estimate.
const MAX_SAMPLED_POINTS: u64 = 8;

/// Memory (bytes) of the program, its libraries and buffers without points. Basis: measured in
/// docs/scaling.md. Doubling it overestimates small runs.
const PROGRAM_BYTES: f64 = 14e6;

/// Greatest memory (bytes) of a row group while it is encoded. Basis: measured in docs/scaling.md.
/// Doubling it overestimates large results.
const ROW_GROUP_BYTES: f64 = 40e6;

impl Estimate {
    /// Estimates a run from its first rows, which one thread evaluates.
    ///
    /// # Errors
    /// A plan that has no engine, or a thread that cannot be started.
    pub fn from_first_rows<M: Model>(plan: &Plan<M>, threads: usize) -> Result<Self, Error> {
        let sampled_points = plan.points().min(MAX_SAMPLED_POINTS);
        let engine = M::engine(plan, None)?;
        let axis_values: Vec<Vec<f64>> =
            (0..sampled_points).map(|point| plan.axis_values(point)).collect();
        let interrupt = Interrupt::new();
        let context = RunContext::new(&interrupt);
        let pool = threads::build_pool(1)?;
        let start_time = Instant::now();
        let rows_by_point =
            pool.install(|| evaluate_points(engine.evaluator.as_ref(), &axis_values, &context));
        let core_s_per_point = start_time.elapsed().as_secs_f64() / sampled_points as f64;
        let layout = M::layout(plan);
        let mut sample_statuses = NameCounts::new();
        for row in rows_by_point.iter().flatten().flat_map(|result| &result.rows) {
            if let Some(status) = layout.name(row, "status") {
                count_name(&mut sample_statuses, status);
            }
        }
        let result_bytes = plan.points() as f64 * layout.bytes_per_row() as f64;
        let step_description = match plan.integrator.steps() {
            Steps::Checked(_) => ", until two runs agree",
            Steps::Fixed(_) => ", two trajectories per point",
            Steps::ByError => ": steps as it needs",
        };
        Ok(Self {
            simd: engine.simd.to_owned(),
            threads,
            wall_s: plan.points() as f64 * core_s_per_point / threads as f64,
            core_s_per_point,
            sample_statuses,
            sampled_s: plan.end_s,
            memory_bytes: PROGRAM_BYTES + result_bytes.min(ROW_GROUP_BYTES),
            disk_bytes: result_bytes,
            result_bytes,
            method: format!("{}{step_description}", plan.integrator),
            criterion: "",
            notes: Vec::new(),
        })
    }
}

/// Formats a size with three digits.
pub fn format_bytes(bytes: f64) -> String {
    /// The units, each 1000 times the one before.
    const SIZE_UNITS: [&str; 5] = ["bytes", "kB", "MB", "GB", "TB"];
    let mut scaled_size = bytes;
    let mut unit_index = 0;
    while scaled_size >= 999.5 && unit_index + 1 < SIZE_UNITS.len() {
        scaled_size /= 1e3;
        unit_index += 1;
    }
    let digits = if unit_index == 0 || scaled_size >= 99.95 { 0 } else { 1 };
    format!("{scaled_size:.digits$} {}", SIZE_UNITS[unit_index])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_readable_units() {
        let formatted_sizes = [0.0, 999.0, 1234.0, 56.7e6, 999.96e6, 2e9, 3e15].map(format_bytes);
        assert_eq!(
            formatted_sizes,
            ["0 bytes", "999 bytes", "1.2 kB", "56.7 MB", "1.0 GB", "2.0 GB", "3000 TB"]
        );
    }
}
