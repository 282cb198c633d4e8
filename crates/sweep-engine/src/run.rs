//! The runner of a job:
//!
//! 1. Open or create the run's folder, and find the missing chunks.
//! 2. Have the engine evaluate the rows of these chunks on all cores.
//! 3. Write each chunk when its rows are complete, and at the end the rows of chunks that a signal
//!    or an error left incomplete.
//! 4. Join the chunks into the result file.
//!
//! Memory: at most one chunk for each thread (4096 points, about 2 MB) and as many chunks that wait
//! for the disk, then about 40 MB for the join. Only the set of missing chunks grows with the
//! number of points.

use std::collections::BTreeSet;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use crate::engine::IncompleteGroups;
use crate::store::provenance::{self, Session};
use crate::store::read::NameCounts;
use crate::store::{
    OpenOptions, OpenOutcome, OpenRun, PointRows, ResultFile, Shard, ShardRequest, Tally,
    note_idle_shards,
};
use crate::threads::{self};
use crate::{Engine, Environment, Interrupt, Job, Progress, ProgressMode, RunContext, StoreError};
use sweep_files::panics::{self, into_content, lock};

/// The interval between updates of the progress. Basis: a bar that moves smoothly. Doubling it
/// makes the bar jerk.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(100);

/// The options of a run.
#[derive(Clone, Copy)]
pub struct RunOptions<'a> {
    /// The number of worker threads (`threads::choose_count`).
    pub threads: usize,
    /// Whether to discard the rows of an earlier run.
    pub starts_over: bool,
    /// The shard to compute; `None` for the whole run.
    pub shard: Option<ShardRequest>,
    /// The form in which progress is shown.
    pub progress: ProgressMode,
    /// The function that looks up the scheduler's variables.
    pub environment: Environment<'a>,
    /// The function that shows messages to the user before the work starts.
    pub show_message: &'a dyn Fn(&str),
}

/// The outcome of a run without an error.
#[derive(Debug)]
pub enum RunEnd {
    /// The result existed already.
    AlreadyFinished(Box<ResultFile>, Box<Tally>),
    /// The run was completed.
    Finished(Box<Tally>),
    /// The shard was completed, with these numbers of rows by status. `sweep merge` joins all
    /// shards.
    Shard(Shard, NameCounts),
    /// A signal stopped the run. Its rows are stored.
    Interrupted {
        /// The signal.
        signal: u8,
        /// The number of stored points.
        stored_points: u64,
        /// The number of all points.
        points: u64,
    },
}

/// The outcome of a run.
#[derive(Debug)]
pub struct RunReport {
    /// The end of the run.
    pub end: RunEnd,
    /// The work of this process; `None` if the result existed already.
    pub session: Option<Session>,
    /// The notes for the user.
    pub notes: Vec<String>,
}

/// Runs a job for an output, and resumes an earlier run of it.
///
/// # Errors
/// Any [`StoreError`]. Complete chunks are stored before.
pub fn run(
    engine: &Engine<'_>,
    job: &Job<'_>,
    output: &Path,
    options: RunOptions<'_>,
    interrupt: &Interrupt,
) -> Result<RunReport, StoreError> {
    let RunOptions { threads, starts_over: fresh, shard, environment, .. } = options;
    let mut run =
        match OpenRun::open(output, job, OpenOptions { starts_over: fresh, shard, environment })? {
            OpenOutcome::Finished((file, tally)) => {
                let end = RunEnd::AlreadyFinished(Box::new(file), Box::new(tally));
                return Ok(RunReport { end, session: None, notes: Vec::new() });
            }
            OpenOutcome::Open(run) => run,
        };
    let (points, stored_points) = run.count_own_points();
    if let Some(shard) = run.shard() {
        (options.show_message)(&format!("shard {} of {}", shard.index, shard.count));
        note_idle_shards(job.points, shard.count)
            .iter()
            .for_each(|note| (options.show_message)(note));
    }
    for note in run.take_notes() {
        (options.show_message)(&note);
    }
    if stored_points > 0 {
        (options.show_message)(&format!("going on: {stored_points} of {points} points are there"));
    }
    let start_time = Instant::now();
    let started_unix_s = provenance::now_unix_s();
    let progress = Progress::new(options.progress, points, stored_points);
    let runner = Runner { engine, job, threads, progress: &progress, interrupt };
    let result = runner.compute_and_join(&mut run);
    progress.finish();
    let wall_s = start_time.elapsed().as_secs_f64();
    let computed_points = run.count_own_points().1.saturating_sub(stored_points);
    let session = Session {
        started_unix_s,
        wall_s,
        host: provenance::host_name(),
        pid: std::process::id(),
        cpus: threads::count_cores(),
        cpu_model: provenance::cpu_model(),
        simd: engine.simd.to_owned(),
        threads,
        shard: run.shard().map(|shard| format!("{}/{}", shard.index, shard.count)),
        points: computed_points,
        points_per_s: if wall_s > 0.0 { computed_points as f64 / wall_s } else { 0.0 },
        version: job.version.to_owned(),
    };
    match result {
        Ok(Some(tally)) => {
            let notes = run.complete(job, &tally, Some(session.clone()))?;
            let end = RunEnd::Finished(Box::new(tally));
            Ok(RunReport { end, session: Some(session), notes })
        }
        Ok(None) => {
            let mut notes = run.take_notes();
            // A failure to record the session affects only the sidecar's list of sessions, not the
            // rows.
            notes.extend(run.record_session(&session).err().map(|error| error.to_string()));
            let (points, stored_points) = run.count_own_points();
            let end = match (interrupt.signal(), run.shard()) {
                (None, Some(shard)) => RunEnd::Shard(shard, run.count_statuses()?),
                (signal, _) => RunEnd::Interrupted {
                    signal: signal.unwrap_or_default(),
                    stored_points,
                    points,
                },
            };
            Ok(RunReport { end, session: Some(session), notes })
        }
        Err(error) => {
            // The error of the run is reported, not an error of recording the session.
            let _ = run.record_session(&session);
            Err(error)
        }
    }
}

/// The values that stay the same during a run.
struct Runner<'a> {
    engine: &'a Engine<'a>,
    job: &'a Job<'a>,
    threads: usize,
    progress: &'a Progress,
    interrupt: &'a Interrupt,
}

impl Runner<'_> {
    /// Computes the missing chunks and joins all; `None` for a shard, or after a signal.
    fn compute_and_join(&self, run: &mut OpenRun) -> Result<Option<Tally>, StoreError> {
        let is_interrupted = || self.interrupt.is_raised();
        let mut remaining_attempts = 2;
        loop {
            self.compute_missing_chunks(run)?;
            if is_interrupted() || run.shard().is_some() {
                return Ok(None);
            }
            self.progress.show_joining();
            match run.join(self.job, &is_interrupted) {
                // A chunk became unreadable after it was counted. It is computed again, at most
                // twice.
                Err(StoreError::Incomplete { .. }) if remaining_attempts > 0 => {
                    remaining_attempts -= 1
                }
                result => return result,
            }
        }
    }

    /// Computes and writes the missing chunks of this process's shard, until a signal or an error.
    fn compute_missing_chunks(&self, run: &OpenRun) -> Result<(), StoreError> {
        let pool = threads::build_pool(self.threads)?;
        let stored_rows = |point| run.find_stored_rows(point);
        let run_context = RunContext::with_known_rows(self.interrupt, &stored_rows);
        let (_, stored_point_count) = run.count_own_points();
        // A bounded channel makes the engine wait for a slower disk instead of filling memory.
        let (sender, receiver) = sync_channel(self.threads);
        let collector = ChunkCollector::new(self, run, &run_context, sender);
        let collection_result = Mutex::new(Ok(()));
        let write_result = pool.in_place_scope(|scope| {
            scope.spawn(|_| *lock(&collection_result) = collector.run());
            let mut write_result = Ok(());
            loop {
                match receiver.recv_timeout(PROGRESS_INTERVAL) {
                    Ok((chunk, rows)) => {
                        if let Err(error) = run.write_chunk(self.job, chunk, rows) {
                            // Invalid rows lose one chunk; a failing disk would lose all further
                            // ones.
                            if !matches!(error, StoreError::Engine { .. }) {
                                run_context.abort();
                            }
                            write_result = write_result.and(Err(error));
                        }
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return write_result,
                }
                self.progress.show(stored_point_count + run_context.points_done());
            }
        });
        write_result.and(into_content(collection_result))
    }
}

/// A source of the points of missing chunks and a sink of their rows, which sends each chunk to the
/// writer when it is complete.
struct ChunkCollector<'a> {
    runner: &'a Runner<'a>,
    open_run: &'a OpenRun,
    context: &'a RunContext<'a>,
    /// The queue of points that have not been evaluated.
    point_queue: Mutex<Box<dyn Iterator<Item = u64> + Send + 'a>>,
    /// The rows of incomplete chunks, including those that an interrupted process has stored.
    incomplete_chunks: IncompleteGroups,
    writer: SyncSender<(u64, Vec<PointRows>)>,
}

impl<'a> ChunkCollector<'a> {
    fn new(
        runner: &'a Runner<'a>,
        run: &'a OpenRun,
        context: &'a RunContext<'a>,
        writer: SyncSender<(u64, Vec<PointRows>)>,
    ) -> Self {
        let incomplete_chunks = run.take_incomplete_chunks();
        let stored_points: BTreeSet<u64> =
            incomplete_chunks.values().flatten().map(|row| row.point).collect();
        let chunks = run.chunk_count();
        let stride = if runner.engine.shares_work_of_rows { 1 } else { chunk_stride(chunks) };
        let queue = (0..chunks)
            .map(move |k| (u128::from(k) * u128::from(stride) % u128::from(chunks)) as u64)
            .filter(|&chunk| run.is_missing(chunk))
            .flat_map(|chunk| run.chunk_range(chunk))
            .filter(move |point| !stored_points.contains(point));
        Self {
            runner,
            open_run: run,
            context,
            point_queue: Mutex::new(Box::new(queue)),
            incomplete_chunks: IncompleteGroups(Mutex::new(incomplete_chunks)),
            writer,
        }
    }

    /// Has the engine evaluate all missing rows, then writes the rows of incomplete chunks. Returns
    /// the first error.
    fn run(self) -> Result<(), StoreError> {
        let mut result = self.evaluate_missing_rows();
        let incomplete_chunks = std::mem::take(&mut *lock(&self.incomplete_chunks.0));
        for (chunk, rows) in incomplete_chunks {
            // After an error in one chunk, the others are written all the same.
            let write_result = self.open_run.write_chunk(self.runner.job, chunk, rows);
            result = result.and(write_result);
        }
        result
    }

    fn evaluate_missing_rows(&self) -> Result<(), StoreError> {
        let Runner { engine, job, .. } = self.runner;
        let point_source = || {
            let point =
                if self.context.must_stop() { None } else { lock(&self.point_queue).next() }?;
            Some((point, (job.axis_values)(point)))
        };
        let row_sink = |row| self.add_row(row);
        let run_engine = || engine.evaluator.evaluate(&point_source, &row_sink, self.context);
        let failure_reason = match catch_unwind(AssertUnwindSafe(run_engine)) {
            Err(panic) => format!("the engine panicked: {}", panics::panic_message(panic.as_ref())),
            Ok(()) if self.context.must_stop() => return Ok(()),
            Ok(()) => "the engine ended before it had evaluated all points".to_owned(),
        };
        let incomplete_chunks = lock(&self.incomplete_chunks.0);
        let unfinished_points =
            incomplete_chunks.keys().next().map(|&chunk| self.open_run.chunk_range(chunk));
        let unstarted_points = lock(&self.point_queue).next().map(|point| point..point + 1);
        match unfinished_points.or(unstarted_points) {
            None => Ok(()),
            Some(Range { start: first, end }) => Err(StoreError::Engine {
                first,
                last: end.saturating_sub(1),
                reason: failure_reason,
            }),
        }
    }

    /// Adds a row to its chunk, and sends the chunk to the writer if it is complete.
    fn add_row(&self, row: PointRows) {
        self.context.add_points(1);
        let chunk = self.open_run.chunk_of(row.point);
        let points = self.open_run.chunk_range(chunk);
        if let Some(rows) = self.incomplete_chunks.add_result(chunk, points.end - points.start, row)
        {
            // The receiver outlives the engine's work.
            let _ = self.writer.send((chunk, rows));
        }
    }
}

/// Returns a stride with which a loop over the chunks visits each chunk once, and consecutive
/// chunks are far apart.
///
/// Expensive rows are neighbours in a grid. In this order some of them start early, together with
/// cheap rows that keep the other threads busy, and the finished rows are a sample of the remaining
/// ones.
fn chunk_stride(chunks: u64) -> u64 {
    // Multiples of the golden ratio spread most evenly (Knuth, TAOCP 3, section 6.4).
    const GOLDEN_RATIO: f64 = 0.618_033_988_749_895;
    let is_coprime = |stride: &u64| greatest_common_divisor(*stride, chunks) == 1;
    ((GOLDEN_RATIO * chunks as f64) as u64..=chunks).find(is_coprime).unwrap_or(1)
}

/// Computes the greatest common divisor by Euclid's algorithm.
fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests;
