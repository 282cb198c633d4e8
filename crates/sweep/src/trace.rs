//! Time histories of both models at one point or at all of a plan, as a table.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::iter::repeat_n;
use std::path::Path;

use lane_ode::Failure;
use rayon::iter::{
    IndexedParallelIterator as _, IntoParallelIterator as _, IntoParallelRefIterator as _,
    ParallelIterator as _,
};
use serde_json::{Value, json};
use washer_model::{
    Asked, COORDINATES, Channel, Forces, History, Instant, Method, ModelKind, NoEquilibrium, Point,
    Spin, Start, StepSelector, Timing, histories, instants, together,
};

use crate::engine::{CappedRun, ModelEngine, reference};
use crate::method::Integrator;
use crate::model::Washer;
use crate::plan::{Plan, Scenario, friction_speeds, ready};
use sweep_engine::config::NamedValues;
use sweep_engine::method::Integrator as _;
use sweep_engine::store::read;
use sweep_engine::threads::Cancel;
use sweep_engine::{Error, StoreError, Table, threads};
use sweep_files::{self as files, FileKind, ParquetFile, key, regular};
use washer_row::Level;

/// Most instants that are kept: some 5 GB of both models' states in memory would be ten times as
/// many.
const MOST_INSTANTS: f64 = 2e6;

/// An angle so near to a whole turn is one: some ten times what rounding leaves of the most turns.
const WHOLE_TURN_RAD: f64 = 1e-7;

/// Most points whose traces a run keeps: at some 300 kB each.
pub(crate) const MOST_KEPT: u64 = 10_000;

/// Instants of a kept trace: what a page shows of it.
const KEPT_INSTANTS: f64 = 2000.0;

/// What a trace holds beside channels, gap and speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extras {
    /// Rates and accelerations of the channels.
    pub rates: bool,
    /// Coordinates and their speeds.
    pub states: bool,
    /// Forces of the elements between cabinet and tub, their sum, and what the feet carry.
    pub forces: bool,
    /// The drum's angle.
    pub angle: bool,
}

/// One coordinate or speed at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StartValue {
    is_speed: bool,
    /// From 0.
    index: usize,
    value: f64,
}

/// Angles beyond a right angle, and shifts of metres, are no start of anything.
const FARTHEST_START: f64 = 1.5;

/// Reads `q5=0.1`.
///
/// # Errors
/// What was expected instead.
pub(crate) fn start_value(text: &str) -> Result<StartValue, String> {
    let expected =
        "expected a coordinate q1 to q10 or a speed u1 to u10 with its value, as in q5=0.1";
    let (name, value) = text.split_once('=').ok_or(expected)?;
    let (is_speed, number) = match name.trim().split_at_checked(1) {
        Some(("q", number)) => (false, number),
        Some(("u", number)) => (true, number),
        _ => return Err(expected.to_owned()),
    };
    let number = number.parse().ok().filter(|number| (1..=COORDINATES).contains(number));
    let index = number.ok_or(expected)? - 1;
    let value = value.trim().parse().ok().filter(|value: &f64| value.is_finite());
    let value = value.ok_or(expected)?;
    if !is_speed && value.abs() > FARTHEST_START {
        return Err(format!("expected at most {FARTHEST_START} m or rad from equilibrium"));
    }
    Ok(StartValue { is_speed, index, value })
}

/// The start with these values, and everything else at equilibrium.
pub(crate) fn start_of(values: &[StartValue]) -> Start {
    let mut start = Start::default();
    for StartValue { is_speed, index, value } in values {
        if *is_speed { start.speeds[*index] = *value } else { start.deviations[*index] = *value }
    }
    start
}

/// The time between instants, or none for one a turn, if it makes a sensible number of them at the
/// points of a plan.
///
/// # Errors
/// [`Error::Refused`].
pub(crate) fn every(every_s: Option<f64>, plan: &Plan) -> Result<Option<f64>, Error> {
    let points = plan.points();
    let Some(every_s) = every_s else {
        let mut count = 0.0;
        for point in 0..points {
            // The start is an instant too.
            count += 1.0 + plan.scenario(point).model.spin.turns_within([0.0, plan.end_s]);
            if count > MOST_INSTANTS {
                let expected = format!(
                    "at most {MOST_INSTANTS} turns of the drum, over all points: an earlier end_s, \
                     or fewer points"
                );
                return Err(Error::option("--turns", format!("to {} s", plan.end_s), expected));
            }
        }
        return Ok(None);
    };
    let least = plan.end_s * points as f64 / MOST_INSTANTS;
    if (least..=plan.end_s).contains(&every_s) {
        return Ok(Some(every_s));
    }
    Err(Error::option("--every", every_s, format!("from {least:e} to {} s", plan.end_s)))
}

/// What of a point's histories is looked at.
pub(crate) struct View {
    /// Time between two instants, s; `None` for one a turn, where the unbalance is up.
    pub(crate) every_s: Option<f64>,
    pub(crate) models: Models,
    /// Where both models begin.
    pub(crate) start: Start,
    pub(crate) extras: Extras,
    /// For the trajectories of the point's row, how that was found.
    pub(crate) quick: Option<CappedRun>,
}

/// Which models are integrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Models {
    #[default]
    Both,
    Nonlinear,
    Linear,
}

impl Models {
    fn kinds(self) -> &'static [ModelKind] {
        match self {
            Self::Both => &ModelKind::ALL,
            Self::Nonlinear => &[ModelKind::Nonlinear],
            Self::Linear => &[ModelKind::Linear],
        }
    }
}

/// The histories of one point, or of all of a plan one below the other.
pub(crate) struct Trace {
    pub(crate) table: Table,
    /// Instants.
    pub(crate) instants: usize,
    /// How each model failed that did, in words.
    pub(crate) failures: Vec<String>,
    /// What integrated the nonlinear model of the only point.
    pub(crate) level: Option<Level>,
}

/// Histories of a plan's only point, which `at` names, or of all of its points, in a pool of their
/// own where the system has threads; the bits are those of one thread.
///
/// # Errors
/// [`NoEquilibrium`] of the only point.
pub(crate) fn in_pool(
    plan: &Plan,
    at: Option<Vec<(String, f64)>>,
    view: &View,
    stop: Cancel<'_>,
) -> Result<Trace, NoEquilibrium> {
    // A thread for each model, where there may be two.
    let wanted = if at.is_some() { 2 } else { threads::cores() };
    let work = || match at {
        Some(at) => trace(plan, plan.scenario(0), at, view, stop),
        None => Ok(trace_all(plan, view, stop)),
    };
    match threads::pool(wanted) {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

/// Integrates models of a scenario and reads them from 0 to the end; in a pool, both at once.
///
/// `at` names the point: parameters with their values. Once `stop` says so it ends early, and what
/// it returns means nothing.
///
/// # Errors
/// [`NoEquilibrium`].
pub(crate) fn trace(
    plan: &Plan,
    scenario: Scenario,
    at: NamedValues,
    view: &View,
    stop: Cancel<'_>,
) -> Result<Trace, NoEquilibrium> {
    let run = Run::new(plan, scenario, view)?;
    let runs = [&run];
    let models = integrate(&runs, view.models, stop);
    let mut table = Table::new(crate::identity::BUILD);
    let failures = columns(&mut table, &runs, &models, view.extras);
    let of = |kind: ModelKind| {
        let model = view.models.kinds().iter().position(|known| *known == kind);
        model.and_then(|model| failures[model][0].clone())
    };
    table.metadata(key::PLAN, &plan.to_json());
    let mut facts = json!({
        "at": at.into_iter().collect::<BTreeMap<_, _>>(),
        "every_s": view.every_s,
        "equilibrium": named('q', run.point.equilibrium()),
        "start": start_json(&view.start),
        "integrator": run.method_json,
        "nonlinear_failure": of(ModelKind::Nonlinear),
        "linear_failure": of(ModelKind::Linear),
    });
    let taken = friction_speeds(&run.point);
    if !taken.is_empty() {
        facts["friction_speeds_m_per_s"] = taken.into();
    }
    table.metadata(key::TRACE, &facts);
    let failures = failures.into_iter().flatten().flatten().collect();
    Ok(Trace { table, instants: run.times_s.len(), failures, level: Some(run.level) })
}

/// As [`trace`] of every point of a plan, in one table with the points' numbers and axes: so many
/// at once as there are lanes, each with the bits that it has alone. A point without equilibrium
/// has no rows, and is among the failures.
pub(crate) fn trace_all(plan: &Plan, view: &View, stop: Cancel<'_>) -> Trace {
    let mut failures = Vec::new();
    let mut runs = Vec::new();
    for number in 0..plan.points() {
        match Run::new(plan, plan.scenario(number), view) {
            Ok(run) => runs.push((number, run)),
            Err(none) => failures.push(format!("point {number}: {none}")),
        }
    }
    let each: Vec<&Run> = runs.iter().map(|(_, run)| run).collect();
    let models = integrate(&each, view.models, stop);
    let mut table = Table::new(crate::identity::BUILD);
    let rows = || runs.iter().map(|(number, run)| (*number, run.times_s.len()));
    let numbers = rows().flat_map(|(number, count)| repeat_n(number, count));
    table.counts("point", "number of the point in its grid", numbers);
    for (k, axis) in plan.axes.iter().enumerate() {
        let values = rows()
            .flat_map(|(number, count)| repeat_n(plan.axis_values(number).get(k).copied(), count));
        table.parameter(&axis.parameter, values);
    }
    let failed = columns(&mut table, &each, &models, view.extras);
    for (k, (number, _)) in runs.iter().enumerate() {
        let of_point = failed.iter().filter_map(|model| model[k].as_deref());
        failures.extend(of_point.map(|text| format!("point {number}: {text}")));
    }
    table.metadata(key::PLAN, &plan.to_json());
    let facts = json!({ "every_s": view.every_s, "start": start_json(&view.start) });
    table.metadata(key::TRACE, &facts);
    let instants = each.iter().map(|run| run.times_s.len()).sum();
    Trace { table, instants, failures, level: None }
}

/// One point made ready.
struct Run {
    point: Point,
    spin: Spin,
    start: Start,
    /// The method of the nonlinear model, and that of the linear one.
    methods: [Method; 2],
    /// What a row says of the nonlinear model's.
    level: Level,
    method_json: Value,
    times_s: Vec<f64>,
}

impl Run {
    fn new(plan: &Plan, scenario: Scenario, view: &View) -> Result<Self, NoEquilibrium> {
        let Scenario { model: Washer { machine, spin, .. }, window_s } = scenario;
        let checkpoints = view.quick.map_or(0, |quick| quick.checkpoints);
        let timing = Timing { end_s: plan.end_s, window_s, checkpoints };
        let point = ready(machine, spin.clone(), &timing)?;
        let (methods, level, method_json) = methods(plan, &point, &spin, view.quick);
        let times_s = match view.every_s {
            Some(every_s) => {
                (0..instants(plan.end_s, every_s)).map(|k| k as f64 * every_s).collect()
            }
            None => spin.whole_turns_s(plan.end_s),
        };
        Ok(Self { point, spin, start: view.start, methods, level, method_json, times_s })
    }
}

/// Each model's histories of the runs. Groups that share lanes go to the threads of the pool.
fn integrate<'a>(
    runs: &[&'a Run],
    models: Models,
    stop: Cancel<'_>,
) -> Vec<(ModelKind, Vec<History<'a>>)> {
    let kinds = models.kinds();
    let groups: Vec<(ModelKind, &[&'a Run])> = kinds
        .iter()
        .flat_map(|&kind| runs.chunks(together()).map(move |runs| (kind, runs)))
        .collect();
    let group = |&(kind, runs): &(ModelKind, &[&'a Run])| {
        let asked = runs.iter().map(|run| Asked {
            point: &run.point,
            method: run.methods[usize::from(kind == ModelKind::Linear)],
            start: run.start,
            times_s: run.times_s.clone(),
        });
        histories(kind, asked.collect(), stop)
    };
    let found: Vec<Vec<History<'a>>> = match rayon::current_thread_index() {
        Some(_) => groups.par_iter().map(group).collect(),
        // rayon's own pool is not sure to start, and it panics if it does not.
        None => groups.iter().map(group).collect(),
    };
    let mut found = found.into_iter().flatten();
    kinds.iter().map(|&kind| (kind, found.by_ref().take(runs.len()).collect())).collect()
}

/// Adds the columns of histories, one below the other; of each model says how each one failed.
fn columns(
    table: &mut Table,
    runs: &[&Run],
    models: &[(ModelKind, Vec<History<'_>>)],
    extras: Extras,
) -> Vec<Vec<Option<String>>> {
    let times = runs.iter().flat_map(|run| run.times_s.iter().copied().map(Some));
    table.numbers("time_s", "s", "time since the start", times);
    let speeds = runs.iter().flat_map(|run| run.spin.speeds_rpm(run.times_s.iter().copied()));
    table.numbers("speed_rpm", "rpm", "spin of the shaft", speeds.map(Some));
    if extras.angle {
        let angles = runs.iter().flat_map(|run| run.spin.angles_rad(run.times_s.iter().copied()));
        // Times are rounded: a turn is whole within that, and not a whole one short of it.
        let is_whole = |angle: f64| angle.min(TAU - angle) < WHOLE_TURN_RAD;
        let angles = angles.map(|angle| if is_whole(angle) { 0.0 } else { angle });
        let what = "angle of the drum, 0 where the unbalance is up";
        table.numbers("drum_angle_rad", "rad", what, angles.map(Some));
    }
    let counts: Vec<usize> = runs.iter().map(|run| run.times_s.len()).collect();
    let models =
        models.iter().map(|(kind, histories)| Columns::new(kind.name(), histories, &counts));
    let models: Vec<Columns<'_>> = models.collect();
    models.iter().for_each(|model| model.channels(table));
    models.iter().for_each(|model| model.gap(table));
    if extras.rates {
        models.iter().for_each(|model| model.rates(table));
    }
    if extras.states {
        models.iter().for_each(|model| model.states(table));
    }
    if extras.forces {
        models.iter().for_each(|model| model.forces(table));
    }
    models.iter().map(Columns::failures).collect()
}

fn start_json(start: &Start) -> Value {
    json!({ "deviations": named('q', &start.deviations), "speeds": named('u', &start.speeds) })
}

/// Traces of every point of the plan that `engine` made `result` of, one file each
/// (`point-<index>.parquet`) in `folder`, until `stop` says so. A point without equilibrium has
/// none. `done` hears of every point that is there.
///
/// A row by capped modes has the trace that its numbers come from (of the linear model, one as
/// accurate), in a fraction of the time that `sweep trace` takes.
///
/// # Errors
/// As `store`; and no more threads.
pub(crate) fn keep(
    engine: &ModelEngine<'_>,
    result: &ParquetFile,
    folder: &Path,
    threads: usize,
    stop: Cancel<'_>,
    done: &(dyn Fn() + Sync),
) -> Result<(), StoreError> {
    let plan = engine.plan();
    files::ready(folder)?;
    remove_former(folder)?;
    let levels = read::levels(result)?;
    threads::pool(threads)?.install(|| {
        levels.into_par_iter().enumerate().try_for_each(|(point, level)| {
            let point = point as u64;
            if stop() {
                return Ok(());
            }
            let names = plan.axes.iter().map(|axis| axis.parameter.name().to_owned());
            let at = names.zip(plan.axis_values(point)).collect();
            let level = level.and_then(|name| Level::named(&name));
            let view = View {
                every_s: Some(plan.end_s / KEPT_INSTANTS),
                models: Models::Both,
                start: Start::default(),
                extras: Extras::default(),
                quick: level.and_then(|level| engine.quick(level)),
            };
            let found = trace(plan, plan.scenario(point), at, &view, stop);
            if stop() {
                return Ok(());
            }
            // The row of a point without an equilibrium says so.
            if let Ok(trace) = found {
                let path = folder.join(format!("point-{point}.parquet"));
                files::write(&path, FileKind::Trace, &trace.table.into_bytes(&path)?)?;
            }
            done();
            Ok(())
        })
    })
}

/// Removes the traces that a former run kept in the folder: its points were others.
fn remove_former(folder: &Path) -> Result<(), StoreError> {
    for name in regular::names(folder).map_err(StoreError::io("list", folder))? {
        let is_kept = name.to_str().is_some_and(|name| {
            let number = name.strip_prefix("point-").and_then(|it| it.strip_suffix(".parquet"));
            number.is_some_and(|number| number.parse::<u64>().is_ok())
        });
        let path = folder.join(&name);
        if is_kept && ParquetFile::open(&path).is_ok_and(|file| file.value(key::TRACE).is_some()) {
            std::fs::remove_file(&path).map_err(StoreError::io("remove", &path))?;
        }
    }
    Ok(())
}

/// Ten numbers as q1 to q10 or u1 to u10.
fn named(letter: char, values: &[f64; COORDINATES]) -> Value {
    (1..).zip(values).map(|(i, value)| (format!("{letter}{i}"), *value)).collect()
}

/// What integrates the nonlinear model and the linear one. A map may scale the bearings' mass to be
/// quick; a single trajectory that is no row's keeps them as they are, by the reference's method.
fn methods(
    plan: &Plan,
    point: &Point,
    spin: &Spin,
    quick: Option<CappedRun>,
) -> ([Method; 2], Level, Value) {
    let of_row = |level: Level| {
        let mut json = plan.integrator.to_json();
        json["row"] = level.name().into();
        json
    };
    if let Some(CappedRun { level, methods, .. }) = quick {
        return (methods, level, of_row(level));
    }
    match plan.integrator.direct() {
        Some((level, method)) => ([method; 2], level, plan.integrator.to_json()),
        None => {
            let steps = StepSelector::new([(point, spin)], plan.end_s);
            let methods = ModelKind::ALL.map(|model| reference(&steps, model));
            match methods[0] {
                Method::Rk4 { step_s } => {
                    (methods, Level::Rk4, Integrator::Rk4 { step_s }.to_json())
                }
                _ => (methods, Level::Dop853, of_row(Level::Dop853)),
            }
        }
    }
}

/// One model's columns.
struct Columns<'a> {
    model: &'static str,
    histories: &'a [History<'a>],
    /// How many instants were asked for, by history.
    counts: &'a [usize],
    instants: Vec<Option<Instant>>,
}

impl<'a> Columns<'a> {
    fn new(model: &'static str, histories: &'a [History<'a>], counts: &'a [usize]) -> Self {
        let each = histories.iter().zip(counts);
        let instants = each.flat_map(|(of, &count)| (0..count).map(|k| of.instant(k))).collect();
        Self { model, histories, counts, instants }
    }

    fn column(
        &self,
        table: &mut Table,
        (name, unit, description): (&str, &str, &str),
        of: impl Fn(&Instant) -> f64,
    ) {
        let description = format!("{description}, {} model; null from where it failed", self.model);
        let values = self.instants.iter().map(|instant| instant.as_ref().map(&of));
        table.numbers(name, unit, &description, values);
    }

    fn channels(&self, table: &mut Table) {
        for channel in Channel::ALL {
            let name = format!("{}_{}", self.model, channel.name());
            let description = format!("{} from equilibrium", channel.description());
            self.column(table, (&name, channel.unit(), &description), |at| {
                at.channels[channel.index()]
            });
        }
    }

    fn rates(&self, table: &mut Table) {
        for channel in Channel::ALL {
            let (name, unit, k) = (channel.name(), channel.unit(), channel.index());
            let name = |per: &str| format!("{}_{name}_{unit}_per_{per}", self.model);
            let what = channel.description();
            let rate = format!("rate of the {what}");
            self.column(table, (&name("s"), &format!("{unit}/s"), &rate), |at| at.rates[k]);
            let acceleration = format!("acceleration of the {what}");
            let named = (&*name("s2"), &*format!("{unit}/s^2"), &*acceleration);
            self.column(table, named, |at| at.accelerations[k]);
        }
    }

    fn gap(&self, table: &mut Table) {
        let name = format!("gap_{}_m", self.model);
        self.column(table, (&name, "m", "gap between drum and tub"), |at| at.gap_m);
    }

    fn states(&self, table: &mut Table) {
        for i in 0..COORDINATES {
            let (unit, per_s) = if i < 4 { ("m", "m/s") } else { ("rad", "rad/s") };
            let name = format!("q{}_{}_{unit}", i + 1, self.model);
            let description = format!("coordinate q{} from equilibrium", i + 1);
            self.column(table, (&name, unit, &description), |at| at.deviations[i]);
            let name = format!("u{}_{}_{unit}_per_s", i + 1, self.model);
            self.column(table, (&name, per_s, &format!("speed of q{}", i + 1)), |at| at.speeds[i]);
        }
    }

    fn forces(&self, table: &mut Table) {
        let each = self.histories.iter().zip(self.counts);
        let forces: Vec<Option<Forces>> =
            each.flat_map(|(of, &count)| (0..count).map(|k| of.forces(k))).collect();
        let mut add = |what: &str, description: &str, of: &dyn Fn(&Forces) -> f64| {
            let name = format!("{what}_{}_n", self.model);
            let description =
                format!("{description}, {} model; null from where it failed", self.model);
            table.numbers(&name, "N", &description, forces.iter().map(|at| at.as_ref().map(of)));
        };
        let Some(first) = forces.first().and_then(Option::as_ref) else { return };
        let axes = ["x", "y", "z"];
        for (kind, (element, force, description, count)) in
            Forces::ELEMENT_KINDS.into_iter().enumerate()
        {
            for k in 0..first.by_kind()[kind].len() {
                let (mut name, mut description) =
                    (format!("{element}_{}_{force}", k / count + 1), description.to_owned());
                if count > 1 {
                    name += &format!("_{}", axes[k % count]);
                    description += &(k % count + 1).to_string();
                }
                add(&name, &description, &|at| at.by_kind()[kind][k]);
            }
        }
        let all = match first.stops_n.is_empty() && first.bushings_n.is_empty() {
            true => "all springs and dampers",
            false => "all springs, dampers, stops and bushings",
        };
        for (k, axis) in axes.into_iter().enumerate() {
            let description = format!("force of {all} on the cabinet along c{}", k + 1);
            add(&format!("cabinet_force_{axis}"), &description, &|at| at.cabinet_n[k]);
        }
        for k in 0..first.feet_n.len() {
            let description = "vertical load of the foot, negative where it would lift";
            add(&format!("foot_{}_load", k + 1), description, &|at| at.feet_n[k]);
        }
        if first.slip_margin_n.is_some() {
            let description = "margin of the cabinet against slipping, friction on all feet \
                               together less the horizontal force";
            add("slip_margin", description, &|at| at.slip_margin_n.unwrap_or(f64::NAN));
            let description = "margin of the cabinet against walking: that against slipping less \
                               what turning takes of it";
            add("walk_margin", description, &|at| at.walk_margin_n.unwrap_or(f64::NAN));
        }
    }

    /// How each history failed, if it did.
    fn failures(&self) -> Vec<Option<String>> {
        let one = |history: &History<'_>| {
            let (reason, time_s) = history.failure?;
            let what = match reason {
                Failure::Diverged => "diverged",
                Failure::StepTooSmall => "needs steps too small for double precision",
                Failure::StepLimit => "used up its allowance of steps",
            };
            Some(format!(
                "the {} model {what} at {time_s:.4} s: its columns are null from there on",
                self.model
            ))
        };
        self.histories.iter().map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use arrow_array::RecordBatch;
    use arrow_array::cast::AsArray as _;
    use arrow_array::types::Float64Type;

    use super::*;

    #[test]
    fn a_start_is_a_coordinate_or_a_speed() {
        assert_eq!(start_value("q5=0.1"), Ok(StartValue { is_speed: false, index: 4, value: 0.1 }));
        assert_eq!(
            start_value(" u10 = -2"),
            Ok(StartValue { is_speed: true, index: 9, value: -2.0 })
        );
        for wrong in ["", "q5", "q0=1", "q11=1", "x=1", "q1=nan", "u1=1e999", "q=1", "q5=2"] {
            assert!(start_value(wrong).unwrap_err().contains("expected"), "{wrong}");
        }
    }

    /// The greatest magnitude of a column from an instant on.
    fn peak(rows: &RecordBatch, column: &str, from: usize) -> f64 {
        let values = rows.column_by_name(column).unwrap().as_primitive::<Float64Type>();
        values.values()[from..].iter().fold(0.0, |peak, value| value.abs().max(peak))
    }

    /// Steps of 2e-4 s pass the corners of friction: they were off by a hundredth of a foot's load.
    #[test]
    fn a_trace_with_friction_is_as_true_as_its_row() {
        let folder = tempfile::tempdir().unwrap();
        let machine = include_str!("../../../docs/examples/friction.toml");
        std::fs::write(folder.path().join("machine.toml"), machine).unwrap();
        let grid = "machine = \"machine.toml\"\n[time]\nend_s = 3.3\nwindow_s = [3.2, 3.3]\n\
             [spin]\nprofile = \"table\"\ntime_s = [0, 3, 3.2, 3.25]\n\
             speed_rpm = [0, 1400, 0, 0]\n";
        let path = folder.path().join("grid.toml");
        let loads = |integrator: &str| {
            std::fs::write(&path, format!("{grid}{integrator}")).unwrap();
            let plan = crate::config::load(&path, &[]).unwrap();
            let extras = Extras { forces: true, ..Extras::default() };
            let (models, start) = (Models::Nonlinear, Start::default());
            let view = View { every_s: Some(1e-3), models, start, extras, quick: None };
            let traced = trace(&plan, plan.scenario(0), Vec::new(), &view, &|| false).unwrap();
            let rows = traced.table.finish().unwrap().0;
            let column = rows.column_by_name("foot_1_load_nonlinear_n").unwrap();
            (column.as_primitive::<Float64Type>().values()[3200..].to_vec(), traced.level)
        };
        let (of_file, level) = loads("");
        assert_eq!(level, Some(Level::Dop853));
        let (expected, _) = loads("[integrator]\nmethod = \"rk4\"\nstep_s = 1e-5\n");
        for (load_n, expected_n) in of_file.iter().zip(&expected) {
            assert!((load_n / expected_n - 1.0).abs() < 2e-3, "{load_n} for {expected_n}");
        }
    }

    #[test]
    fn a_trace_by_a_rows_method_is_the_trajectory_of_the_row() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        let grid = "spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n\
             time = { end_s = 50, window_s = [30, 50] }\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.05, 0.3, 0.8]\n\
             [[axis]]\nparameter = \"damping_n_s_per_m\"\nvalues = [100, 300]\n";
        std::fs::write(&path, grid).unwrap();
        let plan = crate::config::load(&path, &[]).unwrap();
        let engine = ModelEngine::new(&plan).unwrap();
        let points: Vec<_> = (0..plan.points()).map(|point| plan.axis_values(point)).collect();
        let (every_s, start) = (0.002, Start::default());
        let from = (plan.window_s[0] / every_s) as usize;
        let mut quick_rows = 0;
        for row in engine.evaluate_at(&points) {
            let Some(quick) = engine.quick(row.method) else { continue };
            quick_rows += 1;
            assert_eq!(quick.level, row.method);
            let (scenario, extras) = (plan.scenario(row.point), Extras::default());
            let models = Models::Both;
            let view = View { every_s: Some(every_s), models, start, extras, quick: Some(quick) };
            let by_row = trace(&plan, scenario, Vec::new(), &view, &|| false);
            let (rows, _) = by_row.unwrap().table.finish().unwrap();
            // The row names the nonlinear level; the linear one may have been another. Peaks
            // between long steps are found to 1e-5.
            for (name, model, over) in
                [("nonlinear", &row.nonlinear, 1e-5), ("linear", &row.linear, 1e-3)]
            {
                for (channel, amplitude) in plan.reliability.channels.iter().zip(&model.amplitudes)
                {
                    let seen = peak(&rows, &format!("{name}_{}", channel.name()), from);
                    // The peak itself is between two instants.
                    let share = seen / amplitude;
                    assert!((0.998..1.0 + over).contains(&share), "{row:?} {channel:?}: {share}");
                }
            }
        }
        assert!(quick_rows >= 3, "{quick_rows}");
    }

    #[test]
    fn points_side_by_side_have_the_bits_that_each_has_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        // Machines of several steps, more than there are lanes.
        let grid = "spin = { profile = \"ramp\", peak_rpm = 250, ramp_s = 2 }\n\
             time = { end_s = 4 }\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4, 0.7]\n\
             [[axis]]\nparameter = \"spring_stiffness_n_per_m\"\nvalues = [5e3, 9e3, 4e5]\n";
        std::fs::write(&path, grid).unwrap();
        let plan = crate::config::load(&path, &[]).unwrap();
        for (every_s, models) in [(Some(0.03), Models::Both), (None, Models::Nonlinear)] {
            let extras = Extras { rates: true, states: true, forces: true, angle: true };
            let view = View { every_s, models, start: Start::default(), extras, quick: None };
            let all = trace_all(&plan, &view, &|| false);
            assert_eq!(every_s.is_none(), all.instants < 9 * 20);
            let (all, _) = all.table.finish().unwrap();
            let mut from = 0;
            for point in 0..plan.points() {
                let one = trace(&plan, plan.scenario(point), Vec::new(), &view, &|| false).unwrap();
                let (one, _) = one.table.finish().unwrap();
                for (k, field) in one.schema().fields().iter().enumerate() {
                    let together = all.column_by_name(field.name()).unwrap();
                    let together = together.slice(from, one.num_rows());
                    assert_eq!(&together, one.column(k), "{field:?} at point {point}");
                }
                from += one.num_rows();
            }
            assert_eq!(all.num_rows(), from);
        }
    }

    /// Two points that turn by ten a second from the end of a ramp of 2 s.
    fn turning(end_s: f64) -> Plan {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        let grid = format!(
            "spin = {{ profile = \"ramp\", peak_rpm = 600, ramp_s = 2 }}\n\
             time = {{ end_s = {end_s} }}\n\
             [[axis]]\nparameter = \"unbalance_mass_kg\"\nvalues = [0.1, 0.4]\n"
        );
        std::fs::write(&path, grid).unwrap();
        crate::config::load(&path, &[]).unwrap()
    }

    #[test]
    fn more_turns_than_are_kept_are_refused_before_any_work() {
        assert_eq!(every(None, &turning(90_000.0)).unwrap(), None);
        let refused = every(None, &turning(110_000.0)).unwrap_err().to_string();
        for word in ["--turns to 110000 s", "at most 2000000 turns", "end_s"] {
            assert!(refused.contains(word), "{refused}");
        }
    }

    #[test]
    fn the_angle_of_a_whole_turn_is_zero() {
        let extras = Extras { angle: true, ..Extras::default() };
        let (models, start) = (Models::Linear, Start::default());
        let view = View { every_s: None, models, start, extras, quick: None };
        let all = trace_all(&turning(4.05), &view, &|| false);
        assert_eq!(all.instants, 2 * 31);
        let (rows, _) = all.table.finish().unwrap();
        assert_eq!(peak(&rows, "drum_angle_rad", 0), 0.0);
    }
}
