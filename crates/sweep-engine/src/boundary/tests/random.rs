//! The search against level sets drawn at random, whose sides are known everywhere: a boundary with
//! islands, tongues and folds of either kind, smooth or with a jump.

use super::super::lattice::lattice_ranks;
use super::super::*;
use super::{SEARCH_RANGE, check_side_changes, trace_and_check};

/// The number of level sets that are drawn. Basis: a second of tests. Doubling it doubles that.
const LEVEL_SET_COUNT: u64 = 400;
const ROW_COUNT: u32 = 39;
/// The distance between samples of the known sides: half a tolerance. The lattice's columns are
/// among them.
const SAMPLE_STEP: f64 = 0.25;

/// A stretch of a lattice line on one side of the limit.
#[derive(Clone, Copy, Debug)]
struct RowStretch {
    from: f64,
    to: f64,
    is_reliable: bool,
}

impl RowStretch {
    fn width(&self) -> f64 {
        self.to - self.from
    }

    /// Returns the width of the part that lies beside another on the same side.
    fn common_width(&self, other: &Self) -> f64 {
        let shared_width = self.to.min(other.to) - self.from.max(other.from);
        if self.is_reliable == other.is_reliable { shared_width } else { f64::NEG_INFINITY }
    }
}

/// A region of either side laid over a level set: an ellipse, or a parabola's inside, sheared.
struct Pocket {
    centre: [f64; 2],
    half_axes: [f64; 2],
    shear: f64,
    depth: f64,
    /// The end of the first axis at which the region is open, -1 or 1; 0 for a closed ellipse.
    open_end: f64,
    is_reliable: bool,
}

/// A function over `0..=1` and the second axis of [`SEARCH_RANGE`].
struct LevelSet {
    line_coefficients: [f64; 5],
    decay_widths: [f64; 2],
    is_reliable_below: bool,
    pockets: Vec<Pocket>,
    jump_coefficients: Option<[f64; 3]>,
}

impl LevelSet {
    fn draw(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut draw_between = |from: f64, to: f64| from + (to - from) * random.f64();
        let line_coefficients =
            [[40.0, 320.0], [-200.0, 250.0], [0.0, 20.0], [2.0, 9.0], [0.0, 6.0]]
                .map(|[from, to]| draw_between(from, to));
        let decay_widths = [draw_between(15.0, 60.0), draw_between(15.0, 60.0)];
        let is_reliable_below = draw_between(0.0, 1.0) < 0.3;
        let pockets = (0..draw_between(0.0, 4.0) as usize)
            .map(|_| Pocket {
                centre: [draw_between(-0.05, 1.05), draw_between(50.0, 310.0)],
                // The sizes go from one row to most rows, and from 3 N s/m to a quarter of the
                // range.
                half_axes: [
                    10.0_f64.powf(draw_between(-1.6, -0.2)),
                    10.0_f64.powf(draw_between(0.5, 1.8)),
                ],
                shear: draw_between(-200.0, 250.0),
                depth: 10.0_f64.powf(draw_between(-1.0, 0.0)),
                open_end: [0.0, 0.0, -1.0, 1.0][draw_between(0.0, 4.0) as usize],
                is_reliable: draw_between(0.0, 1.0) < 0.5,
            })
            .collect();
        let jump_coefficients =
            [draw_between(60.0, 300.0), draw_between(-200.0, 200.0), draw_between(0.2, 1.5)];
        let jump_coefficients = (draw_between(0.0, 1.0) < 0.2).then_some(jump_coefficients);
        Self { line_coefficients, decay_widths, is_reliable_below, pockets, jump_coefficients }
    }

    /// Returns the distance, which saturates far on both sides of the line, as a ratio does.
    fn distance(&self, x: f64, y: f64) -> f64 {
        let [offset, slope, bend, waves, phase] = self.line_coefficients;
        let line_damping = offset + slope * x + bend * (waves * x + phase).sin();
        let height_on_unreliable_side =
            if self.is_reliable_below { y - line_damping } else { line_damping - y };
        let [unreliable_width, reliable_width] = self.decay_widths;
        let mut distance = if height_on_unreliable_side > 0.0 {
            2.5 * (1.0 - (-height_on_unreliable_side / unreliable_width / 1.8).exp())
        } else {
            0.65 * ((height_on_unreliable_side / reliable_width / 0.4).exp() - 1.0)
        };
        if let Some([offset, slope, height]) = self.jump_coefficients {
            distance += if y < offset + slope * x { 0.5 * height } else { -0.5 * height };
        }
        for pocket in &self.pockets {
            let u = x - pocket.centre[0];
            let v = (y - pocket.centre[1] - pocket.shear * u) / pocket.half_axes[1];
            let u = u / pocket.half_axes[0];
            let extent_term =
                if pocket.open_end == 0.0 { 1.0 - u * u } else { pocket.open_end * u };
            let depth_inside = (extent_term - v * v) * pocket.depth;
            distance = match pocket.is_reliable {
                true => distance.min(-depth_inside),
                false => distance.max(depth_inside),
            };
        }
        distance.clamp(-0.7, 2.6)
    }

    /// Returns whether the samples of a row are reliable.
    fn sample_sides(&self, x: f64) -> Vec<bool> {
        (0..=sample_intervals()).map(|k| self.distance(x, sample_position(k)) < 0.0).collect()
    }
}

fn sample_intervals() -> usize {
    ((SEARCH_RANGE.greatest - SEARCH_RANGE.least) / SAMPLE_STEP) as usize
}

fn sample_position(sample: usize) -> f64 {
    SEARCH_RANGE.least + SAMPLE_STEP * sample as f64
}

/// Returns the stretches of one side in a row of samples.
fn true_stretches(sides: &[bool]) -> Vec<RowStretch> {
    let change_samples = (1..sides.len()).filter(|k| sides[*k] != sides[*k - 1]);
    split_stretches(
        sides[0],
        change_samples.map(|k| (sample_position(k) - 0.5 * SAMPLE_STEP, sides[k])),
    )
}

/// Returns the stretches of a row, from the side at its beginning and the changes of side along it.
fn split_stretches(
    is_first_reliable: bool,
    changes: impl Iterator<Item = (f64, bool)>,
) -> Vec<RowStretch> {
    let full_stretch = RowStretch {
        from: SEARCH_RANGE.least,
        to: SEARCH_RANGE.greatest,
        is_reliable: is_first_reliable,
    };
    let mut stretches = vec![full_stretch];
    for (position, is_reliable) in changes {
        if let Some(last) = stretches.last_mut() {
            last.to = position;
        }
        stretches.push(RowStretch { from: position, to: SEARCH_RANGE.greatest, is_reliable });
    }
    stretches
}

/// Returns the stretches of a traced row.
fn traced_stretches(row: &BoundaryRow) -> Vec<RowStretch> {
    let is_reliable = |distance: Option<f64>| distance.is_some_and(|distance| distance < 0.0);
    let is_first_reliable = match row.side_changes[0].bracket {
        Some(_) => is_reliable(row.side_changes[0].distances[0]),
        None => row.side_changes[0].kind == SideChangeKind::AllReliable,
    };
    let changes = row.side_changes.iter().filter_map(|side_change| {
        let [low, high] = side_change.bracket?;
        Some((0.5 * (low + high), is_reliable(side_change.distances[1])))
    });
    split_stretches(is_first_reliable, changes)
}

/// Returns, for each run of `rows` rows, the stretches that are on one side in all of them.
fn common_stretches(sides: &[Vec<bool>], rows: usize) -> Vec<(usize, Vec<RowStretch>)> {
    let mut stretches_by_row = Vec::new();
    for (first, row_window) in sides.windows(rows).enumerate() {
        let mut stretches_on_side = Vec::new();
        for is_reliable in [false, true] {
            let is_on_side: Vec<bool> = (0..=sample_intervals())
                .map(|k| row_window.iter().all(|row| row[k] == is_reliable))
                .collect();
            // A stretch ends at its last sample, not halfway to the next.
            let mut start_sample = None;
            for k in 0..=sample_intervals() + 1 {
                let is_stretch = is_on_side.get(k).copied().unwrap_or(false);
                if let Some(start) = start_sample.filter(|_| !is_stretch) {
                    let to = sample_position(k - 1);
                    stretches_on_side.push(RowStretch {
                        from: sample_position(start),
                        to,
                        is_reliable,
                    });
                    start_sample = None;
                } else if is_stretch && start_sample.is_none() {
                    start_sample = Some(k);
                }
            }
        }
        stretches_by_row.push((first, stretches_on_side));
    }
    stretches_by_row
}

/// The search must find islands of at least a lattice cell on every lattice line that crosses them;
/// smaller ones that it misses are counted.
#[test]
fn random_level_sets() {
    let clock_seed =
        std::time::SystemTime::UNIX_EPOCH.elapsed().map_or(0, |now| now.as_nanos() as u64);
    let seed = std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(clock_seed);
    let first_values: Vec<f64> =
        (0..ROW_COUNT).map(|k| f64::from(k) / f64::from(ROW_COUNT - 1)).collect();
    let lattice_line_ranks = lattice_ranks(first_values.len(), SEARCH_RANGE.lattice_cells);
    let rows_per_cell =
        lattice_line_ranks.windows(2).map(|pair| pair[1] - pair[0] + 1).max().unwrap_or(1);
    let cell_width =
        (SEARCH_RANGE.greatest - SEARCH_RANGE.least) / SEARCH_RANGE.lattice_cells as f64;
    let mut guaranteed_island_count = 0;
    let mut pocket_count = 0;
    let mut trial_count = 0;
    let mut widths_missed_beside_neighbour = Vec::new();
    let mut other_missed_widths = Vec::new();
    for k in 0..LEVEL_SET_COUNT {
        let level_set = LevelSet::draw(seed.wrapping_add(k));
        let distance = |x, y| Some(level_set.distance(x, y));
        let traced_boundary = trace_and_check(distance, &first_values, &SEARCH_RANGE);
        check_side_changes(&traced_boundary, distance, SEARCH_RANGE.tolerance);
        trial_count += traced_boundary.trial_count;
        let found_stretches: Vec<Vec<RowStretch>> =
            traced_boundary.rows_by_curve[0].iter().map(traced_stretches).collect();
        let sides_by_row: Vec<Vec<bool>> =
            first_values.iter().map(|first| level_set.sample_sides(*first)).collect();
        for (first, islands) in common_stretches(&sides_by_row, rows_per_cell) {
            for island in islands.iter().filter(|island| island.width() >= cell_width) {
                for (row, row_stretches) in
                    found_stretches.iter().enumerate().skip(first).take(rows_per_cell)
                {
                    guaranteed_island_count += 1;
                    let is_found =
                        row_stretches.iter().any(|other| island.common_width(other) > 0.0);
                    assert!(is_found, "SEED={seed}, level set {k}, row {row}: {island:?}");
                }
            }
        }
        for (row, row_sides) in sides_by_row.iter().enumerate() {
            let adjacent_rows = [row.checked_sub(1), Some(row + 1)].into_iter().flatten();
            let adjacent_rows: Vec<&RowStretch> =
                adjacent_rows.filter_map(|k| found_stretches.get(k)).flatten().collect();
            for pocket in true_stretches(row_sides) {
                if pocket.width() <= SEARCH_RANGE.tolerance {
                    continue;
                }
                pocket_count += 1;
                if found_stretches[row].iter().any(|other| pocket.common_width(other) > 0.0) {
                    continue;
                }
                let is_beside = adjacent_rows
                    .iter()
                    .any(|other| pocket.common_width(other) > SEARCH_RANGE.tolerance);
                let missed_widths = if is_beside {
                    &mut widths_missed_beside_neighbour
                } else {
                    &mut other_missed_widths
                };
                missed_widths.push(pocket.width());
            }
        }
    }
    let max_width = |widths: &[f64]| widths.iter().copied().fold(0.0, f64::max);
    let summary = format!(
        "SEED={seed}: {LEVEL_SET_COUNT} level sets, {} trials each; {guaranteed_island_count} \
         islands as large as a cell, all found; of {pocket_count} stretches of one side wider than \
         {} N s/m, missed {} beside a neighbour's, at most {} wide, and {} others, at most {} wide",
        trial_count / LEVEL_SET_COUNT as usize,
        SEARCH_RANGE.tolerance,
        widths_missed_beside_neighbour.len(),
        max_width(&widths_missed_beside_neighbour),
        other_missed_widths.len(),
        max_width(&other_missed_widths)
    );
    println!("{summary}");
    assert!(guaranteed_island_count > 10 * LEVEL_SET_COUNT, "{summary}");
    // The stretches of 60 seeds that the search misses are 1 in 1,800 beside a neighbour that
    // shows them, and 1 in 160 of the others; a single seed at most 1 in 940 and 1 in 97.
    assert!(widths_missed_beside_neighbour.len() * 400 <= pocket_count, "{summary}");
    assert!(other_missed_widths.len() * 50 <= pocket_count, "{summary}");
    assert!(trial_count <= 400 * LEVEL_SET_COUNT as usize, "{summary}");
}
