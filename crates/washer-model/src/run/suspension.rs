//! Computes the forces of the elements between cabinet and tub, their sum on the cabinet, and the
//! loads of the feet.
//!
//! The force laws are those of the equations (`nonlinear/elements.rs`). The linear model's forces
//! are first order in its deviations, by automatic differentiation at the equilibrium.

use crate::coordinates::{STATES, TUB_COORDINATES, TUB_Y, TUB_Z};
use crate::lanes::ToDual as _;
use crate::machine::feet::LOAD_COMPONENTS;
use crate::nonlinear::elements::{CabinetLine, ElementEnds, ForceLaw, PointMotion, TubMotion};
use crate::nonlinear::frame::{Tilt, Vec3, dot};
use crate::run::model::{LaneModel, NonlinearModel};
use crate::{COORDINATES, ModelKind, Point};
use lane_ode::{Dual, Lane, N, Real};
use std::borrow::Cow;

/// The forces of the suspension at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SuspensionForces {
    /// The tension of each spring (N), negative under compression.
    pub spring_tensions_n: Vec<f64>,
    /// The tension of each damper (N), positive while the damper lengthens.
    pub damper_tensions_n: Vec<f64>,
    /// The force of each stop (N), along the direction from the tub.
    pub stop_forces_n: Vec<f64>,
    /// The force of each bushing on the cabinet (N), along c1, c2 and c3.
    pub bushing_forces_n: Vec<[f64; 3]>,
    /// The sum of all forces on the cabinet (N), along c1, c2 and c3: the weight at rest.
    pub cabinet_force_n: [f64; 3],
    /// The vertical load of each foot (N), negative where the foot would lift; empty without a
    /// cabinet.
    pub foot_loads_n: Vec<f64>,
    /// The margin of the cabinet against slipping (N); absent without a cabinet.
    pub slip_margin_n: Option<f64>,
    /// The margin of the cabinet against walking (N); absent without a cabinet.
    pub walk_margin_n: Option<f64>,
}

impl SuspensionForces {
    /// The kinds of elements: the name, the name of the force, its description, and the number of
    /// components, which is appended to the description of more than one.
    pub const ELEMENT_KINDS: [(&str, &str, &str, usize); 4] = [
        ("spring", "tension", "tension of the spring, negative where it pushes", 1),
        ("damper", "tension", "tension of the damper, positive while it is drawn out", 1),
        ("stop", "force", "push between the tub and the stop", 1),
        ("bushing", "force", "force of the bushing on the cabinet along c", 3),
    ];

    /// Returns the forces of all elements of each kind.
    pub fn by_kind(&self) -> [&[f64]; Self::ELEMENT_KINDS.len()] {
        [
            &self.spring_tensions_n,
            &self.damper_tensions_n,
            &self.stop_forces_n,
            self.bushing_forces_n.as_flattened(),
        ]
    }
}

/// Computes the forces at a state: coordinates of the nonlinear model, deviations from equilibrium
/// of the linear one.
pub(crate) fn compute_forces(
    point: &Point,
    model: ModelKind,
    state: &[f64; STATES],
) -> SuspensionForces {
    let elements = match model {
        ModelKind::Nonlinear => Cow::Borrowed(&point.machine.elements),
        ModelKind::Linear => Cow::Owned(point.machine.elements.with_viscous_friction()),
    };
    let u: [f64; COORDINATES] = core::array::from_fn(|i| state[COORDINATES + i]);
    let q: [f64; COORDINATES] = match model {
        ModelKind::Nonlinear => core::array::from_fn(|i| state[i]),
        ModelKind::Linear => point.equilibrium,
    };
    let tub = TubState {
        model,
        coordinates_over_time: dual_coordinates(&q, &u),
        deviating_coordinates: dual_coordinates(&q, &core::array::from_fn(|i| state[i])),
    };
    let mut forces = SuspensionForces::default();
    // The components of a spring's and of a damper's force are products and quotients in different
    // orders. A common order would change the last bits of stored results.
    for spring in &elements.springs {
        let (tension, line) = tub.tension(&spring.constant());
        let force_per_length = tension / line.length;
        for k in 0..3 {
            forces.cabinet_force_n[k] +=
                first_order_value(model, (force_per_length * line.span[k]).v());
        }
        forces.spring_tensions_n.push(first_order_value(model, tension));
    }
    for damper in &elements.dampers {
        let (tension, line) = tub.tension(&damper.constant());
        let tension = first_order_value(model, tension);
        for k in 0..3 {
            forces.cabinet_force_n[k] += tension * line.span[k].0.value / line.length.0.value;
        }
        forces.damper_tensions_n.push(tension);
    }
    for stop in &elements.stops {
        let stop = stop.constant();
        let force_n = first_order_value(model, stop.force(&tub.point_motion(&stop.tub_point)));
        for k in 0..3 {
            forces.cabinet_force_n[k] += force_n * stop.direction[k].0.value;
        }
        forces.stop_forces_n.push(force_n);
    }
    for bushing in &elements.bushings {
        let bushing = bushing.constant();
        let tub_load = bushing.force(&tub.point_motion(&bushing.tub_point));
        let force = tub_load.map(|force| first_order_value(model, -force));
        for k in 0..3 {
            forces.cabinet_force_n[k] += force[k];
        }
        forces.bushing_forces_n.push(force);
    }
    if let Some(feet) = &point.feet {
        let load = load_on_cabinet(point, model, state);
        forces.foot_loads_n = feet.loads_n(&load);
        forces.slip_margin_n = Some(feet.slip_margin_n(&load));
        forces.walk_margin_n = Some(feet.walk_margin_n(&load));
    }
    forces
}

/// Computes the force (N) and the moment about O (N m) of the suspension on the cabinet, in cabinet
/// axes, from the load on the tub.
#[inline(always)]
pub(super) fn load_on_cabinet_axes<T: Lane>(
    tub: &TubMotion<T>,
    (force, moment): &(Vec3<T>, Vec3<T>),
) -> [N<T>; LOAD_COMPONENTS] {
    let [fx, fy, fz] = tub.rotate_to_cabinet(force);
    let [mx, my, mz] = tub.rotate_to_cabinet(moment);
    let [y, z] = tub.midpoint;
    // The reaction of the load on the tub, with P_T at (0, y, z).
    [-fx, -fy, -fz, -(mx + (y * fz - z * fy)), -(my + z * fx), -(mz - y * fx)]
}

/// Returns a dual number.
pub(super) fn dual(value: f64, slope: f64) -> N<Dual<f64>> {
    N(Dual { value, slope })
}

/// Returns the tub's motion at equilibrium with a first-order deviation.
pub(super) fn tub_with_deviation(
    point: &Point,
    deviations: &[f64; STATES],
) -> TubMotion<Dual<f64>> {
    TubMotion::new(
        &TUB_COORDINATES.map(|q| dual(point.equilibrium[q], deviations[q])),
        &TUB_COORDINATES.map(|q| dual(0.0, deviations[COORDINATES + q])),
    )
}

/// Computes the suspension's load on the cabinet at a state: coordinates of the nonlinear model,
/// deviations from equilibrium of the linear one.
pub(crate) fn load_on_cabinet(
    point: &Point,
    model: ModelKind,
    state: &[f64; STATES],
) -> [f64; LOAD_COMPONENTS] {
    let elements = &point.machine.elements;
    let (elements, tub) = match model {
        ModelKind::Nonlinear => {
            let [q, u] =
                [0, COORDINATES].map(|first| TUB_COORDINATES.map(|q| dual(state[first + q], 0.0)));
            (elements.constant(), TubMotion::new(&q, &u))
        }
        ModelKind::Linear => {
            (elements.with_viscous_friction().constant(), tub_with_deviation(point, state))
        }
    };
    let load = load_on_cabinet_axes(&tub, &elements.load_on_tub(&tub));
    load.map(|N(component)| component.value + component.slope)
}

/// Computes the force of each stop (N) at equilibrium.
pub fn stop_forces_at_rest_n(point: &Point) -> Vec<f64> {
    compute_forces(
        point,
        ModelKind::Nonlinear,
        &<NonlinearModel<f64> as LaneModel<f64>>::rest_state(point),
    )
    .stop_forces_n
}

/// Computes the speed along each damper (m/s) in the linear model, at deviations from equilibrium.
pub(crate) fn damper_speeds_m_per_s(point: &Point, deviations: &[f64; STATES]) -> Vec<f64> {
    let elements = point.machine.elements.constant();
    let tub = tub_with_deviation(point, deviations);
    let damper_speed = |number| elements.damper_motion(number, &tub)[1].0.slope;
    (0..elements.dampers.len()).map(damper_speed).collect()
}

/// Computes the vectors from cabinet end to tub end (m) of each spring and of each damper at
/// coordinates, in cabinet axes.
pub(crate) fn attachment_vectors(point: &Point, q: &[f64; COORDINATES]) -> [Vec<[f64; 3]>; 2] {
    let q = q.map(N);
    let tilt = Tilt::tub(&q);
    let span = |ends: &ElementEnds<f64>| tilted_span(&tilt, &q, ends).map(|x| x.0);
    let elements = &point.machine.elements;
    [
        elements.springs.iter().map(|spring| span(&spring.ends)).collect(),
        elements.dampers.iter().map(|damper| span(&damper.ends)).collect(),
    ]
}

/// The state of the tub as dual numbers.
struct TubState {
    model: ModelKind,
    /// The coordinates with time derivatives.
    coordinates_over_time: [N<Dual<f64>>; COORDINATES],
    /// The coordinates with first-order deviations.
    deviating_coordinates: [N<Dual<f64>>; COORDINATES],
}

impl TubState {
    /// Computes the tension of an element, and its line.
    fn tension(
        &self,
        element: &impl ForceLaw<Dual<f64>>,
    ) -> (N<Dual<f64>>, CabinetLine<Dual<f64>>) {
        let ends = element.ends();
        let span = dual_span(&self.deviating_coordinates, ends);
        let time_dual_span = dual_span(&self.coordinates_over_time, ends);
        let length_rate = self.time_derivative(dot(&time_dual_span, &time_dual_span).sqrt());
        let line = CabinetLine { span, length: dot(&span, &span).sqrt(), length_rate };
        (-element.force(&line) - element.optional_force(&line), line)
    }

    /// Computes the motion of a tub point.
    fn point_motion(&self, tub: &Vec3<Dual<f64>>) -> PointMotion<Dual<f64>> {
        let both_ends = ElementEnds { cabinet_end: *tub, tub_end: *tub };
        PointMotion {
            displacement: dual_span(&self.deviating_coordinates, &both_ends),
            velocity: dual_span(&self.coordinates_over_time, &both_ends)
                .map(|position| self.time_derivative(position)),
        }
    }

    /// Returns the time derivative of a number as a dual number of the model's order.
    fn time_derivative(&self, time_dual: N<Dual<f64>>) -> N<Dual<f64>> {
        let rate = time_dual.0.slope;
        N(match self.model {
            ModelKind::Nonlinear => Dual { value: rate, slope: 0.0 },
            // Velocities are zero at equilibrium, so that they are first-order terms.
            ModelKind::Linear => Dual { value: 0.0, slope: rate },
        })
    }
}

/// Returns the value, or for the linear model the first-order expansion.
fn first_order_value(model: ModelKind, value: N<Dual<f64>>) -> f64 {
    match model {
        ModelKind::Nonlinear => value.0.value,
        ModelKind::Linear => value.0.value + value.0.slope,
    }
}

/// Returns coordinates as dual numbers with derivatives.
fn dual_coordinates(
    q: &[f64; COORDINATES],
    direction: &[f64; COORDINATES],
) -> [N<Dual<f64>>; COORDINATES] {
    core::array::from_fn(|i| N(Dual { value: q[i], slope: direction[i] }))
}

/// Computes the vector from the cabinet end to the tub end at coordinates, in cabinet axes.
fn dual_span(q: &[N<Dual<f64>>; COORDINATES], ends: &ElementEnds<Dual<f64>>) -> Vec3<Dual<f64>> {
    tilted_span(&Tilt::tub(q), q, ends)
}

/// Computes the vector from the cabinet end to the tub end of a tilted tub, in cabinet axes.
fn tilted_span<T: Real>(tilt: &Tilt<T>, q: &[N<T>; COORDINATES], ends: &ElementEnds<T>) -> Vec3<T> {
    let tub = tilt.rotate_to_cabinet(&ends.tub_end);
    [
        tub[0] - ends.cabinet_end[0],
        tub[1] + q[TUB_Y] - ends.cabinet_end[1],
        tub[2] + q[TUB_Z] - ends.cabinet_end[2],
    ]
}
