//! Checks of the resolved plan as a whole, each pointing back at the numbers it concerns.

use std::collections::BTreeSet;

use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use washer_model::{
    ElementList, NoModes, Point, Spin, Target, Violation, decimal,
    highest_explicit_frequency_rad_per_s, highest_frequency_rad_per_s, prepare,
};
use washer_row::Criterion;

use crate::method::{Integrator, REFERENCE_SHARE};
use crate::model::Washer;
use crate::plan::{Plan, Scenario, timing};
use sweep_engine::config::whole::{refuse, refuse_step, window};
use sweep_engine::config::{Diagnostic, Draft};
use sweep_engine::method::{Integrator as _, Steps};
use sweep_engine::plan::{MAX_STEPS, shortest_step_s};

/// Most turns of the drum in a window that are compared one by one: 20 minutes at 1000 rpm. They
/// stay in memory for a group of points.
const MOST_TURNS: f64 = 20_000.0;

/// Greatest frequency in the steps of the additive method, as a share of the machine's, at which a
/// user is pointed to that method. Basis: below it stiff bearings or a stiff hinge make the
/// machine's frequency. A value twice as large would point everybody there.
const MOSTLY_BY_BEARINGS: f64 = 0.9;

/// Elements and rows of a spin's table that are looked at before a run, over all points of a list:
/// some seconds' worth.
const MOST_JUDGED: u64 = 1_000_000_000;

/// Counting a row's turns takes as long as judging so many rows.
const TURNS_PER_ROW: u64 = 50;

/// A machine or spin that cannot be, at any corner of the grid. Inertia and bearings are linear
/// conditions, so a machine that meets them at the corners meets them between; a spring that
/// shrinks to nothing only in between is left to the run, as a failed row.
pub(crate) fn scenarios(draft: &Draft<'_, Washer>) {
    let plan = &draft.plan;
    let mut scenario = plan.scenario_at(&plan.corner(0));
    let swept = Swept::of(plan);
    if swept.is_too_much(draft, &scenario) {
        return;
    }
    let mut judge = Judge { draft, reported: BTreeSet::new(), spin_is_sound: true };
    judge.corner(&scenario, Swept::EVERYTHING);
    for corner in 1..plan.corners() {
        if draft.report.is_full() {
            // A corner's mistakes are mostly another's, and none would be shown.
            break;
        }
        plan.place(&mut scenario, &plan.corner(corner));
        judge.corner(&scenario, swept);
    }
}

/// What of a scenario differs from corner to corner.
#[derive(Clone, Copy)]
struct Swept {
    machine: bool,
    spin: bool,
    window: bool,
}

impl Swept {
    const EVERYTHING: Self = Self { machine: true, spin: true, window: true };

    fn of(plan: &Plan) -> Self {
        let any = |of: fn(Target) -> bool| plan.axes.iter().any(|axis| of(axis.parameter.target()));
        Self {
            machine: any(|target| !matches!(target, Target::Spin | Target::Window(_))),
            spin: any(|target| target == Target::Spin),
            window: any(|target| matches!(target, Target::Window(_))),
        }
    }

    /// Refuses a list so long, of a machine or a spin so large, that judging its points would take
    /// minutes.
    fn is_too_much(self, draft: &Draft<'_, Washer>, scenario: &Scenario) -> bool {
        let Washer { machine, spin, .. } = &scenario.model;
        let elements = ElementList::all().map(|list| (list.count)(machine) as u64).sum::<u64>();
        let rows = match spin {
            Spin::Table { time_s, .. } => time_s.len() as u64,
            Spin::Ramped { .. } => 1,
        };
        let counts_turns = draft.plan.model.measures.criterion == Criterion::Envelope
            && (self.spin || self.window);
        let a_point = u64::from(self.machine) * elements
            + u64::from(self.spin) * rows
            + u64::from(counts_turns) * rows * TURNS_PER_ROW;
        let (points, most) = (draft.plan.corners(), MOST_JUDGED / a_point.max(1));
        if points <= most {
            return false;
        }
        let title = format!(
            "too many points to check: {points}, each with {elements} springs, dampers \
             and the like and a spin of {rows} rows"
        );
        let at = draft.report.place("axis[0]");
        draft.report.push(at.into_iter().fold(Diagnostic::new(title), |diagnostic, at| {
            diagnostic.at(&at, format!("expected at most {most} points of this machine and spin"))
        }));
        true
    }
}

/// Judges corner after corner, and reports each mistake once.
struct Judge<'a> {
    draft: &'a Draft<'a, Washer>,
    reported: BTreeSet<Vec<String>>,
    spin_is_sound: bool,
}

impl Judge<'_> {
    /// Judges what is new at a corner. Single numbers were judged where they were read; left is how
    /// they go together.
    fn corner(&mut self, scenario: &Scenario, new: Swept) {
        if new.machine {
            self.violations(scenario.model.machine.joint_violations());
        }
        if new.spin {
            let violations = scenario.model.spin.joint_violations();
            self.spin_is_sound = violations.is_empty();
            self.violations(violations);
        }
        if new.window {
            window(self.draft, scenario, &mut self.reported);
        }
        if (new.spin || new.window) && self.spin_is_sound {
            turns(self.draft, scenario, &mut self.reported);
        }
    }

    fn violations(&mut self, found: Vec<Violation>) {
        for Violation { title, concerns, expected } in found {
            let judged = !concerns.iter().any(|key| self.draft.report.is_doubtful(key));
            if judged && self.reported.insert(concerns.clone()) {
                refuse(self.draft, title, &concerns, &format!("expected {expected}"));
            }
        }
    }
}

/// More turns of the drum in the window than are compared one by one.
fn turns(draft: &Draft<'_, Washer>, scenario: &Scenario, reported: &mut BTreeSet<Vec<String>>) {
    let Some(criterion) = draft.report.place("reliability.criterion") else { return };
    if draft.plan.model.measures.criterion != Criterion::Envelope {
        return;
    }
    let turns = scenario.model.spin.turns_within(scenario.window_s);
    if turns <= MOST_TURNS || !reported.insert(vec!["reliability.criterion".to_owned()]) {
        return;
    }
    let name = Criterion::Envelope.name();
    let title =
        format!("the drum makes {turns:.0} turns in the window, too many to compare one by one");
    let expected =
        format!("expected at most {MOST_TURNS} turns for \"{name}\": shorten the window");
    draft.report.push(Diagnostic::new(title).at(&criterion, expected));
}

/// Refuses a machine whose fastest motion is too fast for the method: for any number of steps that
/// is accepted, or for the plan's own step. Only a sound plan can be judged.
pub(crate) fn stability(draft: &Draft<'_, Washer>) {
    // As a share of the longest stable step: that which the method takes at its slowest.
    let (step_s, share) = match draft.plan.integrator.steps() {
        Steps::Fixed(step_s) => (Some(step_s), 1.0),
        Steps::ByError => (None, 1.0),
        Steps::Checked(_) => (None, REFERENCE_SHARE),
    };
    if !draft.report.is_clean() {
        return;
    }
    let end_s = draft.plan.end_s;
    let is_too_fast =
        |frequency: f64| share * RK4_STABILITY_LIMIT / frequency < shortest_step_s(end_s);
    let is_additive = matches!(draft.plan.integrator, Integrator::Additive { .. });
    let by_method = if is_additive {
        highest_explicit_frequency_rad_per_s
    } else {
        highest_frequency_rad_per_s
    };
    let frequency = highest_of_corners_rad_per_s(draft, by_method);
    let limit_s = RK4_STABILITY_LIMIT / frequency;
    let axes = draft.plan.axes.iter().any(|axis| axis.values.len() > 1);
    let at = if axes { ", at the grid's hardest corner" } else { "" };
    if is_too_fast(frequency) {
        let steps = end_s / (share * limit_s);
        let end_s = decimal(end_s);
        let name = draft.plan.integrator.name();
        let needs = format!("\"{name}\" needs {steps:.1e} steps to {end_s} s");
        let title = format!("the machine is too stiff: {needs}");
        let place =
            ["integrator", "time.end_s"].into_iter().find_map(|key| draft.report.place(key));
        let refusal = place.into_iter().fold(Diagnostic::new(title), |diagnostic, at| {
            diagnostic.at(&at, format!("expected at most {MAX_STEPS:e} steps"))
        });
        let way_out = if is_too_fast(by_additive(draft)) {
            ""
        } else {
            ", or use method = \"additive\", which takes stiff bearings in long steps"
        };
        draft.report.push(refusal.help(format!(
            "its highest natural frequency is {frequency:.1e} rad/s{at}: look for a mass, a moment \
             of inertia or a stiffness that is not meant so{way_out}"
        )));
    } else if let Some(step_s) = step_s.filter(|&step_s| step_s > limit_s) {
        let title = format!(
            "a step of {} s is past the stability limit of rk4 on this machine, {limit_s:.2e} s",
            decimal(step_s)
        );
        let expected = format!("expected a step of at most {limit_s:.2e} s");
        let way_out = if by_additive(draft) > MOSTLY_BY_BEARINGS * frequency {
            ""
        } else {
            "; method = \"additive\" takes stiff bearings in longer steps"
        };
        draft.report.push(refuse_step(draft, title, &expected).help(format!(
            "the limit is 2.83 / w with w = {frequency:.0} rad/s, the machine's highest natural \
             frequency{at}{way_out}"
        )));
    }
}

/// Returns the highest frequency that limits the steps of the additive method.
fn by_additive(draft: &Draft<'_, Washer>) -> f64 {
    highest_of_corners_rad_per_s(draft, highest_explicit_frequency_rad_per_s)
}

/// Returns the highest natural frequency of any corner's machine, turning at its greatest speed. As
/// a rule it is that of undamped bearings against their mass. A machine without equilibrium has
/// none, and its rows will say so.
fn highest_of_corners_rad_per_s(
    draft: &Draft<'_, Washer>,
    highest_rad_per_s: fn(&Point, f64) -> Result<f64, NoModes>,
) -> f64 {
    let plan = &draft.plan;
    let timing = timing(plan);
    let mut highest = 0.0_f64;
    for values in plan.some_corners() {
        let Washer { mut machine, spin, .. } = plan.scenario_at(&values).model;
        // What friction is taken at bounds no frequency: its steepest slope does, beyond any free
        // stroke.
        for damper in &mut machine.dampers {
            damper.free_stroke_m = 0.0;
            damper.friction_linear_speed_m_per_s.get_or_insert(damper.friction_speed_m_per_s);
        }
        let speed = spin.greatest_speed_rad_per_s(plan.end_s);
        for point in prepare(Simd::Scalar, &[(machine, spin)], &timing).into_iter().flatten() {
            // Matrices without eigenvalues leave it to the run to tell whether the machine can
            // move.
            highest = highest.max(highest_rad_per_s(&point, speed).unwrap_or(0.0));
        }
    }
    highest
}
