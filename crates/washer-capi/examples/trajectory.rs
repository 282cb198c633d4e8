//! Integrates the paper's machine by RK4 in every lane of a register, for
//! `scripts/benchmarks/arm_cycles.py`: `trajectory scalar|avx2|avx512|neon`.

use lane_ode::Simd;
use washer_model::{Machine, Method, ModelKind, Profile, Spin, Timing, prepare, simulate};

fn main() {
    let name = std::env::args().nth(1);
    let simd = Simd::ALL.into_iter().find(|simd| Some(simd.name()) == name.as_deref());
    let simd =
        simd.filter(|simd| simd.is_available()).expect("an instruction set that this machine has");
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
    let point = prepare(simd, &[(Machine::paper(), spin)], &timing).pop();
    let point = point.expect("a point").expect("an equilibrium");
    let copies = vec![&point; simd.lanes()];
    drop(simulate(simd, ModelKind::Nonlinear, &Method::rk4(2.5e-4), &copies));
}
