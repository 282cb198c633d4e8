//! The loads of the cabinet's feet. The cabinet does not move; the floor balances its weight and
//! the forces of the suspension.

use lane_ode::{N, Real};

use crate::Machine;
use crate::lanes::lane_struct;

/// The greatest number of feet of a cabinet.
pub(crate) const MAX_FEET: usize = 4;

/// The number of components of a load on the cabinet: the force along c1, c2 and c3 (N), then the
/// moment about O (N m).
pub(crate) const LOAD_COMPONENTS: usize = 6;

/// The load added to the sum of the feet's loads (N), so that divisions by the sum are finite if no
/// foot carries a load. Basis: negligible against any load. Doubling it changes nothing.
const REGULARISING_LOAD_N: f64 = 1e-9;

/// The minimum lever arm (m) at which the floor's friction balances a moment about the vertical.
/// Basis: the radius of a foot's pad, by which a single loaded foot balances such a moment.
/// Doubling it halves the friction that a moment needs at a single loaded foot.
const MIN_ARM_M: f64 = 0.01;

/// The determinant of the matrix of the feet's second moments, relative to the square of the trace,
/// up to which the feet count as being in a line. Basis: far below the value of any cabinet, far
/// above rounding. Doubling it refuses feet that are up to 1.4 times as far from a line.
const COLLINEARITY_TOLERANCE: f64 = 1e-6;

/// The distribution of loads on the cabinet over its feet.
///
/// The loads of three feet follow from statics. Four feet are taken as equally stiff under a rigid
/// cabinet, so that the loads are the linear function of x and z that balances forces and moments.
/// The horizontal force acts on the feet together, at their mean height.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Feet {
    /// The number of feet, 3 or 4.
    pub(crate) count: usize,
    pub(crate) distribution: LoadDistribution<f64>,
}

lane_struct! {
    /// The coefficients of the distribution. Entries beyond the last foot repeat the position of
    /// the first foot and carry no load.
    #[derive(Clone, Copy, Debug)]
    LoadDistribution {
        /// The vertical load of each foot by the weight of the cabinet (N).
        cabinet_weight_loads: [N<T>; MAX_FEET],
        /// The vertical load of each foot per component of a load on the cabinet.
        loads_per_component: [[N<T>; LOAD_COMPONENTS]; MAX_FEET],
        /// The position of each foot along c1 and c3 (m).
        foot_positions: [[N<T>; 2]; MAX_FEET],
        /// The coefficient of friction.
        friction_coefficient: N<T>,
        /// The weight of the cabinet (N).
        cabinet_weight: N<T>,
    }
}

impl Feet {
    /// Computes the distribution of a machine; `None` without a cabinet, with other than three or
    /// four feet, or with all feet in a line.
    pub(crate) fn new(machine: &Machine) -> Option<Self> {
        let cabinet = machine.cabinet?;
        let count = machine.feet.len();
        if !(3..=MAX_FEET).contains(&count) {
            return None;
        }
        let mean_coordinate = |axis: usize| {
            machine.feet.iter().map(|foot| foot.foot_m[axis]).sum::<f64>() / count as f64
        };
        let [mean_x, mean_y, mean_z] = [mean_coordinate(0), mean_coordinate(1), mean_coordinate(2)];
        let foot_positions: Vec<[f64; 2]> = machine
            .feet
            .iter()
            .map(|foot| [foot.foot_m[0] - mean_x, foot.foot_m[2] - mean_z])
            .collect();
        let sum_over_feet =
            |term: fn(&[f64; 2]) -> f64| foot_positions.iter().map(term).sum::<f64>();
        let [xx, xz, zz] = [
            sum_over_feet(|p| p[0] * p[0]),
            sum_over_feet(|p| p[0] * p[1]),
            sum_over_feet(|p| p[1] * p[1]),
        ];
        let determinant = xx * zz - xz * xz;
        let trace = xx + zz;
        if determinant.is_nan() || determinant <= COLLINEARITY_TOLERANCE * trace * trace {
            return None;
        }
        let weight_n = cabinet.mass_kg * machine.gravity_m_per_s2;
        let [centre_x, _, centre_z] = cabinet.centre_m;
        let mut cabinet_weight_loads = [N(0.0); MAX_FEET];
        let mut loads_per_component = [[N(0.0); LOAD_COMPONENTS]; MAX_FEET];
        for (k, [x, z]) in foot_positions.into_iter().enumerate() {
            // The load of this foot per unit of the sum of all loads, and per unit of their first
            // moments about the feet's mean position.
            let load_per_total = 1.0 / count as f64;
            let load_per_moment_x = (zz * x - xz * z) / determinant;
            let load_per_moment_z = (xx * z - xz * x) / determinant;
            cabinet_weight_loads[k] = N(weight_n
                * (load_per_total
                    + load_per_moment_x * (centre_x - mean_x)
                    + load_per_moment_z * (centre_z - mean_z)));
            // The sum of the feet's loads is -F_y, the first moments of the loads in x and z are
            // -M_z - y F_x and M_x - y F_z.
            loads_per_component[k] = [
                -load_per_moment_x * mean_y,
                load_per_moment_x * mean_x + load_per_moment_z * mean_z - load_per_total,
                -load_per_moment_z * mean_y,
                load_per_moment_z,
                0.0,
                -load_per_moment_x,
            ]
            .map(N);
        }
        let foot_position = |k: usize| machine.feet[if k < count { k } else { 0 }].foot_m;
        let foot_positions =
            core::array::from_fn(|k| [foot_position(k)[0], foot_position(k)[2]].map(N));
        let friction_coefficient = N(cabinet.friction_coefficient);
        let cabinet_weight = N(weight_n);
        Some(Self {
            count,
            distribution: LoadDistribution {
                cabinet_weight_loads,
                loads_per_component,
                foot_positions,
                friction_coefficient,
                cabinet_weight,
            },
        })
    }

    /// Returns the vertical loads of the feet (N) under a load on the cabinet.
    pub(crate) fn loads_n(&self, load: &[f64; LOAD_COMPONENTS]) -> Vec<f64> {
        let foot_load_n = |k: usize| {
            let component_pairs = self.distribution.loads_per_component[k].iter().zip(load);
            self.distribution.cabinet_weight_loads[k].0
                + component_pairs
                    .map(|(coefficient, load_component)| coefficient.0 * load_component)
                    .sum::<f64>()
        };
        (0..self.count).map(foot_load_n).collect()
    }

    /// Returns the margin against slipping (N) under a load on the cabinet.
    pub(crate) fn slip_margin_n(&self, load: &[f64; LOAD_COMPONENTS]) -> f64 {
        let [force_x, force_y, force_z, ..] = *load;
        let LoadDistribution {
            friction_coefficient: N(friction), cabinet_weight: N(weight_n), ..
        } = self.distribution;
        friction * (weight_n - force_y) - (force_x * force_x + force_z * force_z).sqrt()
    }

    /// Returns the margin against walking (N) under a load on the cabinet; walking is slipping,
    /// turning or both.
    pub(crate) fn walk_margin_n(&self, load: &[f64; LOAD_COMPONENTS]) -> f64 {
        let mut foot_loads = [N(0.0); MAX_FEET];
        for (foot_load, load_n) in foot_loads.iter_mut().zip(self.loads_n(load)) {
            *foot_load = N(load_n);
        }
        self.slip_margin_n(load)
            - turning_force_n(&self.distribution.foot_positions, &foot_loads, &load.map(N)).0
    }

    /// Returns the vertical loads of the feet (N) under the weight of the machine at rest, with all
    /// bodies at their positions before the machine sags.
    pub(crate) fn rest_loads_n(&self, machine: &Machine) -> Vec<f64> {
        let masses_and_positions = [
            (machine.tub.mass_kg, machine.tub.centre_x_m),
            (machine.shaft.mass_kg, machine.shaft.centre_x_m),
            (machine.drum.mass_kg, machine.drum.centre_x_m),
        ];
        let unbalances = machine.unbalances().map(|u| (u.mass_kg, u.x_m));
        let mut weight_n = 0.0;
        let mut moment_n_m = 0.0;
        for (mass_kg, x_m) in masses_and_positions.into_iter().chain(unbalances) {
            weight_n += machine.gravity_m_per_s2 * mass_kg;
            moment_n_m += machine.gravity_m_per_s2 * mass_kg * x_m;
        }
        self.loads_n(&[0.0, -weight_n, 0.0, 0.0, 0.0, -moment_n_m])
    }
}

/// Returns the amount (N) by which a load's moment about the vertical reduces the margin against
/// slipping.
///
/// The cabinet stays in place if the floor force of each foot is within the foot's friction. The
/// feet share the horizontal force in proportion to their loads; this leaves a moment about the
/// centre of the loads. Forces across the arms from that centre, in proportion to load and arm,
/// balance the moment and have no resultant. The sum of the magnitudes of both forces, relative to
/// the foot's load, is greatest at the foot with the longest arm.
#[inline(always)]
pub(crate) fn turning_force_n<T: Real>(
    foot_positions: &[[N<T>; 2]; MAX_FEET],
    foot_loads: &[N<T>; MAX_FEET],
    load: &[N<T>; LOAD_COMPONENTS],
) -> N<T> {
    let zero = load[0].lit(0.0);
    let mut total_load = load[0].lit(REGULARISING_LOAD_N);
    let mut load_moments = [zero; 2];
    let mut positive_loads = *foot_loads;
    for k in 0..MAX_FEET {
        // A foot with a negative load would lift, and has no friction.
        positive_loads[k] = foot_loads[k].where_less(zero, zero, foot_loads[k]);
        total_load += positive_loads[k];
        load_moments[0] += positive_loads[k] * foot_positions[k][0];
        load_moments[1] += positive_loads[k] * foot_positions[k][1];
    }
    let centre = [load_moments[0] / total_load, load_moments[1] / total_load];
    let mut second_moment = load[0].lit(REGULARISING_LOAD_N);
    let mut max_squared_arm = zero;
    for k in 0..MAX_FEET {
        let [arm_x, arm_z] = [foot_positions[k][0] - centre[0], foot_positions[k][1] - centre[1]];
        let squared_arm = arm_x * arm_x + arm_z * arm_z;
        second_moment += positive_loads[k] * squared_arm;
        max_squared_arm = max_squared_arm.where_less(squared_arm, squared_arm, max_squared_arm);
    }
    let max_arm_m = max_squared_arm.sqrt();
    let min_second_moment = (load[0].lit(MIN_ARM_M) * max_arm_m * total_load).v();
    let vertical_moment = load[4] - (centre[1] * load[0] - centre[0] * load[2]);
    vertical_moment.abs() * max_arm_m * total_load
        / second_moment.where_less(min_second_moment, min_second_moment, second_moment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Cabinet, Foot};

    fn machine_on_feet(feet: &[[f64; 3]]) -> Machine {
        let mut machine = Machine::paper();
        machine.cabinet =
            Some(Cabinet { mass_kg: 30.0, centre_m: [0.2, -0.1, 0.01], friction_coefficient: 0.4 });
        machine.feet = feet.iter().map(|&foot_m| Foot { foot_m }).collect();
        machine
    }

    /// Computes the force and the moment about O that remain after adding the floor's forces.
    fn residual_load(machine: &Machine, load: &[f64; LOAD_COMPONENTS]) -> [f64; LOAD_COMPONENTS] {
        let feet = Feet::new(machine).unwrap();
        let cross_product = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let cabinet = machine.cabinet.unwrap();
        let mut forces = vec![(cabinet.centre_m, [0.0, -9.81 * cabinet.mass_kg, 0.0])];
        for (foot, load_n) in machine.feet.iter().zip(feet.loads_n(load)) {
            let horizontal_share = 1.0 / machine.feet.len() as f64;
            forces.push((
                foot.foot_m,
                [-horizontal_share * load[0], load_n, -horizontal_share * load[2]],
            ));
        }
        let mut remaining_load = *load;
        for (position, force) in forces {
            let moment = cross_product(position, force);
            for i in 0..3 {
                remaining_load[i] += force[i];
                remaining_load[3 + i] += moment[i];
            }
        }
        remaining_load
    }

    const CORNER_FEET: [[f64; 3]; 4] =
        [[0.5, -0.5, 0.25], [0.5, -0.5, -0.25], [-0.1, -0.5, 0.25], [-0.1, -0.5, -0.25]];

    #[test]
    fn loads_of_feet_balance_forces_and_moments() {
        let load = [30.0, -350.0, 40.0, 12.0, 5.0, -70.0];
        for feet in [&CORNER_FEET[..], &[[0.5, -0.5, 0.2], [0.45, -0.5, -0.3], [-0.1, -0.5, 0.1]]] {
            let machine = machine_on_feet(feet);
            let residual = residual_load(&machine, &load);
            // The moment about the vertical (component 4) is balanced by friction, not by the
            // vertical loads.
            for i in [0, 1, 2, 3, 5] {
                assert!(residual[i].abs() < 1e-10, "{i}: {}", residual[i]);
            }
        }
    }

    // The floor's forces on all feet balance the load. The margin is zero when, at one foot, the
    // sum of the magnitudes of the force's two parts (see [`turning_force_n`]) equals the foot's
    // friction.
    #[test]
    fn a_margin_against_walking_keeps_every_foot_within_its_friction() {
        let mut turning_case_count = 0;
        for feet in [&CORNER_FEET[..], &[[0.5, -0.5, 0.2], [0.45, -0.5, -0.3], [-0.1, -0.5, 0.1]]] {
            let machine = machine_on_feet(feet);
            let distribution = Feet::new(&machine).unwrap();
            for seed in 0..200_u32 {
                let random_number =
                    |k: u32| f64::from((seed * 7919 + k * 104_729) % 2003) / 1001.5 - 1.0;
                let load = [
                    60.0 * random_number(1),
                    -350.0 + 90.0 * random_number(2),
                    60.0 * random_number(3),
                    12.0 * random_number(4),
                ];
                let load = [load[0], load[1], load[2], load[3], 160.0 * random_number(5), -70.0];
                let loads_n = distribution.loads_n(&load);
                let total_n: f64 = loads_n.iter().sum();
                if loads_n.iter().any(|n| *n < 1.0) {
                    continue;
                }
                let mean_coordinate = |axis: usize| {
                    let moments = feet.iter().zip(&loads_n).map(|(foot, n)| foot[axis] * n);
                    moments.sum::<f64>() / total_n
                };
                let arms: Vec<[f64; 2]> = feet
                    .iter()
                    .map(|foot| [foot[0] - mean_coordinate(0), foot[2] - mean_coordinate(2)])
                    .collect();
                let second_moment: f64 =
                    arms.iter().zip(&loads_n).map(|([x, z], n)| n * (x * x + z * z)).sum();
                let moment_about = |force: [f64; 2], position: [f64; 2]| {
                    position[1] * force[0] - position[0] * force[1]
                };
                let moment = load[4]
                    - moment_about([load[0], load[2]], [mean_coordinate(0), mean_coordinate(2)]);
                let mut force_sum = [0.0; 2];
                let mut friction_moment = 0.0;
                let mut max_friction_ratio = 0.0_f64;
                for (([x, z], foot), n) in arms.iter().zip(feet).zip(&loads_n) {
                    let [load_share, turning_factor] = [n / total_n, moment * n / second_moment];
                    let force = [
                        -load[0] * load_share - turning_factor * z,
                        -load[2] * load_share + turning_factor * x,
                    ];
                    force_sum = [force_sum[0] + force[0], force_sum[1] + force[1]];
                    friction_moment += moment_about(force, [foot[0], foot[2]]);
                    assert!(
                        (0.4 * n - force[0].hypot(force[1])) / n * total_n
                            >= distribution.walk_margin_n(&load) - 1e-9
                    );
                    let magnitude_sum =
                        load[0].hypot(load[2]) * load_share + turning_factor.abs() * x.hypot(*z);
                    max_friction_ratio = max_friction_ratio.max(magnitude_sum / n);
                }
                assert!(
                    (force_sum[0] + load[0]).abs() < 1e-9 && (force_sum[1] + load[2]).abs() < 1e-9
                );
                assert!(
                    (friction_moment + load[4]).abs() < 1e-9,
                    "{friction_moment} for {}",
                    load[4]
                );
                let expected_margin_n = (0.4 - max_friction_ratio) * total_n;
                let computed_margin_n = distribution.walk_margin_n(&load);
                assert!(
                    (computed_margin_n - expected_margin_n).abs() < 1e-6,
                    "{computed_margin_n} for {expected_margin_n}"
                );
                assert!(computed_margin_n <= distribution.slip_margin_n(&load));
                turning_case_count += i32::from(
                    (computed_margin_n < 0.0) != (distribution.slip_margin_n(&load) < 0.0),
                );
            }
        }
        assert!(turning_case_count > 20, "{turning_case_count} turn before they slip");
    }

    #[test]
    fn a_single_loaded_foot_balances_moments_at_the_radius_of_its_pad() {
        let feet = Feet::new(&machine_on_feet(&CORNER_FEET)).unwrap();
        let mut single_foot_case_count = 0;
        for tilting_moment_n_m in (0..200).map(f64::from) {
            let load = [20.0, 400.0, 30.0, 50.0, 25.0, -tilting_moment_n_m];
            let loaded_feet = feet.loads_n(&load).iter().filter(|n| **n > 0.0).count();
            let turning_margin_n = feet.slip_margin_n(&load) - feet.walk_margin_n(&load);
            assert!(
                (0.0..1e4).contains(&turning_margin_n),
                "{turning_margin_n} N with {loaded_feet} feet"
            );
            single_foot_case_count += i32::from(loaded_feet == 1);
        }
        assert!(single_foot_case_count > 0);
    }

    #[test]
    fn feet_carry_the_weight_at_rest() {
        let machine = machine_on_feet(&CORNER_FEET);
        let loads_n = Feet::new(&machine).unwrap().rest_loads_n(&machine);
        let weight_n = 9.81 * (30.0 + 23.87 + 4.34 + 3.64 + 0.4);
        assert!((loads_n.iter().sum::<f64>() - weight_n).abs() < 1e-9, "{loads_n:?}");
        // The cabinet's mass centre is offset towards c3, so that the first and the third foot
        // carry more.
        assert!(loads_n[0] > loads_n[1] && loads_n[2] > loads_n[3], "{loads_n:?}");
    }

    #[test]
    fn feet_in_a_line_are_refused() {
        let feet_in_line = [[0.0, -0.5, 0.0], [0.1, -0.5, 0.1], [0.3, -0.5, 0.3]];
        assert!(Feet::new(&machine_on_feet(&feet_in_line)).is_none());
        assert!(Feet::new(&machine_on_feet(&CORNER_FEET[..2])).is_none());
    }
}
