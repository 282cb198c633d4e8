//! Rows as others see them, and the changes of side that two have in common.

use super::span::{Hint, Side, SideRange, Span};

/// Roots are not expected closer than this to where they are predicted, in tolerances.
const LEAST_SPREAD: f64 = 0.1;

/// A row as others see it: its place along the first axis, and what was found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour<'a> {
    pub at: f64,
    pub runs: &'a [SideRange],
}

impl Neighbour<'_> {
    fn sides(&self) -> impl Iterator<Item = Side> + '_ {
        self.runs.iter().map(|run| run.side)
    }

    /// Whether the sides change as in another row.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        self.sides().eq(other.sides())
    }

    /// Changes of side.
    fn roots(&self) -> impl Iterator<Item = f64> + '_ {
        self.runs.iter().skip(1).map(|run| run.from)
    }

    /// How far every change of side should move on the way to another place: as far, in proportion,
    /// as from the row before. Nothing where that one's sides change otherwise.
    pub(super) fn drift(&self, before: Option<&Self>, to: f64) -> Vec<f64> {
        let Some(before) = before.filter(|before| before.is_like(self)) else { return Vec::new() };
        let part = (to - self.at) / (self.at - before.at);
        self.roots().zip(before.roots()).map(|(now, then)| part * (now - then)).collect()
    }
}

/// A root with how far it may be off: by as much as this, and never by nothing.
pub(super) fn hint(root: f64, off: f64, span: &Span) -> Hint {
    Hint { root, spread: off.abs().max(LEAST_SPREAD * span.tolerance) }
}

/// How far the change of side next to a run has moved, of these with their moves.
pub(super) fn nearest(run: &SideRange, moves: impl Iterator<Item = (f64, f64)>) -> f64 {
    let away = |at: f64| (at - run.middle()).abs();
    let nearest = moves.min_by(|a, b| away(a.0).total_cmp(&away(b.0)));
    nearest.map_or(0.0, |(_, moved)| moved)
}

/// Changes of side that two rows have in common, as pairs of their numbers (of the run that begins
/// there): every change of the row with fewer goes with the nearest of its kind in the other, in
/// order. `before` is the row before `b`, seen from `a`: it shows how far those of `b` have moved
/// on their way.
pub(super) fn shared(
    a: Neighbour<'_>,
    b: Neighbour<'_>,
    before: Option<&Neighbour<'_>>,
) -> Vec<[usize; 2]> {
    let drift = b.drift(before, a.at);
    let expected = |m: usize| b.runs[m].from + drift.get(m - 1).copied().unwrap_or(0.0);
    let is_alike = |k: usize, m: usize| {
        let sides = |runs: &[SideRange], k: usize| [runs[k - 1].side, runs[k].side];
        sides(a.runs, k) == sides(b.runs, m)
    };
    let distance = |k: usize, m: usize| (a.runs[k].from - expected(m)).abs();
    let has_more = a.runs.len() >= b.runs.len();
    let (few, many) = if has_more { (b, a) } else { (a, b) };
    let mut pairs = Vec::new();
    let mut next = 1;
    for one in 1..few.runs.len() {
        let pair = |other: usize| if has_more { [other, one] } else { [one, other] };
        // Those after it need theirs too.
        let end = many.runs.len() - (few.runs.len() - 1 - one);
        let found = (next..end.max(next))
            .filter(|other| is_alike(pair(*other)[0], pair(*other)[1]))
            .min_by(|x, y| {
                let [x, y] = [pair(*x), pair(*y)];
                distance(x[0], x[1]).total_cmp(&distance(y[0], y[1]))
            });
        if let Some(other) = found {
            pairs.push(pair(other));
            next = other + 1;
        }
    }
    pairs
}
