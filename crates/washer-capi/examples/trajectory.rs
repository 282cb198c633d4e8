//! This project's own methods on the trajectory of `scripts/peers/trajectory.h`, in the same words: `trajectory SIMD METHOD SETTINGS`, with
//! rk4 STEP, rk4-mass-scaled STEP CAP, dopri5 RTOL ATOL or rodas5p RTOL ATOL. Lanes are filled with copies, and the time is that of one of them.
#![allow(clippy::print_stdout)]

use std::process::ExitCode;
use std::time::Instant;

use lane_ode::{Simd, Tolerance};
use washer_model::{Channel, Machine, Method, ModelKind, Spin, Timing, prepare, simulate};

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let words: Vec<_> = arguments.iter().map(String::as_str).collect();
    let number = |word: &str| word.parse::<f64>().ok();
    let tolerance = |rtol: &str, atol: &str| {
        Some(Tolerance { relative: number(rtol)?, absolute: number(atol)?, max_steps: u64::MAX })
    };
    let parsed = match words[..] {
        [simd, "rk4", step] => number(step).map(|step_s| (simd, "RK4", Method::Rk4 { step_s })),
        [simd, "rk4-mass-scaled", step, cap] => {
            number(step).zip(number(cap)).map(|(step_s, cap_rad_per_s)| {
                (simd, "mass-scaled RK4", Method::Rk4MassScaled { step_s, cap_rad_per_s })
            })
        }
        [simd, "dopri5", rtol, atol] => tolerance(rtol, atol).map(|t| (simd, "dopri5", Method::Dopri5(t))),
        [simd, "rodas5p", rtol, atol] => tolerance(rtol, atol).map(|t| (simd, "Rodas5P", Method::Rodas5p(t))),
        _ => None,
    };
    let known = |name: &str| Simd::ALL.into_iter().find(|simd| simd.name() == name && simd.is_available());
    let Some((simd, name, method)) =
        parsed.and_then(|(simd, name, method)| Some((known(simd)?, name, method)))
    else {
        eprintln!(
            "usage: trajectory scalar|avx2|avx512|neon rk4 STEP | rk4-mass-scaled STEP CAP | dopri5 RTOL ATOL | rodas5p RTOL ATOL"
        );
        return ExitCode::from(2);
    };
    // The stiff method uses lanes for its derivatives.
    let copies = if matches!(method, Method::Rodas5p(_)) { 1 } else { simd.lanes() };

    let mut machine = Machine::paper();
    machine.unbalance.mass_kg = 0.4;
    machine.dampers.iter_mut().for_each(|damper| damper.damping_n_s_per_m = 140.0);
    let scenario = (machine, Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 });
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0] };
    let Some(Ok(point)) = prepare(simd, &[scenario], &timing).pop() else {
        eprintln!("no equilibrium");
        return ExitCode::FAILURE;
    };
    let begin = Instant::now();
    let records = simulate(simd, ModelKind::Nonlinear, &method, &vec![&point; copies]);
    let seconds = begin.elapsed().as_secs_f64() / copies as f64;
    let record = records[0];
    if let Some((reason, time_s)) = record.failure {
        eprintln!("{reason:?} at {time_s} s");
        return ExitCode::FAILURE;
    }
    let settings = match method {
        Method::Rk4 { step_s } => format!("step {step_s:e} s"),
        Method::Rk4MassScaled { step_s, cap_rad_per_s } => {
            format!("step {step_s:e} s, cap {cap_rad_per_s} rad/s")
        }
        Method::Dopri5(t) | Method::Rodas5p(t) => format!("rtol {:.0e}, atol {:.0e}", t.relative, t.absolute),
    };
    let lanes =
        if copies == 1 { "one trajectory".to_owned() } else { format!("{copies} lanes, {}", simd.name()) };
    println!(
        r#"{{"program": "sweep {}", "method": "{name}, {lanes}", "settings": "{settings}", "yaw_rad": {:e}, "seconds": {seconds}, "evaluations": 0, "steps": {}}}"#,
        env!("CARGO_PKG_VERSION"),
        record.amplitudes[Channel::TubYaw.index()],
        record.steps,
    );
    ExitCode::SUCCESS
}
