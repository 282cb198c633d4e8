//! Times of kernels by instruction set: `cargo bench --bench kernels`. A time is that of an
//! evaluation, step or trajectory in all lanes; divided by the lanes (1, 4, 8) it is that of one
//! trajectory.

use divan::{Bencher, counter::ItemsCount};
use lane_ode::{Simd, Tolerance};
use washer_model::bench::{RhsPart, evaluate};
use washer_model::{
    Caps, Machine, Method, ModelKind, Point, Profile, Spin, Timing, prepare, simulate,
};

fn main() {
    divan::main();
}

/// The caps of capped evaluations. Basis: about those of `rk4-mass-scaled` with an accuracy of
/// 1e-3. Doubling them does not change the cost.
const BENCHMARK_CAPS: Caps = Caps { bearings_rad_per_s: 400.0, hinge_rad_per_s: Some(400.0) };

const MODELS: [ModelKind; 2] = [ModelKind::Nonlinear, ModelKind::Linear];

/// Returns every pair of a model and an instruction set that this processor has.
fn models_and_simds() -> Vec<(ModelKind, Simd)> {
    let available = Simd::ALL.into_iter().filter(|simd| simd.is_available());
    available.flat_map(|simd| MODELS.map(|model| (model, simd))).collect()
}

/// Prepares the paper's machine for the first `end_s` of its run-up, with amplitudes over the
/// second half.
fn paper_points(simd: Simd, end_s: f64) -> Vec<Point> {
    let scenario = (
        Machine::paper(),
        Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 },
    );
    let timing = Timing { end_s, window_s: [0.5 * end_s, end_s], checkpoints: 0 };
    prepare(simd, &vec![scenario; simd.lanes()], &timing).into_iter().map(Result::unwrap).collect()
}

#[divan::bench(args = models_and_simds())]
fn derivative(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    bench_part(bencher, model, simd, RhsPart::Derivative, None);
}

/// Measures the derivative with capped modes of bearings and hinge.
#[divan::bench(args = models_and_simds())]
fn derivative_mass_scaled(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    bench_part(bencher, model, simd, RhsPart::Derivative, Some(BENCHMARK_CAPS));
}

#[divan::bench(args = models_and_simds())]
fn forcing(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    bench_part(bencher, model, simd, RhsPart::Forcing, None);
}

fn bench_part(
    bencher: Bencher<'_, '_>,
    model: ModelKind,
    simd: Simd,
    part: RhsPart,
    caps: Option<Caps>,
) {
    const EVALUATIONS: u64 = 10_000;
    let point = &paper_points(simd, 1.0)[0];
    bencher
        .counter(ItemsCount::new(EVALUATIONS * simd.lanes() as u64))
        .bench(|| evaluate(simd, model, part, point, caps, EVALUATIONS));
}

/// Measures a thousand RK4 steps with their records, the second half within the window.
#[divan::bench(args = models_and_simds())]
fn thousand_steps(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    bench_trajectory(bencher, model, simd, 0.25, &Method::rk4(2.5e-4));
}

/// Measures a second of the run-up by Dormand-Prince.
#[divan::bench(args = models_and_simds())]
fn second_by_dopri5(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    let tolerance =
        Tolerance { relative: 1e-6, absolute: 1e-9, max_steps: u64::MAX, longest_step_s: None };
    bench_trajectory(bencher, model, simd, 1.0, &Method::dopri5(tolerance));
}

#[divan::bench(args = models_and_simds())]
fn second_by_additive(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    let tolerance =
        Tolerance { relative: 1e-6, absolute: 1e-9, max_steps: u64::MAX, longest_step_s: None };
    bench_trajectory(bencher, model, simd, 1.0, &Method::additive(tolerance));
}

/// Measures the whole 50 s of the paper.
#[divan::bench(args = models_and_simds(), sample_count = 5, sample_size = 1)]
fn whole_trajectory(bencher: Bencher<'_, '_>, (model, simd): (ModelKind, Simd)) {
    bench_trajectory(bencher, model, simd, 50.0, &Method::rk4(2.5e-4));
}

fn bench_trajectory(
    bencher: Bencher<'_, '_>,
    model: ModelKind,
    simd: Simd,
    end_s: f64,
    method: &Method,
) {
    let points = paper_points(simd, end_s);
    let point_references: Vec<_> = points.iter().collect();
    bencher
        .counter(ItemsCount::new(point_references.len()))
        .bench(|| simulate(simd, model, method, &point_references));
}

/// Measures the preparation of a point in every lane: its equilibrium and its linear model.
#[divan::bench(args = Simd::ALL.into_iter().filter(|simd| simd.is_available()))]
fn preparation(bencher: Bencher<'_, '_>, simd: Simd) {
    bencher.counter(ItemsCount::new(simd.lanes())).bench(|| paper_points(simd, 1.0));
}
