//! The pool: rows from a feed, runs that wait for lanes, threads that take whole lane groups of
//! them.
//!
//! A lane group costs the same with one trajectory as with eight. So runs of one rung and model
//! wait for each other, whichever rows they belong to, and a thread takes a group as soon as there
//! is a whole one, the highest rung first: rows that are nearly done leave. Once no more points
//! come, groups are taken that are not full, the lowest rung first: it has the longest way to go.
//! Where every trajectory has steps of its own, groups are larger, the longest trajectories first:
//! a lane that ends early takes up the next.
//!
//! What a lane computes does not depend on its company, so neither does a row.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use lane_ode::MAX_LANES;
use washer_model::{Method, Point};
use washer_row::{Climbs, Next, Outcome, Status, Terms};

use super::{ModelEngine, RunContext, growth};
use crate::plan::Scenario;
use sweep_files::panics::lock;

/// Points that are made ready together.
const FED: usize = MAX_LANES;

/// Kinds of runs, of which less than a group waits each.
const KINDS: usize = 12;

/// How many runs by a method a thread takes at once.
fn group(method: &Method) -> usize {
    if method.has_own_steps() { 4 * MAX_LANES } else { MAX_LANES }
}

impl ModelEngine<'_> {
    /// Rows that are on their way at once, at most, on so many threads.
    pub(crate) fn most_on_their_way(&self, threads: usize) -> usize {
        (KINDS + threads) * group(&self.ladders()[0].rungs[0].method)
    }
}

/// A row that has seen so many others come after it waits no longer: the group is taken as it is,
/// so that chunks become whole and an interrupt loses little.
const PATIENCE: u64 = 2048;

/// Where points come from: at most so many, none at the end. Each with what the caller knows it by.
pub(super) type Feed<'a> = dyn Fn(usize) -> Vec<(u64, Scenario)> + Sync + 'a;

/// Where rows go, in no particular order.
pub(super) type Keep<'a> = dyn Fn(Outcome) + Sync + 'a;

/// How long a thread that waits for others goes without a look at the stop flag.
const LOOK_UP: Duration = Duration::from_millis(50);

/// Runs of one rung of one model: positions on its ladder, behind it for twins, and in
/// `ModelKind::ALL`.
type ModelRung = (usize, usize);

/// A point's row on its way.
struct Climber {
    /// What the caller knows it by.
    id: u64,
    /// Or why there is none.
    point: Result<Arc<Point>, Status>,
    climbs: Climbs,
    /// Runs that have been asked for and are not there yet.
    pending: usize,
    /// How many rows came before it.
    came_as: u64,
}

impl Climber {
    /// What is to be done once nothing is pending.
    fn next(&self, terms: Terms<'_>) -> Next {
        match &self.point {
            Ok(point) => self.climbs.next(self.id, point, terms),
            Err(status) => {
                let method = terms.ladders[0].rungs[0].level;
                Next::Done(Box::new(Outcome { method, ..Outcome::failed(self.id, *status) }))
            }
        }
    }
}

/// Rows and the runs that they wait for.
#[derive(Default)]
pub(super) struct PoolState {
    /// Rows on their way, by what the caller knows them by.
    rows: BTreeMap<u64, Climber>,
    /// Points that the feed has given.
    fed: u64,
    /// Rows that wait for a run, by its kind.
    waiting: BTreeMap<ModelRung, Vec<u64>>,
    /// Threads that are at work on runs or points.
    at_work: usize,
    /// The feed has run dry.
    is_dry: bool,
}

/// What a thread does next.
enum Work {
    Feed,
    Runs(ModelRung, Vec<(u64, Arc<Point>)>),
    Wait,
    End,
}

/// Rows on their way through the lanes.
pub(super) struct Pool<'a> {
    pub(super) engine: &'a ModelEngine<'a>,
    pub(super) feed: &'a Feed<'a>,
    pub(super) keep: &'a Keep<'a>,
    pub(super) watch: &'a RunContext<'a>,
    pub(super) state: Mutex<PoolState>,
    pub(super) changed: Condvar,
}

impl Pool<'_> {
    /// The work of one thread, until nothing is left or the watch stops it.
    pub(super) fn work(&self) {
        while !self.watch.stopped() {
            let mut state = self.lock();
            match state.choose(&|(rung, model)| {
                let method = |terms: Terms<'_>| group(terms.ladders[model].method(rung));
                self.terms().map_or(MAX_LANES, method)
            }) {
                Work::End => break,
                Work::Wait => drop(self.changed.wait_timeout(state, LOOK_UP)),
                Work::Feed => {
                    state.at_work += 1;
                    drop(state);
                    let mut rows = self.fed();
                    let mut state = self.lock();
                    state.is_dry |= rows.is_empty();
                    for row in &mut rows {
                        row.came_as = state.fed;
                        state.fed += 1;
                    }
                    self.advance(state, rows);
                }
                Work::Runs((rung, model), taken) => {
                    state.at_work += 1;
                    drop(state);
                    let Some(terms) = self.terms() else { break };
                    let ladder = &terms.ladders[model];
                    let points = || taken.iter().map(|(_, point)| point.as_ref());
                    let twins: Vec<Point> = match rung == ladder.twin() {
                        true => points().map(Point::nudged).collect(),
                        false => Vec::new(),
                    };
                    let points: Vec<&Point> =
                        if twins.is_empty() { points().collect() } else { twins.iter().collect() };
                    let runs = self.engine.runs(model, ladder.method(rung), &points, self.watch);
                    // They may have been cut short.
                    if self.watch.stopped() {
                        break;
                    }
                    let mut state = self.lock();
                    let mut rows = Vec::with_capacity(taken.len());
                    for ((position, _), run) in taken.iter().zip(runs) {
                        let Some(mut row) = state.rows.remove(position) else { continue };
                        row.pending -= 1;
                        if let Ok(point) = &row.point {
                            row.climbs.take((model, rung), run, point, terms);
                        }
                        rows.push(row);
                    }
                    self.advance(state, rows);
                }
            }
        }
        self.changed.notify_all();
    }

    /// What rows are judged by; `None` once the watch has stopped the work before it was found.
    fn terms(&self) -> Option<Terms<'_>> {
        let ModelEngine { demand, rule, .. } = self.engine;
        let ladders = self.engine.ladders_under(self.watch)?;
        Some(Terms { ladders, demand: *demand, rule })
    }

    fn lock(&self) -> MutexGuard<'_, PoolState> {
        lock(&self.state)
    }

    /// New rows from the feed; none at its end.
    fn fed(&self) -> Vec<Climber> {
        let (ids, scenarios): (Vec<u64>, Vec<Scenario>) = (self.feed)(FED).into_iter().unzip();
        let points = self.engine.prepare(&scenarios);
        let row = |(id, point): (u64, Result<Point, Status>)| {
            let point = point.map(Arc::new);
            Climber { id, point, climbs: Climbs::default(), pending: 0, came_as: 0 }
        };
        ids.into_iter().zip(points).map(row).collect()
    }

    /// Asks for what rows need next, and hands over those that need nothing.
    fn advance(&self, mut state: MutexGuard<'_, PoolState>, rows: Vec<Climber>) {
        let mut done = Vec::new();
        for mut row in rows {
            let next = if row.pending > 0 {
                Next::Runs(Vec::new())
            } else {
                // Nothing is kept of what is put down.
                let Some(terms) = self.terms() else { break };
                row.next(terms)
            };
            match next {
                Next::Runs(kinds) => {
                    let position = row.id;
                    row.pending += kinds.len();
                    for (model, rung) in kinds {
                        state.waiting.entry((rung, model)).or_default().push(position);
                    }
                    state.rows.insert(position, row);
                }
                Next::Done(outcome) => done.push((*outcome, row.point)),
            }
        }
        state.at_work -= 1;
        drop(state);
        self.changed.notify_all();
        done.iter_mut().for_each(|(outcome, _)| outcome.forget_turns());
        let model = &self.engine.plan.model;
        if let Some(speeds) = &model.held_speeds {
            let is_stopped = || self.watch.stopped();
            let asked = (speeds.values(), model.measures.metrics.as_slice());
            let there = done
                .iter_mut()
                .filter_map(|(outcome, point)| point.as_deref().ok().map(|point| (outcome, point)));
            growth::add(&mut there.collect::<Vec<_>>(), self.engine.widest(), asked, &is_stopped);
            if is_stopped() {
                return;
            }
        }
        done.into_iter().for_each(|(outcome, _)| (self.keep)(outcome));
    }
}

impl PoolState {
    /// `group` says how many runs of a kind are taken at once.
    fn choose(&mut self, group: &dyn Fn(ModelRung) -> usize) -> Work {
        let is_full = |(kind, waiting): &(&ModelRung, &Vec<u64>)| waiting.len() >= group(**kind);
        let highest = self.waiting.iter().rfind(is_full).map(|(kind, _)| *kind);
        if let Some(kind) = highest.or_else(|| self.overdue()) {
            return self.take(kind, group(kind));
        }
        if !self.is_dry {
            return Work::Feed;
        }
        let lowest = self.waiting.iter().find(|(_, waiting)| !waiting.is_empty());
        match lowest.map(|(kind, waiting)| (*kind, waiting.len())) {
            // The rest is for other threads.
            Some((kind, count)) => self.take(kind, count.div_ceil(2).max(MAX_LANES)),
            None if self.at_work == 0 => Work::End,
            None => Work::Wait,
        }
    }

    /// The kind of runs that a row has waited for too long, if any.
    fn overdue(&self) -> Option<ModelRung> {
        let latest = self.fed.checked_sub(PATIENCE)?;
        let is_overdue = |id: &u64| self.rows.get(id).is_some_and(|row| row.came_as < latest);
        let mut waiting = self.waiting.iter();
        let highest = waiting.rfind(|(_, waiting)| waiting.first().is_some_and(is_overdue));
        highest.map(|(kind, _)| *kind)
    }

    /// Takes a group of what waits, the first come, of these the longest first.
    fn take(&mut self, kind: ModelRung, most: usize) -> Work {
        let waiting = self.waiting.entry(kind).or_default();
        let mut positions: Vec<u64> = waiting.drain(..waiting.len().min(most)).collect();
        let steps = |id: &u64| self.rows.get(id).map(|row| row.climbs.steps(kind.1));
        positions.sort_by_key(|id| Reverse(steps(id)));
        let point =
            |position: &u64| Some((*position, self.rows.get(position)?.point.clone().ok()?));
        Work::Runs(kind, positions.iter().filter_map(point).collect())
    }
}
