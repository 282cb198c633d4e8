//! The engine's plan with a washing machine as its model.

use lane_ode::Simd;
use serde_json::{Map, Value};
use sweep_engine::ModelParameter;
use washer_model::{Channel, Machine, NoEquilibrium, Point, PointInput, Spin, Timing, prepare};

use crate::model::Washer;

pub(crate) use sweep_engine::AxisValues;

/// A validated plan of a washing machine: its points, and the method by which each is integrated.
pub type Plan = sweep_engine::Plan<Washer>;

/// A parameter that varies over the points, with its values.
pub(crate) type Axis = sweep_engine::Axis<Washer>;

/// Returns the end and the window of a plan's runs.
pub(crate) fn timing(plan: &Plan) -> Timing {
    Timing { end_s: plan.end_s, window_s: plan.window_s, checkpoints: 0 }
}

/// Returns the input of the point at values of a plan's axes, on the grid or between its points.
pub fn point_input(plan: &Plan, axis_values: &[f64]) -> PointInput {
    let Washer { machine, spin, .. } = &plan.model;
    let mut input =
        PointInput { machine: machine.clone(), spin: spin.clone(), window_s: plan.window_s };
    write_axis_values(plan, &mut input, axis_values);
    input
}

/// Writes values of a plan's axes into the input of a point. Inputs of a plan differ in nothing
/// else.
pub(crate) fn write_axis_values(plan: &Plan, input: &mut PointInput, axis_values: &[f64]) {
    for (axis, &value) in plan.axes.iter().zip(axis_values) {
        input.write(&axis.parameter.handle, value);
    }
}

/// Returns the channels that a plan compares.
pub(crate) fn compared_channels(plan: &Plan) -> Vec<Channel> {
    let channels = plan.reliability.channels.iter();
    let find_channel = |name| Channel::ALL.into_iter().find(|channel| channel.name() == name);
    channels.filter_map(|channel| find_channel(channel.name)).collect()
}

/// Returns an axis with two values.
pub(crate) fn axis_between(parameter: ModelParameter<Washer>, from: f64, to: f64) -> Axis {
    Axis { parameter, values: AxisValues::Linear { from, to, count: 2 }, tolerance: None }
}

/// Prepares a machine with its spin for integration.
///
/// # Errors
/// Returns [`NoEquilibrium`] if the machine has none.
pub(crate) fn prepare_point(
    machine: Machine,
    spin: Spin,
    timing: &Timing,
) -> Result<Point, NoEquilibrium> {
    prepare(Simd::Scalar, &[(machine, spin)], timing).remove(0)
}

/// Prepares the input of a point for integration.
///
/// # Errors
/// Returns [`NoEquilibrium`] if the machine has none.
pub(crate) fn prepare_input(plan: &Plan, input: &PointInput) -> Result<Point, NoEquilibrium> {
    let timing = Timing { window_s: input.window_s, ..timing(plan) };
    prepare_point(input.machine.clone(), input.spin.clone(), &timing)
}

/// Returns the reason why a point of a plan has no equilibrium, if it has none.
pub(crate) fn failure_reason(plan: &Plan, point: u64) -> Option<String> {
    prepare_input(plan, &point_input(plan, &plan.axis_values(point)))
        .err()
        .map(|reason| reason.to_string())
}

/// Returns the speed amplitudes (m/s) at which the linear model of a point takes the friction of
/// its dampers, by their names.
pub(crate) fn friction_speeds(point: &Point) -> Map<String, Value> {
    let speeds = point.friction_speeds().iter();
    speeds
        .map(|friction_speed| {
            (
                format!("damper_{}", friction_speed.damper_index + 1),
                friction_speed.speed_m_per_s.into(),
            )
        })
        .collect()
}

/// Returns whether some damper has friction at some point of a plan.
pub(crate) fn has_friction(plan: &Plan) -> bool {
    plan.model.machine.dampers.iter().any(|damper| damper.friction_n != 0.0)
        || plan.axes.iter().any(|axis| axis.parameter.name.ends_with("friction_n"))
}

/// Returns the elements whose forces have corners at some point of a plan, as text; `None` if all
/// forces are smooth.
pub(crate) fn corners_of_forces(plan: &Plan) -> Option<&'static str> {
    match (has_friction(plan), plan.model.machine.stops.is_empty()) {
        (true, true) => Some("dampers with friction"),
        (true, false) => Some("dampers with friction, and stops"),
        (false, false) => Some("stops"),
        (false, true) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::rk4_mass_scaled;
    use sweep_engine::design::{Design, DesignRule};
    use sweep_engine::{AxisValues, Model as _, Reliability};
    use washer_model::{Machine, MachineParameter, Profile, Spin};
    use washer_row::Measures;

    fn plan_with_axes(axes: &[(&str, AxisValues)]) -> Plan {
        let machine = Machine::paper();
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
        let axis_of_values = |(name, values): &(&str, AxisValues)| Axis {
            parameter: crate::model::engine_parameter(
                MachineParameter::find(name, &machine, &spin).unwrap(),
                &machine,
                &spin,
            ),
            values: values.clone(),
            tolerance: None,
        };
        Plan {
            name: "test".to_owned(),
            axes: axes.iter().map(axis_of_values).collect(),
            design: None,
            model: Washer { machine, spin, measures: Measures::default(), held_speeds: None },
            end_s: 50.0,
            window_s: [30.0, 50.0],
            integrator: rk4_mass_scaled(1e-3),
            reliability: Reliability {
                limits: 2.0.into(),
                channels: Washer::ABOUT.channels.to_vec(),
            },
            set: Vec::new(),
            sources: Default::default(),
            reading_notes: Default::default(),
        }
    }

    #[test]
    fn the_first_axis_varies_slowest() {
        let plan = plan_with_axes(&[
            ("unbalance_mass_kg", AxisValues::List(vec![0.1, 0.2])),
            ("damping_n_s_per_m", AxisValues::Linear { from: 60.0, to: 80.0, count: 3 }),
        ]);
        assert_eq!(plan.points(), 6);
        let points_in_order: Vec<_> = (0..6).map(|p| plan.axis_values(p)).collect();
        let expected_points =
            [[0.1, 60.0], [0.1, 70.0], [0.1, 80.0], [0.2, 60.0], [0.2, 70.0], [0.2, 80.0]]
                .map(Vec::from);
        assert_eq!(points_in_order, expected_points);
        let input = point_input(&plan, &plan.axis_values(4));
        assert_eq!(input.machine.unbalance.mass_kg, 0.2);
        assert!(input.machine.dampers.iter().all(|d| d.damping_n_s_per_m == 70.0));
        assert_eq!(input.spin, plan.model.spin);
    }

    #[test]
    fn corners_are_the_extreme_points_even_of_unordered_lists() {
        let plan = plan_with_axes(&[
            ("unbalance_mass_kg", AxisValues::List(vec![0.3, 0.1, 0.2])),
            ("damping_n_s_per_m", AxisValues::Linear { from: 80.0, to: 60.0, count: 3 }),
        ]);
        let corners: Vec<_> =
            (0..plan.corner_count()).map(|corner| plan.corner_values(corner)).collect();
        assert_eq!(corners, [[0.1, 60.0], [0.3, 60.0], [0.1, 80.0], [0.3, 80.0]].map(Vec::from));
    }

    #[test]
    fn a_plan_without_axes_is_one_point() {
        let plan = plan_with_axes(&[]);
        assert_eq!(plan.points(), 1);
        assert_eq!((plan.corner_count(), plan.corner_values(0)), (1, Vec::new()));
        assert_eq!(point_input(&plan, &[]).machine, plan.model.machine);
    }

    #[test]
    fn a_design_spreads_its_points_over_the_axes_ranges() {
        let mut plan = plan_with_axes(&[
            ("unbalance_mass_kg", AxisValues::Linear { from: 0.1, to: 0.9, count: 2 }),
            ("bearing_stiffness_n_per_m", AxisValues::Log { from: 1e6, to: 1e8, count: 2 }),
        ]);
        plan.design = Some(Design::Spread { rule: DesignRule::Sobol, points: 1024, seed: 1 });
        assert_eq!(plan.points(), 1024);
        let points: Vec<Vec<f64>> = (0..1024).map(|point| plan.axis_values(point)).collect();
        let count_below =
            |axis: usize, middle: f64| points.iter().filter(|point| point[axis] < middle).count();
        assert_eq!([count_below(0, 0.5), count_below(1, 1e7)], [512, 512]);
        assert!(points.iter().all(|p| (0.1..0.9).contains(&p[0]) && (1e6..1e8).contains(&p[1])));
        assert_eq!(plan.corner_count(), 4);
        assert_eq!(point_input(&plan, &points[7]).machine.unbalance.mass_kg, points[7][0]);
    }
}
