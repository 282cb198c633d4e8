//! Checks of the plan as a whole. Each mistake refers to the numbers in the files that cause it.

use std::collections::BTreeSet;

use lane_ode::Simd;
use lane_ode::rk4::RK4_STABILITY_LIMIT;
use washer_model::{
    ElementList, ModesError, Point, PointInput, Spin, Target, Violation, decimal,
    highest_explicit_frequency_rad_per_s, highest_frequency_rad_per_s, prepare,
};
use washer_row::{Criterion, MethodKind};

use crate::method::{REFERENCE_STEP_RATIO, direct_method};
use crate::model::Washer;
use crate::plan::{Plan, point_input, timing, write_axis_values};
use sweep_engine::config::plan_checks::{check_window, refuse_numbers, step_mistake};
use sweep_engine::config::{Diagnostic, Draft};
use sweep_engine::method::Steps;
use sweep_engine::plan::{MAX_STEPS, shortest_step_s};

/// Maximum number of turns of the drum in a window for the criterion that compares turns. Basis: 20
/// minutes at 1000 rpm. The peaks of every turn stay in memory for a group of points. Doubling it
/// doubles that memory.
const MAX_COMPARED_TURNS: f64 = 20_000.0;

/// Maximum ratio of the highest frequency that limits the steps of the additive method to the
/// machine's highest frequency, at which a message recommends that method. Basis: at a lower ratio,
/// stiff bearings or a stiff hinge cause the highest frequency. Doubling it recommends the method
/// always.
const MAX_ADDITIVE_FREQUENCY_RATIO: f64 = 0.9;

/// Maximum number of elements and of rows of a spin's table that are checked before a run, over all
/// points. Basis: their check takes some seconds. Doubling it doubles that time.
const MAX_CHECKED_ELEMENTS: u64 = 1_000_000_000;

/// Time to count the turns in a row of a spin's table, relative to the time to check a row. Basis:
/// turns are counted at each time step of a row. Doubling it halves the number of points that are
/// accepted with the criterion that compares turns.
const TURN_COUNT_COST_RATIO: u64 = 50;

/// Refuses impossible machines and spins at the corners of the grid.
///
/// The conditions on inertia and bearings are linear, so that a grid which satisfies them at its
/// corners satisfies them everywhere. If a spring's length vanishes only between corners, a row of
/// the run fails.
pub(crate) fn check_corners(draft: &Draft<'_, Washer>) {
    let plan = &draft.plan;
    let mut input = point_input(plan, &plan.corner_values(0));
    let varying_parts = VaryingParts::new(plan);
    if varying_parts.refuse_too_many_points(draft, &input) {
        return;
    }
    let mut corner_check =
        CornerCheck { draft, reported_keys: BTreeSet::new(), is_spin_valid: true };
    corner_check.check_corner(&input, VaryingParts::ALL);
    for corner in 1..plan.corner_count() {
        if draft.report.is_full() {
            // The report has as many mistakes as it shows.
            break;
        }
        write_axis_values(plan, &mut input, &plan.corner_values(corner));
        corner_check.check_corner(&input, varying_parts);
    }
}

/// The parts of a point's input that differ from corner to corner.
#[derive(Clone, Copy)]
struct VaryingParts {
    machine: bool,
    spin: bool,
    window: bool,
}

impl VaryingParts {
    /// All parts, for the first corner.
    const ALL: Self = Self { machine: true, spin: true, window: true };

    fn new(plan: &Plan) -> Self {
        let has_axis = |belongs_to_part: fn(Target) -> bool| {
            plan.axes.iter().any(|axis| belongs_to_part(axis.parameter.handle.target()))
        };
        Self {
            machine: has_axis(|target| !matches!(target, Target::Spin | Target::Window(_))),
            spin: has_axis(|target| target == Target::Spin),
            window: has_axis(|target| matches!(target, Target::Window(_))),
        }
    }

    /// Refuses a list of points whose check would take minutes. Returns whether the list was
    /// refused.
    fn refuse_too_many_points(self, draft: &Draft<'_, Washer>, input: &PointInput) -> bool {
        let PointInput { machine, spin, .. } = input;
        let element_count =
            ElementList::all().map(|list| (list.count)(machine) as u64).sum::<u64>();
        let row_count = match spin {
            Spin::Table { time_s, .. } => time_s.len() as u64,
            Spin::Ramped { .. } => 1,
        };
        let counts_turns = draft.plan.model.measures.criterion == Criterion::Envelope
            && (self.spin || self.window);
        let cost_per_point = u64::from(self.machine) * element_count
            + u64::from(self.spin) * row_count
            + u64::from(counts_turns) * row_count * TURN_COUNT_COST_RATIO;
        let point_count = draft.plan.corner_count();
        let max_points = MAX_CHECKED_ELEMENTS / cost_per_point.max(1);
        if point_count <= max_points {
            return false;
        }
        let title = format!(
            "too many points to check: {point_count}, each with {element_count} springs, dampers \
             and the like and a spin of {row_count} rows"
        );
        let axis_location = draft.report.location("axis[0]");
        draft.report.push(axis_location.into_iter().fold(
            Diagnostic::new(title),
            |diagnostic, location| {
                diagnostic.at_location(
                    &location,
                    format!("expected at most {max_points} points of this machine and spin"),
                )
            },
        ));
        true
    }
}

/// A check of corners that reports each mistake once.
struct CornerCheck<'a> {
    draft: &'a Draft<'a, Washer>,
    /// The keys of each mistake that was reported.
    reported_keys: BTreeSet<Vec<String>>,
    is_spin_valid: bool,
}

impl CornerCheck<'_> {
    /// Checks the parts that differ from those of the corners before. Single numbers were checked
    /// as they were read; this function checks their combinations.
    fn check_corner(&mut self, input: &PointInput, changed_parts: VaryingParts) {
        if changed_parts.machine {
            self.report_violations(input.machine.joint_violations());
        }
        if changed_parts.spin {
            let violations = input.spin.joint_violations();
            self.is_spin_valid = violations.is_empty();
            self.report_violations(violations);
        }
        if changed_parts.window {
            check_window(self.draft, input.window_s, &mut self.reported_keys);
        }
        if (changed_parts.spin || changed_parts.window) && self.is_spin_valid {
            refuse_too_many_turns(self.draft, input, &mut self.reported_keys);
        }
    }

    fn report_violations(&mut self, violations: Vec<Violation>) {
        for Violation { title, parameters, expected } in violations {
            let uses_valid_numbers =
                !parameters.iter().any(|key| self.draft.report.is_invalid(key));
            if uses_valid_numbers && self.reported_keys.insert(parameters.clone()) {
                refuse_numbers(self.draft, title, &parameters, &format!("expected {expected}"));
            }
        }
    }
}

/// Refuses a window with more turns of the drum than the criterion that compares turns permits.
fn refuse_too_many_turns(
    draft: &Draft<'_, Washer>,
    input: &PointInput,
    reported_keys: &mut BTreeSet<Vec<String>>,
) {
    let Some(criterion_location) = draft.report.location("reliability.criterion") else { return };
    if draft.plan.model.measures.criterion != Criterion::Envelope {
        return;
    }
    let turn_count = input.spin.turns_within(input.window_s);
    if turn_count <= MAX_COMPARED_TURNS
        || !reported_keys.insert(vec!["reliability.criterion".to_owned()])
    {
        return;
    }
    let name = Criterion::Envelope.name();
    let title = format!(
        "the drum makes {turn_count:.0} turns in the window, too many to compare one by one"
    );
    let expected =
        format!("expected at most {MAX_COMPARED_TURNS} turns for \"{name}\": shorten the window");
    draft.report.push(Diagnostic::new(title).at_location(&criterion_location, expected));
}

/// Refuses a machine whose highest frequency is too high for the method: for the greatest accepted
/// number of steps, or for the plan's own step. It does nothing if the plan has mistakes.
pub(crate) fn check_stability(draft: &Draft<'_, Washer>) {
    // `step_ratio` is the shortest step that the method takes, relative to the longest stable one.
    let (step_s, step_ratio) = match draft.plan.integrator.steps() {
        Steps::Fixed(step_s) => (Some(step_s), 1.0),
        Steps::ByError => (None, 1.0),
        Steps::Checked(_) => (None, REFERENCE_STEP_RATIO),
    };
    if !draft.report.is_clean() {
        return;
    }
    let end_s = draft.plan.end_s;
    let is_too_fast =
        |frequency: f64| step_ratio * RK4_STABILITY_LIMIT / frequency < shortest_step_s(end_s);
    let is_additive = direct_method(&draft.plan.integrator)
        .is_some_and(|method| method.kind == MethodKind::Additive);
    let highest_frequency_of = if is_additive {
        highest_explicit_frequency_rad_per_s
    } else {
        highest_frequency_rad_per_s
    };
    let highest_rad_per_s = highest_of_corners_rad_per_s(draft, highest_frequency_of);
    let limit_s = RK4_STABILITY_LIMIT / highest_rad_per_s;
    let has_corners = draft.plan.axes.iter().any(|axis| axis.values.len() > 1);
    let corner_text = if has_corners { ", at the grid's hardest corner" } else { "" };
    if is_too_fast(highest_rad_per_s) {
        let step_count = end_s / (step_ratio * limit_s);
        let end_s = decimal(end_s);
        let name = draft.plan.integrator.name();
        let step_need_text = format!("\"{name}\" needs {step_count:.1e} steps to {end_s} s");
        let title = format!("the machine is too stiff: {step_need_text}");
        let location =
            ["integrator", "time.end_s"].into_iter().find_map(|key| draft.report.location(key));
        let refusal = location.into_iter().fold(Diagnostic::new(title), |diagnostic, location| {
            diagnostic.at_location(&location, format!("expected at most {MAX_STEPS:e} steps"))
        });
        let hint_text = if is_too_fast(highest_additive_rad_per_s(draft)) {
            ""
        } else {
            ", or use method = \"additive\", which takes stiff bearings in long steps"
        };
        draft.report.push(refusal.with_help(format!(
            "its highest natural frequency is {highest_rad_per_s:.1e} rad/s{corner_text}: look \
             for a mistaken mass, moment of inertia or stiffness{hint_text}"
        )));
    } else if let Some(step_s) = step_s.filter(|&step_s| step_s > limit_s) {
        let title = format!(
            "a step of {} s is past the stability limit of rk4 on this machine, {limit_s:.2e} s",
            decimal(step_s)
        );
        let expected = format!("expected a step of at most {limit_s:.2e} s");
        let hint_text = if highest_additive_rad_per_s(draft)
            > MAX_ADDITIVE_FREQUENCY_RATIO * highest_rad_per_s
        {
            ""
        } else {
            "; method = \"additive\" takes stiff bearings in longer steps"
        };
        draft.report.push(step_mistake(draft, title, &expected).with_help(format!(
            "the limit is 2.83 / w with w = {highest_rad_per_s:.0} rad/s, the machine's highest \
             natural frequency{corner_text}{hint_text}"
        )));
    }
}

/// Returns the highest frequency that limits the steps of the additive method, over the corners.
fn highest_additive_rad_per_s(draft: &Draft<'_, Washer>) -> f64 {
    highest_of_corners_rad_per_s(draft, highest_explicit_frequency_rad_per_s)
}

/// Returns the highest natural frequency over the corners, each at its greatest speed. It is mostly
/// that of the bearings. A machine without equilibrium has none; the run reports it as a failed
/// row.
fn highest_of_corners_rad_per_s(
    draft: &Draft<'_, Washer>,
    highest_frequency_of: fn(&Point, f64) -> Result<f64, ModesError>,
) -> f64 {
    let plan = &draft.plan;
    let point_timing = timing(plan);
    let mut highest_of_all = 0.0_f64;
    for values in plan.corners_to_prepare() {
        let PointInput { mut machine, spin, .. } = point_input(plan, &values);
        // The steepest slope of friction bounds the frequency. It holds for a linearisation about
        // rest, without free strokes.
        for damper in &mut machine.dampers {
            damper.free_stroke_m = 0.0;
            damper.friction_linear_speed_m_per_s.get_or_insert(damper.friction_speed_m_per_s);
        }
        let max_speed_rad_per_s = spin.max_speed_rad_per_s(plan.end_s);
        for point in prepare(Simd::Scalar, &[(machine, spin)], &point_timing).into_iter().flatten()
        {
            // The run reports a machine whose eigenvalues do not converge.
            highest_of_all = highest_of_all
                .max(highest_frequency_of(&point, max_speed_rad_per_s).unwrap_or(0.0));
        }
    }
    highest_of_all
}
