//! The load components of both models at a motion of the tub, with their rates.
//!
//! The nonlinear model evaluates the elements over dual numbers. The linear model's loads are first
//! order in its deviations from equilibrium; their derivatives follow from the same laws.

use super::load_components::LoadSelection;
use super::suspension::{compute_forces, dual, tub_with_deviation};
use crate::coordinates::{STATES, TUB_COORDINATES};
use crate::lanes::{InLanes as _, ToDual as _};
use crate::nonlinear::elements::{Elements, TubMotion};
use crate::nonlinear::frame::dot;
use crate::{COORDINATES, ModelKind, Point};
use lane_ode::{Dual, Lane, N, Sample};

/// The first-order expansion of a quantity in the tub's coordinates and speeds about equilibrium.
#[derive(Clone, Copy)]
pub(super) struct TubExpansion<T> {
    value_at_rest: N<T>,
    coordinate_derivatives: [N<T>; 4],
    speed_derivatives: [N<T>; 4],
}

impl<T: Lane> TubExpansion<T> {
    #[inline(always)]
    fn new(zero: N<T>) -> Self {
        Self {
            value_at_rest: zero,
            coordinate_derivatives: [zero; 4],
            speed_derivatives: [zero; 4],
        }
    }

    /// Sets the value at rest and the derivatives by coordinate `k` in one lane.
    fn set(
        &mut self,
        lane: usize,
        value_at_rest: f64,
        k: usize,
        coordinate_derivative: f64,
        speed_derivative: f64,
    ) {
        self.value_at_rest.0.set(lane, value_at_rest);
        self.coordinate_derivatives[k].0.set(lane, coordinate_derivative);
        self.speed_derivatives[k].0.set(lane, speed_derivative);
    }

    #[inline(always)]
    fn evaluate(&self, tub: &[Sample<T>; 4]) -> N<Dual<T>> {
        let mut value = self.value_at_rest;
        let mut slope = self.value_at_rest.lit(0.0);
        for k in 0..4 {
            value += self.coordinate_derivatives[k] * tub[k].value;
            value += self.speed_derivatives[k] * tub[k].slope;
            slope += self.coordinate_derivatives[k] * tub[k].slope;
            slope += self.speed_derivatives[k] * tub[k].curvature;
        }
        N(Dual { value: value.0, slope: slope.0 })
    }
}

/// The load laws of one of the two models.
pub(super) enum LoadLaws<T> {
    /// The machine's elements, over dual numbers for rates.
    Nonlinear(Elements<Dual<T>>),
    /// The expansions of the force on the cabinet and of the load components.
    Linear { force: [TubExpansion<T>; 3], components: Vec<TubExpansion<T>> },
}

impl<T: Lane> LoadLaws<T> {
    /// Creates the laws of a model with the same elements in every lane.
    #[inline(always)]
    pub(super) fn new(
        zero: N<T>,
        model: ModelKind,
        elements: &Elements<f64>,
        selection: LoadSelection,
    ) -> Self {
        match model {
            ModelKind::Nonlinear => Self::Nonlinear(Elements::splat(zero.constant(), elements)),
            ModelKind::Linear => {
                let zero_expansion = TubExpansion::new(zero);
                let components = vec![zero_expansion; selection.component_count()];
                Self::Linear { force: [zero_expansion; 3], components }
            }
        }
    }

    /// Sets the point of one lane.
    pub(super) fn set_point(&mut self, lane: usize, point: &Point, selection: LoadSelection) {
        let (force, components) = match self {
            Self::Nonlinear(elements) => return elements.set_lane(lane, &point.machine.elements),
            Self::Linear { force, components } => (force, components),
        };
        let elements = point.machine.elements.with_viscous_friction().constant();
        let unit_state = |state: usize| core::array::from_fn(|i| f64::from(u8::from(i == state)));
        let components_at_unit = |state: usize| {
            let mut components = vec![dual(0.0, 0.0); selection.component_count()];
            selection.evaluate(
                &elements,
                &tub_with_deviation(point, &unit_state(state)),
                &mut components,
            );
            components
        };
        let cabinet_force_at =
            |state: &[f64; STATES]| compute_forces(point, ModelKind::Linear, state).cabinet_force_n;
        for k in 0..4 {
            let [coordinate, speed] = [TUB_COORDINATES[k], COORDINATES + TUB_COORDINATES[k]];
            let slopes = components_at_unit(coordinate).into_iter().zip(components_at_unit(speed));
            for (component, (N(coordinate_derivative), N(speed_derivative))) in
                components.iter_mut().zip(slopes)
            {
                component.set(
                    lane,
                    coordinate_derivative.value,
                    k,
                    coordinate_derivative.slope,
                    speed_derivative.slope,
                );
            }
            if selection.has_cabinet_force {
                let force_at_rest = cabinet_force_at(&[0.0; STATES]);
                let [at_unit_coordinate, at_unit_speed] =
                    [coordinate, speed].map(|state| cabinet_force_at(&unit_state(state)));
                for i in 0..3 {
                    let coordinate_derivative = at_unit_coordinate[i] - force_at_rest[i];
                    let speed_derivative = at_unit_speed[i] - force_at_rest[i];
                    force[i].set(
                        lane,
                        force_at_rest[i],
                        k,
                        coordinate_derivative,
                        speed_derivative,
                    );
                }
            }
        }
    }

    /// Computes the selected load components at a motion of the tub. Returns the square of the
    /// force on the cabinet, which is zero if that is not selected.
    #[inline(always)]
    pub(super) fn evaluate(
        &mut self,
        selection: LoadSelection,
        tub: &[Sample<T>; 4],
        components: &mut [N<Dual<T>>],
    ) -> Sample<T> {
        let zero = tub[0].value.lit(0.0);
        let mut force_squared = Sample::constant(zero, zero);
        match self {
            Self::Nonlinear(elements) => {
                let mut q = [tub[0].value.constant(); 4];
                let mut u = q;
                for k in 0..4 {
                    q[k] = N(Dual { value: tub[k].value.0, slope: tub[k].slope.0 });
                    u[k] = N(Dual { value: tub[k].slope.0, slope: tub[k].curvature.0 });
                }
                // The force on the tub in tub axes has the same magnitude as the force on the
                // cabinet.
                let force = selection.evaluate(elements, &TubMotion::new(&q, &u), components);
                force_squared = to_sample(dot(&force, &force));
            }
            Self::Linear { force, components: expansions } => {
                if selection.has_cabinet_force {
                    for expansion in force {
                        let N(dual) = expansion.evaluate(tub);
                        let force = N(dual.value);
                        let rate = N(dual.slope);
                        force_squared.value += force * force;
                        force_squared.slope += (2.0 * force).v() * rate;
                    }
                }
                for (component, expansion) in components.iter_mut().zip(expansions) {
                    *component = expansion.evaluate(tub);
                }
            }
        }
        force_squared
    }
}

/// Returns a dual number as a sample without curvature.
#[inline(always)]
pub(super) fn to_sample<T: Lane>(dual: N<Dual<T>>) -> Sample<T> {
    let value = N(dual.0.value);
    let slope = N(dual.0.slope);
    Sample { value, slope, curvature: value.lit(0.0) }
}
