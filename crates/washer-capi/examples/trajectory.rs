//! This project's own methods on the trajectory of `scripts/peers/trajectory.h`, in the same words:
//! `trajectory SIMD METHOD SETTINGS`, with rk4 STEP, rk4-mass-scaled ACCURACY, dopri5 RTOL ATOL or
//! rodas5p RTOL ATOL. Lanes are filled with copies, and the time is that of one of them. It takes
//! 50 s unless the environment has another `END_S`.
#![allow(clippy::print_stdout)]

use std::process::ExitCode;
use std::time::Instant;

use lane_ode::{Simd, Tolerance};
use washer_model::{
    Cases, Channel, Gear, Machine, Method, ModelKind, Point, Spin, Timing, prepare, simulate,
};

const USAGE: &str = "usage: trajectory scalar|avx2|avx512|neon \
    rk4 STEP | rk4-mass-scaled ACCURACY | dopri5 RTOL ATOL | rodas5p RTOL ATOL";

fn main() -> ExitCode {
    match run() {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(Failed::Usage) => {
            eprintln!("{USAGE}");
            ExitCode::from(2)
        }
        Err(Failed::Because(what)) => {
            eprintln!("{what}");
            ExitCode::FAILURE
        }
    }
}

enum Failed {
    Usage,
    Because(String),
}

fn number(word: &str) -> Result<f64, Failed> {
    word.parse().map_err(|_| Failed::Usage)
}

/// The method that the words name, and how the table calls it.
fn method(
    words: &[&str],
    point: &Point,
    spin: &Spin,
    end_s: f64,
) -> Result<(Method, &'static str), Failed> {
    let tolerance = |relative: &str, absolute: &str| {
        Ok(Tolerance {
            relative: number(relative)?,
            absolute: number(absolute)?,
            max_steps: u64::MAX,
        })
    };
    match words {
        ["rk4", step] => Ok((Method::Rk4 { step_s: number(step)? }, "RK4")),
        ["rk4-mass-scaled", accuracy] => {
            let geared =
                Cases::new([(point, spin)], end_s).choose(ModelKind::Nonlinear, number(accuracy)?);
            let geared = geared.map_err(|error| Failed::Because(error.to_string()))?;
            let geared =
                geared.ok_or_else(|| Failed::Because("plain RK4 is cheaper".to_owned()))?;
            Ok((Method::Geared(geared), "mass-scaled RK"))
        }
        ["dopri5", rtol, atol] => Ok((Method::Dopri5(tolerance(rtol, atol)?), "dopri5")),
        ["rodas5p", rtol, atol] => Ok((Method::Rodas5p(tolerance(rtol, atol)?), "Rodas5P")),
        _ => Err(Failed::Usage),
    }
}

fn run() -> Result<String, Failed> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let words: Vec<_> = arguments.iter().map(String::as_str).collect();
    let (name, words) = words.split_first().ok_or(Failed::Usage)?;
    let known = Simd::ALL.into_iter().find(|simd| simd.name() == *name && simd.is_available());
    let simd = known.ok_or(Failed::Usage)?;

    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = 0.4;
    machine.dampers.iter_mut().for_each(|damper| damper.damping_n_s_per_m = 140.0);
    let spin = Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 };
    let end_s = std::env::var("END_S").map_or(Ok(50.0), |given| number(&given))?;
    let timing = Timing { end_s, window_s: [0.6 * end_s, end_s], checkpoints: 0 };
    let Some(Ok(point)) = prepare(simd, &[(machine, spin.clone())], &timing).pop() else {
        return Err(Failed::Because("no equilibrium".to_owned()));
    };
    let (method, name) = method(words, &point, &spin, end_s)?;
    // The stiff method uses lanes for its derivatives.
    let copies = if matches!(method, Method::Rodas5p(_)) { 1 } else { simd.lanes() };

    let begin = Instant::now();
    let records = simulate(simd, ModelKind::Nonlinear, &method, &vec![&point; copies]);
    let seconds = begin.elapsed().as_secs_f64() / copies as f64;
    let record = records[0];
    if let Some((reason, time_s)) = record.failure {
        return Err(Failed::Because(format!("{reason:?} at {time_s} s")));
    }
    let settings = match method {
        Method::Rk4 { step_s } => format!("step {step_s:e} s"),
        Method::Geared(geared) => {
            let Gear { step_s, caps, .. } = *geared.top();
            let hinge = if caps.hinge_rad_per_s.is_some() { ", hinge too" } else { "" };
            let cap = caps.bearings_rad_per_s;
            format!("accuracy {}: step {step_s:.2e} s, cap {cap:.0} rad/s{hinge}", words[1])
        }
        Method::Dopri5(t) | Method::Rodas5p(t) => {
            format!("rtol {:.0e}, atol {:.0e}", t.relative, t.absolute)
        }
    };
    let lanes = match copies {
        1 => "one trajectory".to_owned(),
        _ => format!("{copies} lanes, {}", simd.name()),
    };
    Ok(format!(
        "{{\"program\": \"sweep {}\", \"method\": \"{name}, {lanes}\", \
         \"settings\": \"{settings}\", \"yaw_rad\": {:e}, \"seconds\": {seconds}, \
         \"evaluations\": 0, \"steps\": {}}}",
        env!("CARGO_PKG_VERSION"),
        record.amplitudes[Channel::TubYaw.index()],
        record.steps,
    ))
}
