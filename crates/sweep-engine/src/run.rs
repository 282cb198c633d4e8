//! The runner: takes missing chunks, has the engine compute them on all cores, keeps each as it
//! comes, and joins the whole. Of chunks that a signal or an error cuts short it keeps the rows
//! that are there.
//!
//! Memory: a chunk (at most 4096 points, about 2 MB) in hand for each thread and as many again on
//! their way to the disk, then about 40 MB for the join; nothing grows with the number of points
//! but one set entry a chunk.

use std::collections::BTreeSet;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use crate::store::provenance::{self, Session};
use crate::store::read::NameCounts;
use crate::store::{
    Done, OpenOptions, OpenRun, Opened, ResultFile, Shard, ShardRequest, Tally, idle_shards,
};
use crate::threads::{self};
use crate::watch::Parts;
use crate::{Engine, Environment, Interrupt, Job, Progress, ProgressMode, StoreError, Watch};
use sweep_files::panics::{self, lock, unlocked};

/// How to run.
#[derive(Clone, Copy)]
pub struct RunOptions<'a> {
    /// Worker threads (`threads::count`).
    pub threads: usize,
    /// Start over.
    pub fresh: bool,
    /// Which part.
    pub shard: Option<ShardRequest>,
    /// How progress is shown.
    pub progress: ProgressMode,
    /// Looks up the scheduler's variables.
    pub environment: Environment<'a>,
    /// Shows a user what matters before the work starts.
    pub tell: &'a dyn Fn(&str),
}

/// How a run ended, other than by an error.
#[derive(Debug)]
pub enum Ended {
    /// The output was there already.
    Already(Box<ResultFile>, Box<Tally>),
    /// The output is in place.
    Finished(Box<Tally>),
    /// This shard's part is there, with so many rows by status; the merge comes when all are.
    Shard(Shard, NameCounts),
    /// A signal stopped it; what is done is kept.
    Interrupted {
        /// The signal.
        signal: u8,
        /// Points that are there.
        kept: u64,
        /// Points in all.
        points: u64,
    },
}

/// The outcome of a run, for a user.
#[derive(Debug)]
pub struct RunReport {
    /// How it ended.
    pub ended: Ended,
    /// This process's work; absent if there was none to do.
    pub session: Option<Session>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Runs a job on an output, resuming what is there.
///
/// # Errors
/// Everything of [`StoreError`]; finished chunks are kept whatever it is.
pub fn run(
    engine: &dyn Engine,
    job: &Job<'_>,
    output: &Path,
    options: RunOptions<'_>,
    interrupt: &Interrupt,
) -> Result<RunReport, StoreError> {
    let RunOptions { threads, fresh, shard, environment, .. } = options;
    let mut run = match OpenRun::open(output, job, OpenOptions { fresh, shard, environment })? {
        Opened::Finished((file, tally)) => {
            let ended = Ended::Already(Box::new(file), Box::new(tally));
            return Ok(RunReport { ended, session: None, notes: Vec::new() });
        }
        Opened::Open(run) => run,
    };
    let (points, there) = run.own_points();
    if let Some(shard) = run.shard() {
        (options.tell)(&format!("shard {} of {}", shard.index, shard.of));
        idle_shards(job.points, shard.of).iter().for_each(|note| (options.tell)(note));
    }
    for note in run.take_notes() {
        (options.tell)(&note);
    }
    if there > 0 {
        (options.tell)(&format!("going on: {there} of {points} points are there"));
    }
    let (began, started_unix_s) = (Instant::now(), provenance::now_unix_s());
    let progress = Progress::new(options.progress, points, there);
    let work = Work { engine, job, threads, progress: &progress, interrupt };
    let result = work.compute_and_join(&mut run);
    progress.finish();
    let wall_s = began.elapsed().as_secs_f64();
    let computed = run.own_points().1.saturating_sub(there);
    let session = Session {
        started_unix_s,
        wall_s,
        host: provenance::host(),
        pid: std::process::id(),
        cpus: threads::cores(),
        cpu_model: provenance::cpu_model(),
        simd: engine.simd().to_owned(),
        threads,
        shard: run.shard().map(|shard| format!("{}/{}", shard.index, shard.of)),
        points: computed,
        points_per_s: if wall_s > 0.0 { computed as f64 / wall_s } else { 0.0 },
        version: job.version.to_owned(),
    };
    match result {
        Ok(Some(tally)) => {
            let notes = run.complete(job, &tally, Some(session.clone()))?;
            let ended = Ended::Finished(Box::new(tally));
            Ok(RunReport { ended, session: Some(session), notes })
        }
        Ok(None) => {
            let mut notes = run.take_notes();
            // Only the sidecar's account of the work would miss this; the work itself is kept.
            notes.extend(run.record(&session).err().map(|error| error.to_string()));
            let (points, kept) = run.own_points();
            let ended = match (interrupt.signal(), run.shard()) {
                (None, Some(shard)) => Ended::Shard(shard, run.statuses(job)?),
                (signal, _) => {
                    Ended::Interrupted { signal: signal.unwrap_or_default(), kept, points }
                }
            };
            Ok(RunReport { ended, session: Some(session), notes })
        }
        Err(error) => {
            // The error counts; whether its session can be recorded on the same disk does not.
            let _ = run.record(&session);
            Err(error)
        }
    }
}

/// What works on a run, and for whom.
struct Work<'a> {
    engine: &'a dyn Engine,
    job: &'a Job<'a>,
    threads: usize,
    progress: &'a Progress,
    interrupt: &'a Interrupt,
}

impl Work<'_> {
    /// Computes what is missing and joins the whole; `None` for a shard, or when a signal stopped
    /// it.
    fn compute_and_join(&self, run: &mut OpenRun) -> Result<Option<Tally>, StoreError> {
        let stopped = || self.interrupt.stopped();
        let mut attempts_left = 2;
        loop {
            self.compute(run)?;
            if stopped() || run.shard().is_some() {
                return Ok(None);
            }
            self.progress.joining();
            match run.join(self.job, &stopped) {
                // A chunk that was whole a moment ago is not any more: compute it again, but not
                // for ever.
                Err(StoreError::Incomplete { .. }) if attempts_left > 0 => attempts_left -= 1,
                result => return result,
            }
        }
    }

    /// Computes and keeps every missing chunk of this process's part, or as many as a signal or an
    /// error lets.
    fn compute(&self, run: &OpenRun) -> Result<(), StoreError> {
        let pool = threads::pool(self.threads)?;
        let known = |point| run.known(point);
        let watch = Watch::knowing(self.interrupt, &known);
        let (_, start) = run.own_points();
        // Bounded, so that a disk slower than the engine holds the engine up instead of filling
        // memory.
        let (sender, receiver) = sync_channel(self.threads);
        let hand = Hand::new(self, run, &watch, sender);
        let filled = Mutex::new(Ok(()));
        let kept = pool.in_place_scope(|scope| {
            scope.spawn(|_| *lock(&filled) = hand.fill());
            let mut kept = Ok(());
            loop {
                match receiver.recv_timeout(Duration::from_millis(100)) {
                    Ok((chunk, outcomes)) => {
                        if let Err(error) = run.write_chunk(chunk, outcomes) {
                            // A chunk that makes no sense costs itself; a disk that fails would
                            // cost them all.
                            if !matches!(error, StoreError::Engine { .. }) {
                                watch.abort();
                            }
                            kept = kept.and(Err(error));
                        }
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return kept,
                }
                self.progress.show(start + watch.points_done());
            }
        });
        kept.and(unlocked(filled))
    }
}

/// Chunks in hand: points go out one by one, outcomes come back in any order, whole chunks go on.
struct Hand<'a> {
    work: &'a Work<'a>,
    run: &'a OpenRun,
    watch: &'a Watch<'a>,
    /// Points of missing chunks that have not gone out.
    left: Mutex<Box<dyn Iterator<Item = u64> + Send + 'a>>,
    /// Outcomes of chunks that are not whole, those of an interrupted process among them.
    parts: Parts,
    whole: SyncSender<(u64, Vec<Done>)>,
}

impl<'a> Hand<'a> {
    fn new(
        work: &'a Work<'a>,
        run: &'a OpenRun,
        watch: &'a Watch<'a>,
        whole: SyncSender<(u64, Vec<Done>)>,
    ) -> Self {
        let parts = run.take_parts();
        let there: BTreeSet<u64> = parts.values().flatten().map(|outcome| outcome.point).collect();
        let chunks = run.chunks();
        let stride = if work.engine.is_helped_by_neighbours() { 1 } else { stride(chunks) };
        let order = (0..chunks)
            .map(move |k| (u128::from(k) * u128::from(stride) % u128::from(chunks)) as u64);
        let missing = order.filter(|&chunk| run.is_missing(chunk));
        let left = missing.flat_map(|chunk| run.chunk_range(chunk));
        let left = left.filter(move |point| !there.contains(point));
        let (left, parts) = (Mutex::new(Box::new(left) as Box<_>), Parts(Mutex::new(parts)));
        Self { work, run, watch, left, parts, whole }
    }

    /// Has the engine evaluate everything that is missing, and keeps what there is of chunks that
    /// did not become whole.
    fn fill(self) -> Result<(), StoreError> {
        let evaluated = self.evaluate();
        // A part that makes no sense costs itself.
        let parts = std::mem::take(&mut *lock(&self.parts.0));
        let kept = parts.into_iter().map(|(chunk, part)| self.run.write_chunk(chunk, part));
        kept.fold(evaluated, Result::and)
    }

    fn evaluate(&self) -> Result<(), StoreError> {
        let Work { engine, job, .. } = self.work;
        let next = || {
            let point = if self.watch.stopped() { None } else { lock(&self.left).next() }?;
            Some((point, (job.axis_values)(point)))
        };
        let keep = |outcome| self.keep(outcome);
        let evaluate = || engine.evaluate(&next, &keep, self.watch);
        let reason = match catch_unwind(AssertUnwindSafe(evaluate)) {
            Err(panic) => format!("the engine panicked: {}", panics::text(panic.as_ref())),
            Ok(()) if self.watch.stopped() => return Ok(()),
            Ok(()) => "the engine put its work down unasked".to_owned(),
        };
        let parts = lock(&self.parts.0);
        let unfinished = parts.keys().next().map(|&chunk| self.run.chunk_range(chunk));
        let untouched = lock(&self.left).next().map(|point| point..point + 1);
        match unfinished.or(untouched) {
            None => Ok(()),
            Some(Range { start: first, end }) => {
                Err(StoreError::Engine { first, last: end.saturating_sub(1), reason })
            }
        }
    }

    fn keep(&self, outcome: Done) {
        self.watch.done(1);
        let chunk = self.run.chunk_of(outcome.point);
        let points = self.run.chunk_range(chunk);
        if let Some(outcomes) = self.parts.add(chunk, points.end - points.start, outcome) {
            // The receiver outlives the engine's work.
            let _ = self.whole.send((chunk, outcomes));
        }
    }
}

/// Of so many chunks, the step from each to the next that takes all of them, those that follow one
/// another far apart. Points that take long lie side by side in a grid: so some come early, and
/// threads have others to work on meanwhile; and what is done is a sample of what is left.
fn stride(chunks: u64) -> u64 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let is_coprime = |stride: &u64| {
        let (mut a, mut b) = (*stride, chunks);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    ((GOLDEN * chunks as f64) as u64..=chunks).find(is_coprime).unwrap_or(1)
}

#[cfg(test)]
mod tests;
