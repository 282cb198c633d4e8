//! Tests of the mass matrix against independent numbers and against the model's accelerations.

use super::instruments::{equations, loaded_equations, mass_matrix, random_machine};
use crate::coordinates::COORDINATES;
use crate::machine::spin::SpinState;
use crate::nonlinear::coefficients::MachineCoefficients;
use crate::nonlinear::coupling::{Caps, Coupling, Sag};
use crate::nonlinear::forces::Deflection;
use crate::nonlinear::frame::Tilt;
use crate::nonlinear::{accelerations, assemble_coupled_halves};
use crate::tests::reference::{
    assert_matrix, read_machine, read_numbers, read_reference, read_spin,
};
use lane_ode::{Dual, N};

#[test]
fn val_mass_matrix_matches_that_of_an_independent_program() {
    let mut max_error = 0.0_f64;
    for case in read_reference("rhs.json")["cases"].as_array().unwrap() {
        let computed = mass_matrix(
            &MachineCoefficients::new(&read_machine(case)),
            &read_spin(case),
            &read_numbers(&case["q"]),
        );
        max_error = max_error.max(assert_matrix("M", &computed, &case["mass_matrix"], 1e-14));
    }
    eprintln!("mass matrix: at most {max_error:.1e} of the largest entry");
}

/// Calls `check` with random states of random machines, at small deflections of the bearings.
fn check_random_states(
    seed: u64,
    mut check: impl FnMut(&MachineCoefficients<f64>, &SpinState<f64>, &LaneVector, &LaneVector),
) {
    let mut rng = fastrand::Rng::with_seed(seed);
    for _ in 0..200 {
        let coefficients = MachineCoefficients::new(&random_machine(&mut rng));
        let mut random_number = |size: f64| N(size * (2.0 * rng.f64() - 1.0));
        let spin = SpinState::new(
            random_number(40.0).sin_cos(),
            random_number(130.0),
            random_number(10.0),
        );
        let mut q: LaneVector = core::array::from_fn(|_| random_number(0.05));
        for (rotor, tub) in [(2, 0), (3, 1), (6, 4), (7, 5)] {
            q[rotor] = q[tub] + random_number(1e-5);
        }
        let u = core::array::from_fn(|_| random_number(0.5));
        check(&coefficients, &spin, &q, &u);
    }
}

type LaneVector = [N<f64>; COORDINATES];

/// Returns the residual M a - f, relative to the largest force.
fn residual([inertia, force]: &[LaneVector; 2]) -> f64 {
    let largest_force = force.iter().fold(0.0_f64, |m, f| m.max(f.0.abs()));
    (0..COORDINATES).fold(0.0, |m, i| m.max((inertia[i] - force[i]).0.abs() / largest_force))
}

#[test]
fn accelerations_solve_the_equations_of_motion_of_any_machine() {
    let mut max_error = 0.0_f64;
    check_random_states(11, |machine, spin, q, u| {
        let a = accelerations(machine, &Coupling::Springs, &arbitrary_sag(), spin, q, u);
        max_error = max_error.max(residual(&equations(machine, spin, q, u, &a)));
    });
    eprintln!("M a - f: at most {max_error:.1e} of the largest force");
    assert!(max_error < 1e-12, "{max_error:e}");
}

/// Returns an arbitrary sag. Mass scaling is correct for any sag.
fn arbitrary_sag() -> Sag<f64> {
    let bearings = Deflection { offset: [N(-3e-6), N(1e-6)], tilt: [N(2e-5), N(-1e-5)] };
    Sag { bearing_deflection: bearings, hinge_angles: [N(2e-4), N(-7e-4)] }
}

#[test]
fn mass_scaling_changes_only_the_forces_of_bearings_and_hinge() {
    let mut max_error = 0.0_f64;
    for (cap, hinge_rad_per_s) in [(300.0_f64, Some(400.0)), (1500.0, None)] {
        let caps = Caps { bearings_rad_per_s: cap, hinge_rad_per_s };
        check_random_states(12, |machine, spin, q, u| {
            let sag = arbitrary_sag();
            let a = accelerations(machine, &Coupling::new(N(0.0), Some(&caps)), &sag, spin, q, u);
            // Nested dual numbers give the second time derivative of the deflection.
            let motion: [_; COORDINATES] = core::array::from_fn(|i| {
                let [q, u, a] = [q[i].0, u[i].0, a[i].0];
                N(Dual { value: Dual { value: q, slope: u }, slope: Dual { value: u, slope: a } })
            });
            let [tub, shaft] = [4, 6].map(|i| Tilt::new(motion[i], motion[i + 1]));
            let moving_deflection = Deflection::new(&motion, &tub, &shaft);
            let speed_squared = spin.speed.0 * spin.speed.0;
            // The deflection at which plain springs have the load of mass-scaled ones.
            let mass_scaled_deflection =
                |moving_deflection: [N<Dual<Dual<f64>>>; 2], sag: [N<f64>; 2]| {
                    let deflection_component = |i: usize| {
                        let Dual { value, slope } = moving_deflection[i].0;
                        N((slope.slope + speed_squared * (value.value - sag[i].0)) / (cap * cap))
                    };
                    [deflection_component(0), deflection_component(1)]
                };
            let Deflection { offset, tilt } = sag.bearing_deflection;
            let deflection = Deflection {
                offset: mass_scaled_deflection(moving_deflection.offset, offset),
                tilt: mass_scaled_deflection(moving_deflection.tilt, tilt),
            };
            let load = deflection.load_on_shaft(&machine.bodies);
            let mut halves = assemble_coupled_halves(machine, spin, q, u);
            halves.tub.chain.add_load(&load.reaction());
            halves.rotor.chain.add_load(&load);
            if let Some(cap) = hinge_rad_per_s {
                // The deflection by weight does not turn with the drum, so that it rotates
                // backwards in the shaft's frame.
                let [sag_9, sag_10] = sag.hinge_angles;
                let rotated_sag =
                    [spin.cos * sag_9 + spin.sin * sag_10, spin.cos * sag_10 - spin.sin * sag_9];
                let scaled_mass = N(machine.bodies.flexure_stiffness.0 / (cap * cap));
                let forwards = [-u[9], u[8]];
                for i in 0..2 {
                    let whirl = N(1.5 * spin.speed.0) * forwards[i]
                        - N(0.5 * speed_squared) * rotated_sag[i];
                    halves.rotor.chain.torque[2 + i] -= scaled_mass * (a[8 + i] + whirl);
                }
            }
            max_error = max_error.max(residual(&loaded_equations(&halves, &a)));
        });
    }
    eprintln!("(M + K/w^2) a - f: at most {max_error:.1e} of the largest force");
    assert!(max_error < 1e-11, "{max_error:e}");
}
