//! Tests of the search with functions whose changes of side are known.

mod random;

use std::cell::{Cell, RefCell};
use std::convert::Infallible;

use super::*;

pub(crate) const SEARCH: SearchRange = SearchRange {
    least: 60.0,
    greatest: 300.0,
    first_log: false,
    second_log: false,
    tolerance: 0.5,
    lattice: 6,
};

fn masses(count: u32) -> Vec<f64> {
    (0..count).map(|k| 0.05 + 0.95 * f64::from(k) / f64::from(count - 1)).collect()
}

pub(crate) fn traced(
    distance: impl Fn(f64, f64) -> Option<f64>,
    first_values: &[f64],
    search: &SearchRange,
) -> TracedBoundary {
    let evaluated = RefCell::new(Vec::<BoundaryTrial>::new());
    let batches = RefCell::new(Vec::new());
    let evaluate = |trials: &[BoundaryTrial]| {
        evaluated.borrow_mut().extend_from_slice(trials);
        batches.borrow_mut().push(trials.len());
        Ok(trials.iter().map(|trial| distance(trial.first, trial.second)).collect())
    };
    let mut check_lines = |rows| assert!(rows < first_values.len(), "{rows}");
    let Ok::<_, Infallible>(traced) = trace(&evaluate, first_values, 1, search, &mut check_lines);
    let evaluated = evaluated.borrow();
    let batches = batches.borrow();
    assert!(batches.iter().all(|&trials| trials > 0), "{batches:?}");
    assert_eq!((traced.trials, traced.rounds), (evaluated.len(), batches.len()));
    let mut keys: Vec<[u64; 2]> =
        evaluated.iter().map(|trial| [trial.first.to_bits(), trial.second.to_bits()]).collect();
    keys.sort_unstable();
    keys.dedup();
    assert_eq!(keys.len(), evaluated.len(), "nothing is evaluated twice");
    assert!(evaluated.iter().all(|trial| (search.least..=search.greatest).contains(&trial.second)));
    traced
}

/// Returns a distance similar to that of the paper's Fig. 12: saturated on both sides of a slightly
/// bent line.
fn fig12_distance(mass: f64, damping: f64) -> Option<f64> {
    let x = (line(mass) - damping) / 40.0;
    let distance =
        if x > 0.0 { 2.5 * (1.0 - (-1.4 * x).exp()) } else { 0.65 * ((1.6 * x).exp() - 1.0) };
    Some(distance)
}

fn line(mass: f64) -> f64 {
    30.0 + 230.0 * mass + 15.0 * (5.0 * mass).sin()
}

/// Checks that every change of side has the right sides at its ends and is no wider than the
/// tolerance.
pub(crate) fn check_side_changes(
    traced: &TracedBoundary,
    distance: impl Fn(f64, f64) -> Option<f64>,
    tolerance: f64,
) {
    for row in &traced.curves[0] {
        for side_change in &row.side_changes {
            let Some([low, high]) = side_change.bracket else { continue };
            assert!(high - low <= tolerance, "{row:?}");
            let [a, b] = [distance(row.first, low), distance(row.first, high)];
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
    let first_values = masses(39);
    let traced = traced(fig12_distance, &first_values, &SEARCH);
    check_side_changes(&traced, fig12_distance, 0.5);
    assert!(traced.trials <= 39 * 33 / 5, "{}", traced.trials);
    for (row, &mass) in traced.curves[0].iter().zip(&first_values) {
        assert_eq!((row.first, row.side_changes.len()), (mass, 1));
        let side_change = row.side_changes[0];
        if line(mass) <= 60.0 {
            assert_eq!(side_change.kind, SideChangeKind::AllReliable, "{mass}");
        } else {
            assert_eq!(side_change.kind, SideChangeKind::Crossing, "{mass}");
            // The function has a kink at its limit, so that linear interpolation in the bracket is
            // not exact.
            assert!(
                (side_change.position.unwrap() - line(mass)).abs() < 0.2,
                "{mass}: {side_change:?}"
            );
        }
    }
}

#[test]
fn the_cost_of_a_trace_is_pinned() {
    let fold = |mass, damping| distance_with_dip(mass, damping);
    let wave = |mass: f64, damping: f64| Some(0.8 * ((damping - 20.0 * mass) / 25.0).sin());
    let cost = |distance: &dyn Fn(f64, f64) -> Option<f64>, rows| {
        let traced = traced(distance, &masses(rows), &SEARCH);
        (traced.trials, traced.rounds)
    };
    let costs = [
        cost(&fig12_distance, 5),
        cost(&fig12_distance, 39),
        cost(&fig12_distance, 400),
        cost(&fold, 39),
        cost(&wave, 39),
    ];
    assert_eq!(costs, [(91, 10), (202, 23), (955, 39), (273, 32), (423, 9)]);
}

#[test]
fn jumps_are_distinguished_from_steep_crossings() {
    let step_function = |_: f64, damping: f64| Some(if damping < 137.3 { 1.0 } else { -0.6 });
    for row in &traced(step_function, &masses(12), &SEARCH).curves[0] {
        let side_change = row.side_changes[0];
        assert_eq!((side_change.kind, side_change.position), (SideChangeKind::Jump, None));
        let [low, high] = side_change.bracket.unwrap();
        assert!(low < 137.3 && 137.3 <= high && high - low <= 0.5 / 16.0);
    }
    let steep = |_: f64, damping: f64| Some(((137.3 - damping) * 5.0).clamp(-0.6, 1.0));
    for row in &traced(steep, &masses(12), &SEARCH).curves[0] {
        assert_eq!(row.side_changes[0].kind, SideChangeKind::Crossing);
        assert!((row.side_changes[0].position.unwrap() - 137.3).abs() < 0.03, "{row:?}");
    }
}

#[test]
fn several_crossings_are_several_changes_of_side() {
    let wave = |mass: f64, damping: f64| Some(0.8 * ((damping - 20.0 * mass) / 25.0).sin());
    let traced = traced(wave, &masses(20), &SEARCH);
    check_side_changes(&traced, wave, 0.5);
    for row in &traced.curves[0] {
        let roots: Vec<f64> = (0..12)
            .map(|k| 20.0 * row.first + 25.0 * std::f64::consts::PI * f64::from(k))
            .filter(|root| (60.0..300.0).contains(root))
            .collect();
        let positions: Vec<f64> =
            row.side_changes.iter().map(|side_change| side_change.position.unwrap()).collect();
        assert_eq!(positions.len(), roots.len(), "{}", row.first);
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
        let disc = |mass: f64, damping: f64| {
            let x = (mass - 0.5) / 0.3;
            let y = (damping - 170.0) / 55.0;
            Some(sign * (x * x + y * y - 1.0).clamp(-0.6, 2.0))
        };
        let traced = traced(disc, &masses(39), &SEARCH);
        check_side_changes(&traced, disc, 0.5);
        for row in &traced.curves[0] {
            let x = (row.first - 0.5) / 0.3;
            if x.abs() < 0.97 {
                assert_eq!(row.side_changes.len(), 2, "{row:?}");
            } else if x.abs() > 1.0 {
                let no_change_kind = if sign > 0.0 {
                    SideChangeKind::AllUnreliable
                } else {
                    SideChangeKind::AllReliable
                };
                assert_eq!(row.side_changes[0].kind, no_change_kind, "{row:?}");
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
    let traced = traced(distance_with_dip, &masses(39), &SEARCH);
    check_side_changes(&traced, distance_with_dip, 0.5);
    let side_changes: Vec<usize> =
        traced.curves[0].iter().rev().take(5).map(|row| row.side_changes.len()).collect();
    assert_eq!(side_changes, [3, 3, 3, 1, 1]);
}

#[test]
fn a_pocket_that_ends_between_rows_is_found_up_to_its_last_row() {
    // The axes are the height of damper 1 on the cabinet and the damping. The reliable region lies
    // between two lines. The lower one rises steeply at the lowest heights; the upper one leaves
    // the range at 0.125 m, is at 180 N s/m at 0.1125 m, and meets the lower one at 0.1 m.
    let heights: Vec<f64> = (0..17).map(|k| 0.1 + 0.0125 * f64::from(k)).collect();
    let bottom = |height: f64| 97.0 + 0.3 / (height - 0.09);
    let pocket = |height: f64, damping: f64| {
        let top = 180.0 + (height - 0.1125) * (130.0 / 0.0125);
        Some(((bottom(height) - damping).max(damping - top) / 40.0).clamp(-0.65, 2.4))
    };
    let traced = traced(pocket, &heights, &SEARCH);
    check_side_changes(&traced, pocket, 0.5);
    let rows = &traced.curves[0];
    assert_eq!(rows[0].side_changes[0].kind, SideChangeKind::AllUnreliable);
    for (row, height) in rows.iter().zip(&heights).skip(1) {
        let mut expected = vec![bottom(*height)];
        expected.extend((*height < 0.12).then_some(180.0));
        let positions: Vec<f64> =
            row.side_changes.iter().filter_map(|side_change| side_change.position).collect();
        let is_near = |(a, b): (&f64, &f64)| (a - b).abs() < 0.1;
        assert!(
            positions.len() == expected.len() && positions.iter().zip(&expected).all(is_near),
            "{row:?}"
        );
    }
}

#[test]
fn a_pocket_found_late_is_followed_through_every_row() {
    // The tongue is slanted, narrower than a cell of the lattice, and hit by one lattice point.
    let tongue = |mass: f64, damping: f64| {
        let middle = 140.0 + 180.0 * (mass - 0.3);
        let half = 4.0 * (1.0 - ((mass - 0.55) / 0.3).powi(2));
        Some((((damping - middle).abs() - half) / 10.0).clamp(-0.6, 0.6))
    };
    let traced = traced(tongue, &masses(39), &SEARCH);
    check_side_changes(&traced, tongue, 0.5);
    for row in &traced.curves[0] {
        let crosses_tongue = ((row.first - 0.55) / 0.3).abs() < 0.9;
        assert!(row.side_changes.len() == 2 || !crosses_tongue, "{row:?}");
    }
}

/// Searches ramps of 4 to 30 s with pockets of 0.3 to 0.5 s, which cells of 4.3 s can miss.
#[test]
fn pockets_are_found_once_a_cell_fits_into_them() {
    let pockets = [[7.1, 7.4], [13.3, 13.7], [21.0, 21.5]];
    let distance = |_: f64, ramp_s: f64| {
        let inside = pockets.iter().any(|[from, to]| (from..=to).contains(&&ramp_s));
        Some(if inside { 0.5 } else { -0.5 })
    };
    let search = SearchRange { least: 4.0, greatest: 30.0, tolerance: 0.02, ..SEARCH };
    // These cells are 0.299 s wide.
    let traced = traced(distance, &masses(3), &SearchRange { lattice: 87, ..search });
    check_side_changes(&traced, distance, 0.02);
    assert!(traced.curves[0].iter().all(|row| row.side_changes.len() == 6), "{traced:?}");
}

#[test]
fn undefined_quantities_are_reported() {
    let partly_undefined = |mass: f64, damping: f64| {
        if damping < 100.0 { None } else { fig12_distance(mass, damping) }
    };
    let rows_of = |distance: &dyn Fn(f64, f64) -> Option<f64>, first_values: &[f64]| {
        traced(distance, first_values, &SEARCH).curves.remove(0)
    };
    let rows = rows_of(&partly_undefined, &[0.2, 0.6]);
    let kinds: Vec<Vec<SideChangeKind>> = rows
        .iter()
        .map(|row| row.side_changes.iter().map(|side_change| side_change.kind).collect())
        .collect();
    assert_eq!(
        kinds,
        [
            vec![SideChangeKind::Undefined],
            vec![SideChangeKind::Undefined, SideChangeKind::Crossing]
        ]
    );
    assert_eq!(rows[0].side_changes[0].position, None);
    let undefined_rows = rows_of(&|_, _| None, &masses(5));
    assert!(
        undefined_rows.iter().all(|row| row.side_changes[0].kind == SideChangeKind::AllUndefined)
    );
    let nan_rows = rows_of(&|_, _| Some(f64::NAN), &masses(5));
    assert!(nan_rows.iter().all(|row| row.side_changes[0].kind == SideChangeKind::AllUndefined));
}

#[test]
fn a_row_without_a_change_of_side_has_no_number() {
    for (distance, kind) in
        [(-1.0, SideChangeKind::AllReliable), (1.0, SideChangeKind::AllUnreliable)]
    {
        let traced = traced(|_, _| Some(distance), &masses(39), &SEARCH);
        for row in &traced.curves[0] {
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
        let noise = |mass: f64, damping: f64| {
            let bits = (mass.to_bits() ^ damping.to_bits().rotate_left(17))
                .wrapping_mul(0x9E37_79B9_7F4A_7C15 ^ seed);
            match bits >> 60 {
                0 => None,
                1 => Some(f64::INFINITY),
                2 => Some(f64::NEG_INFINITY),
                _ => Some((bits >> 12) as f64 / 2.0_f64.powi(51) - 1.0),
            }
        };
        let traced = traced(noise, &masses(17), &SEARCH);
        check_side_changes(&traced, noise, 0.5);
        // The bound is twice the number of trials at every tolerance.
        assert!(traced.trials <= 2 * 17 * 480, "{}", traced.trials);
    }
}

#[test]
fn logarithmic_axes_are_searched_in_their_logarithms() {
    let line = |first: f64| 1e5 * first.powf(1.5);
    let distance = |first: f64, second: f64| Some((line(first) / second).ln().clamp(-1.0, 1.0));
    let first_values: Vec<f64> = (0..20).map(|k| 10.0_f64.powf(f64::from(k) / 10.0)).collect();
    let search = SearchRange {
        least: 1e4,
        greatest: 1e9,
        first_log: true,
        second_log: true,
        tolerance: 0.01,
        ..SEARCH
    };
    for row in &traced(distance, &first_values, &search).curves[0] {
        let side_change = row.side_changes[0];
        let [low, high] = side_change.bracket.unwrap();
        assert!((high / low).ln() <= 0.0101, "{side_change:?}");
        assert!((side_change.position.unwrap() / line(row.first)).ln().abs() < 0.005);
    }
}

#[test]
fn curves_share_batches() {
    let evaluate_shifted = |trials: &[BoundaryTrial]| -> Result<_, Infallible> {
        let distance = |t: &BoundaryTrial| fig12_distance(t.first, t.second - 9.0 * t.curve as f64);
        Ok(trials.iter().map(distance).collect())
    };
    let first_values = masses(39);
    let [Ok(one_curve), Ok(three_curves)] =
        [1, 3].map(|n| trace(&evaluate_shifted, &first_values, n, &SEARCH, &mut |_| {}));
    assert!(
        three_curves.rounds <= one_curve.rounds + 4,
        "{} for {}",
        three_curves.rounds,
        one_curve.rounds
    );
    for (k, rows) in three_curves.curves.iter().enumerate() {
        for row in rows {
            let line = line(row.first) + 9.0 * k as f64;
            let position = row.side_changes[0].position;
            assert!(
                position.map_or(line <= 60.0, |position| (position - line).abs() < 0.2),
                "{k}: {row:?}"
            );
        }
    }
}

#[test]
fn rows_in_any_order_give_the_same_changes_of_side() {
    let first_values = masses(13);
    let mut shuffled = first_values.clone();
    shuffled.swap(0, 7);
    shuffled.reverse();
    let mut rows = traced(fig12_distance, &shuffled, &SEARCH).curves.remove(0);
    rows.sort_by(|a, b| a.first.total_cmp(&b.first));
    assert_eq!(rows, traced(fig12_distance, &first_values, &SEARCH).curves[0]);
}

#[test]
fn an_evaluator_that_stops_ends_the_search() {
    let batches = Cell::new(0);
    let stop_at_third = |trials: &[BoundaryTrial]| {
        batches.set(batches.get() + 1);
        if batches.get() == 3 {
            return Err("enough");
        }
        Ok(trials.iter().map(|t| fig12_distance(t.first, t.second)).collect())
    };
    let result = trace(&stop_at_third, &masses(9), 1, &SEARCH, &mut |_| {});
    assert_eq!(result, Err("enough"));
}
