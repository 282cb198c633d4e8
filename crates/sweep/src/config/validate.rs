//! Checks of the resolved plan as a whole, each pointing back at the numbers it concerns.

use std::collections::BTreeSet;

use washer_model::{Parameter, Violation, decimal};

use super::grid::Draft;
use super::report::{Diagnostic, Report};
use super::source::{Location, Sources};
use crate::plan::{Integrator, Scenario};

/// Most fixed steps of a trajectory that are accepted; an hour or more of computing for one point.
pub(super) const MOST_STEPS: f64 = 1e10;

/// A machine or spin that cannot be, at any corner of the grid. Ranges, inertia and bearings are linear conditions, so
/// a machine that meets them at the corners meets them between; a spring that shrinks to nothing only in between is
/// left to the run, as a failed row.
pub(super) fn scenarios(draft: &Draft, report: &mut Report) {
    let mut reported = BTreeSet::new();
    for values in draft.plan.corners() {
        for (violation, of_spin) in violations(&draft.plan.scenario_at(&values)) {
            let concerns = keys(&violation, of_spin);
            let judged = !concerns.iter().any(|key| draft.origins.is_doubtful(key));
            if judged && reported.insert(concerns.clone()) {
                report.push_with(|sources| describe(&violation, &places(draft, &concerns, sources)));
            }
        }
    }
}

/// What is wrong with one scenario, and whether it is the spin.
fn violations(scenario: &Scenario) -> Vec<(Violation, bool)> {
    let machine = scenario.machine.violations().into_iter().map(|violation| (violation, false));
    machine.chain(scenario.spin.violations().into_iter().map(|violation| (violation, true))).collect()
}

/// The keys under which the numbers' places are kept.
fn keys(violation: &Violation, of_spin: bool) -> Vec<String> {
    let tabled = of_spin && !matches!(violation, Violation::OutOfRange { .. });
    let key = |name: String| if tabled { format!("spin.{name}") } else { name };
    violation.concerns().into_iter().map(key).collect()
}

/// Where the concerned numbers were written: the axes that sweep them first, then files and arguments.
fn places(draft: &Draft, concerns: &[String], sources: &Sources) -> Vec<Location> {
    let sweeps = |parameter: &Parameter| {
        parameter.parts(&draft.plan.machine).iter().any(|part| concerns.iter().any(|key| key == part))
    };
    let axes = draft.plan.axes.iter().enumerate().filter(|(_, axis)| sweeps(&axis.parameter));
    let axes = axes.filter_map(|(k, _)| draft.origins.get(&format!("axis[{k}]")));
    let mut places: Vec<Location> = Vec::new();
    for place in axes.chain(concerns.iter().filter_map(|key| draft.origins.get(key))) {
        // Numbers of one line, as of one vector, are one place.
        let line = sources.line(place).number;
        let same = places
            .iter_mut()
            .find(|other| other.source == place.source && sources.line(other).number == line);
        match same {
            Some(other) => {
                other.span = other.span.start.min(place.span.start)..other.span.end.max(place.span.end);
            }
            None => places.push(place.clone()),
        }
    }
    places
}

fn describe(violation: &Violation, places: &[Location]) -> Diagnostic {
    let mut diagnostic = Diagnostic::new(violation.to_string());
    for (k, place) in places.iter().enumerate() {
        let label = if k == 0 { format!("expected {}", violation.expected()) } else { "and this".to_owned() };
        diagnostic = diagnostic.at(place, label);
    }
    diagnostic
}

/// A fixed step that is longer than the run, or so short that a trajectory would never end.
pub(super) fn steps(draft: &Draft, report: &mut Report) {
    let Integrator::Rk4 { step_s } = draft.plan.integrator else { return };
    let end_s = draft.plan.end_s;
    let steps = end_s / step_s;
    let title = if step_s > end_s {
        format!("a step of {} s is longer than the whole run, {} s", decimal(step_s), decimal(end_s))
    } else if steps > MOST_STEPS {
        format!("a step of {} s makes {steps:.1e} steps to {} s", decimal(step_s), decimal(end_s))
    } else {
        return;
    };
    let expected = format!("expected a step from {:e} s to {} s", end_s / MOST_STEPS, decimal(end_s));
    report.push(refuse_step(draft, title, &expected));
}

/// A refusal of the step, pointing at it, or at the section that leaves it out, and at the end it must reach.
fn refuse_step(draft: &Draft, title: String, expected: &str) -> Diagnostic {
    let step = draft.origins.get("integrator.step_s").or_else(|| draft.origins.get("integrator"));
    let end = draft.origins.get("time.end_s");
    let places = step.into_iter().chain(end).zip([expected, "and this"]);
    places.fold(Diagnostic::new(title), |diagnostic, (at, label)| diagnostic.at(at, label))
}
