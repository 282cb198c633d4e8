//! Tests of the outputs' derivatives in time against differences of the outputs' values.

use super::instruments::{prepare_point, random_machine, random_spin};
use crate::channel::CHANNELS;
use crate::coordinates::{COORDINATES, STATES};
use crate::nonlinear::coupling::Coupling;
use crate::nonlinear::outputs::RADIAL_COMPONENTS;
use crate::run::model::{LaneModel, LinearModel, NonlinearModel};
use lane_ode::{N, Sample};

const OUTPUT_COUNT: usize = CHANNELS + RADIAL_COMPONENTS;

/// Computes the largest errors of slope and curvature, relative to their largest magnitudes,
/// against central differences over `2 STEP_S`.
fn derivative_errors<M: LaneModel<f64>>(seed: u64) -> [f64; 2] {
    const STEP_S: f64 = 1e-5;
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut max_errors = [0.0_f64; 2];
    for kind in 0..40 {
        let point = prepare_point(random_machine(&mut rng), random_spin(&mut rng, kind, 4.0), 4.0);
        let model = M::splat(N(0.0), &point, Coupling::Springs);
        let mut random_number = |size: f64| size * (2.0 * rng.f64() - 1.0);
        let middle_s = 0.2 + random_number(0.1);
        let state_at_rest = M::rest_state(&point);
        let q: [f64; COORDINATES] =
            core::array::from_fn(|i| state_at_rest[i] + random_number(0.03));
        let u: [f64; COORDINATES] = core::array::from_fn(|_| random_number(0.5));
        let a: [f64; COORDINATES] = core::array::from_fn(|_| random_number(20.0));
        // The outputs of a motion of constant acceleration.
        let outputs_at = |t: f64| -> [Sample<f64>; OUTPUT_COUNT] {
            let position = |i: usize| q[i] + t * (u[i] + 0.5 * t * a[i]);
            let speed = |i: usize| u[i] + t * a[i];
            let join_state =
                |first: &dyn Fn(usize) -> f64, second: &dyn Fn(usize) -> f64| -> [N<f64>; STATES] {
                    core::array::from_fn(|i| {
                        N(if i < COORDINATES { first(i) } else { second(i - COORDINATES) })
                    })
                };
            let x = join_state(&position, &speed);
            let dx = join_state(&speed, &|i| a[i]);
            let (radial_position, channels) =
                model.observe(&model.forcing(N(middle_s + t)), &x, &dx, true);
            let channels = channels.unwrap();
            core::array::from_fn(|i| {
                if i < CHANNELS { channels[i] } else { radial_position[i - CHANNELS] }
            })
        };
        let [outputs_before, outputs_now, outputs_after] = [-STEP_S, 0.0, STEP_S].map(outputs_at);
        let mut max_values = [0.0_f64; 2];
        let mut max_differences = [0.0_f64; 2];
        for i in 0..OUTPUT_COUNT {
            let slope = (outputs_after[i].value.0 - outputs_before[i].value.0) / (2.0 * STEP_S);
            let curvature = (outputs_after[i].slope.0 - outputs_before[i].slope.0) / (2.0 * STEP_S);
            for (k, (value, expected)) in
                [(outputs_now[i].slope.0, slope), (outputs_now[i].curvature.0, curvature)]
                    .into_iter()
                    .enumerate()
            {
                max_differences[k] = max_differences[k].max((value - expected).abs());
                max_values[k] = max_values[k].max(expected.abs());
            }
        }
        for k in 0..2 {
            max_errors[k] = max_errors[k].max(max_differences[k] / max_values[k]);
        }
    }
    max_errors
}

#[test]
fn slopes_and_curvatures_of_the_nonlinear_outputs_are_derivatives_in_time() {
    let [slope, curvature] = derivative_errors::<NonlinearModel<f64>>(41);
    eprintln!("nonlinear outputs: slope within {slope:.1e}, curvature within {curvature:.1e}");
    assert!(slope < 1e-6 && curvature < 1e-6);
}

#[test]
fn slopes_and_curvatures_of_the_linear_outputs_are_derivatives_in_time() {
    let [slope, curvature] = derivative_errors::<LinearModel<f64>>(42);
    eprintln!("linear outputs: slope within {slope:.1e}, curvature within {curvature:.1e}");
    assert!(slope < 1e-6 && curvature < 1e-6);
}
