//! Checks of the plan as a whole, which point at the numbers that they concern.

use std::collections::BTreeSet;
use std::iter::{once, repeat};

use sweep_parameter::decimal;

use super::{Diagnostic, Draft, Location, Sources};
use crate::method::Steps;
use crate::plan::{MAX_STEPS, shortest_step_s};
use crate::{Model, ModelParameter};

/// Reports a window that is invalid at a corner of the grid.
pub fn check_windows<M: Model>(draft: &Draft<'_, M>) {
    let mut reported_keys = BTreeSet::new();
    for corner in 0..draft.plan.corner_count() {
        if draft.report.is_full() || !reported_keys.is_empty() {
            break;
        }
        let window_s = draft.plan.window_at(&draft.plan.corner_values(corner));
        check_window(draft, window_s, &mut reported_keys);
    }
}

/// Reports a window that constants or axes have reversed or moved past the end.
pub fn check_window<M: Model>(
    draft: &Draft<'_, M>,
    [from_s, to_s]: [f64; 2],
    reported_keys: &mut BTreeSet<Vec<String>>,
) {
    let end_s = draft.plan.end_s;
    if from_s < to_s && to_s <= end_s {
        return;
    }
    let keys = ["window_from_s", "window_to_s", "time.end_s"].map(str::to_owned).to_vec();
    if !reported_keys.insert(keys.clone()) {
        return;
    }
    let [from_s, to_s, end_s] = [from_s, to_s, end_s].map(decimal);
    let title =
        format!("the window from {from_s} s to {to_s} s does not fit into a run to {end_s} s");
    refuse_numbers(draft, title, &keys, "expected window_from_s < window_to_s <= end_s");
}

/// Reports a combination of numbers at each location where one of them was written.
pub fn refuse_numbers<M: Model>(
    draft: &Draft<'_, M>,
    title: String,
    keys: &[String],
    expectation: &str,
) {
    draft.report.push_with(|sources| {
        let labels = once(expectation).chain(repeat("and this"));
        let locations = find_locations(draft, keys, sources);
        locations
            .iter()
            .zip(labels)
            .fold(Diagnostic::new(title), |diagnostic, (location, label)| {
                diagnostic.at_location(location, label)
            })
    });
}

/// Returns the locations of the concerned numbers: the axes that sweep them first, then files and
/// arguments.
fn find_locations<M: Model>(
    draft: &Draft<'_, M>,
    keys: &[String],
    sources: &Sources,
) -> Vec<Location> {
    let writes_key = |parameter: &ModelParameter<M>| {
        parameter.number_names.iter().any(|part| keys.iter().any(|key| key == part))
    };
    let axes = draft.plan.axes.iter().enumerate().filter(|(_, axis)| writes_key(&axis.parameter));
    let axes = axes.filter_map(|(k, _)| draft.report.location(&format!("axis[{k}]")));
    let mut locations: Vec<Location> = Vec::new();
    for location in axes.chain(keys.iter().filter_map(|key| draft.report.location(key))) {
        // Numbers on one line, such as a vector's, share a location.
        let line = sources.line(&location).number;
        let location_on_line = locations
            .iter_mut()
            .find(|other| other.source == location.source && sources.line(other).number == line);
        match location_on_line {
            Some(other) => {
                other.span = other.span.start.min(location.span.start)
                    ..other.span.end.max(location.span.end);
            }
            None => locations.push(location.clone()),
        }
    }
    locations
}

/// Reports a fixed step that is longer than the run, or needs too many steps.
pub fn check_steps<M: Model>(draft: &Draft<'_, M>) {
    let Steps::Fixed(step_s) = draft.plan.integrator.steps() else { return };
    let end_s = draft.plan.end_s;
    let step_count = end_s / step_s;
    let [step_text, end] = [step_s, end_s].map(decimal);
    let title = if step_s > end_s {
        format!("a step of {step_text} s is longer than the whole run, {end} s")
    } else if step_count > MAX_STEPS {
        format!("a step of {step_text} s makes {step_count:.1e} steps to {end} s")
    } else {
        return;
    };
    let expectation = format!("expected a step from {:e} s to {end} s", shortest_step_s(end_s));
    let refusal = step_mistake(draft, title, &expectation);
    let end = draft.report.location("time.end_s").into_iter();
    draft
        .report
        .push(end.fold(refusal, |diagnostic, end| diagnostic.at_location(&end, "and this")));
}

/// Returns the mistake of a step. It is at the step's location, or at the section if the file gives
/// no step.
pub fn step_mistake<M: Model>(
    draft: &Draft<'_, M>,
    title: String,
    expectation: &str,
) -> Diagnostic {
    let step =
        draft.report.location("integrator.step_s").or_else(|| draft.report.location("integrator"));
    step.into_iter().fold(Diagnostic::new(title), |diagnostic, location| {
        diagnostic.at_location(&location, expectation)
    })
}
