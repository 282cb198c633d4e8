//! Tests that the time to prepare points grows with the rows of a spin table, not with their
//! square.

use std::sync::Arc;

use lane_ode::Simd;

use crate::{Machine, Point, Spin, Timing, prepare};

/// Returns a table at intervals of 1/64 s with a speed that rises and falls.
fn table_spin(row_count: usize) -> Spin {
    let speed_at = |k: usize| 300.0 + 50.0 * ((k % 97) as f64 - 48.0) / 48.0;
    let time_s = (0..row_count).map(|k| k as f64 / 64.0).collect();
    Spin::Table { time_s, speed_rpm: (0..row_count).map(speed_at).collect() }
}

const fn timing(end_s: f64, window_s: [f64; 2]) -> Timing {
    Timing { end_s, window_s, checkpoints: 0 }
}

fn prepare_points(spins: &[Spin], timing: &Timing) -> Vec<Point> {
    let scenarios: Vec<_> = spins.iter().map(|spin| (Machine::paper(), spin.clone())).collect();
    prepare(Simd::Scalar, &scenarios, timing).into_iter().map(Result::unwrap).collect()
}

#[test]
fn a_table_of_a_million_rows_is_prepared() {
    // Each of these computations would take hours if it grew with the square of the rows.
    let row_count = 1_000_000;
    let spin = table_spin(row_count);
    let end_s = row_count as f64 / 64.0;
    let greatest_rpm = spin.max_speed_rad_per_s(end_s) * 60.0 / core::f64::consts::TAU;
    assert!((greatest_rpm - 350.0).abs() < 1e-9, "{greatest_rpm}");
    let midpoints_s = (0..row_count).map(|k| (k as f64 + 0.5) / 64.0);
    let mean_rpm = spin.speeds_rpm(midpoints_s).sum::<f64>() / row_count as f64;
    assert!((mean_rpm - 300.0).abs() < 0.1, "{mean_rpm}");
    let point = &prepare_points(&[spin], &timing(end_s, [1.0, end_s]))[0];
    assert_eq!((point.spin_segments.len(), point.segments.len()), (row_count, row_count));
}

#[test]
fn every_segment_lies_within_its_spin_segment() {
    let spin = table_spin(200);
    // The edges are at a row's time, between two rows, and after the last one.
    for window_s in [[0.0, 1.0], [0.5, 2.3], [1.01, 4.0]] {
        let point = &prepare_points(std::slice::from_ref(&spin), &timing(4.0, window_s))[0];
        for segment in point.segments.iter() {
            let expected = point
                .spin_segments
                .iter()
                .rposition(|spin_segment| spin_segment.start_s.0 <= segment.start_s);
            assert_eq!(Some(segment.spin_segment_index), expected, "{segment:?}");
            let next_segment = point.spin_segments.get(segment.spin_segment_index + 1);
            assert!(
                next_segment.is_none_or(|next_segment| segment.end_s <= next_segment.start_s.0)
            );
        }
        for t_s in [0.0, 0.3, 0.5, 2.3, 5.0] {
            let spin_segment =
                point.spin_segments.iter().rev().find(|spin_segment| spin_segment.start_s.0 <= t_s);
            let speed_rad_per_s = spin_segment.unwrap().speed_rad_per_s(t_s);
            let speed_rpm = speed_rad_per_s * 60.0 / core::f64::consts::TAU;
            assert_eq!(spin.speeds_rpm([t_s]).next(), Some(speed_rpm), "{t_s}");
        }
    }
}

#[test]
fn neighbours_with_the_same_spin_share_spin_segments_and_segments() {
    let first_spin = table_spin(100);
    let second_spin = table_spin(101);
    let points = prepare_points(
        &[first_spin.clone(), first_spin.clone(), second_spin, first_spin],
        &timing(1.0, [0.0, 1.0]),
    );
    let share_segments = |i: usize, j: usize| {
        Arc::ptr_eq(&points[i].spin_segments, &points[j].spin_segments)
            && Arc::ptr_eq(&points[i].segments, &points[j].segments)
    };
    assert!(share_segments(0, 1) && !share_segments(1, 2) && !share_segments(2, 3));
    assert_eq!(points[0].segments, points[3].segments);
}
