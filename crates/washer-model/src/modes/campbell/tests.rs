//! Tests of the modes against the paper (its Fig. 7), and of their general properties.

use crate::machine::Machine;
use crate::modes::campbell::{ModeAtSpeed, ModeOverSpeed, campbell};
use crate::modes::shape::{MotionPlane, Movement};
use crate::{Point, Profile, Spin, Timing, modes, prepare};
use core::f64::consts::TAU;
use lane_ode::Simd;
use std::sync::OnceLock;

fn point(machine: Machine) -> Point {
    let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 1200.0, ramp_s: 20.0 };
    let timing = Timing { end_s: 20.0, window_s: [0.0, 20.0], checkpoints: 0 };
    prepare(Simd::Scalar, &[(machine, spin)], &timing).remove(0).unwrap()
}

fn paper_modes() -> &'static [ModeOverSpeed] {
    static MODES: OnceLock<Vec<ModeOverSpeed>> = OnceLock::new();
    MODES.get_or_init(|| {
        let speeds: Vec<f64> = (0..=24).map(|k| 50.0 * f64::from(k)).collect();
        campbell(&point(Machine::paper()), &speeds).unwrap()
    })
}

#[test]
fn val_resonances_agree_with_the_paper() {
    let modes = paper_modes();
    let references = [
        (99.9, 99.86, Movement::Rocking, MotionPlane::Horizontal),
        (147.6, 147.76, Movement::Rocking, MotionPlane::Vertical),
        (162.3, 162.08, Movement::Translation, MotionPlane::Horizontal),
        (261.6, 261.48, Movement::Translation, MotionPlane::Vertical),
    ];
    for (mode, (paper, independent, movement, plane)) in modes.iter().zip(references) {
        let [resonance] = mode.resonances[..] else { panic!("{:?}", mode.resonances) };
        let speed = resonance.speed_rpm;
        assert!((speed / paper - 1.0).abs() < 2e-3, "{speed} against the paper's {paper}");
        assert!((speed - independent).abs() < 0.02, "{speed} against {independent}");
        assert!((resonance.mode.frequency_rpm - speed).abs() < 1e-6);
        assert_eq!((mode.motion.movement, mode.motion.plane), (movement, plane), "{}", mode.motion);
        assert!(
            relative_variation(&resonance.mode) < 3e-3,
            "{} over a turn at {speed}",
            relative_variation(&resonance.mode)
        );
    }
    assert!(modes[4..].iter().all(|mode| mode.resonances.is_empty()));
}

#[test]
fn loaded_springs_at_the_tabulated_positions_do_not_give_the_papers_resonances() {
    // The paper's tables may also be read as positions of the loaded machine. By the law of the
    // lever each spring then carries its share of the weight, and its free length is shorter by the
    // deflection.
    let mut machine = Machine::paper();
    let drum = &machine.drum;
    let unbalance = &machine.unbalance;
    let bodies = [
        (machine.tub.mass_kg, machine.tub.centre_x_m),
        (machine.shaft.mass_kg, machine.shaft.centre_x_m),
        (drum.mass_kg, drum.centre_x_m),
        (unbalance.mass_kg, unbalance.x_m),
    ];
    let mass_kg: f64 = bodies.iter().map(|(mass, _)| mass).sum();
    let centre_x_m = bodies.iter().map(|(mass, x)| mass * x).sum::<f64>() / mass_kg;
    let [front_x_m, rear_x_m] = [0, 2].map(|k| machine.springs[k].tub_m[0]);
    let weight_n = mass_kg * machine.gravity_m_per_s2;
    for (k, spring) in machine.springs.iter_mut().enumerate() {
        let other_x_m = if k < 2 { rear_x_m } else { front_x_m };
        let share = (centre_x_m - other_x_m) / (spring.tub_m[0] - other_x_m);
        let upwards = (spring.cabinet_m[1] - spring.tub_m[1]) / spring.given_length_m();
        let tension_n = 0.5 * share * weight_n / upwards;
        spring.free_length_m = Some(spring.given_length_m() - tension_n / spring.stiffness_n_per_m);
    }
    let point = point(machine);
    assert!(point.equilibrium()[0].abs() < 1e-6 && point.static_sag_m().abs() < 1e-6);
    let speeds: Vec<f64> = (0..=12).map(|k| 25.0 * f64::from(k)).collect();
    let modes = campbell(&point, &speeds).unwrap();
    for (mode, (paper, expected)) in
        modes.iter().zip([(99.9, 104.96), (147.6, 146.46), (162.3, 173.26), (261.6, 255.49)])
    {
        let [resonance] = mode.resonances[..] else { panic!("{:?}", mode.resonances) };
        assert!((resonance.speed_rpm - expected).abs() < 0.01, "{}", resonance.speed_rpm);
        assert!(
            (resonance.speed_rpm / paper - 1.0).abs() > 7e-3,
            "{} against {paper}",
            resonance.speed_rpm
        );
    }
}

/// Returns half the range of the frequency over a turn, relative to the mean.
fn relative_variation(mode: &ModeAtSpeed) -> f64 {
    0.5 * (mode.greatest_rpm - mode.least_rpm) / mode.frequency_rpm
}

#[test]
fn val_frequencies_hardly_vary_over_a_turn() {
    // The paper gives a variation of less than 0.3 % up to 1200 rpm. The first mode at 1200 rpm
    // exceeds it slightly.
    for (k, mode) in paper_modes()[..4].iter().enumerate() {
        for (mode_at_speed, step) in mode.at_speed.iter().zip(0..) {
            let speed = 50 * step;
            if (k, speed) == (0, 1200) {
                assert!(
                    (relative_variation(mode_at_speed) - 3.0133e-3).abs() < 2e-6,
                    "{} at {speed} rpm",
                    relative_variation(mode_at_speed)
                );
            } else {
                assert!(
                    relative_variation(mode_at_speed) < 3e-3,
                    "{}: {} at {speed} rpm",
                    mode.motion,
                    relative_variation(mode_at_speed)
                );
            }
        }
    }
    // Without dampers the variation of all modes is below 0.3 %.
    let mut undamped = Machine::paper();
    for damper in &mut undamped.dampers {
        damper.damping_n_s_per_m = 0.0;
    }
    for mode in &campbell(&point(undamped), &[1200.0]).unwrap()[..4] {
        assert!(
            relative_variation(&mode.at_speed[0]) < 2.97e-3,
            "{}: {}",
            mode.motion,
            relative_variation(&mode.at_speed[0])
        );
    }
}

#[test]
fn modes_are_followed_through_crossings() {
    let modes = paper_modes();
    // The frequency of pitch crosses that of the horizontal translation, whose damping ratio is
    // several times as great.
    let pitch = &modes[1].at_speed;
    let sway = &modes[2].at_speed;
    assert!(pitch[0].frequency_rpm < sway[0].frequency_rpm);
    assert!(pitch[24].frequency_rpm > sway[24].frequency_rpm + 50.0);
    for k in 0..25 {
        assert!(pitch[k].damping_ratio < 0.03 && sway[k].damping_ratio > 0.1, "at step {k}");
    }
    for mode in modes {
        for pair in mode.at_speed.windows(2) {
            let jump = (pair[1].frequency_rpm - pair[0].frequency_rpm).abs();
            assert!(jump < 60.0, "{}: {jump} rpm from one speed to the next", mode.motion);
        }
    }
}

#[test]
fn a_mode_solves_the_equations_of_motion() {
    let point = point(Machine::paper());
    let speed = 900.0 * TAU / 60.0;
    let matrices = point.matrices(1.0, speed, 0.0);
    for mode in modes(&point, 1.0, speed).unwrap().modes {
        let re = mode.re_per_s;
        let im = mode.im_rad_per_s;
        // The real and imaginary part of s^2.
        let square_re = re * re - im * im;
        let square_im = 2.0 * re * im;
        for i in 0..10 {
            let mut residual = [0.0; 2];
            let mut size = 0.0;
            for j in 0..10 {
                let m = matrices.mass[i][j];
                let c = matrices.damping[i][j];
                let k = matrices.stiffness[i][j];
                let a = m * square_re + c * re + k;
                let b = m * square_im + c * im;
                let [x, y] = mode.shape[j];
                residual[0] += a * x - b * y;
                residual[1] += a * y + b * x;
                size += k.abs() * x.hypot(y);
            }
            let residual = residual[0].hypot(residual[1]);
            assert!(residual < 1e-9 * size, "row {i} of the mode at {im} rad/s");
        }
    }
}

#[test]
fn an_overdamped_machine_has_ten_modes() {
    let mut machine = Machine::paper();
    machine.dampers.iter_mut().for_each(|damper| damper.damping_n_s_per_m = 3000.0);
    let modes = campbell(&point(machine), &[0.0, 100.0, 200.0]).unwrap();
    assert_eq!(modes.len(), 10);
    let overdamped: Vec<_> =
        modes.iter().filter(|mode| mode.at_speed[0].frequency_rpm == 0.0).collect();
    assert!(!overdamped.is_empty());
    for mode in overdamped {
        assert!(mode.at_speed[0].damping_ratio >= 1.0, "{}", mode.at_speed[0].damping_ratio);
    }
}
