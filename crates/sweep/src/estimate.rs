//! Estimates of a run's cost: the time from a few points that are integrated, memory and disk space
//! from the sizes of the data.

use lane_ode::MAX_LANES;
use washer_model::ModelKind;
use washer_row::{Deviations, Metric, Outcome, RefinementLevels};

use crate::engine::ModelEngine;
use crate::notes::{criterion_words, plan_notes};
use crate::plan::Plan;
use sweep_engine::method::Steps;
use sweep_engine::plan::shortest_step_s;
use sweep_engine::store::chunk_points;
use sweep_engine::store::read::{NameCounts, count_name};
use sweep_engine::{Error, Estimate, Interrupt, Job, RunContext};

/// The minimum time (s) for the integration of beginnings of trajectories, which are made longer
/// until their integration takes it. Basis:
/// far above the resolution of clocks. Doubling it doubles the time of an estimate.
const MIN_MEASURED_TIME_S: f64 = 0.2;

/// The maximum time (s) for whole trajectories, after which beginnings are used. Basis: a user's
/// patience. Doubling it makes estimates of expensive grids slower and more accurate.
const MAX_TRAJECTORIES_S: f64 = 4.0;

/// The length (s) of the shortest beginning of a trajectory by a method that chooses its steps.
/// Basis: milliseconds of computing. Doubling it saves no time.
const SHORTEST_BEGINNING_S: f64 = 1e-3;

/// The maximum number of the shortest possible steps in the shortest beginning. Basis: milliseconds
/// of computing, however stiff the machine is. Doubling it doubles that time.
const MAX_SHORTEST_STEPS: f64 = 1e4;

/// The maximum time (s) for a batch of whole trajectories, by the cost of the first few. Basis: a
/// user's patience. Doubling it makes estimates slower and more accurate.
const MAX_BATCH_S: f64 = 2.0;

/// The maximum number of points in a batch of whole trajectories. Basis: all lanes of all levels
/// are full. Doubling it doubles the time of an estimate.
const MAX_BATCH_POINTS: u64 = 64;

/// The golden section. The fractional parts of its multiples are spread over the unit interval
/// without a period.
const GOLDEN_SECTION: f64 = 0.618_033_988_749_894_9;

/// The memory (bytes) of the program, its libraries and buffers without points. Basis: measured in
/// docs/scaling.md. Doubling it overestimates small runs.
const PROGRAM_BYTES: f64 = 14e6;

/// The memory (bytes) of a cell of a row group while it is encoded, besides its own 8 bytes. Basis:
/// measured in docs/scaling.md. Doubling it overestimates large results.
const ENCODING_BYTES_PER_CELL: f64 = 5.0;

/// The disk space (bytes) of a column besides its cells, with its share of the plan. Basis: 767 and
/// 768 bytes in results of one point with 35 and 40 columns. Doubling it overestimates small
/// results.
const BYTES_PER_RESULT_COLUMN: f64 = 800.0;

/// The bytes that a column of a part takes besides its cells. Basis: 282 bytes in parts of eight
/// points with 36 columns. Doubling it doubles the disk that small chunks are said to take.
const BYTES_PER_PART_COLUMN: f64 = 300.0;

/// The estimated time (s) of work above which a command says what makes it shorter. Basis: a user's
/// patience. Doubling it makes more users wait who could shorten the work.
pub(crate) const LONG_WORK_S: f64 = 180.0;

/// Estimates the cost of a run on a number of threads: it integrates some points of the plan, for a
/// few seconds at most, and extrapolates.
///
/// # Errors
/// Returns an error if the plan has no engine.
pub(crate) fn estimate(plan: &Plan, threads: usize) -> Result<Estimate, Error> {
    estimate_within(plan, threads, MAX_TRAJECTORIES_S)
}

/// Estimates the cost like [`estimate`], with a maximum time (s) for whole trajectories.
fn estimate_within(
    plan: &Plan,
    threads: usize,
    max_trajectories_s: f64,
) -> Result<Estimate, Error> {
    let engine = ModelEngine::new(plan)?;
    // The time to find the levels does not belong to the points.
    engine.levels();
    let few_points_cost = MeasuredCost::measure_few(&engine, max_trajectories_s);
    let MeasuredCost { core_s_per_point, sample_statuses, integrated_s } =
        MeasuredCost::measure_batch(&engine, &few_points_cost).unwrap_or(few_points_cost);
    let points_per_chunk = chunk_points(plan.points());
    let layout = &Job::new(plan).layout;
    let row_bytes = plan.points() as f64 * layout.bytes_per_row() as f64;
    let column_count = layout.schema().fields().len() as f64;
    let part_count = plan.points().div_ceil(points_per_chunk) as f64;
    // A chunk is one thread's work, so the last round of chunks may leave threads without any.
    let round_count = plan.points().div_ceil(points_per_chunk).div_ceil(threads as u64);
    let points_per_thread = (round_count * points_per_chunk).min(plan.points());
    Ok(Estimate {
        simd: engine.widest_simd().name().to_owned(),
        threads,
        wall_s: points_per_thread as f64 * core_s_per_point,
        core_s_per_point,
        sample_statuses,
        sampled_s: integrated_s,
        memory_bytes: memory_bytes(&engine, threads),
        disk_bytes: row_bytes + part_count * column_count * BYTES_PER_PART_COLUMN,
        result_bytes: row_bytes + column_count * BYTES_PER_RESULT_COLUMN,
        method: describe_method(plan, &engine.levels()[0]),
        criterion: criterion_words(plan),
        notes: plan_notes(plan),
    })
}

/// The measured cost of some points.
struct MeasuredCost {
    core_s_per_point: f64,
    /// The number of points by status.
    sample_statuses: NameCounts,
    /// The length (s) of the integrated beginnings.
    integrated_s: f64,
}

impl MeasuredCost {
    /// Measures whole trajectories of as many points as there are lanes, or beginnings of them.
    fn measure_few(engine: &ModelEngine<'_>, max_trajectories_s: f64) -> Self {
        let plan = engine.plan();
        let point_count = plan.points().min(MAX_LANES as u64);
        // A method with levels costs most at the beginning, where little moves, so that beginnings
        // overestimate it.
        if let Steps::Checked(_) = plan.integrator.steps()
            && let Some((cost_s, sample_statuses)) =
                measure_cost_within(max_trajectories_s, engine, point_count)
        {
            let core_s_per_point = cost_s / point_count as f64;
            return Self { core_s_per_point, sample_statuses, integrated_s: plan.end_s };
        }
        let mut shorter_beginning: Option<(f64, f64)> = None;
        let mut end_s = shortest_end_s(plan);
        let mut shortened_plan = plan.clone();
        // The cost of metrics at held speeds does not grow with the length. It is measured once,
        // and these metrics are removed.
        let mut held_speeds_s = 0.0;
        loop {
            shortened_plan.end_s = end_s;
            shortened_plan.window_s =
                plan.window_s.map(|edge_s| (edge_s * (end_s / plan.end_s)).min(end_s));
            // The levels of a shorter run would be for lower speeds, with longer steps.
            let (cost_s, sample_statuses) =
                measure_cost(&engine.for_plan(&shortened_plan), point_count);
            let grows_with_length =
                |metric: &Metric| !matches!(metric, Metric::Growth | Metric::Dwell);
            if !shortened_plan.model.measures.metrics.iter().all(grows_with_length) {
                shortened_plan.model.measures.metrics.retain(grows_with_length);
                held_speeds_s = cost_s;
                continue;
            }
            if end_s >= plan.end_s || cost_s >= MIN_MEASURED_TIME_S {
                // The cost of the equilibrium does not grow with the length, so the difference of
                // two beginnings gives the rate.
                let (base_end_s, base_s) = shorter_beginning.unwrap_or((0.0, 0.0));
                let cost_per_length = ((cost_s - base_s) / (end_s - base_end_s)).max(0.0);
                let total_cost_s = held_speeds_s + cost_s + cost_per_length * (plan.end_s - end_s);
                let core_s_per_point = total_cost_s / point_count as f64;
                return Self { core_s_per_point, sample_statuses, integrated_s: end_s };
            }
            shorter_beginning = Some((end_s, cost_s));
            end_s = (4.0 * end_s).min(plan.end_s);
        }
    }

    /// Measures whole trajectories of more points together, if there is time. Their rows share the
    /// lanes of fine levels, as in a run. Few points leave these lanes empty, and cost several
    /// times as much each.
    fn measure_batch(engine: &ModelEngine<'_>, first: &Self) -> Option<Self> {
        let plan = engine.plan();
        let affordable_points = (MAX_BATCH_S / first.core_s_per_point) as u64;
        let point_count = affordable_points.min(MAX_BATCH_POINTS).min(plan.points());
        if first.integrated_s < plan.end_s || point_count <= first.sample_statuses.values().sum() {
            return None;
        }
        let (cost_s, sample_statuses) = measure_cost(engine, point_count);
        let core_s_per_point = cost_s / point_count as f64;
        Some(Self { core_s_per_point, sample_statuses, integrated_s: plan.end_s })
    }
}

/// Returns the end (s) of a beginning so short that any method integrates it in milliseconds.
fn shortest_end_s(plan: &Plan) -> f64 {
    let shortest_s = match plan.integrator.steps() {
        Steps::Fixed(step_s) => 100.0 * step_s,
        Steps::ByError | Steps::Checked(_) => {
            SHORTEST_BEGINNING_S.min(MAX_SHORTEST_STEPS * shortest_step_s(plan.end_s))
        }
    };
    shortest_s.min(plan.end_s)
}

/// Returns the time (s) that one core takes for a number of points, and their statuses.
fn measure_cost(engine: &ModelEngine<'_>, points: u64) -> (f64, NameCounts) {
    measure_cost_within(f64::INFINITY, engine, points).unwrap_or((f64::INFINITY, NameCounts::new()))
}

/// Returns the cost like [`measure_cost`], or `None` if it exceeds a time (s). The points are one
/// in each of as many equal parts of the grid, at irregular positions: with equal distances all
/// might have the same value of an axis.
fn measure_cost_within(
    max_cost_s: f64,
    engine: &ModelEngine<'_>,
    point_count: u64,
) -> Option<(f64, NameCounts)> {
    let plan = engine.plan();
    let points_per_part = plan.points() as f64 / point_count as f64;
    let point_index =
        |k| ((k as f64 + (k as f64 * GOLDEN_SECTION).fract()) * points_per_part) as u64;
    let axis_values: Vec<Vec<f64>> =
        (0..point_count).map(|k| plan.axis_values(point_index(k))).collect();
    let start_s = thread_time_s();
    let is_late = || thread_time_s() - start_s > max_cost_s;
    let interrupt = Interrupt::new();
    let context = RunContext::with_time_limit(&interrupt, &is_late);
    let rows = engine.evaluate_points(&axis_values, &context)?;
    let cost_s = thread_time_s() - start_s;
    let mut sample_statuses = NameCounts::new();
    rows.iter().for_each(|row| count_name(&mut sample_statuses, row.status()));
    Some((cost_s, sample_statuses))
}

/// Returns the processor time (s) of this thread, which other work on the computer does not affect.
#[cfg(unix)]
fn thread_time_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Returns the wall-clock time (s), on systems without a clock of the thread's processor time.
#[cfg(not(unix))]
fn thread_time_s() -> f64 {
    /// The first call of this function.
    static FIRST_CALL: std::sync::LazyLock<std::time::Instant> =
        std::sync::LazyLock::new(std::time::Instant::now);
    FIRST_CALL.elapsed().as_secs_f64()
}

/// Returns the memory (bytes) of a run: that of the chunks in progress, or that of a row group of
/// the result, which is written after them.
fn memory_bytes(engine: &ModelEngine<'_>, threads: usize) -> f64 {
    let plan = engine.plan();
    let channel_count = plan.reliability.channels.len() as f64;
    let outcome_bytes = size_of::<Outcome>() as f64 + 2.0 * 8.0 * channel_count;
    let chunk_bytes = (2 * threads + 1) as f64 * chunk_points(plan.points()) as f64 * outcome_bytes;
    let column_count = Job::new(plan).layout.schema().fields().len() as f64;
    let row_group_rows = sweep_engine::store::schema::ROW_GROUP_ROWS as f64;
    let row_group_bytes =
        row_group_rows.min(plan.points() as f64) * column_count * (8.0 + ENCODING_BYTES_PER_CELL);
    PROGRAM_BYTES + chunk_bytes.max(row_group_bytes) + turn_peak_bytes(engine, threads)
}

/// Returns the memory (bytes) of the peaks by turn of the drum, of both models and of all points
/// that are in progress.
fn turn_peak_bytes(engine: &ModelEngine<'_>, threads: usize) -> f64 {
    let plan = engine.plan();
    if !plan.model.measures.recorders().with_turns {
        return 0.0;
    }
    let turn_count = plan.model.spin.turns_within(plan.window_s);
    let row_count = engine.max_rows_in_flight(threads) as f64;
    row_count * 2.0 * turn_count * size_of::<Deviations>() as f64
}

/// Returns a description of the method, with its steps or levels.
fn describe_method(plan: &Plan, levels: &RefinementLevels) -> String {
    let steps_text = match plan.integrator.steps() {
        Steps::Fixed(step_s) => {
            // Steps end at both window edges and at the end, so the number in each part is rounded
            // up.
            let part_ends_s = [0.0, plan.window_s[0], plan.window_s[1], plan.end_s];
            let step_count: f64 =
                part_ends_s.windows(2).map(|edge| ((edge[1] - edge[0]) / step_s).ceil()).sum();
            format!(": about {step_count} steps per trajectory, two trajectories per point")
        }
        Steps::ByError => ": steps as it needs".to_owned(),
        Steps::Checked(_) => {
            let first_description = levels.levels[0].describe(ModelKind::Nonlinear);
            let last_description =
                levels.levels[levels.levels.len() - 1].describe(ModelKind::Nonlinear);
            let level_count = levels.levels.len();
            let note = levels.note.as_ref().map(|note| format!("\n            {note}"));
            let note = note.unwrap_or_default();
            format!(
                ", until two of {level_count} levels agree: {first_description}\n            to \
                 {last_description}{note}"
            )
        }
    };
    format!("{}{steps_text}", plan.integrator)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the plan of a grid of `count` points over `end_s`.
    fn plan_by_rk4(count: u64, end_s: f64) -> Plan {
        plan_by_method("", "\"rk4\"\nstep_s = 2e-4", count, end_s)
    }

    fn plan_by_method(top_keys: &str, method: &str, count: u64, end_s: f64) -> Plan {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        let grid = format!(
            "{top_keys}[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = \
             50\n[time]\nend_s = {end_s}\n\
             [integrator]\nmethod = {method}\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.0, count \
             = {count} }}\n"
        );
        std::fs::write(&path, grid).unwrap();
        crate::config::load(&path, &[]).unwrap()
    }

    #[test]
    fn an_estimate_reports_the_integrated_time() {
        // Short trajectories are measured whole, long ones by their beginnings.
        for (end_s, sampled_whole) in [(0.01, true), (1e5, false)] {
            let plan = plan_by_rk4(16, end_s);
            let estimate = estimate(&plan, 1).unwrap();
            assert!(estimate.wall_s.is_finite() && estimate.wall_s > 0.0, "{estimate:?}");
            assert_eq!(estimate.sampled_s >= end_s, sampled_whole, "{estimate:?}");
            assert_eq!(estimate.threads, 1);
        }
    }

    #[test]
    fn whole_trajectories_are_measured_if_there_is_time() {
        let plan = plan_by_method("", "\"rk4-mass-scaled\"", 16, 50.0);
        assert_eq!(estimate_within(&plan, 1, f64::INFINITY).unwrap().sampled_s, plan.end_s);
        // With friction a point takes a tenth of a second and more.
        let plan = plan_by_method("[set]\nfriction_n = 30\n", "\"rk4-mass-scaled\"", 16, 50.0);
        assert_eq!(estimate(&plan, 1).unwrap().sampled_s, plan.end_s);
        let long_plan = plan_by_method("", "\"rk4-mass-scaled\"", 16, 1e5);
        assert!(estimate_within(&long_plan, 1, 0.0).unwrap().sampled_s < long_plan.end_s);
    }

    #[test]
    fn held_speeds_cost_the_same_however_long_the_run_is() {
        let top = "metrics = [\"growth\"]\nstability = { speed_rpm = \"250,300\" }\n";
        let plan = plan_by_method(top, "\"rk4-mass-scaled\"", 16, 50.0);
        let [whole_cost_s, beginning_cost_s] = [f64::INFINITY, 0.0]
            .map(|whole_s| estimate_within(&plan, 1, whole_s).unwrap().core_s_per_point);
        // Beginnings overestimate a method with levels by a factor of some 20. If the cost of held
        // speeds were multiplied with the length, the factor would be 100,000.
        assert!(
            beginning_cost_s < 300.0 * whole_cost_s,
            "{beginning_cost_s} s a point from a beginning, actually {whole_cost_s} s"
        );
    }

    #[test]
    fn other_work_on_the_computer_is_not_counted() {
        // The first estimate is from beginnings, the second from whole trajectories.
        for end_s in [1e5, 5.0] {
            let plan = plan_by_rk4(16, end_s);
            // The least of three, because other programs are at work in any case.
            let least_cost = || {
                let costs = (0..3).map(|_| estimate(&plan, 1).unwrap().core_s_per_point);
                costs.fold(f64::INFINITY, f64::min)
            };
            let alone_s = least_cost();
            let is_over = std::sync::atomic::AtomicBool::new(false);
            let beside_s = std::thread::scope(|scope| {
                for _ in 0..8 * sweep_engine::threads::count_cores() {
                    scope.spawn(|| {
                        while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                            std::hint::spin_loop();
                        }
                    });
                }
                let beside_s = least_cost();
                is_over.store(true, std::sync::atomic::Ordering::Relaxed);
                beside_s
            });
            // A ninth of a core is left for the estimate.
            assert!(beside_s < 3.0 * alone_s, "{beside_s} s beside others, {alone_s} s alone");
        }
    }

    #[test]
    fn time_grows_with_points_and_memory_does_not() {
        let plans = [plan_by_rk4(1_000_000, 0.01), plan_by_rk4(1_000_000_000, 0.01)];
        let [small_estimate, large_estimate] = plans.map(|plan| estimate(&plan, 1).unwrap());
        assert!(
            large_estimate.wall_s > small_estimate.wall_s,
            "{small_estimate:?} {large_estimate:?}"
        );
        assert!(
            large_estimate.memory_bytes < 1.2 * small_estimate.memory_bytes,
            "{small_estimate:?} {large_estimate:?}"
        );
        assert!(large_estimate.memory_bytes < 200e6, "{large_estimate:?}");
        // Larger parts have a smaller share of what is not cells.
        let disk_ratio = large_estimate.disk_bytes / small_estimate.disk_bytes;
        assert!((950.0..1000.0).contains(&disk_ratio), "{disk_ratio}");
    }
}
