//! What a live page computes with: the plan of a map as the setup of `washer-live`'s module.

use std::f64::consts::TAU;
use std::path::Path;

use sweep_files::{ParquetFile, key};
use washer_live::{Setup, Sliders};
use washer_model::{Channel, Ending, Kind, ModeOverSpeed, ModelKind, Parameter, campbell};
use washer_plot::{Live, Slider};
use washer_row::{Level, Measured, Metric};

use crate::config::GridInput;
use crate::engine::{CHECKPOINTS, ModelEngine, rule};
use crate::method::Integrator;
use crate::model::Washer;
use crate::plan::{Axis, Plan, between, corners_of_forces, ready, timing};
use sweep_engine::Error;
use sweep_engine::method::ACCURACY;
use sweep_engine::store::read::overview;

/// Parameters that a page offers beside the axes, where the machine has them.
const OFFERED: [&str; 6] = [
    "unbalance_mass_kg",
    "damping_n_s_per_m",
    "spring_stiffness_n_per_m",
    "tub_mass_kg",
    "unbalance_x_m",
    "spin_peak_rpm",
];

/// How far their values go either way, as a share.
const SPREAD: f64 = 0.3;

/// The greatest number of sliders beside the axes: levels are chosen for every corner of their
/// ranges.
const MOST_SLIDERS: usize = 6;

/// Time between two instants of a history (s): at 1200 rpm five to a turn.
const EVERY_S: f64 = 0.01;

/// Most instants of a history, so that a page of a long run stays quick.
const MOST_INSTANTS: f64 = 8000.0;

/// Speeds at which modes are followed (rpm).
const MODES_EVERY_RPM: f64 = 10.0;

/// A parameter with the ends of its range, as `--slider` gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct SliderRange {
    name: String,
    from: f64,
    to: f64,
}

/// Reads `tub_mass_kg=20:30`.
///
/// # Errors
/// What was expected instead.
pub(crate) fn slider_range(text: &str) -> Result<SliderRange, String> {
    let expected = "expected NAME=FROM:TO, as in tub_mass_kg=20:30";
    let (name, range) = text.split_once('=').ok_or(expected)?;
    let (from, to) = range.split_once(':').ok_or(expected)?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    match (number(from), number(to)) {
        (Some(from), Some(to)) if from < to => {
            Ok(SliderRange { name: name.trim().to_owned(), from, to })
        }
        (Some(_), Some(_)) => Err("expected a range that goes up, as in 20:30".to_owned()),
        _ => Err(expected.to_owned()),
    }
}

/// What the page of a map file computes with. Without `ranges` it has the usual sliders.
///
/// # Errors
/// A file that is not the map of a grid with its plan; ranges that no machine can have.
pub(crate) fn live(file: &Path, ranges: &[SliderRange]) -> Result<Live, Error> {
    let mut plan = plan_of(file)?;
    let has_slow_growth = corners_of_forces(&plan).is_some();
    let (held_speeds_rpm, held_metrics) = take_held(&mut plan);
    let sliders = match ranges {
        [] => usual(&plan),
        _ => chosen(&plan, ranges)?,
    };
    let (setup, words) = setup(&plan, &sliders)?;
    let axes = plan.axes.iter().map(|axis| slider(axis, None));
    let Washer { machine, spin, .. } = &plan.model;
    let further = sliders.iter().map(|axis| slider(axis, axis.parameter.get(machine, spin)));
    let columns = |number: Measured| ModelKind::ALL.map(|model| number.column(model.name()));
    let criterion = plan.model.measures.criterion;
    // What a column has where there is no ratio is not a page's.
    let ratio = criterion.ratio().split(';').next().unwrap_or_default();
    Ok(Live {
        setup: setup.to_numbers(),
        sliders: axes.chain(further).collect(),
        every_s: EVERY_S.max(plan.end_s / MOST_INSTANTS),
        end_s: plan.end_s,
        window_s: plan.window_s,
        channels: Channel::ALL.map(|channel| channel.name().to_owned()).to_vec(),
        criterion: [criterion.amplitude(), ratio].map(str::to_owned),
        metrics: plan.model.measures.of_model().map(columns).collect(),
        held_speeds_rpm,
        held_metrics: held_metrics.iter().map(|metric| metric.name().to_owned()).collect(),
        has_slow_growth,
        motions: Ending::KIND_NAMES.map(str::to_owned).to_vec(),
        has_static_sag: plan.model.measures.metrics.contains(&Metric::StaticSag),
        kinds: Kind::ALL.map(|kind| kind.name().to_owned()).to_vec(),
        compared: plan.reliability.channels.iter().map(|channel| channel.index()).collect(),
        levels: Level::ALL.map(|level| level.name().to_owned()).to_vec(),
        accuracy: setup.rule.accuracy,
        ratio_limit: setup.rule.limits.most,
        ratio_min: setup.rule.limits.least,
        rungs: words,
        version: crate::VERSION.to_owned(),
        resonances: resonances(&plan),
    })
}

/// Resonances of the machine at the middle of every axis, up to its greatest speed; none where it
/// has no modes.
pub(crate) fn resonances(plan: &Plan) -> Vec<[String; 3]> {
    let middle: Vec<f64> = plan.axes.iter().map(|axis| axis.values.between(0.5)).collect();
    let Washer { machine, spin, .. } = plan.scenario_at(&middle).model;
    let greatest_rpm = spin.greatest_speed_rad_per_s(plan.end_s) * 60.0 / TAU;
    let count = (greatest_rpm / MODES_EVERY_RPM).ceil() as u32;
    let speeds_rpm: Vec<f64> = (0..=count).map(|k| MODES_EVERY_RPM * f64::from(k)).collect();
    let Ok(point) = ready(machine, spin, &timing(plan)) else { return Vec::new() };
    let modes = campbell(&point, &speeds_rpm).unwrap_or_default();
    let of_mode = |mode: ModeOverSpeed| {
        let motion = mode.motion.to_string();
        let resonances = mode.resonances.into_iter().map(move |at| {
            let (speed, damping) = (at.speed_rpm, at.mode.damping_ratio);
            [motion.clone(), format!("{speed:.1} rpm"), format!("{damping:.4}")]
        });
        resonances.collect::<Vec<_>>()
    };
    modes.into_iter().flat_map(of_mode).collect()
}

fn slider(Axis { parameter, values }: &Axis, value: Option<f64>) -> Slider {
    let [from, to] = values.extremes();
    let (name, description) = (parameter.name().to_owned(), parameter.description().to_owned());
    Slider { name, description, from, to, value }
}

/// The plan that a map was made by.
fn plan_of(file: &Path) -> Result<Plan, Error> {
    let refused = |expected: &str| Error::option("--live", file.display(), expected);
    let opened = ParquetFile::open(file)?;
    let json = opened.json(key::PLAN);
    let mut json = json.ok_or_else(|| refused("a map by `sweep run`, which carries its plan"))?;
    let name = file.display().to_string();
    if json.get("design").is_none() {
        let plan: Plan = GridInput::of_plan(&name, &json).load()?;
        return if plan.axes.is_empty() { Err(refused("a map with an axis")) } else { Ok(plan) };
    }
    // Points of a design are where its axes' ranges have them; of a list and of distributions,
    // wherever its file does.
    let axes = json["axis"].take();
    let mut plan: Plan = GridInput::of_plan(&name, &json).load()?;
    let columns = overview(&opened)?.columns;
    for axis in axes.as_array().into_iter().flatten() {
        let name = axis["parameter"].as_str().unwrap_or_default();
        let parameter = Parameter::find(name, &plan.model.machine, &plan.model.spin);
        let [from, to] = ["from", "to"].map(|end| axis["range"][end].as_f64());
        let in_file = || columns.iter().find(|column| column.name == name)?.range;
        if let (Ok(parameter), Some((from, to))) = (parameter, from.zip(to).or_else(in_file)) {
            plan.axes.push(between(parameter, from, to));
        }
    }
    Ok(plan)
}

/// The constant speeds (rpm) of metrics that a page asks for beside a point's row, and these.
fn take_held(plan: &mut Plan) -> (Vec<f64>, Vec<Metric>) {
    let Washer { measures, held_speeds, .. } = &mut plan.model;
    let held = measures.metrics.extract_if(.., |metric| metric.is_of_speeds()).collect();
    let speeds = held_speeds.take();
    (speeds.map_or_else(Vec::new, |speeds| speeds.values().to_vec()), held)
}

/// The usual sliders: about the plan's values, as far as machines can be.
fn usual(plan: &Plan) -> Vec<Axis> {
    let is_axis = |name: &str| plan.axes.iter().any(|axis| axis.parameter.name() == name);
    let offered = OFFERED.into_iter().filter(|name| !is_axis(name));
    let Washer { machine, spin, .. } = &plan.model;
    let range = |name| {
        let parameter = Parameter::find(name, machine, spin).ok()?;
        let value = parameter.get(machine, spin).filter(|value| *value != 0.0)?;
        let ends = [(1.0 - SPREAD) * value, (1.0 + SPREAD) * value];
        let [from, to] = if value > 0.0 { ends } else { [ends[1], ends[0]] };
        let range = between(parameter, from, to);
        is_sound(plan, std::slice::from_ref(&range)).then_some(range)
    };
    offered.filter_map(range).collect()
}

/// The sliders that `--slider` asks for.
fn chosen(plan: &Plan, ranges: &[SliderRange]) -> Result<Vec<Axis>, Error> {
    let mut found: Vec<Axis> = Vec::new();
    for SliderRange { name, from, to } in ranges {
        let refused =
            |expected: String| Error::option("--slider", format!("{name}={from}:{to}"), expected);
        let parameter = Parameter::find(name, &plan.model.machine, &plan.model.spin)
            .map_err(|why| refused(format!("a name of `sweep parameters`: {why}")))?;
        let has_slider = plan.axes.iter().chain(&found).any(|axis| axis.parameter == parameter);
        let is_spread = parameter.get(&plan.model.machine, &plan.model.spin).is_none();
        let range = parameter.range();
        let beyond = [*from, *to].into_iter().find(|end| !range.contains(*end));
        found.push(between(parameter, *from, *to));
        let expected = match beyond {
            _ if has_slider => "a parameter that has no slider yet".to_owned(),
            _ if is_spread => "a parameter that has one value in this map".to_owned(),
            Some(end) => format!("{} at both ends", range.instead_of(end)),
            None if found.len() > MOST_SLIDERS => format!("at most {MOST_SLIDERS} sliders"),
            None if !is_sound(plan, &found) => "values that a machine can have together".to_owned(),
            None => continue,
        };
        return Err(refused(expected));
    }
    Ok(found)
}

/// Whether machines and spins can be everywhere within these ranges.
fn is_sound(plan: &Plan, sliders: &[Axis]) -> bool {
    let wide = widened(plan, sliders);
    wide.some_corners().iter().all(|corner| {
        let scenario = wide.scenario_at(corner);
        scenario.model.machine.violations().is_empty()
            && scenario.model.spin.violations().is_empty()
    })
}

/// The plan with the sliders as further axes.
fn widened(plan: &Plan, sliders: &[Axis]) -> Plan {
    Plan { axes: [&plan.axes, sliders].concat(), ..plan.clone() }
}

/// Returns the setup, and the refinement levels of both models in words.
fn setup(plan: &Plan, sliders: &[Axis]) -> Result<(Setup, [Vec<String>; 2]), Error> {
    // By the fast method, whatever the map's; as accurate as that, or as usual.
    let own = rule(plan).accuracy;
    let accuracy = if own.is_finite() { own } else { ACCURACY.default };
    let plan = &Plan { integrator: Integrator::Rk4MassScaled { accuracy }, ..plan.clone() };
    let levels = ModelEngine::new(plan)?.levels().clone();
    let wide = widened(plan, sliders);
    let wide_levels = ModelEngine::new(&wide)?.levels().clone();
    let words = ModelKind::ALL.map(|model| {
        levels[model as usize].levels.iter().map(|level| level.describe(model)).collect()
    });
    let parameters = wide.axes.iter().map(|axis| axis.parameter.clone()).collect();
    let setup = Setup {
        machine: plan.model.machine.clone(),
        spin: plan.model.spin.clone(),
        checkpoints: CHECKPOINTS,
        rule: rule(plan),
        sliders: Sliders { parameters, axes: plan.axes.len() },
        levels,
        wide_levels,
    };
    Ok((setup, words))
}

#[cfg(test)]
mod tests;
