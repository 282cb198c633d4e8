//! Forces of the elements between cabinet and tub, their sum on the cabinet, and what its feet
//! carry of it.
//!
//! The laws are those of the equations (`nonlinear/elements.rs`). The linear model's forces are
//! first order in its deviations, by automatic differentiation at the equilibrium.

use crate::coordinates::{COORDINATES, STATES, TUB_Y, TUB_Z};
use crate::kind::ModelKind;
use crate::lanes::Constant as _;
use crate::nonlinear::elements::{CabinetLine, Ends, Law, PointMotion};
use crate::nonlinear::frame::{Tilt, Vec3, dot};
use crate::point::Point;
use crate::run::loads::load_on_cabinet;
use lane_ode::{Dual, N};
use std::borrow::Cow;

/// Forces of the suspension at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Forces {
    /// Tension of each spring (N); below zero it pushes.
    pub springs_n: Vec<f64>,
    /// Tension of each damper (N); above zero while it is drawn out.
    pub dampers_n: Vec<f64>,
    /// Push of each stop (N), along its direction from the tub.
    pub stops_n: Vec<f64>,
    /// Force of each bushing on the cabinet (N), along c1, c2 and c3.
    pub bushings_n: Vec<[f64; 3]>,
    /// Sum of all forces on the cabinet (N), along c1, c2 and c3: at rest it is the weight.
    pub cabinet_n: [f64; 3],
    /// Vertical load of each foot (N), below zero where it would lift; empty without a cabinet.
    pub feet_n: Vec<f64>,
    /// Margin of the cabinet against slipping (N); absent without a cabinet.
    pub slip_margin_n: Option<f64>,
    /// Margin of the cabinet against walking (N); absent without a cabinet.
    pub walk_margin_n: Option<f64>,
}

/// The forces at a state: whole coordinates of the nonlinear model, deviations of the linear one.
pub(crate) fn forces(point: &Point, model: ModelKind, state: &[f64; STATES]) -> Forces {
    let elements = match model {
        ModelKind::Nonlinear => Cow::Borrowed(&point.machine.elements),
        ModelKind::Linear => Cow::Owned(point.machine.elements.with_viscous_friction()),
    };
    let u: [f64; COORDINATES] = core::array::from_fn(|i| state[COORDINATES + i]);
    let q: [f64; COORDINATES] = match model {
        ModelKind::Nonlinear => core::array::from_fn(|i| state[i]),
        ModelKind::Linear => point.equilibrium,
    };
    let tub = Tub {
        model,
        moving: along(&q, &u),
        displaced: along(&q, &core::array::from_fn(|i| state[i])),
    };
    let mut forces = Forces {
        springs_n: Vec::new(),
        dampers_n: Vec::new(),
        stops_n: Vec::new(),
        bushings_n: Vec::new(),
        cabinet_n: [0.0; 3],
        feet_n: Vec::new(),
        slip_margin_n: None,
        walk_margin_n: None,
    };
    // How the force is divided among the axes differs by a rounding: results on record have it so.
    for (spring, stiffening) in elements.springs.iter().zip(&elements.stiffenings) {
        let (tension, line) = tub.tension(&spring.constant());
        let tension = tension - stiffening.constant().push(&line);
        let share = tension / line.length;
        for k in 0..3 {
            forces.cabinet_n[k] += first_order(model, (share * line.span[k]).v());
        }
        forces.springs_n.push(first_order(model, tension));
    }
    for (damper, friction) in elements.dampers.iter().zip(&elements.frictions) {
        let (tension, line) = tub.tension(&damper.constant());
        let tension = first_order(model, tension - friction.constant().push(&line));
        for k in 0..3 {
            forces.cabinet_n[k] += tension * line.span[k].0.value / line.length.0.value;
        }
        forces.dampers_n.push(tension);
    }
    for stop in &elements.stops {
        let stop = stop.constant();
        let push = first_order(model, stop.push(&tub.point(&stop.tub)));
        for k in 0..3 {
            forces.cabinet_n[k] += push * stop.direction[k].0.value;
        }
        forces.stops_n.push(push);
    }
    for bushing in &elements.bushings {
        let bushing = bushing.constant();
        let on_tub = bushing.force(&tub.point(&bushing.tub));
        let force = on_tub.map(|force| first_order(model, -force));
        for k in 0..3 {
            forces.cabinet_n[k] += force[k];
        }
        forces.bushings_n.push(force);
    }
    if let Some(feet) = &point.feet {
        let load = load_on_cabinet(point, model, state);
        forces.feet_n = feet.loads_n(&load);
        forces.slip_margin_n = Some(feet.slip_margin_n(&load));
        forces.walk_margin_n = Some(feet.walk_margin_n(&load));
    }
    forces
}

/// From the cabinet end of each spring and damper to its tub end (m), in cabinet axes.
pub(crate) struct Attachments {
    pub(crate) springs: Vec<[f64; 3]>,
    pub(crate) dampers: Vec<[f64; 3]>,
}

/// Those at some coordinates.
pub(crate) fn attachments(point: &Point, q: &[f64; COORDINATES]) -> Attachments {
    let q = along(q, &[0.0; COORDINATES]);
    let span = |ends: &Ends<Dual<f64>>| tub_from_cabinet(&q, ends).map(|x| x.0.value);
    let elements = &point.machine.elements;
    Attachments {
        springs: elements.springs.iter().map(|spring| span(&spring.constant().ends)).collect(),
        dampers: elements.dampers.iter().map(|damper| span(&damper.constant().ends)).collect(),
    }
}

/// The tub at a state.
struct Tub {
    model: ModelKind,
    /// Coordinates with their derivative in time.
    moving: [N<Dual<f64>>; COORDINATES],
    /// Coordinates with their first-order deviation.
    displaced: [N<Dual<f64>>; COORDINATES],
}

impl Tub {
    /// Tension of an element, and its line.
    fn tension<E>(&self, element: &E) -> (N<Dual<f64>>, CabinetLine<Dual<f64>>)
    where
        E: Law<Dual<f64>, CabinetLine<Dual<f64>>>,
    {
        let ends = element.ends();
        let span = tub_from_cabinet(&self.displaced, ends);
        let moving = tub_from_cabinet(&self.moving, ends);
        let rate = self.velocity(dot(&moving, &moving).sqrt());
        let line = CabinetLine { span, length: dot(&span, &span).sqrt(), rate };
        (-element.push(&line), line)
    }

    /// A tub point's motion.
    fn point(&self, tub: &Vec3<Dual<f64>>) -> PointMotion<Dual<f64>> {
        let at_first = Ends { cabinet: *tub, tub: *tub };
        PointMotion {
            displacement: tub_from_cabinet(&self.displaced, &at_first),
            velocity: tub_from_cabinet(&self.moving, &at_first).map(|place| self.velocity(place)),
        }
    }

    /// The rate of what has its derivative in time with it.
    fn velocity(&self, moving: N<Dual<f64>>) -> N<Dual<f64>> {
        let rate = moving.0.slope;
        N(match self.model {
            ModelKind::Nonlinear => Dual { value: rate, slope: 0.0 },
            // Zero at equilibrium.
            ModelKind::Linear => Dual { value: 0.0, slope: rate },
        })
    }
}

/// The value itself, or for the linear model its first-order expansion.
fn first_order(model: ModelKind, value: N<Dual<f64>>) -> f64 {
    match model {
        ModelKind::Nonlinear => value.0.value,
        ModelKind::Linear => value.0.value + value.0.slope,
    }
}

/// `q` with its derivative along `direction`.
fn along(q: &[f64; COORDINATES], direction: &[f64; COORDINATES]) -> [N<Dual<f64>>; COORDINATES] {
    core::array::from_fn(|i| N(Dual { value: q[i], slope: direction[i] }))
}

/// From the cabinet end to the tub end, in cabinet axes.
fn tub_from_cabinet(q: &[N<Dual<f64>>; COORDINATES], ends: &Ends<Dual<f64>>) -> Vec3<Dual<f64>> {
    let tub = Tilt::of_tub(q).in_cabinet_axes(&ends.tub);
    [
        tub[0] - ends.cabinet[0],
        tub[1] + q[TUB_Y] - ends.cabinet[1],
        tub[2] + q[TUB_Z] - ends.cabinet[2],
    ]
}
