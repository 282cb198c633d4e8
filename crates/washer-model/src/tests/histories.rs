//! Time histories against those of an independent program.

use super::instruments::{Sampler, paper, ready};
use crate::Spin;
use crate::channel::Channel;
use crate::machine::Machine;
use crate::model::{Linear, Model, Nonlinear};
use crate::reference_tests::table;

/// The default step. Steps of 5e-5 s bring the run-up's error from 2e-9 to 2e-11; the turn's, 8e-7 at most, does not change.
const STEP_S: f64 = 2e-4;

/// Samples are 10 ms apart.
const EVERY_S: f64 = 0.01;

/// The largest deviation of any channel, over that channel's peak.
fn compare<M: Model<f64>>(file: &str, machine: Machine, spin: Spin, end_s: f64) -> f64 {
    let (names, rows) = table(file);
    let point = ready(machine, spin, end_s);
    let mut sampler = Sampler::<M>::run(&point, M::at_rest(&point), EVERY_S, end_s, STEP_S);
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
    eprintln!("{file}: {}", errors.join(", "));
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
    let error = compare::<Nonlinear<f64>>("cycloidal_600rpm_4s_nonlinear.csv", machine, spin, 6.0);
    assert!(error < 1e-8, "{error:e}");
}

#[test]
fn val_linear_run_up_matches_an_independent_time_history() {
    let (machine, spin) = run_up();
    let error = compare::<Linear<f64>>("cycloidal_600rpm_4s_linear.csv", machine, spin, 6.0);
    assert!(error < 1e-8, "{error:e}");
}

#[test]
fn val_nonlinear_turn_matches_an_independent_time_history() {
    let (machine, spin) = turn();
    let error = compare::<Nonlinear<f64>>("triangular_350rpm_8s_nonlinear.csv", machine, spin, 16.0);
    assert!(error < 1e-6, "{error:e}");
}

#[test]
fn val_linear_turn_matches_an_independent_time_history() {
    let (machine, spin) = turn();
    let error = compare::<Linear<f64>>("triangular_350rpm_8s_linear.csv", machine, spin, 16.0);
    assert!(error < 1e-6, "{error:e}");
}
