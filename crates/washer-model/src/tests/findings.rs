//! Tests of the paper's findings (its Figs. 10 to 12).

use super::instruments::{paper_machine, triangular_spin};
use crate::{Channel, Method, ModelKind, Record, Timing, prepare, simulate};
use lane_ode::Simd;

/// Simulates both models at each unbalance mass (kg) and damping (N s/m).
fn simulate_both_models(points: &[(f64, f64)]) -> Vec<[Record; 2]> {
    let scenarios: Vec<_> =
        points.iter().map(|&(m, c)| (paper_machine(m, c), triangular_spin())).collect();
    let timing = Timing { end_s: 50.0, window_s: [30.0, 50.0], checkpoints: 0 };
    let simd = Simd::widest();
    let points: Vec<_> =
        prepare(simd, &scenarios, &timing).into_iter().map(Result::unwrap).collect();
    let points: Vec<_> = points.iter().collect();
    let method = Method::rk4(2e-4);
    let nonlinear = simulate(simd, ModelKind::Nonlinear, &method, &points);
    let linear = simulate(simd, ModelKind::Linear, &method, &points);
    nonlinear.into_iter().zip(linear).map(|(nonlinear, linear)| [nonlinear, linear]).collect()
}

/// Returns the largest ratio of amplitudes over the paper's channels.
fn largest_ratio([nonlinear, linear]: &[Record; 2]) -> f64 {
    let channels = [
        Channel::TubFrontY,
        Channel::TubFrontZ,
        Channel::DrumFrontY,
        Channel::DrumFrontZ,
        Channel::TubYaw,
        Channel::TubPitch,
    ];
    assert!(nonlinear.failure.is_none() && linear.failure.is_none());
    let channel_ratio = |c: Channel| nonlinear.amplitudes[c.index()] / linear.amplitudes[c.index()];
    channels.into_iter().map(channel_ratio).fold(0.0, f64::max)
}

#[test]
fn the_linear_model_is_reliable_at_a_damping_of_140_but_not_at_100() {
    let records = simulate_both_models(&[(0.4, 140.0), (0.4, 100.0)]);
    let [reliable_ratio, unreliable_ratio] = [&records[0], &records[1]].map(largest_ratio);
    let yaw_amplitudes_rad = records[1].map(|r| r.amplitudes[Channel::TubYaw.index()]);
    eprintln!(
        "C = 140: ratio {reliable_ratio:.3}; C = 100: ratio {unreliable_ratio:.2}, yaw {:.1} mrad \
         nonlinear, {:.2} mrad linear",
        1e3 * yaw_amplitudes_rad[0],
        1e3 * yaw_amplitudes_rad[1]
    );
    assert!(reliable_ratio < 2.0, "{reliable_ratio}");
    assert!(unreliable_ratio >= 2.0, "{unreliable_ratio}");
    assert!(
        yaw_amplitudes_rad[0] > 0.060 && yaw_amplitudes_rad[1] < 0.010,
        "{yaw_amplitudes_rad:?}"
    );
}

#[test]
fn the_boundary_rises_with_the_unbalance_mass() {
    // The linear model is not reliable at a bracket's lower damping, and reliable at the upper one.
    // The brackets rise with the mass. (At 1 kg the bracket also contains a reliable island at
    // 250 N s/m, so that the boundary is not a single curve everywhere.)
    let brackets = [(0.15, [55.0, 75.0]), (0.4, [110.0, 135.0]), (1.0, [240.0, 290.0])];
    let points: Vec<_> =
        brackets.iter().flat_map(|&(m, [low, high])| [(m, low), (m, high)]).collect();
    let ratios: Vec<_> = simulate_both_models(&points).iter().map(largest_ratio).collect();
    for ((m, [low, high]), pair) in brackets.into_iter().zip(ratios.chunks(2)) {
        eprintln!("m_u = {m} kg: ratio {:.2} at {low} N s/m, {:.2} at {high}", pair[0], pair[1]);
        assert!(pair[0] >= 2.0 && pair[1] < 2.0, "m_u = {m} kg: {pair:?}");
    }
}
