//! Time histories against those of an independent program.

use super::instruments::{Sampler, paper, ready};
use crate::Spin;
use crate::channel::Channel;
use crate::machine::Machine;
use crate::model::{Linear, Model, Nonlinear};
use crate::reference_tests::table;

/// Samples are 10 ms apart.
const EVERY_S: f64 = 0.01;

/// Largest deviation of each channel over its peak, with the channel it is of.
fn compare<M: Model<f64>>(file: &str, machine: Machine, spin: Spin, end_s: f64, step_s: f64) -> f64 {
    let (names, rows) = table(file);
    let point = ready(machine, spin, end_s);
    let mut sampler = Sampler::<M>::run(&point, M::at_rest(&point), EVERY_S, end_s, step_s);
    assert_eq!(sampler.states.len(), rows.len());
    let mut worst = 0.0_f64;
    let mut errors = Vec::new();
    let ours: Vec<_> = (0..rows.len()).map(|i| sampler.channels(i)).collect();
    for channel in Channel::ALL {
        let name = format!("{}_{}", channel.name(), channel.unit());
        let column = names.iter().position(|n| *n == name).unwrap();
        let peak = rows.iter().fold(0.0_f64, |m, row| m.max(row[column].abs()));
        let error = rows
            .iter()
            .zip(&ours)
            .fold(0.0_f64, |m, (row, ours)| m.max((ours[channel.index()] - row[column]).abs() / peak));
        errors.push(format!("{name} {error:.1e}"));
        worst = worst.max(error);
    }
    for (i, row) in rows.iter().enumerate() {
        assert!((row[0] - i as f64 * EVERY_S).abs() < 1e-12);
    }
    eprintln!("{file}, steps of {step_s:e} s: {}", errors.join(", "));
    worst
}

fn run_up() -> (Machine, Spin) {
    (paper(0.4, 140.0), Spin::Cycloidal { peak_rpm: 600.0, ramp_s: 4.0 })
}

fn turn() -> (Machine, Spin) {
    (paper(0.7, 110.0), Spin::Triangular { peak_rpm: 350.0, ramp_s: 8.0 })
}

#[test]
fn val_nonlinear_run_up_matches_an_independent_time_history() {
    let (machine, spin) = run_up();
    let error = compare::<Nonlinear<f64>>("cycloidal_600rpm_4s_nonlinear.csv", machine, spin, 6.0, 5e-5);
    assert!(error < 1e-8, "{error:e}");
}

#[test]
fn val_linear_run_up_matches_an_independent_time_history() {
    let (machine, spin) = run_up();
    let error = compare::<Linear<f64>>("cycloidal_600rpm_4s_linear.csv", machine, spin, 6.0, 5e-5);
    assert!(error < 1e-8, "{error:e}");
}

#[test]
fn val_nonlinear_turn_matches_an_independent_time_history() {
    let (machine, spin) = turn();
    let error = compare::<Nonlinear<f64>>("triangular_350rpm_8s_nonlinear.csv", machine, spin, 16.0, 5e-5);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn val_linear_turn_matches_an_independent_time_history() {
    let (machine, spin) = turn();
    let error = compare::<Linear<f64>>("triangular_350rpm_8s_linear.csv", machine, spin, 16.0, 5e-5);
    assert!(error < 1e-6, "{error:e}");
}
