//! Checks of the resolved plan as a whole, each pointing back at the numbers it concerns.

use std::collections::BTreeSet;

use washer_model::{Parameter, Violation};

use super::grid::Draft;
use super::report::{Diagnostic, Report};
use super::source::Location;
use crate::plan::{Integrator, Scenario};

/// Most fixed steps of a trajectory that are accepted; an hour or more of computing for one point.
pub(super) const MOST_STEPS: f64 = 1e10;

/// A machine or spin that cannot be, at any corner of the grid; the conditions are linear in each parameter, so a
/// machine that is sound at the corners is sound between them.
pub(super) fn scenarios(draft: &Draft, report: &mut Report) {
    let mut reported = BTreeSet::new();
    for point in draft.plan.corners() {
        for (violation, of_spin) in violations(&draft.plan.scenario(point)) {
            let concerns = keys(&violation, of_spin);
            let judged = !concerns.iter().any(|key| draft.origins.is_doubtful(key));
            if judged && reported.insert(concerns.clone()) {
                let places = places(draft, &concerns);
                report.push(describe(&violation, &places));
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
fn places(draft: &Draft, concerns: &[String]) -> Vec<Location> {
    let sweeps = |parameter: &Parameter| {
        parameter.parts(&draft.plan.machine).iter().any(|part| concerns.iter().any(|key| key == part))
    };
    let axes = draft.plan.axes.iter().enumerate().filter(|(_, axis)| sweeps(&axis.parameter));
    let axes = axes.filter_map(|(k, _)| draft.origins.get(&format!("axis[{k}]")));
    let mut places: Vec<Location> = Vec::new();
    for place in axes.chain(concerns.iter().filter_map(|key| draft.origins.get(key))) {
        if !places.contains(place) {
            places.push(place.clone());
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
        format!("a step of {step_s} s is longer than the whole run, {end_s} s")
    } else if steps > MOST_STEPS {
        format!("a step of {step_s} s makes {steps:.1e} steps to {end_s} s")
    } else {
        return;
    };
    let expected = format!("expected a step from {:e} s to {end_s} s", end_s / MOST_STEPS);
    let mut diagnostic = Diagnostic::new(title);
    let written = ["integrator.step_s", "time.end_s"];
    for (at, label) in
        written.iter().filter_map(|key| draft.origins.get(key)).zip([expected.as_str(), "and this"])
    {
        diagnostic = diagnostic.at(at, label);
    }
    report.push(diagnostic);
}
