//! Kernels by instruction set: `cargo bench --bench kernels`. Times are per evaluation, step or
//! trajectory of the whole lane group; divide by the lanes (1, 4, 8) for one trajectory's share.

use divan::{Bencher, counter::ItemsCount};
use lane_ode::{Simd, Tolerance};
use washer_model::bench::{RhsPart, evaluate};
use washer_model::{
    Caps, Machine, Method, ModelKind, Point, Profile, Spin, Timing, prepare, simulate,
};

fn main() {
    divan::main();
}

/// About what `rk4-mass-scaled` takes for 1e-3; its cost does not depend on it.
const CAPS: Caps = Caps { bearings_rad_per_s: 400.0, hinge_rad_per_s: Some(400.0) };

const MODELS: [ModelKind; 2] = [ModelKind::Nonlinear, ModelKind::Linear];

/// Every pair of a model and an instruction set that this processor has.
fn kernels() -> Vec<(ModelKind, Simd)> {
    let available = Simd::ALL.into_iter().filter(|simd| simd.is_available());
    available.flat_map(|simd| MODELS.map(|model| (model, simd))).collect()
}

/// The paper's machine over the first `end_s` of its run-up, amplitudes over the second half.
fn points(simd: Simd, end_s: f64) -> Vec<Point> {
    let scenario = (
        Machine::paper(),
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 },
    );
    let timing = Timing { end_s, window_s: [0.5 * end_s, end_s], checkpoints: 0 };
    prepare(simd, &vec![scenario; simd.lanes()], &timing).into_iter().map(Result::unwrap).collect()
}

#[divan::bench(args = kernels())]
fn derivative(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    part(bencher, model, simd, RhsPart::Derivative, None);
}

/// With the modes of bearings and hinge capped.
#[divan::bench(args = kernels())]
fn derivative_mass_scaled(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    part(bencher, model, simd, RhsPart::Derivative, Some(CAPS));
}

#[divan::bench(args = kernels())]
fn forcing(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    part(bencher, model, simd, RhsPart::Forcing, None);
}

fn part(bencher: Bencher<'_, '_>, model: ModelKind, simd: Simd, part: RhsPart, caps: Option<Caps>) {
    const EVALUATIONS: u64 = 10_000;
    let point = &points(simd, 1.0)[0];
    bencher
        .counter(ItemsCount::new(EVALUATIONS * simd.lanes() as u64))
        .bench(|| evaluate(simd, model, part, point, caps, EVALUATIONS));
}

/// A thousand RK4 steps with what is observed of them, the last half inside the window.
#[divan::bench(args = kernels())]
fn thousand_steps(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    trajectory(bencher, model, simd, 0.25, &Method::Rk4 { step_s: 2.5e-4 });
}

/// A second of the run-up by each method.
#[divan::bench(args = kernels())]
fn second_by_dopri5(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    let tolerance = Tolerance { relative: 1e-6, absolute: 1e-9, max_steps: u64::MAX };
    trajectory(bencher, model, simd, 1.0, &Method::Dopri5(tolerance));
}

#[divan::bench(args = kernels())]
fn second_by_additive(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    let tolerance = Tolerance { relative: 1e-6, absolute: 1e-9, max_steps: u64::MAX };
    trajectory(bencher, model, simd, 1.0, &Method::Additive(tolerance));
}

/// The whole of the paper's 50 s.
#[divan::bench(args = kernels(), sample_count = 5, sample_size = 1)]
fn whole_trajectory(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    trajectory(bencher, model, simd, 50.0, &Method::Rk4 { step_s: 2.5e-4 });
}

fn trajectory(bencher: Bencher<'_, '_>, model: ModelKind, simd: Simd, end_s: f64, method: &Method) {
    let points = points(simd, end_s);
    let points: Vec<_> = points.iter().collect();
    bencher.counter(ItemsCount::new(points.len())).bench(|| simulate(simd, model, method, &points));
}

/// From machine to equilibrium and linear model, per lane group.
#[divan::bench(args = Simd::ALL.into_iter().filter(|simd| simd.is_available()))]
fn preparation(bencher: Bencher<'_, '_>, simd: Simd) {
    bencher.counter(ItemsCount::new(simd.lanes())).bench(|| points(simd, 1.0));
}
