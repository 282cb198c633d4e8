//! Checks of the resolved plan as a whole, each pointing back at the numbers it concerns.

use std::collections::BTreeSet;

use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use washer_model::{Parameter, Timing, Violation, decimal, highest_frequency_rad_per_s, prepare};

use super::grid::Draft;
use super::report::{Diagnostic, Report};
use super::source::{Location, Sources};
use crate::measures::{Criterion, MOST_TURNS};
use crate::plan::{Integrator, Scenario};

/// Most fixed steps of a trajectory that are accepted; an hour or more of computing for one point.
pub(super) const MOST_STEPS: f64 = 1e10;

/// A machine or spin that cannot be, at any corner of the grid. Ranges, inertia and bearings are linear conditions, so
/// a machine that meets them at the corners meets them between; a spring that shrinks to nothing only in between is
/// left to the run, as a failed row.
pub(super) fn scenarios(draft: &Draft, report: &mut Report) {
    let mut reported = BTreeSet::new();
    for values in draft.plan.corners() {
        window(draft, &draft.plan.scenario_at(&values), &mut reported, report);
        turns(draft, &draft.plan.scenario_at(&values), &mut reported, report);
        for (violation, of_spin) in violations(&draft.plan.scenario_at(&values)) {
            let concerns = keys(&violation, of_spin);
            let judged = !concerns.iter().any(|key| draft.origins.is_doubtful(key));
            if judged && reported.insert(concerns.clone()) {
                report.push_with(|sources| describe(&violation, &places(draft, &concerns, sources)));
            }
        }
    }
}

/// A window that constants or axes have turned round, or moved past the end.
fn window(draft: &Draft, scenario: &Scenario, reported: &mut BTreeSet<Vec<String>>, report: &mut Report) {
    let [from_s, to_s] = scenario.window_s;
    let end_s = draft.plan.end_s;
    if from_s < to_s && to_s <= end_s {
        return;
    }
    let concerns = ["window_from_s", "window_to_s", "time.end_s"].map(str::to_owned).to_vec();
    if !reported.insert(concerns.clone()) {
        return;
    }
    let title = format!(
        "the window from {} s to {} s does not fit into a run to {} s",
        decimal(from_s),
        decimal(to_s),
        decimal(end_s)
    );
    report.push_with(|sources| {
        let mut diagnostic = Diagnostic::new(title);
        for (k, place) in places(draft, &concerns, sources).iter().enumerate() {
            let label = if k == 0 { "expected window_from_s < window_to_s <= end_s" } else { "and this" };
            diagnostic = diagnostic.at(place, label);
        }
        diagnostic
    });
}

/// More turns of the drum in the window than are compared one by one.
fn turns(draft: &Draft, scenario: &Scenario, reported: &mut BTreeSet<Vec<String>>, report: &mut Report) {
    let Some(criterion) = draft.origins.get("reliability.criterion") else { return };
    if draft.plan.measures.criterion != Criterion::Envelope || !scenario.spin.violations().is_empty() {
        return;
    }
    let turns = scenario.spin.turns_within(scenario.window_s);
    if turns <= MOST_TURNS || !reported.insert(vec!["reliability.criterion".to_owned()]) {
        return;
    }
    let title = format!("the drum makes {turns:.0} turns in the window, too many to compare one by one");
    let expected = format!(
        "expected at most {MOST_TURNS} turns for \"{}\": shorten the window",
        Criterion::Envelope.name()
    );
    report.push(Diagnostic::new(title).at(criterion, expected));
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
    let refusal = refuse_step(draft, title, &expected);
    report
        .push(draft.origins.get("time.end_s").into_iter().fold(refusal, |all, end| all.at(end, "and this")));
}

/// A fixed step with which some machine's fastest motion would grow without bounds, undamped bearings against their mass as
/// a rule. Only a sound plan can be judged. The limit is sought at the grid's corners, on the machine at rest and turning at
/// its greatest speed; a machine without equilibrium has none, and its rows will say so.
pub(super) fn stability(draft: &Draft, report: &mut Report) {
    let Integrator::Rk4 { step_s } = draft.plan.integrator else { return };
    if !report.is_clean() {
        return;
    }
    let Some(limit_s) = longest_stable_step_s(draft, step_s) else { return };
    let title = format!(
        "a step of {} s is past the stability limit of rk4 on this machine, {limit_s:.2e} s",
        decimal(step_s)
    );
    let expected = format!("expected a step of at most {limit_s:.2e} s");
    let axes = draft.plan.axes.iter().any(|axis| axis.values.len() > 1);
    let at = if axes { ", at the grid's hardest corner" } else { "" };
    let frequency = RK4_STABILITY_LIMIT / limit_s;
    report.push(refuse_step(draft, title, &expected).help(format!(
        "the limit is 2.83 / w with w = {frequency:.0} rad/s, the machine's highest natural frequency{at}"
    )));
}

/// The longest stable step over the grid's corners, if `step_s` is longer.
fn longest_stable_step_s(draft: &Draft, step_s: f64) -> Option<f64> {
    let plan = &draft.plan;
    let timing = Timing { end_s: plan.end_s, window_s: plan.window_s, checkpoints: 0 };
    let mut highest = 0.0_f64;
    for values in plan.some_corners() {
        let Scenario { machine, spin, .. } = plan.scenario_at(&values);
        let speed = spin.greatest_speed_rad_per_s(plan.end_s);
        for point in prepare(Simd::Scalar, &[(machine, spin)], &timing).into_iter().flatten() {
            // Matrices without eigenvalues leave it to the run to tell whether the machine can move.
            highest = highest.max(highest_frequency_rad_per_s(&point, speed).unwrap_or(0.0));
        }
    }
    let limit_s = RK4_STABILITY_LIMIT / highest;
    (step_s > limit_s).then_some(limit_s)
}

/// A refusal of the step, pointing at it, or at the section that leaves it out.
fn refuse_step(draft: &Draft, title: String, expected: &str) -> Diagnostic {
    let step = draft.origins.get("integrator.step_s").or_else(|| draft.origins.get("integrator"));
    step.into_iter().fold(Diagnostic::new(title), |diagnostic, at| diagnostic.at(at, expected))
}
