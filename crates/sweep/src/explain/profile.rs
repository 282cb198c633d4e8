//! The spin profile over time: its range, and the times at which it is within a band of speeds.

use washer_model::{Profile, Spin};

/// The number of equal intervals at whose ends a profile is sampled. Basis: profiles are smooth
/// between kinks, which are sampled, too. Doubling it doubles the time of a search.
const SAMPLE_INTERVAL_COUNT: usize = 4000;

/// The number of bisections of an interval. Basis: they exhaust the digits of a double. Doubling it
/// changes nothing.
const BISECTION_COUNT: usize = 50;

/// The number of equal parts of a passage over which growth is integrated by the midpoint rule.
/// Basis: test `e_folds_are_the_area_under_growth_over_time`, with an error below 1e-5. Doubling it
/// divides the error by 4.
const INTEGRATION_PART_COUNT: usize = 1000;

/// Returns the lowest and the greatest speed (rpm) up to the run's end, negative backwards.
pub(super) fn speed_range_rpm(spin: &Spin, end_s: f64) -> [f64; 2] {
    let mut lowest_rpm = f64::INFINITY;
    let mut greatest_rpm = f64::NEG_INFINITY;
    for speed_rpm in spin.speeds_rpm(sample_times_s(spin, end_s)) {
        lowest_rpm = lowest_rpm.min(speed_rpm);
        greatest_rpm = greatest_rpm.max(speed_rpm);
    }
    // Speeds are stored in rad/s; rounding gives back the digits that the user wrote.
    [lowest_rpm, greatest_rpm].map(|rpm| (1e9 * rpm).round() / 1e9)
}

/// Returns equally spaced times (s) and those of the kinks of the profile, in order.
fn sample_times_s(spin: &Spin, end_s: f64) -> Vec<f64> {
    let mut times_s: Vec<f64> = (0..=SAMPLE_INTERVAL_COUNT)
        .map(|k| end_s * (k as f64 / SAMPLE_INTERVAL_COUNT as f64))
        .collect();
    let kink_times_s = match spin {
        Spin::Ramped { profile: Profile::Triangular, ramp_s, .. } => vec![*ramp_s, 2.0 * ramp_s],
        Spin::Ramped { ramp_s, .. } => vec![*ramp_s],
        Spin::Table { time_s, .. } => time_s.clone(),
    };
    times_s.extend(kink_times_s.into_iter().filter(|&kink_s| kink_s < end_s));
    times_s.sort_by(f64::total_cmp);
    times_s.dedup();
    times_s
}

/// Returns the intervals of time (s) in which the speed is within a band (rpm), in order.
pub(super) fn intervals_inside_s(
    spin: &Spin,
    end_s: f64,
    [low_rpm, high_rpm]: [f64; 2],
) -> Vec<[f64; 2]> {
    let speed_rpm = |time_s: f64| spin.speeds_rpm([time_s]).next().unwrap_or(0.0);
    let is_inside = |time_s: f64| (low_rpm..=high_rpm).contains(&speed_rpm(time_s));
    let times = sample_times_s(spin, end_s);
    let mut intervals: Vec<[f64; 2]> = Vec::new();
    let mut entry_s = is_inside(0.0).then_some(0.0);
    for pair in times.windows(2) {
        let [from_s, to_s] = [pair[0], pair[1]];
        let was_inside = entry_s.is_some();
        let ends_inside = is_inside(to_s);
        // A ramp may pass the whole band between two instants.
        let from_rpm = speed_rpm(from_s);
        let to_rpm = speed_rpm(to_s);
        let passes_band = !was_inside && !ends_inside && (from_rpm < low_rpm) != (to_rpm < low_rpm);
        if passes_band {
            let is_rising = from_rpm < to_rpm;
            let edges_rpm = if is_rising { [low_rpm, high_rpm] } else { [high_rpm, low_rpm] };
            intervals.push(edges_rpm.map(|edge_rpm| {
                let is_before = |time_s: f64| (speed_rpm(time_s) < edge_rpm) == is_rising;
                bisect_s(&is_before, from_s, to_s)
            }));
        } else if was_inside != ends_inside {
            let edge_s = bisect_s(&|time_s| is_inside(time_s) == was_inside, from_s, to_s);
            match entry_s.take() {
                Some(entry_s) => intervals.push([entry_s, edge_s]),
                None => entry_s = Some(edge_s),
            }
        }
    }
    intervals.extend(entry_s.map(|entry_s| [entry_s, end_s]));
    intervals.retain(|[from_s, to_s]| to_s > from_s);
    intervals
}

/// Returns the time (s) at which a condition ceases to hold, by bisection. It must hold at `from_s`
/// and not at `to_s`.
fn bisect_s(is_before_end: &dyn Fn(f64) -> bool, mut from_s: f64, mut to_s: f64) -> f64 {
    for _ in 0..BISECTION_COUNT {
        let middle_s = 0.5 * (from_s + to_s);
        if is_before_end(middle_s) { from_s = middle_s } else { to_s = middle_s }
    }
    0.5 * (from_s + to_s)
}

/// Returns the integral over time of the growth at the magnitude of the speed. `growths` has pairs
/// of speed (rpm) and growth (1/s) in order of speed.
pub(super) fn e_folds(spin: &Spin, [from_s, to_s]: [f64; 2], growths: &[[f64; 2]]) -> f64 {
    let part_s = (to_s - from_s) / INTEGRATION_PART_COUNT as f64;
    let middle_times_s = (0..INTEGRATION_PART_COUNT).map(|k| from_s + (k as f64 + 0.5) * part_s);
    spin.speeds_rpm(middle_times_s).map(|speed| part_s * growth_at(growths, speed.abs())).sum()
}

/// Returns the growth (1/s) at a speed (rpm), by linear interpolation.
pub(super) fn growth_at(growths: &[[f64; 2]], speed_rpm: f64) -> f64 {
    let next_node = growths.partition_point(|[rpm, _]| *rpm < speed_rpm);
    match (next_node.checked_sub(1).map(|below| growths[below]), growths.get(next_node)) {
        (Some([low_rpm, low_growth]), Some([high_rpm, high_growth])) if high_rpm > &low_rpm => {
            low_growth + (high_growth - low_growth) * (speed_rpm - low_rpm) / (high_rpm - low_rpm)
        }
        (Some([_, growth]), _) => growth,
        (None, Some([_, growth])) => *growth,
        (None, None) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table_spin(points: &[(f64, f64)]) -> Spin {
        Spin::Table {
            time_s: points.iter().map(|point| point.0).collect(),
            speed_rpm: points.iter().map(|point| point.1).collect(),
        }
    }

    fn is_nearly_equal(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-9 * b.abs().max(1.0)
    }

    #[test]
    fn a_band_is_crossed_up_and_down() {
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };
        let intervals_s = intervals_inside_s(&spin, 100.0, [140.0, 210.0]);
        assert_eq!(intervals_s.len(), 2);
        for (found, meant) in intervals_s.iter().flatten().zip([20.0, 30.0, 70.0, 80.0]) {
            assert!(is_nearly_equal(*found, meant), "{found} {meant}");
        }
        // The first run ends inside the band, the second one begins inside.
        let intervals_s = intervals_inside_s(&spin, 25.0, [140.0, 210.0]);
        assert!(
            intervals_s.len() == 1
                && is_nearly_equal(intervals_s[0][0], 20.0)
                && intervals_s[0][1] == 25.0
        );
        assert_eq!(
            intervals_inside_s(&table_spin(&[(0.0, 200.0)]), 9.0, [140.0, 210.0]),
            [[0.0, 9.0]]
        );
        assert!(intervals_inside_s(&spin, 100.0, [400.0, 500.0]).is_empty());
    }

    #[test]
    fn a_band_is_found_even_if_it_is_passed_quickly() {
        let spin =
            table_spin(&[(0.0, 0.0), (50.0, 0.0), (50.001, 400.0), (70.0, 400.0), (70.01, 0.0)]);
        let intervals_s = intervals_inside_s(&spin, 100.0, [100.0, 200.0]);
        assert_eq!(intervals_s.len(), 2);
        for (found, meant) in intervals_s.iter().flatten().zip([50.00025, 50.0005, 70.005, 70.0075])
        {
            assert!(is_nearly_equal(*found, meant), "{found} {meant}");
        }
    }

    #[test]
    fn e_folds_are_the_area_under_growth_over_time() {
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 100.0, ramp_s: 10.0 };
        // The growth is a triangle of height 0.5 /s and base 20 rpm, which the ramp passes in 2 s.
        let growths = [[40.0, 0.0], [50.0, 0.5], [60.0, 0.0]];
        assert!((e_folds(&spin, [4.0, 6.0], &growths) - 0.5).abs() < 1e-5);
        assert_eq!(growth_at(&growths, 30.0), 0.0);
    }

    #[test]
    fn a_profile_may_turn_both_ways_and_pause() {
        let spin = table_spin(&[(0.0, 0.0), (3.0, 100.0), (6.0, -50.0), (8.0, -50.0), (9.0, 0.0)]);
        assert_eq!(speed_range_rpm(&spin, 12.0), [-50.0, 100.0]);
        assert_eq!(speed_range_rpm(&spin, 3.0), [0.0, 100.0]);
        let intervals_s = intervals_inside_s(&spin, 12.0, [-40.0, -25.0]);
        assert_eq!(intervals_s.len(), 2);
        for (found, meant) in intervals_s.iter().flatten().zip([5.5, 5.8, 8.2, 8.5]) {
            assert!(is_nearly_equal(*found, meant), "{found} {meant}");
        }
        let growths = [[25.0, 0.5], [40.0, 0.5]];
        assert!((e_folds(&spin, intervals_s[0], &growths) - 0.15).abs() < 1e-9);
    }
}
