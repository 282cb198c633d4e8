//! The search against fields drawn at random, whose edges are known everywhere: a boundary with
//! islands, tongues and folds of either kind, smooth or with a jump. Which pockets does it miss?

use super::super::*;
use super::{SEARCH, check_edges, traced};

/// How many fields are drawn.
const FIELDS: u64 = 1000;
const ROWS: u32 = 39;
/// The truth is sampled at this distance, half a tolerance.
const STEP: f64 = 0.25;

/// A stretch of a row on one side.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: f64,
    to: f64,
    is_reliable: bool,
}

impl Stretch {
    fn width(&self) -> f64 {
        self.to - self.from
    }

    /// How much of it lies beside another on the same side.
    fn common(&self, other: &Self) -> f64 {
        let common = self.to.min(other.to) - self.from.max(other.from);
        if self.is_reliable == other.is_reliable { common } else { f64::NEG_INFINITY }
    }
}

/// A region of either side laid over a field: an ellipse, or a parabola's inside, sheared.
struct Pocket {
    at: [f64; 2],
    size: [f64; 2],
    shear: f64,
    depth: f64,
    /// Towards which end of the first axis it opens; an ellipse opens nowhere.
    opens: f64,
    is_reliable: bool,
}

/// A field over `0..=1` and the second axis of [`SEARCH`].
struct Field {
    line: [f64; 5],
    widths: [f64; 2],
    reliable_below: bool,
    pockets: Vec<Pocket>,
    jump: Option<[f64; 3]>,
}

impl Field {
    fn draw(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut between = |from: f64, to: f64| from + (to - from) * random.f64();
        let line = [[40.0, 320.0], [-200.0, 250.0], [0.0, 20.0], [2.0, 9.0], [0.0, 6.0]]
            .map(|[from, to]| between(from, to));
        let widths = [between(15.0, 60.0), between(15.0, 60.0)];
        let reliable_below = between(0.0, 1.0) < 0.3;
        let pockets = (0..between(0.0, 4.0) as usize)
            .map(|_| Pocket {
                at: [between(-0.05, 1.05), between(50.0, 310.0)],
                // From one row to most of them, from 3 N s/m to a quarter of the range.
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

    /// Saturates far on both sides of its line, as a ratio does.
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
            let (u, v) = (x - pocket.at[0], y - pocket.at[1] - pocket.shear * (x - pocket.at[0]));
            let (u, v) = (u / pocket.size[0], v / pocket.size[1]);
            let along = if pocket.opens == 0.0 { 1.0 - u * u } else { pocket.opens * u };
            let inside = (along - v * v) * pocket.depth;
            distance = match pocket.is_reliable {
                true => distance.min(-inside),
                false => distance.max(inside),
            };
        }
        distance.clamp(-0.7, 2.6)
    }

    fn truth(&self, x: f64) -> Vec<Stretch> {
        let steps = ((SEARCH.greatest - SEARCH.least) / STEP) as u32;
        let at = |k: u32| SEARCH.least + STEP * f64::from(k);
        let sides: Vec<bool> = (0..=steps).map(|k| self.distance(x, at(k)) < 0.0).collect();
        let changes = (1..=steps).filter(|k| sides[*k as usize] != sides[*k as usize - 1]);
        let marks = changes.map(|k| (at(k) - 0.5 * STEP, sides[k as usize]));
        stretches(sides[0], marks)
    }
}

/// The stretches by the side at the least value and the changes of side behind it.
fn stretches(first: bool, changes: impl Iterator<Item = (f64, bool)>) -> Vec<Stretch> {
    let mut found = vec![Stretch { from: SEARCH.least, to: SEARCH.greatest, is_reliable: first }];
    for (at, is_reliable) in changes {
        if let Some(last) = found.last_mut() {
            last.to = at;
        }
        found.push(Stretch { from: at, to: SEARCH.greatest, is_reliable });
    }
    found
}

fn found(row: &TracedRow) -> Vec<Stretch> {
    let is_reliable = |distance: Option<f64>| distance.is_some_and(|distance| distance < 0.0);
    let first = match row.edges[0].bracket {
        Some(_) => is_reliable(row.edges[0].distances[0]),
        None => row.edges[0].kind == EdgeKind::NoneReliable,
    };
    let changes = row.edges.iter().filter_map(|edge| {
        let [low, high] = edge.bracket?;
        Some((0.5 * (low + high), is_reliable(edge.distances[1])))
    });
    stretches(first, changes)
}

#[test]
fn no_wide_pocket_is_missed_that_a_neighbour_announces() {
    let firsts: Vec<f64> = (0..ROWS).map(|k| f64::from(k) / f64::from(ROWS - 1)).collect();
    let (mut pockets, mut lane_groups) = (0, 0);
    // Widths of what was missed, announced or not.
    let (mut announced, mut unannounced) = (Vec::new(), Vec::new());
    for seed in 0..FIELDS {
        let field = Field::draw(seed);
        let of = |x, y| Some(field.distance(x, y));
        let traced = traced(of, &firsts, &SEARCH);
        check_edges(&traced, of, SEARCH.tolerance);
        lane_groups += traced.lane_groups;
        let rows: Vec<Vec<Stretch>> = traced.curves[0].iter().map(found).collect();
        for (k, first) in firsts.iter().enumerate() {
            let beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
            let beside: Vec<&Stretch> = beside.filter_map(|k| rows.get(k)).flatten().collect();
            for pocket in field.truth(*first) {
                if pocket.width() <= SEARCH.tolerance {
                    continue;
                }
                pockets += 1;
                let is_in = |other: &Stretch, by: f64| pocket.common(other) > by;
                if rows[k].iter().any(|other| is_in(other, 0.0)) {
                    continue;
                }
                let is_announced = beside.iter().any(|other| is_in(other, SEARCH.tolerance));
                if is_announced { &mut announced } else { &mut unannounced }.push(pocket.width());
            }
        }
    }
    let widest = |widths: &[f64]| widths.iter().copied().fold(0.0, f64::max);
    let said = format!(
        "{FIELDS} fields, {pockets} stretches of one side wider than {} N s/m, \
         {:.1} lane groups a field; missed: {} that \
         a neighbour announces, at most {} wide, and {} others, at most {} wide",
        SEARCH.tolerance,
        lane_groups as f64 / FIELDS as f64,
        announced.len(),
        widest(&announced),
        unannounced.len(),
        widest(&unannounced)
    );
    println!("{said}");
    // A quarter of a cell of the lattice is 8.6 N s/m, and what lies partly beside the neighbour's
    // pocket may be twice as wide.
    assert!(widest(&announced) <= 17.2, "{said}");
    assert!(announced.len() * 1000 <= pockets, "{said}");
    assert!(unannounced.len() * 50 <= pockets, "{said}");
    assert!(lane_groups <= 40 * FIELDS as usize, "{said}");
}
