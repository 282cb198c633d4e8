//! Tests of responses and attractors against results of independent programs. The machines are in
//! `tests/held`.

use lane_ode::{Cancel, Simd};
use washer_model::{
    AttractorStatus, Channel, HeldSpeed, MotionKind, Point, Response, StartRule, find_attractors,
    find_responses,
};

use crate::plan::{point_input, prepare_point, timing};

/// Returns the last point of a grid in `tests/held`.
fn last_point_of_grid(name: &str) -> Point {
    let path = format!("{}/tests/held/g_{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let plan = crate::config::load(path.as_ref(), &[]).unwrap();
    let input = point_input(&plan, &plan.axis_values(plan.points() - 1));
    prepare_point(input.machine, input.spin, &timing(&plan)).unwrap()
}

fn find_responses_at(point: &Point, speeds_rpm: &[f64]) -> Vec<Vec<Response>> {
    let held_speeds: Vec<HeldSpeed<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| HeldSpeed { point, speed_rpm }).collect();
    find_responses(&held_speeds, Cancel::Never)
        .into_iter()
        .map(|responses| responses.unwrap_or_default())
        .collect()
}

#[test]
fn a_textbook_machine_has_a_response_at_every_speed() {
    let speeds_rpm = [452.0, 500.0, 532.0, 660.0, 700.0];
    for (responses, rpm) in
        find_responses_at(&last_point_of_grid("textbook"), &speeds_rpm).iter().zip(speeds_rpm)
    {
        assert!(!responses.is_empty(), "{rpm} rpm");
    }
}

/// A search for a branch between two others must not converge to the others.
#[test]
fn all_branches_of_a_folded_curve_are_found() {
    let speeds_rpm: Vec<f64> = (0..25).map(|k| 144.2 + 0.05 * f64::from(k)).collect();
    for (responses, rpm) in
        find_responses_at(&last_point_of_grid("fine17"), &speeds_rpm).iter().zip(&speeds_rpm)
    {
        let branches: Vec<u32> = responses.iter().map(|response| response.branch).collect();
        assert_eq!(branches, [2, 3, 4], "{rpm} rpm");
    }
}

/// The corners of friction excite vibrations of the hinge. Its deflection is 7.786 mm by rk4 at
/// 5e-5 s, and 7.767 mm with capped modes.
#[test]
fn a_response_with_friction_is_found_without_caps() {
    let responses = find_responses_at(&last_point_of_grid("72001_10"), &[264.61]);
    let drum_amplitude_m = responses[0][0].nonlinear_peaks[Channel::DrumFrontZ.index()];
    assert!((drum_amplitude_m / 7.786e-3 - 1.0).abs() < 3e-4, "{drum_amplitude_m}");
}

/// At this speed a motion that repeats every second turn has a multiplier of -1.092, so it is
/// unstable. Trajectories leave it for a motion that repeats every fourth turn.
#[test]
fn a_saddle_is_no_attractor() {
    let point = last_point_of_grid("74002_13");
    let held_speeds = [HeldSpeed { point: &point, speed_rpm: 414.0 }];
    let start_rule = StartRule { start_count: 1, ..StartRule::default() };
    let result = find_attractors(Simd::widest(), &held_speeds, &[], &start_rule, Cancel::Never)
        .remove(0)
        .unwrap();
    let motion = &result.attractors[0];
    assert_eq!(motion.motion_kind, Some(MotionKind::Periodic { turns: 4 }));
    let yaw_rad = motion.peaks[Channel::TubYaw.index()];
    assert!((yaw_rad / 50.05e-3 - 1.0).abs() < 5e-3, "{yaw_rad}");
    assert!(motion.exponent.is_some_and(|exponent| exponent.rate_per_s < 0.0));
}

#[test]
#[ignore = "half a minute"]
fn chaos_that_does_not_last_is_a_transient() {
    let point = last_point_of_grid("74001_8");
    let held_speeds = [HeldSpeed { point: &point, speed_rpm: 306.0 }];
    let results =
        find_attractors(Simd::widest(), &held_speeds, &[], &StartRule::default(), Cancel::Never);
    let result = results.into_iter().next().unwrap().unwrap();
    assert!(result.attractors.iter().all(|motion| motion.motion_kind != Some(MotionKind::Chaotic)));
    let is_transient =
        |state| matches!(state, AttractorStatus::Transient { life_s } if life_s > 0.0);
    assert!(result.attractors.iter().any(|motion| is_transient(motion.status)));
}

/// At this speed there is a motion that repeats every fourth turn, with amplitudes of 0.1166 and
/// 0.1471 rad. Kicks from the wide periodic response do not lead to it, but kicks of the machine at
/// rest do.
#[test]
#[ignore = "half a minute"]
fn an_attractor_far_from_the_response_is_found_from_rest() {
    let point = last_point_of_grid("74001_11");
    let held_speeds = [HeldSpeed { point: &point, speed_rpm: 404.1 }];
    let result =
        find_attractors(Simd::widest(), &held_speeds, &[], &StartRule::default(), Cancel::Never);
    let result = result.into_iter().next().unwrap().unwrap();
    let is_expected = |motion: &&washer_model::Attractor| {
        motion.motion_kind == Some(MotionKind::Periodic { turns: 4 })
            && (motion.peaks[Channel::TubYaw.index()] / 0.1166 - 1.0).abs() < 0.02
            && (motion.peaks[Channel::TubPitch.index()] / 0.1471 - 1.0).abs() < 0.02
    };
    let motion = result.attractors.iter().find(is_expected);
    let motion = motion.unwrap_or_else(|| panic!("{:?}", result.attractors));
    assert!(motion.exponent.is_some_and(|exponent| exponent.rate_per_s < 0.0), "{motion:?}");
}

/// The textbook machine ends in the periodic response that `sweep stability` finds, also at speeds
/// where that response is hard to find.
#[test]
fn a_textbook_machine_ends_in_its_response() {
    let point = last_point_of_grid("textbook");
    let speeds_rpm = [500.0, 700.0];
    let held_speeds: Vec<HeldSpeed<'_>> =
        speeds_rpm.iter().map(|&speed_rpm| HeldSpeed { point: &point, speed_rpm }).collect();
    let start_rule = StartRule { start_count: 3, ..StartRule::default() };
    let results = find_attractors(Simd::widest(), &held_speeds, &[], &start_rule, Cancel::Never);
    for (result, rpm) in results.into_iter().zip(speeds_rpm) {
        let result = result.unwrap();
        let motion = &result.attractors[0];
        assert_eq!(motion.motion_kind, Some(MotionKind::Periodic { turns: 1 }), "{rpm} rpm");
        let yaw_index = Channel::TubYaw.index();
        let yaws_rad = result.responses.iter().map(|response| response.nonlinear_peaks[yaw_index]);
        let least_difference = yaws_rad
            .map(|yaw_rad| (yaw_rad / motion.peaks[yaw_index] - 1.0).abs())
            .fold(f64::INFINITY, f64::min);
        assert!(least_difference < 1e-3, "{rpm} rpm: {least_difference}");
    }
}
