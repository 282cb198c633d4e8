//! An evaluator for searches. It responds to requests from a cache, and has an engine evaluate the
//! points of the others.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};

use rayon::ThreadPool;

use crate::engine::IncompleteGroups;
use crate::store::{PointRows, TrialKey, Trials, WRITE_INTERVAL};
use crate::{Engine, Interrupt, RunContext, StoreError, ThreadsError, threads};
use sweep_files::panics::{into_content, lock};

/// A reason why a search stopped before its end. The responses up to then are in the cache.
#[derive(Debug)]
pub enum SearchStop {
    /// The interrupt stopped the search.
    Interrupted,
    /// A response could not be stored.
    Failed(StoreError),
}

impl SearchStop {
    /// Returns the result of a search, `None` where the interrupt stopped it.
    ///
    /// # Errors
    /// A response that could not be stored.
    pub fn interrupted_to_none<T>(result: Result<T, Self>) -> Result<Option<T>, StoreError> {
        match result {
            Ok(result) => Ok(Some(result)),
            Err(Self::Interrupted) => Ok(None),
            Err(Self::Failed(error)) => Err(error),
        }
    }
}

/// The numbers of the response to a request; a number is `None` if it is null.
pub type RequestValues = Vec<Option<f64>>;

/// An engine with a cache of responses.
pub struct CachedEvaluator<'a> {
    engine: Engine<'a>,
    pool: ThreadPool,
    interrupt: &'a Interrupt,
    /// The cache, in memory and on disk; `None` where nothing is stored.
    cache: Mutex<Option<Trials>>,
    responses: AtomicU64,
    show_responses: &'a (dyn Fn(u64) + Sync),
}

impl<'a> CachedEvaluator<'a> {
    /// Creates an evaluator with a number of threads. `show_responses` receives the number of
    /// responses so far after each.
    ///
    /// # Errors
    /// [`ThreadsError::Start`].
    pub fn new(
        engine: Engine<'a>,
        threads: usize,
        interrupt: &'a Interrupt,
        cache: Option<Trials>,
        show_responses: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, ThreadsError> {
        Ok(Self {
            engine,
            pool: threads::build_pool(threads)?,
            interrupt,
            cache: Mutex::new(cache),
            responses: AtomicU64::new(0),
            show_responses,
        })
    }

    /// Returns the cache.
    pub fn into_cache(self) -> Option<Trials> {
        into_content(self.cache)
    }

    /// Evaluates requests, each identified by its key and covering `rows` points.
    ///
    /// `axis_values` returns the values of the axes at a point of a request. `respond` reduces the
    /// results of a request's points, in order, to the response.
    ///
    /// # Errors
    /// Any [`SearchStop`].
    pub fn evaluate(
        &self,
        keys: &[TrialKey],
        rows: u64,
        axis_values: &(dyn Fn(usize, u64) -> Vec<f64> + Sync),
        respond: &(dyn Fn(usize, Vec<PointRows>) -> Result<RequestValues, StoreError> + Sync),
    ) -> Result<Vec<RequestValues>, SearchStop> {
        let cached_responses: Vec<Option<RequestValues>> =
            keys.iter().map(|key| self.look_up(key)).collect();
        let missing_requests: Vec<usize> =
            (0..keys.len()).filter(|&k| cached_responses[k].is_none()).collect();
        self.count_responses((keys.len() - missing_requests.len()) as u64);
        // The points of all requests are one queue, so that they fill lanes together.
        let queue =
            Mutex::new(missing_requests.iter().flat_map(|&k| (0..rows).map(move |row| (k, row))));
        let context = RunContext::new(self.interrupt);
        let source = || {
            let (k, row) = if context.must_stop() { None } else { lock(&queue).next() }?;
            Some((k as u64 * rows + row, axis_values(k, row)))
        };
        let mut responses = cached_responses;
        let mut failure = None;
        let groups = IncompleteGroups::default();
        let (sender, receiver) = channel();
        let evaluator = &self.engine.evaluator;
        // The calling thread writes while the pool evaluates.
        self.pool.in_place_scope(|scope| {
            if missing_requests.is_empty() {
                drop(sender);
            } else {
                scope.spawn(|_| {
                    let sender = sender;
                    let sink = |result: PointRows| {
                        let request = result.point / rows;
                        let Some(results) = groups.add(request, rows, result) else { return };
                        let k = request as usize;
                        // The receiver outlives the engine's work.
                        let _ = sender.send((k, respond(k, results)));
                    };
                    evaluator.evaluate(&source, &sink, &context);
                });
            }
            loop {
                let stored = match receiver.recv_timeout(WRITE_INTERVAL) {
                    Ok((k, response)) => {
                        self.count_responses(1);
                        response.and_then(|response| {
                            self.store(&keys[k], &response)?;
                            responses[k] = Some(response);
                            Ok(())
                        })
                    }
                    Err(RecvTimeoutError::Timeout) => self.write(Trials::is_due),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if let Err(error) = stored {
                    failure.get_or_insert(error);
                    context.abort();
                }
            }
        });
        let write_result = self.write(|_| true);
        if let Some(error) = failure.or(write_result.err()) {
            return Err(SearchStop::Failed(error));
        }
        responses.into_iter().collect::<Option<_>>().ok_or(SearchStop::Interrupted)
    }

    fn look_up(&self, key: &TrialKey) -> Option<RequestValues> {
        let cache = lock(&self.cache);
        let cells = cache.as_ref()?.find_response(key)?;
        Some(cells.iter().map(|cell| cell.map(f64::from_bits)).collect())
    }

    /// Adds a response to the cache, and writes the cache if that is due.
    fn store(&self, key: &TrialKey, response: &RequestValues) -> Result<(), StoreError> {
        if let Some(cache) = lock(&self.cache).as_mut() {
            let cells = response.iter().map(|number| number.map(f64::to_bits)).collect();
            cache.add(key.clone(), cells)?;
        }
        self.write(Trials::is_due)
    }

    /// Writes the cache if a condition holds.
    fn write(&self, when: impl FnOnce(&Trials) -> bool) -> Result<(), StoreError> {
        match lock(&self.cache).as_mut() {
            Some(cache) if when(cache) => cache.write(),
            _ => Ok(()),
        }
    }

    fn count_responses(&self, count: u64) {
        let earlier_count = self.responses.fetch_add(count, Ordering::Relaxed);
        (self.show_responses)(earlier_count + count);
    }
}
