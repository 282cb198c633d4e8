//! The notes of `check` on a plan.

use washer_model::{Point, Spin, stop_forces_at_rest_n};
use washer_row::Criterion;

use crate::plan::{Plan, point_input, prepare_input};

/// The minimum force of a stop at rest, as a share of the machine's weight, at which a note reports
/// it. Basis: softened stops that are open have a small force. Doubling it may hide a stop that is
/// barely closed.
const MIN_RESTING_FORCE_RATIO: f64 = 0.01;

/// Returns a note on the equilibrium of the first point's machine: the reason why it has none, or
/// the stop with the greatest load, if it rests on one.
fn find_rest_note(plan: &Plan) -> Option<(&'static str, String)> {
    match prepare_input(plan, &point_input(plan, &plan.axis_values(0))) {
        Ok(point) => describe_most_loaded_stop(&point).map(|text| ("stops", text)),
        Err(reason) => Some(("rest", format!("{reason} (first point)"))),
    }
}

/// Returns a text on the stop with the greatest force at rest, if the machine rests on it.
fn describe_most_loaded_stop(point: &Point) -> Option<String> {
    let forces_and_numbers = stop_forces_at_rest_n(point).into_iter().map(f64::abs).zip(1..);
    let (force_n, stop) = forces_and_numbers.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (force_n > MIN_RESTING_FORCE_RATIO * point.weight_n()).then(|| {
        let [force_n, weight_n] = [force_n, point.weight_n()].map(f64::round);
        format!(
            "stop {stop} carries {force_n} of {weight_n} N at rest: it is closed in both models, \
             and `clearance_m` is measured from the position before loading"
        )
    })
}

/// Returns the lines that `check` adds on a plan: heading and text.
pub(crate) fn plan_notes(plan: &Plan) -> Vec<(&'static str, String)> {
    let metric_names: Vec<_> =
        plan.model.measures.metrics.iter().map(|metric| metric.name()).collect();
    let mut notes = Vec::new();
    if !metric_names.is_empty() {
        notes.push(("metrics", metric_names.join(", ")));
    }
    if let Spin::Table { speed_rpm, .. } = &plan.model.spin
        && let Some(first_rpm) = speed_rpm.first().filter(|rpm| **rpm != 0.0)
    {
        let jump_note = "from the first instant, with the suspension at rest: the speed jumps";
        notes.push(("spin", format!("{first_rpm} rpm {jump_note}")));
    }
    notes.extend(find_rest_note(plan));
    notes
}

/// Returns the words after "below 2" in the sentence on the verdict.
pub(crate) const fn criterion_words(plan: &Plan) -> &'static str {
    match plan.model.measures.criterion {
        Criterion::Peak => "",
        Criterion::Envelope => ", turn by turn of the drum",
        Criterion::Rms => ", of root mean squares",
    }
}
