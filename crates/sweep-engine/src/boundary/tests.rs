//! Tests of the search with functions whose changes of side are known.

mod random;

use std::cell::{Cell, RefCell};
use std::convert::Infallible;

use super::*;

pub(crate) const SEARCH_RANGE: SearchRange = SearchRange {
    least: 60.0,
    greatest: 300.0,
    is_first_log: false,
    is_second_log: false,
    tolerance: 0.5,
    lattice_cells: 6,
};

fn spread_masses(count: u32) -> Vec<f64> {
    (0..count).map(|k| 0.05 + 0.95 * f64::from(k) / f64::from(count - 1)).collect()
}

pub(crate) fn trace_and_check(
    distance: impl Fn(f64, f64) -> Option<f64>,
    first_values: &[f64],
    search: &SearchRange,
) -> TracedBoundary {
    let evaluated_trials = RefCell::new(Vec::<BoundaryTrial>::new());
    let batch_sizes = RefCell::new(Vec::new());
    let evaluate = |trials: &[BoundaryTrial]| {
        evaluated_trials.borrow_mut().extend_from_slice(trials);
        batch_sizes.borrow_mut().push(trials.len());
        Ok(trials.iter().map(|trial| distance(trial.first_value, trial.second_value)).collect())
    };
    let mut check_line_count = |rows| assert!(rows < first_values.len(), "{rows}");
    let Ok::<_, Infallible>(traced_boundary) =
        trace_boundary(&evaluate, first_values, 1, search, &mut check_line_count);
    let evaluated_trials = evaluated_trials.borrow();
    let batch_sizes = batch_sizes.borrow();
    assert!(batch_sizes.iter().all(|&trials| trials > 0), "{batch_sizes:?}");
    assert_eq!(
        (traced_boundary.trial_count, traced_boundary.batch_count),
        (evaluated_trials.len(), batch_sizes.len())
    );
    let mut trial_keys: Vec<[u64; 2]> = evaluated_trials
        .iter()
        .map(|trial| [trial.first_value.to_bits(), trial.second_value.to_bits()])
        .collect();
    trial_keys.sort_unstable();
    trial_keys.dedup();
    assert_eq!(trial_keys.len(), evaluated_trials.len(), "nothing is evaluated twice");
    assert!(
        evaluated_trials
            .iter()
            .all(|trial| (search.least..=search.greatest).contains(&trial.second_value))
    );
    traced_boundary
}

/// Returns a distance similar to that of the paper's Fig. 12: saturated on both sides of a slightly
/// bent line.
fn fig12_distance(mass: f64, damping: f64) -> Option<f64> {
    let x = (boundary_damping(mass) - damping) / 40.0;
    let distance =
        if x > 0.0 { 2.5 * (1.0 - (-1.4 * x).exp()) } else { 0.65 * ((1.6 * x).exp() - 1.0) };
    Some(distance)
}

fn boundary_damping(mass: f64) -> f64 {
    30.0 + 230.0 * mass + 15.0 * (5.0 * mass).sin()
}

/// Checks that every change of side has the right sides at its ends and is no wider than the
/// tolerance.
pub(crate) fn check_side_changes(
    traced_boundary: &TracedBoundary,
    distance: impl Fn(f64, f64) -> Option<f64>,
    tolerance: f64,
) {
    for row in &traced_boundary.rows_by_curve[0] {
        for side_change in &row.side_changes {
            let Some([low, high]) = side_change.bracket else { continue };
            assert!(high - low <= tolerance, "{row:?}");
            let [a, b] = [distance(row.first_value, low), distance(row.first_value, high)];
            assert_eq!(side_change.distances, [a, b], "{row:?}");
            assert_ne!(a.map(|a| a < 0.0), b.map(|b| b < 0.0), "{row:?}");
            assert!(
                side_change.position.is_none_or(|position| (low..=high).contains(&position)),
                "{row:?}"
            );
        }
    }
}

#[test]
fn a_smooth_boundary_takes_a_fifth_of_the_grids_points() {
    let first_values = spread_masses(39);
    let traced_boundary = trace_and_check(fig12_distance, &first_values, &SEARCH_RANGE);
    check_side_changes(&traced_boundary, fig12_distance, 0.5);
    assert!(traced_boundary.trial_count <= 39 * 33 / 5, "{}", traced_boundary.trial_count);
    for (row, &mass) in traced_boundary.rows_by_curve[0].iter().zip(&first_values) {
        assert_eq!((row.first_value, row.side_changes.len()), (mass, 1));
        let side_change = row.side_changes[0];
        if boundary_damping(mass) <= 60.0 {
            assert_eq!(side_change.kind, SideChangeKind::AllReliable, "{mass}");
        } else {
            assert_eq!(side_change.kind, SideChangeKind::Crossing, "{mass}");
            // The function has a kink at its limit, so that linear interpolation in the bracket is
            // not exact.
            assert!(
                (side_change.position.unwrap() - boundary_damping(mass)).abs() < 0.2,
                "{mass}: {side_change:?}"
            );
        }
    }
}

#[test]
fn the_cost_of_a_trace_is_pinned() {
    let dip_distance = |mass, damping| distance_with_dip(mass, damping);
    let wave_distance =
        |mass: f64, damping: f64| Some(0.8 * ((damping - 20.0 * mass) / 25.0).sin());
    let trace_cost = |distance: &dyn Fn(f64, f64) -> Option<f64>, rows| {
        let traced_boundary = trace_and_check(distance, &spread_masses(rows), &SEARCH_RANGE);
        (traced_boundary.trial_count, traced_boundary.batch_count)
    };
    let costs = [
        trace_cost(&fig12_distance, 5),
        trace_cost(&fig12_distance, 39),
        trace_cost(&fig12_distance, 400),
        trace_cost(&dip_distance, 39),
        trace_cost(&wave_distance, 39),
    ];
    assert_eq!(costs, [(91, 10), (202, 23), (955, 39), (273, 32), (423, 9)]);
}

#[test]
fn jumps_are_distinguished_from_steep_crossings() {
    let step_distance = |_: f64, damping: f64| Some(if damping < 137.3 { 1.0 } else { -0.6 });
    for row in &trace_and_check(step_distance, &spread_masses(12), &SEARCH_RANGE).rows_by_curve[0] {
        let side_change = row.side_changes[0];
        assert_eq!((side_change.kind, side_change.position), (SideChangeKind::Jump, None));
        let [low, high] = side_change.bracket.unwrap();
        assert!(low < 137.3 && 137.3 <= high && high - low <= 0.5 / 16.0);
    }
    let steep_distance = |_: f64, damping: f64| Some(((137.3 - damping) * 5.0).clamp(-0.6, 1.0));
    for row in &trace_and_check(steep_distance, &spread_masses(12), &SEARCH_RANGE).rows_by_curve[0]
    {
        assert_eq!(row.side_changes[0].kind, SideChangeKind::Crossing);
        assert!((row.side_changes[0].position.unwrap() - 137.3).abs() < 0.03, "{row:?}");
    }
}

#[test]
fn several_crossings_are_several_changes_of_side() {
    let wave_distance =
        |mass: f64, damping: f64| Some(0.8 * ((damping - 20.0 * mass) / 25.0).sin());
    let traced_boundary = trace_and_check(wave_distance, &spread_masses(20), &SEARCH_RANGE);
    check_side_changes(&traced_boundary, wave_distance, 0.5);
    for row in &traced_boundary.rows_by_curve[0] {
        let roots: Vec<f64> = (0..12)
            .map(|k| 20.0 * row.first_value + 25.0 * std::f64::consts::PI * f64::from(k))
            .filter(|root| (60.0..300.0).contains(root))
            .collect();
        let positions: Vec<f64> =
            row.side_changes.iter().map(|side_change| side_change.position.unwrap()).collect();
        assert_eq!(positions.len(), roots.len(), "{}", row.first_value);
        assert!(
            positions.iter().zip(&roots).all(|(position, root)| (position - root).abs() < 0.1),
            "{positions:?} {roots:?}"
        );
    }
}

#[test]
fn an_island_as_wide_as_two_cells_is_found_in_every_row_it_spans() {
    // The first case is a reliable disc in an unreliable plane, the second an unreliable disc in a
    // reliable plane.
    for sign in [1.0, -1.0] {
        let disc_distance = |mass: f64, damping: f64| {
            let x = (mass - 0.5) / 0.3;
            let y = (damping - 170.0) / 55.0;
            Some(sign * (x * x + y * y - 1.0).clamp(-0.6, 2.0))
        };
        let traced_boundary = trace_and_check(disc_distance, &spread_masses(39), &SEARCH_RANGE);
        check_side_changes(&traced_boundary, disc_distance, 0.5);
        for row in &traced_boundary.rows_by_curve[0] {
            let x = (row.first_value - 0.5) / 0.3;
            if x.abs() < 0.97 {
                assert_eq!(row.side_changes.len(), 2, "{row:?}");
            } else if x.abs() > 1.0 {
                let expected_kind = if sign > 0.0 {
                    SideChangeKind::AllUnreliable
                } else {
                    SideChangeKind::AllReliable
                };
                assert_eq!(row.side_changes[0].kind, expected_kind, "{row:?}");
            }
        }
    }
}

/// Returns a distance similar to that of Fig. 12 beyond 0.94 kg: a cliff ends in a dip of one to
/// three N s/m below the limit before the ratio rises once more. At smaller masses the dip stays
/// above the limit.
fn distance_with_dip(mass: f64, damping: f64) -> Option<f64> {
    let x = damping - 230.0 * (mass - 1.0);
    let cliff = 0.25 * (246.5 - x);
    let tail = 0.036 * (248.1 - x);
    let rise = 0.12 * (x - 251.6 + 50.0 * (1.0 - mass));
    let hump = 0.36 - ((x - 255.0) / 30.0).powi(2);
    Some(cliff.max(tail.max(rise.min(hump))).clamp(-0.65, 2.4))
}

#[test]
fn a_narrow_dip_beside_the_crossing_is_found_and_followed() {
    let traced_boundary = trace_and_check(distance_with_dip, &spread_masses(39), &SEARCH_RANGE);
    check_side_changes(&traced_boundary, distance_with_dip, 0.5);
    let side_changes: Vec<usize> = traced_boundary.rows_by_curve[0]
        .iter()
        .rev()
        .take(5)
        .map(|row| row.side_changes.len())
        .collect();
    assert_eq!(side_changes, [3, 3, 3, 1, 1]);
}

#[test]
fn a_pocket_that_ends_between_rows_is_found_up_to_its_last_row() {
    // The axes are the height of damper 1 on the cabinet and the damping. The reliable region lies
    // between two lines. The lower one rises steeply at the lowest heights; the upper one leaves
    // the range at 0.125 m, is at 180 N s/m at 0.1125 m, and meets the lower one at 0.1 m.
    let heights: Vec<f64> = (0..17).map(|k| 0.1 + 0.0125 * f64::from(k)).collect();
    let lower_limit_damping = |height: f64| 97.0 + 0.3 / (height - 0.09);
    let pocket_distance = |height: f64, damping: f64| {
        let upper_limit_damping = 180.0 + (height - 0.1125) * (130.0 / 0.0125);
        Some(
            ((lower_limit_damping(height) - damping).max(damping - upper_limit_damping) / 40.0)
                .clamp(-0.65, 2.4),
        )
    };
    let traced_boundary = trace_and_check(pocket_distance, &heights, &SEARCH_RANGE);
    check_side_changes(&traced_boundary, pocket_distance, 0.5);
    let rows = &traced_boundary.rows_by_curve[0];
    assert_eq!(rows[0].side_changes[0].kind, SideChangeKind::AllUnreliable);
    for (row, height) in rows.iter().zip(&heights).skip(1) {
        let mut expected_positions = vec![lower_limit_damping(*height)];
        expected_positions.extend((*height < 0.12).then_some(180.0));
        let positions: Vec<f64> =
            row.side_changes.iter().filter_map(|side_change| side_change.position).collect();
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() < 0.1;
        assert!(
            positions.len() == expected_positions.len()
                && positions.iter().zip(&expected_positions).all(is_near),
            "{row:?}"
        );
    }
}

#[test]
fn a_pocket_found_late_is_followed_through_every_row() {
    // The tongue is slanted, narrower than a cell of the lattice, and hit by one lattice point.
    let slanted_pocket_distance = |mass: f64, damping: f64| {
        let middle_damping = 140.0 + 180.0 * (mass - 0.3);
        let half_width = 4.0 * (1.0 - ((mass - 0.55) / 0.3).powi(2));
        Some((((damping - middle_damping).abs() - half_width) / 10.0).clamp(-0.6, 0.6))
    };
    let traced_boundary =
        trace_and_check(slanted_pocket_distance, &spread_masses(39), &SEARCH_RANGE);
    check_side_changes(&traced_boundary, slanted_pocket_distance, 0.5);
    for row in &traced_boundary.rows_by_curve[0] {
        let crosses_pocket = ((row.first_value - 0.55) / 0.3).abs() < 0.9;
        assert!(row.side_changes.len() == 2 || !crosses_pocket, "{row:?}");
    }
}

/// Searches ramps of 4 to 30 s with pockets of 0.3 to 0.5 s, which cells of 4.3 s can miss.
#[test]
fn pockets_are_found_once_a_cell_fits_into_them() {
    let pocket_ends = [[7.1, 7.4], [13.3, 13.7], [21.0, 21.5]];
    let distance = |_: f64, ramp_s: f64| {
        let is_in_pocket = pocket_ends.iter().any(|[from, to]| (from..=to).contains(&&ramp_s));
        Some(if is_in_pocket { 0.5 } else { -0.5 })
    };
    let range = SearchRange { least: 4.0, greatest: 30.0, tolerance: 0.02, ..SEARCH_RANGE };
    // These cells are 0.299 s wide.
    let traced_boundary =
        trace_and_check(distance, &spread_masses(3), &SearchRange { lattice_cells: 87, ..range });
    check_side_changes(&traced_boundary, distance, 0.02);
    assert!(
        traced_boundary.rows_by_curve[0].iter().all(|row| row.side_changes.len() == 6),
        "{traced_boundary:?}"
    );
}

#[test]
fn undefined_quantities_are_reported() {
    let partly_undefined_distance = |mass: f64, damping: f64| {
        if damping < 100.0 { None } else { fig12_distance(mass, damping) }
    };
    let trace_rows = |distance: &dyn Fn(f64, f64) -> Option<f64>, first_values: &[f64]| {
        trace_and_check(distance, first_values, &SEARCH_RANGE).rows_by_curve.remove(0)
    };
    let rows = trace_rows(&partly_undefined_distance, &[0.2, 0.6]);
    let kinds_by_row: Vec<Vec<SideChangeKind>> = rows
        .iter()
        .map(|row| row.side_changes.iter().map(|side_change| side_change.kind).collect())
        .collect();
    assert_eq!(
        kinds_by_row,
        [
            vec![SideChangeKind::Undefined],
            vec![SideChangeKind::Undefined, SideChangeKind::Crossing]
        ]
    );
    assert_eq!(rows[0].side_changes[0].position, None);
    let undefined_rows = trace_rows(&|_, _| None, &spread_masses(5));
    assert!(
        undefined_rows.iter().all(|row| row.side_changes[0].kind == SideChangeKind::AllUndefined)
    );
    let nan_rows = trace_rows(&|_, _| Some(f64::NAN), &spread_masses(5));
    assert!(nan_rows.iter().all(|row| row.side_changes[0].kind == SideChangeKind::AllUndefined));
}

#[test]
fn a_row_without_a_change_of_side_has_no_number() {
    for (distance, kind) in
        [(-1.0, SideChangeKind::AllReliable), (1.0, SideChangeKind::AllUnreliable)]
    {
        let traced_boundary =
            trace_and_check(|_, _| Some(distance), &spread_masses(39), &SEARCH_RANGE);
        for row in &traced_boundary.rows_by_curve[0] {
            let side_change =
                SideChange { kind, position: None, bracket: None, distances: [None; 2] };
            assert_eq!(row.side_changes, [side_change]);
        }
    }
}

#[test]
fn the_search_of_noise_ends() {
    // The noise, with infinities, depends on the bits of the values.
    for seed in 0..8_u64 {
        let noise_distance = |mass: f64, damping: f64| {
            let bits = (mass.to_bits() ^ damping.to_bits().rotate_left(17))
                .wrapping_mul(0x9E37_79B9_7F4A_7C15 ^ seed);
            match bits >> 60 {
                0 => None,
                1 => Some(f64::INFINITY),
                2 => Some(f64::NEG_INFINITY),
                _ => Some((bits >> 12) as f64 / 2.0_f64.powi(51) - 1.0),
            }
        };
        let traced_boundary = trace_and_check(noise_distance, &spread_masses(17), &SEARCH_RANGE);
        check_side_changes(&traced_boundary, noise_distance, 0.5);
        // The bound is twice the number of trials at every tolerance.
        assert!(traced_boundary.trial_count <= 2 * 17 * 480, "{}", traced_boundary.trial_count);
    }
}

#[test]
fn logarithmic_axes_are_searched_in_their_logarithms() {
    let boundary_value = |first: f64| 1e5 * first.powf(1.5);
    let distance =
        |first: f64, second: f64| Some((boundary_value(first) / second).ln().clamp(-1.0, 1.0));
    let first_values: Vec<f64> = (0..20).map(|k| 10.0_f64.powf(f64::from(k) / 10.0)).collect();
    let log_range = SearchRange {
        least: 1e4,
        greatest: 1e9,
        is_first_log: true,
        is_second_log: true,
        tolerance: 0.01,
        ..SEARCH_RANGE
    };
    for row in &trace_and_check(distance, &first_values, &log_range).rows_by_curve[0] {
        let side_change = row.side_changes[0];
        let [low, high] = side_change.bracket.unwrap();
        assert!((high / low).ln() <= 0.0101, "{side_change:?}");
        assert!(
            (side_change.position.unwrap() / boundary_value(row.first_value)).ln().abs() < 0.005
        );
    }
}

#[test]
fn curves_share_batches() {
    let evaluate_shifted_curves = |trials: &[BoundaryTrial]| -> Result<_, Infallible> {
        let distance = |t: &BoundaryTrial| {
            fig12_distance(t.first_value, t.second_value - 9.0 * t.curve_index as f64)
        };
        Ok(trials.iter().map(distance).collect())
    };
    let first_values = spread_masses(39);
    let [Ok(trace_with_one_curve), Ok(trace_with_three_curves)] = [1, 3].map(|n| {
        trace_boundary(&evaluate_shifted_curves, &first_values, n, &SEARCH_RANGE, &mut |_| {})
    });
    assert!(
        trace_with_three_curves.batch_count <= trace_with_one_curve.batch_count + 4,
        "{} for {}",
        trace_with_three_curves.batch_count,
        trace_with_one_curve.batch_count
    );
    for (k, rows) in trace_with_three_curves.rows_by_curve.iter().enumerate() {
        for row in rows {
            let expected_damping = boundary_damping(row.first_value) + 9.0 * k as f64;
            let position = row.side_changes[0].position;
            assert!(
                position.map_or(expected_damping <= 60.0, |position| (position - expected_damping)
                    .abs()
                    < 0.2),
                "{k}: {row:?}"
            );
        }
    }
}

#[test]
fn rows_in_any_order_give_the_same_changes_of_side() {
    let first_values = spread_masses(13);
    let mut shuffled_values = first_values.clone();
    shuffled_values.swap(0, 7);
    shuffled_values.reverse();
    let mut rows =
        trace_and_check(fig12_distance, &shuffled_values, &SEARCH_RANGE).rows_by_curve.remove(0);
    rows.sort_by(|a, b| a.first_value.total_cmp(&b.first_value));
    assert_eq!(
        rows,
        trace_and_check(fig12_distance, &first_values, &SEARCH_RANGE).rows_by_curve[0]
    );
}

#[test]
fn an_evaluator_that_stops_ends_the_search() {
    let batch_count = Cell::new(0);
    let stop_at_third_batch = |trials: &[BoundaryTrial]| {
        batch_count.set(batch_count.get() + 1);
        if batch_count.get() == 3 {
            return Err("enough");
        }
        Ok(trials.iter().map(|t| fig12_distance(t.first_value, t.second_value)).collect())
    };
    let result =
        trace_boundary(&stop_at_third_batch, &spread_masses(9), 1, &SEARCH_RANGE, &mut |_| {});
    assert_eq!(result, Err("enough"));
}
