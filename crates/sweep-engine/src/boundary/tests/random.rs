//! The search against level sets drawn at random, whose sides are known everywhere: a boundary with
//! islands, tongues and folds of either kind, smooth or with a jump.

use super::super::lattice::lattice_ranks;
use super::super::*;
use super::{SEARCH, check_side_changes, traced};

/// The number of level sets that are drawn. Basis: a second of tests. Doubling it doubles that.
const LEVEL_SETS: u64 = 400;
const ROWS: u32 = 39;
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
    fn common(&self, other: &Self) -> f64 {
        let common = self.to.min(other.to) - self.from.max(other.from);
        if self.is_reliable == other.is_reliable { common } else { f64::NEG_INFINITY }
    }
}

/// A region of either side laid over a level set: an ellipse, or a parabola's inside, sheared.
struct Pocket {
    centre: [f64; 2],
    size: [f64; 2],
    shear: f64,
    depth: f64,
    /// The end of the first axis at which the region is open, -1 or 1; 0 for a closed ellipse.
    opens: f64,
    is_reliable: bool,
}

/// A function over `0..=1` and the second axis of [`SEARCH`].
struct LevelSet {
    line: [f64; 5],
    widths: [f64; 2],
    reliable_below: bool,
    pockets: Vec<Pocket>,
    jump: Option<[f64; 3]>,
}

impl LevelSet {
    fn draw(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut between = |from: f64, to: f64| from + (to - from) * random.f64();
        let line = [[40.0, 320.0], [-200.0, 250.0], [0.0, 20.0], [2.0, 9.0], [0.0, 6.0]]
            .map(|[from, to]| between(from, to));
        let widths = [between(15.0, 60.0), between(15.0, 60.0)];
        let reliable_below = between(0.0, 1.0) < 0.3;
        let pockets = (0..between(0.0, 4.0) as usize)
            .map(|_| Pocket {
                centre: [between(-0.05, 1.05), between(50.0, 310.0)],
                // The sizes go from one row to most rows, and from 3 N s/m to a quarter of the
                // range.
                size: [10.0_f64.powf(between(-1.6, -0.2)), 10.0_f64.powf(between(0.5, 1.8))],
                shear: between(-200.0, 250.0),
                depth: 10.0_f64.powf(between(-1.0, 0.0)),
                opens: [0.0, 0.0, -1.0, 1.0][between(0.0, 4.0) as usize],
                is_reliable: between(0.0, 1.0) < 0.5,
            })
            .collect();
        let jump = [between(60.0, 300.0), between(-200.0, 200.0), between(0.2, 1.5)];
        let jump = (between(0.0, 1.0) < 0.2).then_some(jump);
        Self { line, widths, reliable_below, pockets, jump }
    }

    /// Returns the distance, which saturates far on both sides of the line, as a ratio does.
    fn distance(&self, x: f64, y: f64) -> f64 {
        let [offset, slope, bend, waves, phase] = self.line;
        let line = offset + slope * x + bend * (waves * x + phase).sin();
        let above = if self.reliable_below { y - line } else { line - y };
        let [rise, fall] = self.widths;
        let mut distance = if above > 0.0 {
            2.5 * (1.0 - (-above / rise / 1.8).exp())
        } else {
            0.65 * ((above / fall / 0.4).exp() - 1.0)
        };
        if let Some([offset, slope, height]) = self.jump {
            distance += if y < offset + slope * x { 0.5 * height } else { -0.5 * height };
        }
        for pocket in &self.pockets {
            let u = x - pocket.centre[0];
            let v = (y - pocket.centre[1] - pocket.shear * u) / pocket.size[1];
            let u = u / pocket.size[0];
            let extent_term = if pocket.opens == 0.0 { 1.0 - u * u } else { pocket.opens * u };
            let inside = (extent_term - v * v) * pocket.depth;
            distance = match pocket.is_reliable {
                true => distance.min(-inside),
                false => distance.max(inside),
            };
        }
        distance.clamp(-0.7, 2.6)
    }

    /// Returns whether the samples of a row are reliable.
    fn sides(&self, x: f64) -> Vec<bool> {
        (0..=samples()).map(|k| self.distance(x, sample_position(k)) < 0.0).collect()
    }
}

fn samples() -> usize {
    ((SEARCH.greatest - SEARCH.least) / SAMPLE_STEP) as usize
}

fn sample_position(sample: usize) -> f64 {
    SEARCH.least + SAMPLE_STEP * sample as f64
}

/// Returns the stretches of one side in a row of samples.
fn true_stretches(sides: &[bool]) -> Vec<RowStretch> {
    let changes = (1..sides.len()).filter(|k| sides[*k] != sides[*k - 1]);
    split_stretches(sides[0], changes.map(|k| (sample_position(k) - 0.5 * SAMPLE_STEP, sides[k])))
}

/// Returns the stretches of a row, from the side at its beginning and the changes of side along it.
fn split_stretches(first: bool, changes: impl Iterator<Item = (f64, bool)>) -> Vec<RowStretch> {
    let full_stretch = RowStretch { from: SEARCH.least, to: SEARCH.greatest, is_reliable: first };
    let mut stretches = vec![full_stretch];
    for (position, is_reliable) in changes {
        if let Some(last) = stretches.last_mut() {
            last.to = position;
        }
        stretches.push(RowStretch { from: position, to: SEARCH.greatest, is_reliable });
    }
    stretches
}

/// Returns the stretches of a traced row.
fn traced_stretches(row: &BoundaryRow) -> Vec<RowStretch> {
    let is_reliable = |distance: Option<f64>| distance.is_some_and(|distance| distance < 0.0);
    let first = match row.side_changes[0].bracket {
        Some(_) => is_reliable(row.side_changes[0].distances[0]),
        None => row.side_changes[0].kind == SideChangeKind::AllReliable,
    };
    let changes = row.side_changes.iter().filter_map(|side_change| {
        let [low, high] = side_change.bracket?;
        Some((0.5 * (low + high), is_reliable(side_change.distances[1])))
    });
    split_stretches(first, changes)
}

/// Returns, for each run of `rows` rows, the stretches that are on one side in all of them.
fn common_stretches(sides: &[Vec<bool>], rows: usize) -> Vec<(usize, Vec<RowStretch>)> {
    let mut stretches_by_row = Vec::new();
    for (first, run) in sides.windows(rows).enumerate() {
        let mut common = Vec::new();
        for is_reliable in [false, true] {
            let all: Vec<bool> =
                (0..=samples()).map(|k| run.iter().all(|row| row[k] == is_reliable)).collect();
            // A stretch ends at its last sample, not halfway to the next.
            let mut from = None;
            for k in 0..=samples() + 1 {
                let is_stretch = all.get(k).copied().unwrap_or(false);
                if let Some(start) = from.filter(|_| !is_stretch) {
                    let to = sample_position(k - 1);
                    common.push(RowStretch { from: sample_position(start), to, is_reliable });
                    from = None;
                } else if is_stretch && from.is_none() {
                    from = Some(k);
                }
            }
        }
        stretches_by_row.push((first, common));
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
    let first_values: Vec<f64> = (0..ROWS).map(|k| f64::from(k) / f64::from(ROWS - 1)).collect();
    let lattice = lattice_ranks(first_values.len(), SEARCH.lattice);
    let cell_rows = lattice.windows(2).map(|pair| pair[1] - pair[0] + 1).max().unwrap_or(1);
    let cell_width = (SEARCH.greatest - SEARCH.least) / SEARCH.lattice as f64;
    let mut guaranteed = 0;
    let mut pocket_count = 0;
    let mut trials = 0;
    let mut missed_beside_neighbour = Vec::new();
    let mut missed_others = Vec::new();
    for k in 0..LEVEL_SETS {
        let level_set = LevelSet::draw(seed.wrapping_add(k));
        let distance = |x, y| Some(level_set.distance(x, y));
        let traced = traced(distance, &first_values, &SEARCH);
        check_side_changes(&traced, distance, SEARCH.tolerance);
        trials += traced.trials;
        let found: Vec<Vec<RowStretch>> = traced.curves[0].iter().map(traced_stretches).collect();
        let sides: Vec<Vec<bool>> =
            first_values.iter().map(|first| level_set.sides(*first)).collect();
        for (first, islands) in common_stretches(&sides, cell_rows) {
            for island in islands.iter().filter(|island| island.width() >= cell_width) {
                for (row, found) in found.iter().enumerate().skip(first).take(cell_rows) {
                    guaranteed += 1;
                    let is_found = found.iter().any(|other| island.common(other) > 0.0);
                    assert!(is_found, "SEED={seed}, level set {k}, row {row}: {island:?}");
                }
            }
        }
        for (row, sides) in sides.iter().enumerate() {
            let adjacent_rows = [row.checked_sub(1), Some(row + 1)].into_iter().flatten();
            let adjacent_rows: Vec<&RowStretch> =
                adjacent_rows.filter_map(|k| found.get(k)).flatten().collect();
            for pocket in true_stretches(sides) {
                if pocket.width() <= SEARCH.tolerance {
                    continue;
                }
                pocket_count += 1;
                if found[row].iter().any(|other| pocket.common(other) > 0.0) {
                    continue;
                }
                let is_beside =
                    adjacent_rows.iter().any(|other| pocket.common(other) > SEARCH.tolerance);
                let missed =
                    if is_beside { &mut missed_beside_neighbour } else { &mut missed_others };
                missed.push(pocket.width());
            }
        }
    }
    let widest = |widths: &[f64]| widths.iter().copied().fold(0.0, f64::max);
    let summary = format!(
        "SEED={seed}: {LEVEL_SETS} level sets, {} trials each; {guaranteed} islands as large as a \
         cell, all found; of {pocket_count} stretches of one side wider than {} N s/m, missed {} \
         beside \
         a neighbour's, at most {} wide, and {} others, at most {} wide",
        trials / LEVEL_SETS as usize,
        SEARCH.tolerance,
        missed_beside_neighbour.len(),
        widest(&missed_beside_neighbour),
        missed_others.len(),
        widest(&missed_others)
    );
    println!("{summary}");
    assert!(guaranteed > 10 * LEVEL_SETS, "{summary}");
    // The stretches of 60 seeds that the search misses are 1 in 1,800 beside a neighbour that
    // shows them, and 1 in 160 of the others; a single seed at most 1 in 940 and 1 in 97.
    assert!(missed_beside_neighbour.len() * 400 <= pocket_count, "{summary}");
    assert!(missed_others.len() * 50 <= pocket_count, "{summary}");
    assert!(trials <= 400 * LEVEL_SETS as usize, "{summary}");
}
