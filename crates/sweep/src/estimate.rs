//! The cost of a run: time, from a few points integrated on the spot; memory and disk, from what is
//! held at once.

use lane_ode::MAX_LANES;
use washer_model::ModelKind;
use washer_row::{Deviations, Metric, Outcome, ROW_STATUSES, RefinementLevels, row_status};

use crate::engine::ModelEngine;
use crate::plan::Plan;
use sweep_engine::method::{Integrator as _, Steps};
use sweep_engine::plan::shortest_step_s;
use sweep_engine::store::chunk_points;
use sweep_engine::store::read::{NameCounts, add};
use sweep_engine::{Engine, Error, Estimate, Interrupt, Job, RunContext};

/// Integration goes on with longer and longer beginnings of a trajectory until one takes this long,
/// in seconds.
const LONG_ENOUGH_S: f64 = 0.2;

/// Whole trajectories are given up after this time.
const WHOLE_S: f64 = 4.0;

/// The first beginning that is tried by a method that chooses its steps: at most [`FIRST_STEPS`] of
/// them.
const FIRST_END_S: f64 = 1e-3;
const FIRST_STEPS: f64 = 1e4;

/// Where whole trajectories are so short that more of them fit, as many are integrated together as
/// take this long if they cost as much as the first few.
const TOGETHER_S: f64 = 2.0;
const MOST_TOGETHER: u64 = 64;

/// Multiples of the golden section spread evenly over a unit, and repeat nothing.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// The program, its libraries and its buffers, before any point (measured: docs/scaling.md).
const BASE_BYTES: f64 = 14e6;

/// What a cell of a row group takes while it is encoded, besides its own 8 bytes (measured:
/// docs/scaling.md).
const CELL_BYTES: f64 = 5.0;

/// What a column of a result takes besides its cells, with its share of the plan: 767 and 768 bytes
/// in results of one point with 35 and 40 columns.
const RESULT_COLUMN_BYTES: f64 = 800.0;

/// The bytes that a column of a part takes besides its cells. Basis: 282 bytes in parts of eight
/// points with 36 columns. Doubling it doubles the disk that small chunks are said to take.
const PART_COLUMN_BYTES: f64 = 300.0;

/// Integrates some points of the plan, for some seconds at most, and reckons from there for so many
/// threads.
///
/// # Errors
/// What keeps a run from having an engine.
pub(crate) fn of(plan: &Plan, threads: usize) -> Result<Estimate, Error> {
    reckoned(plan, threads, WHOLE_S)
}

/// As [`of`], where whole trajectories are given up after a time.
fn reckoned(plan: &Plan, threads: usize, whole_s: f64) -> Result<Estimate, Error> {
    let engine = ModelEngine::new(plan)?;
    // The search for levels is no cost of points.
    engine.levels();
    let first = Measured::take(&engine, whole_s);
    let Measured { core_s_per_point, sampled, integrated_s } =
        Measured::spread(&engine, &first).unwrap_or(first);
    let chunk = chunk_points(plan.points());
    let layout = &Job::of(plan).layout;
    let row_bytes = plan.points() as f64 * layout.bytes_a_row() as f64;
    let columns = layout.schema().fields().len() as f64;
    let parts = plan.points().div_ceil(chunk) as f64;
    // A chunk is one thread's work, so the last round of chunks may leave threads without any.
    let rounds = plan.points().div_ceil(chunk).div_ceil(threads as u64);
    let points_a_thread = (rounds * chunk).min(plan.points());
    Ok(Estimate {
        simd: engine.simd().to_owned(),
        threads,
        wall_s: points_a_thread as f64 * core_s_per_point,
        core_s_per_point,
        sampled,
        sampled_s: integrated_s,
        memory_bytes: memory_bytes(&engine, threads),
        disk_bytes: row_bytes + parts * columns * PART_COLUMN_BYTES,
        result_bytes: row_bytes + columns * RESULT_COLUMN_BYTES,
        method: method(plan, &engine.levels()[0]),
    })
}

/// The cost measured of some points.
struct Measured {
    core_s_per_point: f64,
    /// Points, by status.
    sampled: NameCounts,
    integrated_s: f64,
}

impl Measured {
    fn take(engine: &ModelEngine<'_>, whole_s: f64) -> Self {
        let plan = engine.plan();
        let points = plan.points().min(MAX_LANES as u64);
        // What checks itself costs most where little moves, so that a beginning says too much.
        if let Steps::Checked(_) = plan.integrator.steps()
            && let Some((cost_s, sampled)) = cost_within(whole_s, engine, points)
        {
            let core_s_per_point = cost_s / points as f64;
            return Self { core_s_per_point, sampled, integrated_s: plan.end_s };
        }
        let mut shorter: Option<(f64, f64)> = None;
        let mut end_s = first_end_s(plan);
        let mut cut = plan.clone();
        // What held speeds cost does not grow with the length either, and drowns what does.
        let mut held_s = 0.0;
        loop {
            cut.end_s = end_s;
            cut.window_s = plan.window_s.map(|edge_s| (edge_s * (end_s / plan.end_s)).min(end_s));
            // The cut plan's own levels would be of slower spin, and longer steps.
            let (cost_s, sampled) = cost_of(&engine.for_plan(&cut), points);
            let of_length = |metric: &Metric| !matches!(metric, Metric::Growth | Metric::Dwell);
            if !cut.model.measures.metrics.iter().all(of_length) {
                cut.model.measures.metrics.retain(of_length);
                held_s = cost_s;
                continue;
            }
            if end_s >= plan.end_s || cost_s >= LONG_ENOUGH_S {
                // What does not grow with the length (the equilibrium) must not be multiplied.
                let (base_end_s, base_s) = shorter.unwrap_or((0.0, 0.0));
                let rate = ((cost_s - base_s) / (end_s - base_end_s)).max(0.0);
                let whole_s = held_s + cost_s + rate * (plan.end_s - end_s);
                let core_s_per_point = whole_s / points as f64;
                return Self { core_s_per_point, sampled, integrated_s: end_s };
            }
            shorter = Some((end_s, cost_s));
            end_s = (4.0 * end_s).min(plan.end_s);
        }
    }

    /// Whole trajectories of more points, integrated together: the rows that are left to a finer
    /// level then share its lanes, as in the run. Few points leave such lanes empty, and cost
    /// several times as much each.
    fn spread(engine: &ModelEngine<'_>, first: &Self) -> Option<Self> {
        let plan = engine.plan();
        let affordable = (TOGETHER_S / first.core_s_per_point) as u64;
        let points = affordable.min(MOST_TOGETHER).min(plan.points());
        if first.integrated_s < plan.end_s || points <= first.sampled.values().sum() {
            return None;
        }
        let (cost_s, sampled) = cost_of(engine, points);
        let core_s_per_point = cost_s / points as f64;
        Some(Self { core_s_per_point, sampled, integrated_s: plan.end_s })
    }
}

/// A beginning of the run so short that any method is through it in milliseconds, however stiff the
/// machine.
fn first_end_s(plan: &Plan) -> f64 {
    let short_s = match plan.integrator.steps() {
        Steps::Fixed(step_s) => 100.0 * step_s,
        Steps::ByError | Steps::Checked(_) => {
            FIRST_END_S.min(FIRST_STEPS * shortest_step_s(plan.end_s))
        }
    };
    short_s.min(plan.end_s)
}

/// Time (s) that one core takes for so many points' runs, and how they end.
fn cost_of(engine: &ModelEngine<'_>, points: u64) -> (f64, NameCounts) {
    cost_within(f64::INFINITY, engine, points).unwrap_or((f64::INFINITY, NameCounts::new()))
}

/// The same, if they are done by then. One lies in each of as many equal parts of the grid, here
/// and there in it: at even distances all might have the same value of an axis.
fn cost_within(most_s: f64, engine: &ModelEngine<'_>, points: u64) -> Option<(f64, NameCounts)> {
    let plan = engine.plan();
    let part = plan.points() as f64 / points as f64;
    let place = |k| ((k as f64 + (k as f64 * GOLDEN).fract()) * part) as u64;
    let axis_values: Vec<Vec<f64>> = (0..points).map(|k| plan.axis_values(place(k))).collect();
    let began_s = busy_s();
    let is_late = || busy_s() - began_s > most_s;
    let interrupt = Interrupt::new();
    let outcomes = engine
        .evaluate_in_context(&axis_values, &RunContext::with_time_limit(&interrupt, &is_late))?;
    let cost_s = busy_s() - began_s;
    let mut sampled = NameCounts::new();
    outcomes.iter().for_each(|outcome| add(&mut sampled, ROW_STATUSES[row_status(outcome).0]));
    Some((cost_s, sampled))
}

/// Time that this thread has had a core for: what others do on the machine meanwhile is no cost of
/// the plan.
#[cfg(unix)]
fn busy_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Time on the wall, where the system has no other clock that is known here.
#[cfg(not(unix))]
fn busy_s() -> f64 {
    static BEGAN: std::sync::LazyLock<std::time::Instant> =
        std::sync::LazyLock::new(std::time::Instant::now);
    BEGAN.elapsed().as_secs_f64()
}

/// Chunks in hand and on their way to the disk, then one row group of the result.
fn memory_bytes(engine: &ModelEngine<'_>, threads: usize) -> f64 {
    let plan = engine.plan();
    let channels = plan.reliability.channels.len() as f64;
    let outcome = size_of::<Outcome>() as f64 + 2.0 * 8.0 * channels;
    let in_hand = (2 * threads + 1) as f64 * chunk_points(plan.points()) as f64 * outcome;
    let columns = Job::of(plan).layout.schema().fields().len() as f64;
    let row_group = sweep_engine::store::schema::ROW_GROUP_ROWS as f64;
    let joining = row_group.min(plan.points() as f64) * columns * (8.0 + CELL_BYTES);
    BASE_BYTES + in_hand.max(joining) + turn_bytes(engine, threads)
}

/// Peaks by turn of the drum, both models', of the points that go through each thread's lanes
/// together.
fn turn_bytes(engine: &ModelEngine<'_>, threads: usize) -> f64 {
    let plan = engine.plan();
    if !plan.model.measures.recorders().turns {
        return 0.0;
    }
    let turns = plan.model.spin.turns_within(plan.window_s);
    let rows = engine.max_rows_in_flight(threads) as f64;
    rows * 2.0 * turns * size_of::<Deviations>() as f64
}

/// How the method goes about it, in words.
fn method(plan: &Plan, levels: &RefinementLevels) -> String {
    let steps = match plan.integrator.steps() {
        Steps::Fixed(step_s) => {
            // Both window edges and the end are hit exactly, so each stretch rounds up.
            let edges = [0.0, plan.window_s[0], plan.window_s[1], plan.end_s];
            let steps: f64 =
                edges.windows(2).map(|edge| ((edge[1] - edge[0]) / step_s).ceil()).sum();
            format!(": about {steps} steps per trajectory, two trajectories per point")
        }
        Steps::ByError => ": steps as it needs".to_owned(),
        Steps::Checked(_) => {
            let first = levels.levels[0].describe(ModelKind::Nonlinear);
            let last = levels.levels[levels.levels.len() - 1].describe(ModelKind::Nonlinear);
            let count = levels.levels.len();
            let note = levels.note.as_ref().map(|note| format!("\n            {note}"));
            let note = note.unwrap_or_default();
            format!(", until two of {count} levels agree: {first}\n            to {last}{note}")
        }
    };
    format!("{}{steps}", plan.integrator)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of `count` points over `end_s`.
    fn plan(count: u64, end_s: f64) -> Plan {
        plan_by("", "\"rk4\"\nstep_s = 2e-4", count, end_s)
    }

    fn plan_by(top: &str, method: &str, count: u64, end_s: f64) -> Plan {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        let grid = format!(
            "{top}[spin]\nprofile = \"triangular\"\npeak_rpm = 350\nramp_s = 50\n[time]\nend_s = \
             {end_s}\n\
             [integrator]\nmethod = {method}\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nrange = {{ from = 0.1, to = 1.0, count \
             = {count} }}\n"
        );
        std::fs::write(&path, grid).unwrap();
        crate::config::load(&path, &[]).unwrap()
    }

    #[test]
    fn an_estimate_tells_what_it_was_made_from() {
        // Whole trajectories, and beginnings of longer ones.
        for (end_s, sampled_whole) in [(0.01, true), (1e5, false)] {
            let plan = plan(16, end_s);
            let estimate = of(&plan, 1).unwrap();
            assert!(estimate.wall_s.is_finite() && estimate.wall_s > 0.0, "{estimate:?}");
            assert_eq!(estimate.sampled_s >= end_s, sampled_whole, "{estimate:?}");
            assert_eq!(estimate.threads, 1);
        }
    }

    #[test]
    fn checked_rows_are_measured_whole_where_there_is_time() {
        let plan = plan_by("", "\"rk4-mass-scaled\"", 16, 50.0);
        assert_eq!(reckoned(&plan, 1, f64::INFINITY).unwrap().sampled_s, plan.end_s);
        // With friction a point takes a tenth of a second and more.
        let plan = plan_by("[set]\nfriction_n = 30\n", "\"rk4-mass-scaled\"", 16, 50.0);
        assert_eq!(of(&plan, 1).unwrap().sampled_s, plan.end_s);
        let long = plan_by("", "\"rk4-mass-scaled\"", 16, 1e5);
        assert!(reckoned(&long, 1, 0.0).unwrap().sampled_s < long.end_s);
    }

    #[test]
    fn held_speeds_cost_the_same_however_long_the_run_is() {
        let top = "metrics = [\"growth\"]\nstability = { speed_rpm = \"250,300\" }\n";
        let plan = plan_by(top, "\"rk4-mass-scaled\"", 16, 50.0);
        let [whole, begun] = [f64::INFINITY, 0.0]
            .map(|whole_s| reckoned(&plan, 1, whole_s).unwrap().core_s_per_point);
        // Checked rows cost most where little moves, some 20 times as much; held speeds that are
        // multiplied with the length are 100,000 times too dear.
        assert!(begun < 300.0 * whole, "{begun} s a point from a beginning, {whole} s in truth");
    }

    #[test]
    fn work_beside_it_is_not_counted() {
        // Estimates of beginnings, then of whole trajectories.
        for end_s in [1e5, 5.0] {
            let plan = plan(16, end_s);
            // The least of some, because others are at work in any case.
            let least = || {
                let reckoned = (0..3).map(|_| of(&plan, 1).unwrap().core_s_per_point);
                reckoned.fold(f64::INFINITY, f64::min)
            };
            let alone_s = least();
            let is_over = std::sync::atomic::AtomicBool::new(false);
            let beside_s = std::thread::scope(|scope| {
                for _ in 0..8 * sweep_engine::threads::cores() {
                    scope.spawn(|| {
                        while !is_over.load(std::sync::atomic::Ordering::Relaxed) {
                            std::hint::spin_loop();
                        }
                    });
                }
                let beside_s = least();
                is_over.store(true, std::sync::atomic::Ordering::Relaxed);
                beside_s
            });
            // A ninth of a core was left for it.
            assert!(beside_s < 3.0 * alone_s, "{beside_s} s beside others, {alone_s} s alone");
        }
    }

    #[test]
    fn time_grows_with_points_and_memory_does_not() {
        let (small, large) = (plan(1_000_000, 0.01), plan(1_000_000_000, 0.01));
        let [small, large] = [&small, &large].map(|plan| of(plan, 1).unwrap());
        assert!(large.wall_s > small.wall_s, "{small:?} {large:?}");
        assert!(large.memory_bytes < 1.2 * small.memory_bytes, "{small:?} {large:?}");
        assert!(large.memory_bytes < 200e6, "{large:?}");
        // Larger parts have a smaller share of what is not cells.
        let growth = large.disk_bytes / small.disk_bytes;
        assert!((950.0..1000.0).contains(&growth), "{growth}");
    }
}
