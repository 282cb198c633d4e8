use lane_ode::Simd;
use std::time::Instant;
use washer_model::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let end: f64 = a.get(1).map_or(5.0, |s| s.parse().unwrap());
    let step: f64 = a.get(2).map_or(2.5e-4, |s| s.parse().unwrap());
    let timing = Timing { end_s: end, window_s: [end * 0.6, end] };
    let points: Vec<_> = (0..8).map(|i| { let mut m = Machine::paper(); m.unbalance.mass_kg = 0.4; m.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = 140.0 + f64::from(i)*0.5);
        (m, Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 }) }).collect();
    let only = a.get(3).cloned(); let kind_only = a.get(4).cloned();
    for simd in [Simd::Scalar, Simd::Avx2, Simd::Avx512] { if only.as_deref().is_some_and(|o| o != simd.name()) { continue; }
        let t = Instant::now();
        let ready: Vec<_> = prepare(simd, &points, &timing).into_iter().map(|p| p.unwrap()).collect();
        let prep = t.elapsed();
        let refs: Vec<&Point> = ready.iter().take(if simd == Simd::Scalar { 1 } else { 8 }).collect();
        for kind in [ModelKind::Nonlinear, ModelKind::Linear] { if kind_only.as_deref().is_some_and(|o| o != format!("{kind:?}")) { continue; }
            let t = Instant::now();
            let r = simulate(simd, kind, &Method::Rk4 { step_s: step }, &refs);
            let dt = t.elapsed();
            let per_group = dt.as_secs_f64() / (refs.len() as f64 / simd.lanes() as f64);
            println!("{:8} {:?} prep {:?} total {:?}  ns/rhs-group {:.1}  yaw {:e} y {:e} gap {:e} bits {:x}", simd.name(), kind, prep, dt, per_group * 1e9 / (r[0].steps as f64 * 4.0), r[0].amplitudes[6], r[0].amplitudes[0], r[0].min_gap_m, r[0].amplitudes[6].to_bits());
        }
    }
}
