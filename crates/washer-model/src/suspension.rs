//! What springs and dampers carry, and so what reaches the cabinet (Eqs. 33 to 35).
//!
//! The linear model's forces are first order in its deviations like everything else of it: the same lengths, by automatic
//! differentiation at the equilibrium.

use crate::frame::{Tilt, Vec3, dot};
use crate::model::STATES;
use crate::nonlinear::COORDINATES;
use crate::point::Point;
use crate::run::ModelKind;
use lane_ode::{Dual, N};

/// Forces of the suspension at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Forces {
    /// Tension of each spring (N); below zero it pushes.
    pub springs_n: Vec<f64>,
    /// Tension of each damper (N); above zero while it is drawn out.
    pub dampers_n: Vec<f64>,
    /// Sum of all forces on the cabinet (N), along c1, c2 and c3: at rest it is the weight.
    pub cabinet_n: [f64; 3],
}

/// The forces at a state: whole coordinates of the nonlinear model, deviations of the linear one.
pub(crate) fn forces(point: &Point, model: ModelKind, state: &[f64; STATES]) -> Forces {
    let machine = &point.machine;
    let u: [f64; COORDINATES] = core::array::from_fn(|i| state[COORDINATES + i]);
    let q: [f64; COORDINATES] = match model {
        ModelKind::Nonlinear => core::array::from_fn(|i| state[i]),
        ModelKind::Linear => point.equilibrium,
    };
    let moving = along(&q, &u);
    let displaced = along(&q, &core::array::from_fn(|i| state[i]));
    let mut forces = Forces { springs_n: Vec::new(), dampers_n: Vec::new(), cabinet_n: [0.0; 3] };
    for s in &machine.springs {
        let ends = [[s.cabinet_x, s.cabinet_y, s.cabinet_z], [s.tub_x, s.tub_y, s.tub_z]];
        let span = tub_from_cabinet(&displaced, &ends);
        let length = dot(&span, &span).sqrt();
        let tension = s.stiffness.constant() * length - s.stiffness_times_free_length.constant();
        let share = tension / length;
        for k in 0..3 {
            forces.cabinet_n[k] += first_order(model, (share * span[k]).v());
        }
        forces.springs_n.push(first_order(model, tension));
    }
    for d in &machine.dampers {
        let ends = [[d.cabinet_x, d.cabinet_y, d.cabinet_z], [d.tub_x, d.tub_y, d.tub_z]];
        let span = tub_from_cabinet(&moving, &ends);
        let length = dot(&span, &span).sqrt().0;
        let tension = d.damping.0 * length.slope;
        for k in 0..3 {
            forces.cabinet_n[k] += tension * span[k].0.value / length.value;
        }
        forces.dampers_n.push(tension);
    }
    forces
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
fn tub_from_cabinet(q: &[N<Dual<f64>>; COORDINATES], [cabinet, tub]: &[Vec3<f64>; 2]) -> Vec3<Dual<f64>> {
    let end = Tilt::new(q[4], q[5]).to_cabinet(&tub.map(N::constant));
    [
        end[0] - cabinet[0].constant(),
        end[1] + q[0] - cabinet[1].constant(),
        end[2] + q[1] - cabinet[2].constant(),
    ]
}
