//! Pockets that a neighbour announces: places to look at in a row because the row beside it is on
//! another side there.

use super::{Neighbour, Question, RowSearch, SideRange, Span, hint, nearest, shared};

/// A neighbour's pocket is looked for until no gap between trials is wider than this part of it.
const PART: f64 = 0.25;
/// A pocket may have moved so many of its widths from one row to the next.
const ASTRAY: f64 = 2.0;
/// Part of the pocket's last move by which the next may differ.
const CORRECTION: f64 = 0.25;
/// A change of side that has moved more than so many times as far as before is no longer the same.
const LEAP: f64 = 1.5;

/// A row that is looked at, beside another.
#[derive(Clone, Copy)]
pub(super) struct Beside<'a> {
    /// The row.
    pub own: Neighbour<'a>,
    /// The next row on the other side.
    pub before: Option<Neighbour<'a>>,
    /// What may announce something.
    pub neighbour: Neighbour<'a>,
    /// The next row beyond it.
    pub beyond: Option<Neighbour<'a>>,
    /// Whether no row is between the two.
    pub is_adjacent: bool,
}

impl Beside<'_> {
    /// What the row is asked: `gap` is the widest that is left between trials where the two are on
    /// different sides.
    pub(super) fn question(&self, row: &RowSearch, gap: f64, span: &Span) -> Question {
        let mut question = Question::default();
        for run in missing(self.neighbour.runs, self.own.runs, span) {
            self.look_for(run, row, gap, span, &mut question);
        }
        if self.is_adjacent {
            for [from, to] in self.disputed() {
                question.places.extend(cuts(from, to, gap, row));
            }
        }
        let places = &mut question.places;
        places.retain(|place| span.contains(*place) && !row.knows(*place));
        places.sort_by(f64::total_cmp);
        places.dedup_by(|b, a| *b - *a < 0.5 * span.tolerance);
        // Without a place that is new there is nothing to learn.
        if places.is_empty() { Question::default() } else { question }
    }

    /// Asks for a run of the neighbour's: where it should be by its own way through the rows
    /// beyond, or else where it is there, and where the change of side beside it has taken it.
    fn look_for(
        &self,
        run: &SideRange,
        row: &RowSearch,
        gap: f64,
        span: &Span,
        question: &mut Question,
    ) {
        let trend = self.trend(run, span);
        let expected = trend.unwrap_or_else(|| {
            let pairs = shared(self.neighbour, self.own, self.before.as_ref());
            let moves = pairs.iter().map(|[k, m]| {
                let was = self.neighbour.runs[*k].from;
                (was, self.own.runs[*m].from - was)
            });
            let moved = nearest(run, moves);
            SideRange { from: run.from + moved, to: run.to + moved, side: run.side }
        });
        let ends = [(run.from, expected.from), (run.to, expected.to)];
        let ends = ends.map(|(was, is)| hint(is, CORRECTION * (is - was), span));
        let ends = ends.into_iter().filter(|end| span.least < end.root && end.root < span.greatest);
        let is_untried = row.gaps(expected.from, expected.to).len() == 1;
        if trend.is_some() && is_inner(run, span) && is_untried {
            question.places.push(expected.middle());
            if self.is_adjacent {
                question.roots.extend(ends);
            } else {
                question.perhaps.extend(ends);
            }
        } else if self.is_adjacent {
            for run in [*run, expected] {
                let gap = gap.min(PART * run.width()).max(0.5 * span.tolerance);
                question.places.extend(cuts(run.from, run.to, gap, row));
            }
            question.perhaps.extend(ends);
        }
    }

    /// Where a run of the neighbour's should be here, by where it is in the row beyond.
    fn trend(&self, run: &SideRange, span: &Span) -> Option<SideRange> {
        let beyond = self.beyond?;
        let then = partner(run, self.neighbour.runs, beyond.runs, span)?;
        let part = (self.own.at - self.neighbour.at) / (self.neighbour.at - beyond.at);
        let on = |then: f64, now: f64, end: f64| {
            if now == end || then == end { now } else { now + part * (now - then) }
        };
        let from = on(then.from, run.from, span.least);
        let to = on(then.to, run.to, span.greatest);
        (from < to).then_some(SideRange { from, to, side: run.side })
    }

    /// Stretches where the two rows are on different sides, unless a change of side that both have
    /// has moved over them at its usual pace.
    fn disputed(&self) -> Vec<[f64; 2]> {
        let (own, other) = (self.own, self.neighbour);
        let own_drift = own.drift(self.before.as_ref(), other.at);
        let other_drift = other.drift(self.beyond.as_ref(), own.at);
        let usual = |drift: &[f64], k: usize| drift.get(k - 1).map_or(0.0, |drift| drift.abs());
        let explained: Vec<[f64; 2]> = shared(other, own, self.before.as_ref())
            .into_iter()
            .filter_map(|[k, m]| {
                let (a, b) = (other.runs[k].from, own.runs[m].from);
                let usual = usual(&other_drift, k).max(usual(&own_drift, m));
                ((a - b).abs() <= LEAP * usual).then_some([a.min(b), a.max(b)])
            })
            .collect();
        let mut marks: Vec<f64> =
            own.runs.iter().chain(other.runs).flat_map(|run| [run.from, run.to]).collect();
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        let side = |runs: &[SideRange], at: f64| {
            runs.iter().find(|run| run.from <= at && at <= run.to).map(|run| run.side)
        };
        let is_disputed = |[from, to]: &[f64; 2]| {
            let middle = 0.5 * (from + to);
            side(own.runs, middle) != side(other.runs, middle)
                && !explained.iter().any(|[a, b]| a <= from && to <= b)
        };
        marks.windows(2).map(|pair| [pair[0], pair[1]]).filter(is_disputed).collect()
    }
}

/// The runs of one row that go on in none of another's.
pub(super) fn missing<'a>(
    runs: &'a [SideRange],
    other: &'a [SideRange],
    span: &'a Span,
) -> impl Iterator<Item = &'a SideRange> {
    runs.iter().filter(move |run| partner(run, runs, other, span).is_none())
}

/// The run of another row that continues this run: one that lies beside most of it, or else the
/// nearest, if that is not far and this run is the nearest to it too.
fn partner(
    run: &SideRange,
    runs: &[SideRange],
    other: &[SideRange],
    span: &Span,
) -> Option<SideRange> {
    if let Some(beside) = other.iter().find(|other| lies_beside(run, other)) {
        return Some(*beside);
    }
    let nearest = |to: &SideRange, among: &[SideRange]| {
        let away = |run: &SideRange| (run.middle() - to.middle()).abs();
        let alike = among.iter().filter(|run| run.side == to.side && is_inner(run, span));
        alike.min_by(|a, b| away(a).total_cmp(&away(b))).copied()
    };
    let found = nearest(run, other)?;
    let moved = (found.middle() - run.middle()).abs();
    let is_near = moved <= ASTRAY * run.width().min(found.width());
    (is_near && is_inner(run, span) && nearest(&found, runs) == Some(*run)).then_some(found)
}

/// Whether half of the narrower of two runs lies beside the other.
fn lies_beside(a: &SideRange, b: &SideRange) -> bool {
    let common = a.to.min(b.to) - a.from.max(b.from);
    a.side == b.side && common > 0.5 * a.width().min(b.width())
}

/// Whether a run touches neither end of the range.
fn is_inner(run: &SideRange, span: &Span) -> bool {
    run.from > span.least && run.to < span.greatest
}

/// Places that leave no gap between a row's trials within a stretch wider than this.
fn cuts(from: f64, to: f64, widest: f64, row: &RowSearch) -> Vec<f64> {
    let cut = |[from, to]: [f64; 2]| {
        // Rounding is no reason for one more.
        let pieces = ((to - from) / widest - 1e-6).ceil().max(1.0) as usize;
        (1..pieces).map(move |k| from + (to - from) * (k as f64 / pieces as f64))
    };
    row.gaps(from, to).into_iter().flat_map(cut).collect()
}
