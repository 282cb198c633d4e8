//! Energy of the machine without dampers and spin, written down apart from the equations of motion.

use super::instruments::{mass_matrix, ready};
use crate::coordinates::COORDINATES;
use crate::machine::Machine;
use crate::machine::spin::{Spin, SpinState};
use crate::nonlinear::coefficients::Coefficients;
use crate::{Method, ModelKind, Start, history};
use lane_ode::N;

type Vec3 = [f64; 3];

/// The first two columns of Ry(yaw) Rz(pitch), and the third (Table 1).
fn axes(yaw: f64, pitch: f64) -> [Vec3; 3] {
    let ((sy, cy), (sp, cp)) = (yaw.sin_cos(), pitch.sin_cos());
    [[cy * cp, sp, -sy * cp], [-cy * sp, cp, sy * sp], [sy, 0.0, cy]]
}

/// start + sum of components times axes.
fn place(start: Vec3, axes: &[Vec3; 3], components: Vec3) -> Vec3 {
    std::array::from_fn(|i| start[i] + (0..3).map(|k| components[k] * axes[k][i]).sum::<f64>())
}

fn length(a: Vec3, b: Vec3) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Potential energy (J) at theta = 0: gravity, springs, bearings, flexure (model page, section 3).
fn potential_j(m: &Machine, q: &[f64; COORDINATES]) -> f64 {
    let tub = axes(q[4], q[5]);
    let shaft = axes(q[6], q[7]);
    let (p_t, p_s) = ([0.0, q[0], q[1]], [0.0, q[2], q[3]]);
    // D's axes are those of S turned by q9 about s2, then by q10.
    let turned = axes(q[8], q[9]);
    let drum: [Vec3; 3] = std::array::from_fn(|k| place([0.0; 3], &shaft, turned[k]));
    let hinge = place(p_s, &shaft, [m.drum.hinge_x_m, 0.0, 0.0]);
    let on_drum = |x_m: f64, r_m: f64| place(hinge, &drum, [x_m - m.drum.hinge_x_m, r_m, 0.0]);
    let heights = [
        m.tub.mass_kg * place(p_t, &tub, [m.tub.centre_x_m, 0.0, 0.0])[1],
        m.shaft.mass_kg * place(p_s, &shaft, [m.shaft.centre_x_m, 0.0, 0.0])[1],
        m.drum.mass_kg * on_drum(m.drum.centre_x_m, 0.0)[1],
        m.unbalance.mass_kg * on_drum(m.unbalance.x_m, m.unbalance.radius_m)[1],
    ];
    let mut energy = m.gravity_m_per_s2 * heights.iter().sum::<f64>();
    for s in &m.springs {
        let free = s.free_length_m.unwrap_or_else(|| length(s.cabinet_m, s.tub_m));
        let stretch = length(place(p_t, &tub, s.tub_m), s.cabinet_m) - free;
        energy += 0.5 * s.stiffness_n_per_m * stretch * stretch;
    }
    let b = &m.bearings;
    for (x_m, stiffness) in
        [(b.front_x_m, b.front_stiffness_n_per_m), (b.rear_x_m, b.rear_stiffness_n_per_m)]
    {
        let (on_tub, on_shaft) =
            (place(p_t, &tub, [x_m, 0.0, 0.0]), place(p_s, &shaft, [x_m, 0.0, 0.0]));
        let apart = (on_shaft[1] - on_tub[1]).powi(2) + (on_shaft[2] - on_tub[2]).powi(2);
        energy += 0.5 * stiffness * apart;
    }
    let phi = (q[8].cos() * q[9].cos()).acos();
    energy + 0.5 * m.flexure.stiffness_n_m_per_rad * phi * phi
}

/// Kinetic energy (J): u M u / 2 without spin.
fn kinetic_j(machine: &Coefficients<f64>, q: &[f64; COORDINATES], u: &[f64; COORDINATES]) -> f64 {
    let still = SpinState::new((N(0.0), N(1.0)), N(0.0), N(0.0));
    let mass = mass_matrix(machine, &still, q);
    let of_row = |i: usize| (0..COORDINATES).map(|j| u[i] * mass[i][j] * u[j]).sum::<f64>();
    0.5 * (0..COORDINATES).map(of_row).sum::<f64>()
}

/// The paper's machine without dampers, thrown from its equilibrium: tub and rotor move alike, so
/// that the bearing modes, which a step of 2e-4 s damps on purpose, are left asleep. Energies (J)
/// over 10 s, the first the one given to it.
fn energies_j(step_s: f64) -> Vec<f64> {
    let mut machine = Machine::paper();
    machine.dampers.clear();
    let still = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    let point = ready(machine.clone(), still, 10.0);
    // 0.1 and 0.15 m/s, 0.5 and -0.4 rad/s: some 20 mm and 40 mrad.
    let mut start = Start::default();
    for (tub, rotor, speed) in [(0, 2, 0.1), (1, 3, 0.15), (4, 6, 0.5), (5, 7, -0.4)] {
        (start.speeds[tub], start.speeds[rotor]) = (speed, speed);
    }
    let history = history(ModelKind::Nonlinear, &Method::Rk4 { step_s }, &point, &start, 0.05);
    let coefficients = Coefficients::new(&machine);
    let at_rest = potential_j(&machine, &point.equilibrium);
    let energy = |k| {
        let instant = history.instant(k).unwrap();
        let q = std::array::from_fn(|i| point.equilibrium[i] + instant.deviations[i]);
        potential_j(&machine, &q) - at_rest + kinetic_j(&coefficients, &q, &instant.speeds)
    };
    (0..history.len()).map(energy).collect()
}

#[test]
fn energy_drifts_by_less_than_1e_9_in_10_s_at_the_default_step() {
    let energies = energies_j(2e-4);
    assert_eq!(energies.len(), 201);
    let drift = energies.iter().map(|e| (e / energies[0] - 1.0).abs()).fold(0.0, f64::max);
    eprintln!("energy {:.3} J, drift over 10 s at steps of 2e-4 s: {drift:.1e}", energies[0]);
    assert!(drift < 1e-9, "{drift:e}");
}
