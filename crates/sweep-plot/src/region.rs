//! Placement of a region's name within a panel.

/// Number of sample points across and down. Basis: samples closer than a line of text. Doubling
/// both makes the search sixteen times slower.
const SAMPLES_PER_SIDE: [usize; 2] = [44, 33];

/// Returns the position farthest from the edges of a region for a text of `name_size` px; `None` if
/// the text fits nowhere. The region has the points of a panel of `panel` px for which `is_inside`
/// is true. Coordinates are px from the top left corner of the panel.
pub(crate) fn roomiest_position(
    panel_size: [f64; 2],
    name_size: [f64; 2],
    is_inside: impl Fn([f64; 2]) -> bool,
) -> Option<[f64; 2]> {
    let sample_point = |i: usize, j: usize| {
        [
            (i as f64 + 0.5) / SAMPLES_PER_SIDE[0] as f64 * panel_size[0],
            (j as f64 + 0.5) / SAMPLES_PER_SIDE[1] as f64 * panel_size[1],
        ]
    };
    let sample_points = (0..SAMPLES_PER_SIDE[0])
        .flat_map(|i| (0..SAMPLES_PER_SIDE[1]).map(move |j| sample_point(i, j)));
    let (inside, outside): (Vec<_>, Vec<_>) = sample_points.partition(|&point| is_inside(point));
    // The distance is in units of the text's half extent, so that a wide text gets a wide place.
    let distance = |a: [f64; 2], b: [f64; 2]| {
        let [dx, dy] = [0, 1].map(|k| 2.0 * (a[k] - b[k]).abs() / name_size[k]);
        dx.max(dy)
    };
    let mut best_position: Option<(f64, [f64; 2])> = None;
    for centre in inside {
        let edge_distances =
            [0, 1].map(|k| 2.0 * centre[k].min(panel_size[k] - centre[k]) / name_size[k]);
        let mut clearance = edge_distances[0].min(edge_distances[1]);
        for &outside_point in &outside {
            clearance = clearance.min(distance(centre, outside_point));
            if best_position.is_some_and(|(greatest, _)| clearance <= greatest) {
                break;
            }
        }
        if clearance >= 1.0 && best_position.is_none_or(|(greatest, _)| clearance > greatest) {
            best_position = Some((clearance, centre));
        }
    }
    best_position.map(|(_, centre)| centre)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_placed_in_the_wide_part() {
        // The region is a strip 60 px high at the top, and a column 100 px wide below it.
        let is_inside = |[x, y]: [f64; 2]| y < 60.0 || x < 100.0;
        let [x, y] = roomiest_position([600.0, 400.0], [200.0, 20.0], is_inside).unwrap();
        assert!((100.0..=500.0).contains(&x) && (10.0..=50.0).contains(&y), "{x} {y}");
        assert_eq!(roomiest_position([600.0, 400.0], [200.0, 20.0], |[x, _]| x < 150.0), None);
    }
}
