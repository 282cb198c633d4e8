#![allow(missing_docs, clippy::all, clippy::print_stdout)]
use lane_ode::Simd;
use washer_model::*;
fn cpu() -> f64 { let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap(); s.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9 }
fn main() {
    let mut scen = Vec::new();
    let mut keys = Vec::new();
    let step: usize = std::env::args().nth(1).map_or(1, |s| s.parse().unwrap());
    for i in (0..39).step_by(step) {
        for j in (0..33).step_by(step) {
            let m = 0.05 + 0.95 * i as f64 / 38.0;
            let c = 60.0 + 240.0 * j as f64 / 32.0;
            let mut machine = Machine::paper();
            machine.unbalance.mass_kg = m;
            for d in &mut machine.dampers { d.damping_n_s_per_m = c; }
            scen.push((machine, Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 }));
            keys.push((m, c));
        }
    }
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 128 };
    let simd = Simd::best();
    let points: Vec<Point> = prepare(simd, &scen, &timing).into_iter().map(|p| p.unwrap()).collect();
    let refs: Vec<&Point> = points.iter().collect();
    let w = 32 / step;
    let t = cpu();
    let cases = Cases::new([0usize, w, points.len() - 1 - w, points.len() - 1].iter().map(|&i| (&points[i], &scen[i].1)), 50.0);
    let mut levels = Vec::new();
    for a in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8] {
        let g = cases.choose(a).unwrap();
        eprintln!("{a:e} {:?} {:?}", g, g.map(|g| cases.expected_error(&g)));
        if let Some(g) = g { levels.push((format!("L{a:e}"), g)); }
    }
    eprintln!("choosing {:.3}", cpu() - t);
    let mut runs: Vec<(String, Vec<Record>, Vec<Extra>)> = Vec::new();
    let mut go = |name: &str, model: ModelKind, method: &Method, course: bool| {
        let t = cpu();
        let (records, extras) = simulate_with(simd, model, method, &refs, Wanted { course, ..Wanted::default() });
        eprintln!("{name} {model:?} {:.3} s, {:.4} ms each, steps {} {}", (cpu() - t), (cpu() - t) * 1e3 / refs.len() as f64, records[0].steps, records.last().unwrap().steps);
        runs.push((name.to_string(), records, extras));
    };
    for model in [ModelKind::Nonlinear, ModelKind::Linear] {
        for (n, g) in &levels { go(n, model, &Method::Geared(*g), true); }
    }
    use std::io::Write;
    let mut f = std::io::BufWriter::new(std::fs::File::create("/tmp/levels5.bin").unwrap());
    let mut w = |x: f64| f.write_all(&x.to_le_bytes()).unwrap();
    w(runs.len() as f64); w(points.len() as f64); w(0.0);
    for p in 0..points.len() { w(keys[p].0); w(keys[p].1); for q in points[p].equilibrium() { w(*q); } }
    for (_, recs, extras) in &runs {
        for p in 0..points.len() {
            for a in recs[p].amplitudes { w(a); }
            w(recs[p].min_gap_m);
            w(if recs[p].failure.is_some() { 1.0 } else { 0.0 });
            w(extras[p].course.len() as f64);
            for q in &extras[p].course { for v in q { w(*v); } }
        }
    }
    for (n, ..) in &runs { println!("{n}"); }
}
