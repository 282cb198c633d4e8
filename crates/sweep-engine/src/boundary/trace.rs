//! Rows in their order: the lattice first, then the rows between, each as soon as its neighbours
//! tell where to begin, and again where they announce something.

use super::batch::{LANES, deal, lane_groups};
use super::pockets::Beside;
use super::span::{Question, SideRange, Span, Tried};
use super::warm_start::{self, HEARD};
use super::{Neighbour, RowSearch, Search, Traced, TracedRow, Trial, Want};

/// Rows that are worked on at once, in whole curves: bounds memory, and is plenty to fill lanes.
const ROWS_AT_ONCE: usize = 1 << 14;
/// Most places that a row tries because of what its neighbours announce: whatever the function
/// does, it ends.
const MOST_ASKED: usize = 64;
/// How far a pocket is announced, in rows: from one place to many in a few rounds.
const ANNOUNCED: [isize; 6] = [-1, 1, -2, 2, -4, 4];
/// Where rows disagree, no gap between trials is wider than this part of a cell of the lattice.
const GAP: f64 = 0.25;

/// Traces `curves` curves over these values of the first axis. `evaluate` gives one signed distance
/// from the limit a trial, in the same order: negative on the reliable side, `None` where the
/// quantity is not defined. Before every batch `tell` hears how many rows are done, unless a
/// neighbour will announce something.
///
/// # Errors
/// Whatever stopped the evaluation.
pub fn trace<E>(
    evaluate: &dyn Fn(&[Trial]) -> Result<Vec<Option<f64>>, E>,
    firsts: &[f64],
    curves: usize,
    search: &Search,
    tell: &mut dyn FnMut(usize),
) -> Result<Traced, E> {
    let mut traced = Traced { curves: Vec::with_capacity(curves), ..Traced::default() };
    let at_once = (ROWS_AT_ONCE / firsts.len().max(1)).max(1);
    while traced.curves.len() < curves {
        let begun = traced.curves.len();
        let end = (begun + at_once).min(curves);
        let mut block = Block::new(begun..end, firsts, search);
        while let Some(batch) = block.next() {
            let trials: Vec<Trial> = batch.iter().map(|(trial, ..)| *trial).collect();
            tell(begun * firsts.len() + block.rows_done());
            let distances = evaluate(&trials)?;
            for ((_, place, at), distance) in batch.iter().zip(distances) {
                block.insert(*place, *at, distance);
            }
            traced.trials += trials.len();
            traced.lane_groups += lane_groups(trials.len());
            traced.rounds += 1;
        }
        traced.curves.extend(block.finish());
    }
    Ok(traced)
}

/// A row's place: its curve within the block, its rank along the first axis.
type Place = (usize, usize);
/// A trial, the place that asked for it, and its position.
type Asked = (Trial, Place, f64);

/// Curves that are traced together.
struct Block<'a> {
    first_curve: usize,
    firsts: &'a [f64],
    search: Search,
    span: Span,
    order: Vec<Rank>,
    curves: Vec<Vec<Slot>>,
    /// Widest gap where rows disagree.
    gap: f64,
}

/// A row's rank along the first axis, the same in every curve.
struct Rank {
    /// Value or logarithm of the first axis.
    at: f64,
    /// Index among the values of the first axis.
    index: usize,
    /// When it begins.
    level: usize,
    /// Ranks of earlier levels that it begins from, to its left and to its right, the nearest
    /// first.
    heard: [Vec<usize>; 2],
}

/// A row of a curve.
#[derive(Clone, Default)]
struct Slot {
    row: Option<RowSearch>,
    /// It wanted nothing when it was last asked, and nothing has come since.
    is_settled: bool,
    /// Whether its roots are known well enough for others to begin from.
    is_placed: bool,
    /// What is known of it, while it is placed.
    runs: Vec<SideRange>,
    /// Places it tried because of its neighbours.
    asked: usize,
}

impl<'a> Block<'a> {
    fn new(curves: std::ops::Range<usize>, firsts: &'a [f64], search: &Search) -> Self {
        let position = |value: f64, log: bool| if log { libm::log(value) } else { value };
        let ends = [search.least, search.greatest];
        let [least, greatest] = ends.map(|value| position(value, search.second_log));
        let cells = search.lattice.max(1);
        let places = firsts.iter().map(|first| position(*first, search.first_log));
        let order = ranks(places.collect(), cells);
        let rows = order.iter().filter(|rank| rank.level == 0).count().max(1);
        // More columns fill up the last lane group.
        let columns = (lane_groups(rows * (cells + 1)) * LANES / rows).max(cells + 1);
        let width = (greatest - least) / (columns - 1) as f64;
        let lattice: Vec<f64> = (0..columns)
            .map(|k| if k + 1 == columns { greatest } else { least + width * k as f64 })
            .collect();
        let slot = |rank: &Rank| {
            let row = (rank.level == 0)
                .then(|| RowSearch::new(Question::places(lattice.clone()), [None; 2]));
            Slot { row, ..Slot::default() }
        };
        let slots: Vec<Slot> = order.iter().map(slot).collect();
        Self {
            first_curve: curves.start,
            firsts,
            search: *search,
            span: Span { least, greatest, tolerance: search.tolerance },
            order,
            curves: vec![slots; curves.len()],
            gap: GAP * width,
        }
    }

    /// The next batch; `None` when all is done.
    fn next(&mut self) -> Option<Vec<Asked>> {
        loop {
            let mut wants = self.wants();
            self.begin(&mut wants);
            if wants.is_empty() {
                return None;
            }
            wants.sort_by_key(|(place, _)| *place);
            let batch = self.deal(&wants);
            // With all of it known by now, the rows go on from there.
            if !batch.is_empty() {
                return Some(batch);
            }
        }
    }

    /// What rows at work want tried next, and what settled rows are asked by their neighbours.
    fn wants(&mut self) -> Vec<(Place, Want)> {
        let mut wants = Vec::new();
        for (curve, slots) in self.curves.iter_mut().enumerate() {
            for (rank, slot) in slots.iter_mut().enumerate() {
                let Some(row) = slot.row.as_mut().filter(|_| !slot.is_settled) else { continue };
                let of_row = row.wants(&self.span);
                slot.is_settled = of_row.is_empty();
                slot.is_placed = slot.is_settled || row.is_placed(&self.span);
                slot.runs = if slot.is_placed { row.runs(&self.span) } else { Vec::new() };
                wants.extend(of_row.into_iter().map(|want| ((curve, rank), want)));
            }
            let questions = announced(slots, &self.order, self.gap, &self.span);
            for (rank, question) in questions {
                let slot = &mut slots[rank];
                let Some(row) = &mut slot.row else { continue };
                slot.asked += question.places.len();
                slot.is_settled = false;
                row.ask(question);
            }
            for (rank, slot) in slots.iter_mut().enumerate() {
                let Some(row) = slot.row.as_mut().filter(|row| row.is_asked()) else { continue };
                wants.extend(row.wants(&self.span).into_iter().map(|want| ((curve, rank), want)));
            }
        }
        wants
    }

    /// Begins rows whose neighbours are placed: as many as make whole lane groups together with
    /// what the others want, in the order of their levels; the rest waits for the next batch.
    fn begin(&mut self, wants: &mut Vec<(Place, Want)>) {
        let mut ready: Vec<(Place, RowSearch, Vec<Want>)> = Vec::new();
        for (curve, slots) in self.curves.iter().enumerate() {
            for (rank, _) in slots.iter().enumerate().filter(|(_, slot)| slot.row.is_none()) {
                let Rank { at, heard, .. } = &self.order[rank];
                if !heard.iter().flatten().all(|rank| slots[*rank].is_placed) {
                    continue;
                }
                let seen = |rank: &usize| neighbour(slots, &self.order, *rank);
                let [left, right] =
                    heard.each_ref().map(|ranks| ranks.iter().map(seen).collect::<Vec<_>>());
                let mut row = warm_start::start(*at, &left, &right, &self.span);
                let of_row = row.wants(&self.span);
                ready.push(((curve, rank), row, of_row));
            }
        }
        ready.sort_by_key(|((curve, rank), ..)| (self.order[*rank].level, *curve, *rank));
        let count = |wants: &[Want]| wants.iter().map(Want::needed).sum::<usize>();
        let mut needed: usize = wants.iter().map(|(_, want)| want.needed()).sum();
        let all = needed + ready.iter().map(|(.., of_row)| count(of_row)).sum::<usize>();
        let whole = (all / LANES).max(lane_groups(needed)) * LANES;
        for (place, row, of_row) in ready {
            needed += count(&of_row);
            if needed > whole && !wants.is_empty() {
                break;
            }
            self.curves[place.0][place.1].row = Some(row);
            wants.extend(of_row.into_iter().map(|want| (place, want)));
        }
    }

    /// The trials of these wants, in the order of their rows, each once.
    fn deal(&mut self, wants: &[(Place, Want)]) -> Vec<Asked> {
        let counts = deal(&wants.iter().map(|(_, want)| want).collect::<Vec<_>>(), &self.span);
        let mut batch = Vec::new();
        let with_counts: Vec<_> = wants.iter().zip(counts).collect();
        for of_row in with_counts.chunk_by(|a, b| a.0.0 == b.0.0) {
            let (curve, rank) = of_row[0].0.0;
            let Some(row) = &mut self.curves[curve][rank].row else { continue };
            let mut positions: Vec<f64> = Vec::new();
            for ((_, want), count) in of_row {
                let places = want.places(*count, &self.span);
                if let (Want::Net(_), [first, .., last]) = (want, places.as_slice()) {
                    row.note([*first, *last]);
                }
                positions.extend(places);
            }
            positions.retain(|at| !row.knows(*at));
            positions.sort_by(f64::total_cmp);
            positions.dedup();
            let first = self.firsts[self.order[rank].index];
            for at in positions {
                let second = value(&self.search, &self.span, at);
                let trial = Trial { curve: self.first_curve + curve, first, second };
                batch.push((trial, (curve, rank), at));
            }
        }
        batch
    }

    fn insert(&mut self, (curve, rank): Place, at: f64, distance: Option<f64>) {
        let slot = &mut self.curves[curve][rank];
        slot.is_settled = false;
        if let Some(row) = &mut slot.row {
            row.insert(Tried { at, distance: distance.filter(|distance| !distance.is_nan()) });
        }
    }

    fn rows_done(&self) -> usize {
        self.curves.iter().flatten().filter(|slot| slot.is_settled).count()
    }

    fn finish(self) -> Vec<Vec<TracedRow>> {
        let value = |at: f64| value(&self.search, &self.span, at);
        let mut ranks: Vec<usize> = (0..self.order.len()).collect();
        ranks.sort_by_key(|rank| self.order[*rank].index);
        let traced = |slots: &Vec<Slot>| {
            let rows = ranks.iter().filter_map(|rank| {
                let row = slots[*rank].row.as_ref()?;
                let first = self.firsts[self.order[*rank].index];
                let edges = row.edges(&self.span, &value);
                Some(TracedRow { first, edges, trials: row.trials() })
            });
            rows.collect()
        };
        self.curves.iter().map(traced).collect()
    }
}

/// The value of the second axis at a position.
fn value(search: &Search, span: &Span, at: f64) -> f64 {
    // The ends are exact whatever the logarithm rounds to.
    if at <= span.least {
        search.least
    } else if at >= span.greatest {
        search.greatest
    } else if search.second_log {
        libm::exp(at)
    } else {
        at
    }
}

fn neighbour<'s>(slots: &'s [Slot], order: &[Rank], rank: usize) -> Neighbour<'s> {
    Neighbour { at: order[rank].at, runs: &slots[rank].runs }
}

/// What settled rows are asked because of settled rows beside them.
fn announced(slots: &[Slot], order: &[Rank], gap: f64, span: &Span) -> Vec<(usize, Question)> {
    let settled = |rank: Option<usize>| {
        let rank = rank.filter(|rank| slots.get(*rank).is_some_and(|slot| slot.is_settled))?;
        Some(neighbour(slots, order, rank))
    };
    let mut questions = Vec::new();
    for (rank, slot) in slots.iter().enumerate() {
        let (Some(row), Some(own)) = (&slot.row, settled(Some(rank))) else { continue };
        if slot.asked >= MOST_ASKED {
            continue;
        }
        for step in ANNOUNCED {
            let beside = |step: isize| settled(rank.checked_add_signed(step));
            let Some(neighbour) = beside(step) else { continue };
            let beside = Beside {
                own,
                before: beside(-step.signum()),
                neighbour,
                beyond: beside(step + step.signum()),
                is_adjacent: step.abs() == 1,
            };
            let question = beside.question(row, gap, span);
            if !question.is_empty() {
                questions.push((rank, question));
            }
        }
    }
    questions
}

/// Rows by their places along the first axis, with the order in which they begin: the lattice's
/// rows, evenly spread with both ends, then again and again the middle of every gap.
fn ranks(places: Vec<f64>, cells: usize) -> Vec<Rank> {
    let rank = |(index, at): (usize, f64)| Rank { at, index, level: 0, heard: Default::default() };
    let mut order: Vec<Rank> = places.into_iter().enumerate().map(rank).collect();
    order.sort_by(|a, b| a.at.total_cmp(&b.at));
    let Some(last) = order.len().checked_sub(1) else { return order };
    let mut known: Vec<usize> = (0..=cells).map(|k| (k * last + cells / 2) / cells).collect();
    known.dedup();
    for level in 1.. {
        let is_wide = |k: &usize| known[k + 1] - known[*k] > 1;
        let gaps: Vec<usize> = (0..known.len() - 1).filter(is_wide).collect();
        if gaps.is_empty() {
            break;
        }
        let mut middles = Vec::with_capacity(gaps.len());
        for k in gaps {
            let middle = known[k] + (known[k + 1] - known[k]) / 2;
            let left = known[..=k].iter().rev().take(HEARD).copied().collect();
            let right = known[k + 1..].iter().take(HEARD).copied().collect();
            order[middle] = Rank { level, heard: [left, right], ..order[middle] };
            middles.push(middle);
        }
        known.extend(middles);
        known.sort_unstable();
    }
    order
}
