//! What passes between the engine and its caller: whether to stop, and how many points are done.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::interrupt::Interrupt;
use crate::store::Done;
use sweep_files::panics::lock;

/// Gives a row: what it is known by, and the values of the plan's axes there.
pub type NextRow<'a> = dyn Fn() -> Option<(u64, Vec<f64>)> + Sync + 'a;

/// Takes what came of a row.
pub type KeepRow<'a> = dyn Fn(Done) + Sync + 'a;

/// Recalls what came of a row.
pub type KnownRow<'a> = dyn Fn(u64) -> Option<Done> + Sync + 'a;

/// What computes points.
pub trait Engine: Sync {
    /// Evaluates points until `next` gives none, each with what it is known by and the values of
    /// the plan's axes there, on the grid or between its points. Hands each outcome to `keep`, in
    /// any order; fewer if it stopped because [`Watch::stopped`] said so. Works on all threads of
    /// the rayon pool that it is called in, and calls both from any of them.
    ///
    /// A point that fails, even by a panic, is an outcome; a panic that leaves this function costs
    /// all that is in hand.
    fn evaluate(&self, next: &NextRow<'_>, keep: &KeepRow<'_>, watch: &Watch<'_>);

    /// The instruction set in use.
    fn simd(&self) -> &str;

    /// Whether rows that come one after another share work: `next` then keeps to the grid's order,
    /// and otherwise takes chunks that are far apart.
    fn is_helped_by_neighbours(&self) -> bool {
        false
    }
}

/// The engine's view of the run it serves.
pub struct Watch<'a> {
    interrupt: &'a Interrupt,
    /// Set when a chunk could not be kept: what is in hand would be lost too.
    abort: AtomicBool,
    done: AtomicU64,
    is_late: Option<&'a (dyn Fn() -> bool + Sync)>,
    known: Option<&'a KnownRow<'a>>,
}

impl<'a> Watch<'a> {
    /// A watch over nothing but the stop flag.
    pub const fn new(interrupt: &'a Interrupt) -> Self {
        let (abort, done) = (AtomicBool::new(false), AtomicU64::new(0));
        Self { interrupt, abort, done, is_late: None, known: None }
    }

    /// The same, and over what earlier processes have kept.
    pub const fn knowing(interrupt: &'a Interrupt, known: &'a KnownRow<'a>) -> Self {
        Self { known: Some(known), ..Self::new(interrupt) }
    }

    /// The same, and over a time that the work may take.
    pub const fn until(interrupt: &'a Interrupt, is_late: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self { is_late: Some(is_late), ..Self::new(interrupt) }
    }

    /// What has been kept of a row, by whichever process.
    pub fn known(&self, row: u64) -> Option<Done> {
        self.known.and_then(|known| known(row))
    }

    /// Counts points done, for the bar.
    pub fn done(&self, points: u64) {
        self.done.fetch_add(points, Ordering::Relaxed);
    }

    /// Points done so far.
    pub fn points_done(&self) -> u64 {
        self.done.load(Ordering::Relaxed)
    }

    /// Stops the engine.
    pub fn abort(&self) {
        self.abort.store(true, Ordering::Relaxed);
    }

    /// Whether the engine is to stop.
    pub fn stopped(&self) -> bool {
        let is_late = || self.is_late.is_some_and(|is_late| is_late());
        self.interrupt.stopped() || self.abort.load(Ordering::Relaxed) || is_late()
    }
}

/// Outcomes in groups that are not whole, by the group's number.
#[derive(Debug, Default)]
pub struct Parts(pub Mutex<BTreeMap<u64, Vec<Done>>>);

impl Parts {
    /// Adds an outcome to its group; where that makes it whole, of so many, all of them in order.
    pub fn add(&self, group: u64, whole: u64, outcome: Done) -> Option<Vec<Done>> {
        let mut parts = lock(&self.0);
        let part = parts.entry(group).or_default();
        part.push(outcome);
        if (part.len() as u64) < whole {
            return None;
        }
        let mut outcomes = parts.remove(&group)?;
        drop(parts);
        outcomes.sort_by_key(|outcome| outcome.point);
        Some(outcomes)
    }
}
