//! Tests that the result of a turn does not depend on the turns in other lanes.

use super::*;
use crate::stability::period_map::{TurnRequest, TurnResult, compute_turns};
use crate::{Bushing, Unbalance};
use lane_ode::Cancel;

/// Returns a random machine with the kinds of elements whose bits are set in `element_kinds`:
/// friction, stops, stiffening springs, a bushing, a second unbalance.
fn random_machine_with_elements(element_kinds: u64, random_numbers: &mut fastrand::Rng) -> Machine {
    let mut machine = random_machine(random_numbers);
    let mut random_between = |low: f64, high: f64| low + (high - low) * random_numbers.f64();
    if element_kinds & 1 != 0 {
        for damper in &mut machine.dampers {
            damper.friction_n = random_between(5.0, 80.0);
        }
    }
    if element_kinds & 2 != 0 {
        for side in [1.0, -1.0] {
            machine.stops.push(BumpStop {
                tub_m: [0.35, 0.0, 0.28 * side],
                direction: [0.0, 0.1, side],
                clearance_m: random_between(0.004, 0.02),
                stiffness_n_per_m: random_between(1e4, 1.5e5),
                damping_n_s_per_m: random_between(0.0, 400.0),
                softness_m: random_between(1e-4, 1e-3),
            });
        }
    }
    if element_kinds & 4 != 0 {
        machine
            .springs
            .iter_mut()
            .for_each(|spring| spring.cubic_n_per_m3 = random_between(1e5, 3e6));
    }
    if element_kinds & 8 != 0 {
        machine.bushings.push(Bushing {
            tub_m: [0.45, 0.0, 0.0],
            stiffness_n_per_m: [0.0, random_between(500.0, 2e3), random_between(500.0, 2e3)],
            cubic_n_per_m3: [0.0, 1e7, random_between(5e6, 2e7)],
            damping_n_s_per_m: [0.0, 10.0, 15.0],
        });
    }
    if element_kinds & 16 != 0 {
        let mass_kg = random_between(0.05, 0.4);
        let x_m = random_between(0.1, 0.3);
        machine.further_unbalances.push(Unbalance { mass_kg, x_m, radius_m: 0.18, angle_deg: 0.0 });
    }
    machine
}

fn result_bits(result: &TurnResult) -> Vec<u64> {
    let mut numbers: Vec<f64> = result.end_state.to_vec();
    if let Some(record) = &result.record {
        numbers.extend(record.monodromy.iter().flatten().map(|entry| entry.0));
        numbers.extend(record.peaks);
        numbers.push(record.min_gap_m);
        numbers.extend(record.states.iter().flatten());
    }
    numbers.into_iter().map(f64::to_bits).collect()
}

/// Compares turns of random machines with every combination of elements, computed alone and
/// together with others. The environment variables SEED and MACHINES select other machines.
#[test]
fn turns_do_not_depend_on_other_lanes() {
    let number_from_env = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |text| text.parse().unwrap())
    };
    let mut random_numbers = fastrand::Rng::with_seed(number_from_env("SEED", 1));
    for number in 0..number_from_env("MACHINES", 64) {
        let element_kinds = number % 32;
        let points: Vec<Point> = (0..1 + random_numbers.usize(..4))
            .map(|_| {
                prepare_at_speed(
                    random_machine_with_elements(element_kinds, &mut random_numbers),
                    100.0,
                )
            })
            .collect();
        let mut settings: Vec<Settings<'_>> = points.iter().map(Settings::new).collect();
        let speed_rpm = 60.0 + 400.0 * random_numbers.f64();
        let mut requests: Vec<TurnRequest<'_>> = Vec::new();
        for _ in 0..2 + random_numbers.usize(..12) {
            let settings = random_numbers.choice(&mut settings).unwrap();
            let speed_rpm = speed_rpm * (1.0 + 0.02 * random_numbers.f64());
            let setup = match random_numbers.u8(..3) {
                0 => settings.held_case(speed_rpm).unwrap().setup,
                1 => settings.held_case(speed_rpm).unwrap().without_caps().unwrap().setup,
                _ => settings.continuation_setup(speed_rpm).unwrap(),
            };
            let equilibrium = settings.point.equilibrium();
            let deviation_size = 0.02 * random_numbers.f64();
            let start_state = core::array::from_fn(|i| {
                let offset = deviation_size * (2.0 * random_numbers.f64() - 1.0);
                if i < 2 || (4..6).contains(&i) {
                    equilibrium[i] + offset
                } else if i < COORDINATES {
                    equilibrium[i]
                } else {
                    offset
                }
            });
            requests.push(TurnRequest { setup, start_state, is_recorded: random_numbers.bool() });
        }
        let results = compute_turns(&requests, Cancel::Never);
        for (request, result) in requests.iter().zip(&results) {
            let single_result =
                compute_turns(core::slice::from_ref(request), Cancel::Never).remove(0);
            let batch_key = request.setup.batch_key();
            assert!(
                result_bits(&single_result) == result_bits(result),
                "machine {number}, elements {element_kinds:b}, {batch_key:?}, recorded {}: {:?} \
                 {:?}",
                request.is_recorded,
                single_result.end_state,
                result.end_state
            );
        }
    }
}
