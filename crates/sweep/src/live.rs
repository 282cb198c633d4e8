//! The data with which a live page computes: the plan of a map as the setup of `washer-live`'s
//! module.

use std::f64::consts::TAU;
use std::path::Path;

use sweep_files::{ParquetFile, key};
use washer_live::{Setup, Sliders};
use washer_model::{
    Attractor, Channel, ModeOverSpeed, ModelKind, PointInput, StabilityKind, campbell,
};
use washer_plot::{Live, Slider};
use washer_row::{MethodKind, Metric, MetricColumn};

use crate::config::WasherGridInput;
use crate::engine::{CHECKPOINT_COUNT, ModelEngine, make_row_rule};
use crate::method::rk4_mass_scaled;
use crate::model::Washer;
use crate::plan::{
    Axis, Plan, axis_between, compared_channels, corners_of_forces, point_input, prepare_point,
    timing,
};
use sweep_engine::method::ACCURACY;
use sweep_engine::store::read::read_overview;
use sweep_engine::{Error, Model as _};

/// Parameters with sliders besides the axes, if the machine has them.
const SLIDER_PARAMETERS: [&str; 6] = [
    "unbalance_mass_kg",
    "damping_n_s_per_m",
    "spring_stiffness_n_per_m",
    "tub_mass_kg",
    "unbalance_x_m",
    "spin_peak_rpm",
];

/// Range of a slider on each side of the plan's value, as a share of it. Basis: a wide range that
/// machines can have. Doubling it includes values that few machines have.
const SLIDER_RANGE_RATIO: f64 = 0.3;

/// Maximum number of sliders besides the axes. Basis: levels are chosen for every corner of their
/// ranges. Doubling it makes 64 times as many corners.
const MAX_FURTHER_SLIDERS: usize = 6;

/// Minimum time between two instants of a history (s). Basis: five instants a turn at 1200 rpm.
/// Doubling it misses peaks of fast motions.
const MIN_INSTANT_SPACING_S: f64 = 0.01;

/// Maximum number of instants of a history. Basis: the page of a long run stays fast. Doubling it
/// doubles the time to draw.
const MAX_HISTORY_INSTANTS: f64 = 8000.0;

/// Step between the speeds at which modes are computed (rpm). Basis: resonances are refined between
/// these speeds. Doubling it may confuse modes whose frequencies cross.
const MODE_SPEED_STEP_RPM: f64 = 10.0;

/// A parameter with the ends of its range, from `--slider`.
#[derive(Clone, Debug, PartialEq)]
pub struct SliderRange {
    name: String,
    from: f64,
    to: f64,
}

/// Parses a range such as `tub_mass_kg=20:30`.
///
/// # Errors
/// Returns a description of the expected text.
pub(crate) fn parse_slider_range(text: &str) -> Result<SliderRange, String> {
    let expected = "expected NAME=FROM:TO, as in tub_mass_kg=20:30";
    let (name, range) = text.split_once('=').ok_or(expected)?;
    let (from_text, to_text) = range.split_once(':').ok_or(expected)?;
    let parse_number =
        |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    match (parse_number(from_text), parse_number(to_text)) {
        (Some(from), Some(to)) if from < to => {
            Ok(SliderRange { name: name.trim().to_owned(), from, to })
        }
        (Some(_), Some(_)) => Err("expected a range that goes up, as in 20:30".to_owned()),
        _ => Err(expected.to_owned()),
    }
}

/// Returns the data with which the page of a map file computes. Without `ranges` it has the usual
/// sliders.
///
/// # Errors
/// Returns an error if the file is no map of a grid with its plan, or if no machine can have the
/// ranges.
pub(crate) fn build_live_part(file: &Path, ranges: &[SliderRange]) -> Result<Live, Error> {
    let mut plan = read_plan_of_map(file)?;
    let has_slow_growth = corners_of_forces(&plan).is_some();
    let (held_speeds_rpm, held_metrics) = take_held_metrics(&mut plan);
    let sliders = match ranges {
        [] => usual_sliders(&plan),
        _ => requested_sliders(&plan, ranges)?,
    };
    let (setup, level_descriptions) = build_setup(&plan, &sliders)?;
    let axis_sliders = plan.axes.iter().map(|axis| to_slider(axis, None));
    let further_sliders = sliders.iter().map(|axis| to_slider(axis, axis.parameter.value));
    let columns_of_models =
        |number: MetricColumn| ModelKind::ALL.map(|model| number.column(model.name()));
    let criterion = plan.model.measures.criterion;
    // The rest of the description is about rows without a ratio, which a page does not have.
    let ratio_description = criterion.ratio_description().split(';').next().unwrap_or_default();
    Ok(Live {
        setup: setup.to_numbers(),
        sliders: axis_sliders.chain(further_sliders).collect(),
        every_s: MIN_INSTANT_SPACING_S.max(plan.end_s / MAX_HISTORY_INSTANTS),
        end_s: plan.end_s,
        window_s: plan.window_s,
        channels: Channel::ALL.map(|channel| channel.name().to_owned()).to_vec(),
        criterion_words: [criterion.amplitude_description(), ratio_description].map(str::to_owned),
        metrics: plan.model.measures.model_columns().map(columns_of_models).collect(),
        held_speeds_rpm,
        held_metrics: held_metrics.iter().map(|metric| metric.name().to_owned()).collect(),
        has_slow_growth,
        attractor_kinds: Attractor::KIND_NAMES.map(str::to_owned).to_vec(),
        has_static_sag: plan.model.measures.metrics.contains(&Metric::StaticSag),
        instability_kinds: StabilityKind::ALL.map(|kind| kind.name().to_owned()).to_vec(),
        compared_channels: compared_channels(&plan).iter().map(|channel| channel.index()).collect(),
        levels: MethodKind::ALL.map(|kind| kind.name().to_owned()).to_vec(),
        accuracy: setup.rule.accuracy,
        ratio_limit: setup.rule.limits.upper,
        ratio_min: setup.rule.limits.lower,
        level_words: level_descriptions,
        version: crate::VERSION.to_owned(),
        resonances: resonance_rows(&plan),
    })
}

/// Returns the resonances of the machine at the middle of every axis, up to its greatest speed, as
/// rows of text: motion, speed and damping ratio. A machine without modes has none.
pub(crate) fn resonance_rows(plan: &Plan) -> Vec<[String; 3]> {
    let middle_values: Vec<f64> =
        plan.axes.iter().map(|axis| axis.values.interpolate(0.5)).collect();
    let PointInput { machine, spin, .. } = point_input(plan, &middle_values);
    let greatest_rpm = spin.max_speed_rad_per_s(plan.end_s) * 60.0 / TAU;
    let step_count = (greatest_rpm / MODE_SPEED_STEP_RPM).ceil() as u32;
    let speeds_rpm: Vec<f64> =
        (0..=step_count).map(|k| MODE_SPEED_STEP_RPM * f64::from(k)).collect();
    let Ok(point) = prepare_point(machine, spin, &timing(plan)) else { return Vec::new() };
    let modes = campbell(&point, &speeds_rpm).unwrap_or_default();
    let mode_rows = |mode: ModeOverSpeed| {
        let motion = mode.motion.to_string();
        let rows = mode.resonances.into_iter().map(move |at| {
            let speed = at.speed_rpm;
            let damping = at.mode.damping_ratio;
            [motion.clone(), format!("{speed:.1} rpm"), format!("{damping:.4}")]
        });
        rows.collect::<Vec<_>>()
    };
    modes.into_iter().flat_map(mode_rows).collect()
}

fn to_slider(Axis { parameter, values, .. }: &Axis, value: Option<f64>) -> Slider {
    let [from, to] = values.extremes();
    Slider {
        name: parameter.name.to_string(),
        description: parameter.description.to_owned(),
        from,
        to,
        value,
    }
}

/// Returns the plan of a map.
fn read_plan_of_map(file: &Path) -> Result<Plan, Error> {
    let refuse = |expected: &str| Error::option("--live", file.display(), expected);
    let map = ParquetFile::open(file)?;
    let plan_json = map.json(key::PLAN);
    let mut json =
        plan_json.ok_or_else(|| refuse("a map by `sweep run`, which carries its plan"))?;
    let name = file.display().to_string();
    if json.get("design").is_none() {
        let plan: Plan = WasherGridInput::from_plan(&name, &json).load()?;
        return if plan.axes.is_empty() { Err(refuse("a map with an axis")) } else { Ok(plan) };
    }
    // An axis of a design with ranges has its range in the design. An axis of a list or of a
    // distribution has the range of the file's column.
    let axes = json["axis"].take();
    let mut plan: Plan = WasherGridInput::from_plan(&name, &json).load()?;
    let columns = read_overview(&map)?.columns;
    for axis in axes.as_array().into_iter().flatten() {
        let name = axis["parameter"].as_str().unwrap_or_default();
        let parameter = plan.model.find(name);
        let [range_from, to] = ["from", "to"].map(|end| axis["range"][end].as_f64());
        let column_range = || columns.iter().find(|column| column.name == name)?.range;
        if let (Ok(parameter), Some((from, to))) =
            (parameter, range_from.zip(to).or_else(column_range))
        {
            plan.axes.push(axis_between(parameter, from, to));
        }
    }
    Ok(plan)
}

/// Removes the metrics at held speeds from a plan, because a page requests them separately. Returns
/// their speeds (rpm) and the metrics.
fn take_held_metrics(plan: &mut Plan) -> (Vec<f64>, Vec<Metric>) {
    let Washer { measures, held_speeds, .. } = &mut plan.model;
    let held_metrics =
        measures.metrics.extract_if(.., |metric| metric.is_at_held_speeds()).collect();
    let speeds = held_speeds.take();
    (speeds.map_or_else(Vec::new, |speeds| speeds.values().to_vec()), held_metrics)
}

/// Returns sliders about the plan's values, for the ranges that machines can have.
fn usual_sliders(plan: &Plan) -> Vec<Axis> {
    let is_axis = |name: &str| plan.axes.iter().any(|axis| axis.parameter.name == name);
    let names = SLIDER_PARAMETERS.into_iter().filter(|name| !is_axis(name));
    let possible_range = |name| {
        let parameter = plan.model.find(name).ok()?;
        let value = parameter.value.filter(|value| *value != 0.0)?;
        let range_ends = [(1.0 - SLIDER_RANGE_RATIO) * value, (1.0 + SLIDER_RANGE_RATIO) * value];
        let [from, to] = if value > 0.0 { range_ends } else { [range_ends[1], range_ends[0]] };
        let range = axis_between(parameter, from, to);
        has_possible_machines(plan, std::slice::from_ref(&range)).then_some(range)
    };
    names.filter_map(possible_range).collect()
}

/// Returns the sliders of `--slider`.
fn requested_sliders(plan: &Plan, ranges: &[SliderRange]) -> Result<Vec<Axis>, Error> {
    let mut requested: Vec<Axis> = Vec::new();
    for SliderRange { name, from, to } in ranges {
        let refuse =
            |expected: String| Error::option("--slider", format!("{name}={from}:{to}"), expected);
        let parameter = plan
            .model
            .find(name)
            .map_err(|why| refuse(format!("a name of `sweep parameters`: {why}")))?;
        let has_slider = plan.axes.iter().chain(&requested).any(|axis| axis.parameter == parameter);
        let has_several_values = parameter.value.is_none();
        let range = parameter.range;
        let disallowed_end = [*from, *to].into_iter().find(|end| !range.contains(*end));
        requested.push(axis_between(parameter, *from, *to));
        let expected = match disallowed_end {
            _ if has_slider => "a parameter that has no slider yet".to_owned(),
            _ if has_several_values => "a parameter that has one value in this map".to_owned(),
            Some(end) => format!("{} at both ends", range.describe_for(end)),
            None if requested.len() > MAX_FURTHER_SLIDERS => {
                format!("at most {MAX_FURTHER_SLIDERS} sliders")
            }
            None if !has_possible_machines(plan, &requested) => {
                "values that a machine can have together".to_owned()
            }
            None => continue,
        };
        return Err(refuse(expected));
    }
    Ok(requested)
}

/// Returns whether all corners of these ranges have a possible machine and spin.
fn has_possible_machines(plan: &Plan, sliders: &[Axis]) -> bool {
    let plan = plan_with_sliders(plan, sliders);
    plan.corners_to_prepare().iter().all(|corner| {
        let input = point_input(&plan, corner);
        input.machine.violations().is_empty() && input.spin.violations().is_empty()
    })
}

/// Returns the plan with the sliders as further axes.
fn plan_with_sliders(plan: &Plan, sliders: &[Axis]) -> Plan {
    Plan { axes: [&plan.axes, sliders].concat(), ..plan.clone() }
}

/// Returns the setup, and a description of each model's refinement levels.
fn build_setup(plan: &Plan, sliders: &[Axis]) -> Result<(Setup, [Vec<String>; 2]), Error> {
    // A page uses the fast method, with the accuracy of the map's method if it has one.
    let map_accuracy = make_row_rule(plan).accuracy;
    let accuracy = if map_accuracy.is_finite() { map_accuracy } else { ACCURACY.default };
    let plan = &Plan { integrator: rk4_mass_scaled(accuracy), ..plan.clone() };
    let levels = ModelEngine::new(plan)?.levels().clone();
    let wide_plan = plan_with_sliders(plan, sliders);
    let wide_levels = ModelEngine::new(&wide_plan)?.levels().clone();
    let level_descriptions = ModelKind::ALL.map(|model| {
        levels[model as usize].levels.iter().map(|level| level.describe(model)).collect()
    });
    let parameters = wide_plan.axes.iter().map(|axis| axis.parameter.handle.clone()).collect();
    let setup = Setup {
        machine: plan.model.machine.clone(),
        spin: plan.model.spin.clone(),
        checkpoints: CHECKPOINT_COUNT,
        rule: make_row_rule(plan),
        sliders: Sliders { parameters, axis_count: plan.axes.len() },
        levels,
        wide_levels,
    };
    Ok((setup, level_descriptions))
}

#[cfg(test)]
mod tests;
