//! The mass matrix: against independent numbers, and against the accelerations it belongs to.

use super::instruments::{equations, mass_matrix, random_machine};
use crate::coefficients::Coefficients;
use crate::nonlinear::{COORDINATES, accelerations};
use crate::reference_tests::{machine, numbers, reference, spin};
use crate::spin::SpinState;
use lane_ode::N;

#[test]
fn val_mass_matrix_matches_an_independent_one() {
    let mut worst = 0.0_f64;
    for case in reference("rhs.json")["cases"].as_array().unwrap() {
        let ours = mass_matrix(&Coefficients::new(&machine(case)), &spin(case), &numbers(&case["q"]));
        let theirs: [[f64; COORDINATES]; COORDINATES] =
            std::array::from_fn(|i| numbers(&case["mass_matrix"].as_array().unwrap()[i]));
        let largest = theirs.iter().flatten().fold(0.0_f64, |m, a| m.max(a.abs()));
        for i in 0..COORDINATES {
            for j in 0..COORDINATES {
                let error = (ours[i][j] - theirs[i][j]).abs() / largest;
                assert!(error < 1e-14, "M[{i}][{j}]: {} against {}", ours[i][j], theirs[i][j]);
                worst = worst.max(error);
            }
        }
    }
    eprintln!("mass matrix: at most {worst:.1e} of the largest entry");
}

#[test]
fn accelerations_solve_the_equations_of_motion_of_any_machine() {
    let mut rng = fastrand::Rng::with_seed(11);
    let mut worst = 0.0_f64;
    for _ in 0..200 {
        let coefficients = Coefficients::new(&random_machine(&mut rng));
        let mut draw = |size: f64| N(size * (2.0 * rng.f64() - 1.0));
        let spin = SpinState::new(draw(40.0).sin_cos(), draw(130.0), draw(10.0));
        // Tub and shaft are tilted alike within the bearings' play.
        let mut q: [N<f64>; COORDINATES] = core::array::from_fn(|_| draw(0.05));
        for (rotor, tub) in [(2, 0), (3, 1), (6, 4), (7, 5)] {
            q[rotor] = q[tub] + draw(1e-5);
        }
        let u: [N<f64>; COORDINATES] = core::array::from_fn(|_| draw(0.5));
        let a = accelerations(&coefficients.view(), &spin, &q, &u);
        let [inertia, force] = equations(&coefficients, &spin, &q, &u, &a);
        let scale = force.iter().fold(0.0_f64, |m, f| m.max(f.0.abs()));
        for i in 0..COORDINATES {
            worst = worst.max((inertia[i] - force[i]).0.abs() / scale);
        }
    }
    eprintln!("M a - f: at most {worst:.1e} of the largest force");
    assert!(worst < 1e-12, "{worst:e}");
}
