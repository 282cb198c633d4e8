//! Time histories of both models at one point or at all points of a plan, as a table.

mod columns;
mod point_files;

use std::collections::BTreeMap;
use std::iter::repeat_n;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde_json::{Value, json};
use washer_model::{
    COORDINATES, History, HistoryRequest, InitialDeviation, Method, ModelKind, NoEquilibrium,
    Point, PointInput, Spin, StepSelector, Timing, histories_per_batch, instant_count,
    integrate_histories,
};

use crate::engine::{CappedRun, reference_method};
use crate::method::{direct_method, rk4};
use crate::plan::{Plan, friction_speeds, point_input, prepare_point};
use lane_ode::Cancel;
use sweep_engine::config::NamedValues;
use sweep_engine::{Error, Table, threads};
use sweep_files::key;
use washer_row::MethodKind;

use columns::add_columns;
pub(crate) use point_files::{MAX_POINT_TRACES, write_point_traces};

/// Maximum number of instants of a trace, over all points. Basis: both models' states in memory,
/// some 0.5 GB. Doubling it doubles that.
const MAX_INSTANTS: f64 = 2e6;

/// The quantities that a trace has besides channels, gap and speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraceExtras {
    /// Rates and accelerations of the channels.
    pub rates: bool,
    /// Coordinates and their speeds.
    pub states: bool,
    /// Forces of the elements between cabinet and tub, their sum, and what the feet carry.
    pub forces: bool,
    /// The drum's angle.
    pub angle: bool,
}

/// The initial value of a coordinate or of its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StartValue {
    is_speed: bool,
    /// The number of the coordinate, from 0.
    index: usize,
    value: f64,
}

/// Maximum initial distance from equilibrium of a coordinate (m or rad). Basis: a right angle, and
/// the size of a machine. Doubling it admits starts that no washing machine can have.
const MAX_START_DEVIATION: f64 = 1.5;

/// Parses an initial value such as `q5=0.1`.
///
/// # Errors
/// Returns a description of the expected text.
pub(crate) fn parse_start_value(text: &str) -> Result<StartValue, String> {
    let expected =
        "expected a coordinate q1 to q10 or a speed u1 to u10 with its value, as in q5=0.1";
    let (name, value) = text.split_once('=').ok_or(expected)?;
    let (is_speed, number_text) = match name.trim().split_at_checked(1) {
        Some(("q", number_text)) => (false, number_text),
        Some(("u", number_text)) => (true, number_text),
        _ => return Err(expected.to_owned()),
    };
    let coordinate_number =
        number_text.parse().ok().filter(|number| (1..=COORDINATES).contains(number));
    let index = coordinate_number.ok_or(expected)? - 1;
    let value = value.trim().parse().ok().filter(|value: &f64| value.is_finite());
    let value = value.ok_or(expected)?;
    if !is_speed && value.abs() > MAX_START_DEVIATION {
        return Err(format!("expected at most {MAX_START_DEVIATION} m or rad from equilibrium"));
    }
    Ok(StartValue { is_speed, index, value })
}

/// Returns the start with these values, and all other coordinates at equilibrium.
pub(crate) fn start_from(values: &[StartValue]) -> InitialDeviation {
    let mut start = InitialDeviation::default();
    for StartValue { is_speed, index, value } in values {
        if *is_speed { start.speeds[*index] = *value } else { start.deviations[*index] = *value }
    }
    start
}

/// Returns `every_s`, the time between two instants, if the traces of all points have at most
/// [`MAX_INSTANTS`]. `None` stands for one instant a turn of the drum.
///
/// # Errors
/// Returns [`Error::Refused`] if there are more, and if `every_s` is longer than the run.
pub(crate) fn check_spacing(every_s: Option<f64>, plan: &Plan) -> Result<Option<f64>, Error> {
    let point_count = plan.points();
    let Some(every_s) = every_s else {
        let mut instant_count = 0.0;
        for point in 0..point_count {
            // The start is an instant, too.
            instant_count += 1.0
                + point_input(plan, &plan.axis_values(point)).spin.turns_within([0.0, plan.end_s]);
            if instant_count > MAX_INSTANTS {
                let expected = format!(
                    "at most {MAX_INSTANTS} turns of the drum, over all points: an earlier end_s, \
                     or fewer points"
                );
                return Err(Error::option("--turns", format!("to {} s", plan.end_s), expected));
            }
        }
        return Ok(None);
    };
    let least_spacing_s = plan.end_s * point_count as f64 / MAX_INSTANTS;
    if (least_spacing_s..=plan.end_s).contains(&every_s) {
        return Ok(Some(every_s));
    }
    Err(Error::option("--every", every_s, format!("from {least_spacing_s:e} to {} s", plan.end_s)))
}

/// The models, the instants and the quantities of a trace.
pub(crate) struct TraceSettings {
    /// The time between two instants (s). `None` stands for one instant a turn, where the unbalance
    /// is up.
    pub(crate) every_s: Option<f64>,
    pub(crate) models: Models,
    /// The initial state of both models.
    pub(crate) start: InitialDeviation,
    pub(crate) extras: TraceExtras,
    /// The method of the point's row with its capped modes, for a trace that repeats the row's
    /// trajectory; `None` for a trace by the plan's or the reference method.
    pub(crate) capped: Option<CappedRun>,
}

/// The models that are integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Models {
    #[default]
    Both,
    Nonlinear,
    Linear,
}

impl Models {
    fn model_kinds(self) -> &'static [ModelKind] {
        match self {
            Self::Both => &ModelKind::ALL,
            Self::Nonlinear => &[ModelKind::Nonlinear],
            Self::Linear => &[ModelKind::Linear],
        }
    }
}

/// The histories of one point, or those of all points of a plan one below the other.
pub(crate) struct TraceTable {
    pub(crate) table: Table,
    /// The number of instants, which is that of the table's rows.
    pub(crate) instants: usize,
    /// A message for each integration that failed.
    pub(crate) failures: Vec<String>,
    /// The kind of the nonlinear model's method; `None` for several points.
    pub(crate) method: Option<MethodKind>,
}

/// Computes the histories of a plan's only point, which these parameters name, or those of all
/// points without parameters. Uses a thread pool, or the calling thread if the system starts no
/// threads; the results have the same bits.
///
/// # Errors
/// Returns [`NoEquilibrium`] if the only point has none.
pub(crate) fn trace_in_pool(
    plan: &Plan,
    parameters: Option<NamedValues>,
    settings: &TraceSettings,
    cancel: Cancel<'_>,
) -> Result<TraceTable, NoEquilibrium> {
    // A single point has at most two integrations, one of each model.
    let thread_count = if parameters.is_some() { 2 } else { threads::count_cores() };
    let compute_table = || match parameters {
        Some(parameters) => trace_one_point(plan, 0, parameters, settings, cancel),
        None => Ok(trace_all_points(plan, settings, cancel)),
    };
    match threads::build_pool(thread_count) {
        Ok(pool) => pool.install(compute_table),
        Err(_) => compute_table(),
    }
}

/// Integrates the models of a point from 0 to the end of the run; both at once in a thread pool.
///
/// The parameters name the point in the metadata. Once `cancel` is requested, the integration ends
/// early and the result is meaningless.
///
/// # Errors
/// Returns [`NoEquilibrium`] if the machine has none.
pub(crate) fn trace_one_point(
    plan: &Plan,
    point: u64,
    parameters: NamedValues,
    settings: &TraceSettings,
    cancel: Cancel<'_>,
) -> Result<TraceTable, NoEquilibrium> {
    let run = TraceRun::new(plan, point, settings)?;
    let runs = [&run];
    let models = integrate(&runs, settings.models, cancel);
    let mut table = Table::new(crate::identity::BUILD);
    let failures = add_columns(&mut table, &runs, &models, settings.extras);
    let failure_of_model = |kind: ModelKind| {
        let model_index = settings.models.model_kinds().iter().position(|known| *known == kind);
        model_index.and_then(|model_index| failures[model_index][0].clone())
    };
    table.add_metadata(key::PLAN, &plan.to_json());
    let mut trace_metadata = json!({
        "at": parameters.into_iter().collect::<BTreeMap<_, _>>(),
        "every_s": settings.every_s,
        "equilibrium": json_of_coordinates('q', run.point.equilibrium()),
        "start": start_json(&settings.start),
        "integrator": run.method_json,
        "nonlinear_failure": failure_of_model(ModelKind::Nonlinear),
        "linear_failure": failure_of_model(ModelKind::Linear),
    });
    let friction_speeds = friction_speeds(&run.point);
    if !friction_speeds.is_empty() {
        trace_metadata["friction_speeds_m_per_s"] = friction_speeds.into();
    }
    table.add_metadata(key::TRACE, &trace_metadata);
    let failures = failures.into_iter().flatten().flatten().collect();
    Ok(TraceTable {
        table,
        instants: run.times_s.len(),
        failures,
        method: Some(run.methods[0].kind),
    })
}

/// Computes the traces of all points of a plan, in one table with the points' numbers and axes.
/// Points are integrated together in groups that fill the lanes; the bits of each are those of a
/// trace of the point alone. A point without equilibrium has no rows, and a message among the
/// failures.
pub(crate) fn trace_all_points(
    plan: &Plan,
    settings: &TraceSettings,
    cancel: Cancel<'_>,
) -> TraceTable {
    let mut failures = Vec::new();
    let mut numbered_runs = Vec::new();
    for number in 0..plan.points() {
        match TraceRun::new(plan, number, settings) {
            Ok(run) => numbered_runs.push((number, run)),
            Err(error) => failures.push(format!("point {number}: {error}")),
        }
    }
    let runs: Vec<&TraceRun> = numbered_runs.iter().map(|(_, run)| run).collect();
    let models = integrate(&runs, settings.models, cancel);
    let mut table = Table::new(crate::identity::BUILD);
    let point_and_row_counts =
        || numbered_runs.iter().map(|(number, run)| (*number, run.times_s.len()));
    let point_numbers = point_and_row_counts().flat_map(|(number, count)| repeat_n(number, count));
    table.add_counts("point", "number of the point in its grid", point_numbers);
    for (k, axis) in plan.axes.iter().enumerate() {
        let axis_values = point_and_row_counts()
            .flat_map(|(number, count)| repeat_n(plan.axis_values(number).get(k).copied(), count));
        table.add_parameter(&axis.parameter, axis_values);
    }
    let failures_by_model = add_columns(&mut table, &runs, &models, settings.extras);
    for (k, (number, _)) in numbered_runs.iter().enumerate() {
        let messages = failures_by_model.iter().filter_map(|model| model[k].as_deref());
        failures.extend(messages.map(|text| format!("point {number}: {text}")));
    }
    table.add_metadata(key::PLAN, &plan.to_json());
    let trace_metadata =
        json!({ "every_s": settings.every_s, "start": start_json(&settings.start) });
    table.add_metadata(key::TRACE, &trace_metadata);
    let instants = runs.iter().map(|run| run.times_s.len()).sum();
    TraceTable { table, instants, failures, method: None }
}

/// A point that is prepared for integration.
struct TraceRun {
    point: Point,
    spin: Spin,
    start: InitialDeviation,
    /// The method of the nonlinear model, and that of the linear one.
    methods: [Method; 2],
    method_json: Value,
    times_s: Vec<f64>,
}

impl TraceRun {
    fn new(plan: &Plan, point: u64, settings: &TraceSettings) -> Result<Self, NoEquilibrium> {
        let PointInput { machine, spin, window_s } = point_input(plan, &plan.axis_values(point));
        let checkpoints = settings.capped.map_or(0, |capped| capped.checkpoints);
        let timing = Timing { end_s: plan.end_s, window_s, checkpoints };
        let point = prepare_point(machine, spin.clone(), &timing)?;
        let (methods, method_json) = choose_methods(plan, &point, &spin, settings.capped);
        let times_s = match settings.every_s {
            Some(every_s) => {
                (0..instant_count(plan.end_s, every_s)).map(|k| k as f64 * every_s).collect()
            }
            None => spin.whole_turn_times_s(plan.end_s),
        };
        Ok(Self { point, spin, start: settings.start, methods, method_json, times_s })
    }
}

/// Returns each model's histories of the runs. The threads of the pool take groups of runs that
/// fill the lanes.
fn integrate<'a>(
    runs: &[&'a TraceRun],
    models: Models,
    cancel: Cancel<'_>,
) -> Vec<(ModelKind, Vec<History<'a>>)> {
    let model_kinds = models.model_kinds();
    let groups: Vec<(ModelKind, &[&'a TraceRun])> = model_kinds
        .iter()
        .flat_map(|&kind| runs.chunks(histories_per_batch()).map(move |runs| (kind, runs)))
        .collect();
    let integrate_group = |&(kind, runs): &(ModelKind, &[&'a TraceRun])| {
        let requests = runs.iter().map(|run| HistoryRequest {
            point: &run.point,
            method: run.methods[usize::from(kind == ModelKind::Linear)],
            initial_deviation: run.start,
            times_s: run.times_s.clone(),
        });
        integrate_histories(kind, requests.collect(), cancel)
    };
    let grouped_histories: Vec<Vec<History<'a>>> = match rayon::current_thread_index() {
        Some(_) => groups.par_iter().map(integrate_group).collect(),
        // Outside of a pool rayon would start its global one, and panic if the system has no
        // threads.
        None => groups.iter().map(integrate_group).collect(),
    };
    let mut all_histories = grouped_histories.into_iter().flatten();
    model_kinds
        .iter()
        .map(|&kind| (kind, all_histories.by_ref().take(runs.len()).collect()))
        .collect()
}

fn start_json(start: &InitialDeviation) -> Value {
    json!({
        "deviations": json_of_coordinates('q', &start.deviations),
        "speeds": json_of_coordinates('u', &start.speeds),
    })
}

/// Returns ten numbers with the names q1 to q10, or u1 to u10, by the letter.
fn json_of_coordinates(letter: char, values: &[f64; COORDINATES]) -> Value {
    (1..).zip(values).map(|(i, value)| (format!("{letter}{i}"), *value)).collect()
}

/// Returns the methods of the nonlinear and the linear model, and a description of the former. With
/// `capped` they are those of a map's row, which caps fast modes. Otherwise a plan that chooses
/// levels by error gets the reference method, without capped modes.
fn choose_methods(
    plan: &Plan,
    point: &Point,
    spin: &Spin,
    capped: Option<CappedRun>,
) -> ([Method; 2], Value) {
    let method_json_with_row = |[nonlinear, _]: &[Method; 2]| {
        let mut method_json = plan.integrator.to_json();
        method_json["row"] = nonlinear.kind.name().into();
        method_json
    };
    if let Some(CappedRun { methods, .. }) = capped {
        return (methods, method_json_with_row(&methods));
    }
    if let Some(method) = direct_method(&plan.integrator) {
        return ([method; 2], plan.integrator.to_json());
    }
    let step_selector = StepSelector::new([(point, spin)], plan.end_s);
    let methods = ModelKind::ALL.map(|model| reference_method(&step_selector, model));
    let method_json = match methods[0].kind {
        MethodKind::Rk4 => rk4(methods[0].step_s).to_json(),
        _ => method_json_with_row(&methods),
    };
    (methods, method_json)
}

#[cfg(test)]
mod tests;
