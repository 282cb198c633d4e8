//! An evaluator for searches. It takes the values of requests from a cache, and has an engine
//! evaluate the points of the others.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};

use rayon::ThreadPool;

use crate::engine::IncompleteGroups;
use crate::store::{PointRows, TrialKey, Trials, WRITE_INTERVAL};
use crate::{Engine, Interrupt, RunContext, StoreError, ThreadsError, threads};
use sweep_files::panics::{into_content, lock};

/// A reason why a search stopped before its end. The values of the requests up to then are in the
/// cache.
#[derive(Debug)]
pub enum SearchStop {
    /// The interrupt stopped the search.
    Interrupted,
    /// The values of a request could not be stored.
    Failed(StoreError),
}

impl SearchStop {
    /// Returns the result of a search, `None` where the interrupt stopped it.
    ///
    /// # Errors
    /// Values that could not be stored.
    pub fn interrupted_to_none<T>(result: Result<T, Self>) -> Result<Option<T>, StoreError> {
        match result {
            Ok(result) => Ok(Some(result)),
            Err(Self::Interrupted) => Ok(None),
            Err(Self::Failed(error)) => Err(error),
        }
    }
}

/// The numbers to which the rows of a request are reduced; a number is `None` if it is null.
pub type RequestValues = Vec<Option<f64>>;

/// An engine with a cache of the values of requests.
pub struct CachedEvaluator<'a> {
    engine: Engine<'a>,
    pool: ThreadPool,
    interrupt: &'a Interrupt,
    /// The cache, in memory and on disk; `None` where nothing is stored.
    cache: Mutex<Option<Trials>>,
    evaluated_requests: AtomicU64,
    report_request_count: &'a (dyn Fn(u64) + Sync),
}

impl<'a> CachedEvaluator<'a> {
    /// Creates an evaluator with a number of threads. `report_request_count` receives the number of
    /// evaluated requests after each.
    ///
    /// # Errors
    /// [`ThreadsError::Start`].
    pub fn new(
        engine: Engine<'a>,
        threads: usize,
        interrupt: &'a Interrupt,
        cache: Option<Trials>,
        report_request_count: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, ThreadsError> {
        Ok(Self {
            engine,
            pool: threads::build_pool(threads)?,
            interrupt,
            cache: Mutex::new(cache),
            evaluated_requests: AtomicU64::new(0),
            report_request_count,
        })
    }

    /// Returns the cache.
    pub fn into_cache(self) -> Option<Trials> {
        into_content(self.cache)
    }

    /// Evaluates requests, each identified by its key and covering `points_per_request`
    /// points.
    ///
    /// `axis_values` returns the values of the axes at a point of a request. `reduce` reduces the
    /// rows of a request's points, in order, to the values of the request.
    ///
    /// # Errors
    /// Any [`SearchStop`].
    pub fn evaluate(
        &self,
        request_keys: &[TrialKey],
        points_per_request: u64,
        axis_values: &(dyn Fn(usize, u64) -> Vec<f64> + Sync),
        reduce: &(dyn Fn(usize, Vec<PointRows>) -> Result<RequestValues, StoreError> + Sync),
    ) -> Result<Vec<RequestValues>, SearchStop> {
        let cached_values: Vec<Option<RequestValues>> =
            request_keys.iter().map(|key| self.look_up_values(key)).collect();
        let missing_requests: Vec<usize> =
            (0..request_keys.len()).filter(|&k| cached_values[k].is_none()).collect();
        self.count_requests((request_keys.len() - missing_requests.len()) as u64);
        // The points of all requests are one queue, so that they fill lanes together.
        let point_queue = Mutex::new(
            missing_requests.iter().flat_map(|&k| (0..points_per_request).map(move |row| (k, row))),
        );
        let context = RunContext::new(self.interrupt);
        let point_source = || {
            let (k, row) = if context.must_stop() { None } else { lock(&point_queue).next() }?;
            Some((k as u64 * points_per_request + row, axis_values(k, row)))
        };
        let mut values_by_request = cached_values;
        let mut first_failure = None;
        let incomplete_requests = IncompleteGroups::default();
        let (sender, receiver) = channel();
        let evaluator = &self.engine.evaluator;
        // The calling thread writes while the pool evaluates.
        self.pool.in_place_scope(|scope| {
            if missing_requests.is_empty() {
                drop(sender);
            } else {
                scope.spawn(|_| {
                    let sender = sender;
                    let row_sink = |result: PointRows| {
                        let request_index = result.point / points_per_request;
                        let Some(results) = incomplete_requests.add_result(
                            request_index,
                            points_per_request,
                            result,
                        ) else {
                            return;
                        };
                        let k = request_index as usize;
                        // The receiver outlives the engine's work.
                        let _ = sender.send((k, reduce(k, results)));
                    };
                    evaluator.evaluate(&point_source, &row_sink, &context);
                });
            }
            loop {
                let store_result = match receiver.recv_timeout(WRITE_INTERVAL) {
                    Ok((k, values)) => {
                        self.count_requests(1);
                        values.and_then(|values| {
                            self.store_values(&request_keys[k], &values)?;
                            values_by_request[k] = Some(values);
                            Ok(())
                        })
                    }
                    Err(RecvTimeoutError::Timeout) => self.write_cache_if(Trials::is_write_due),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if let Err(error) = store_result {
                    first_failure.get_or_insert(error);
                    context.abort();
                }
            }
        });
        let write_result = self.write_cache_if(|_| true);
        if let Some(error) = first_failure.or(write_result.err()) {
            return Err(SearchStop::Failed(error));
        }
        values_by_request.into_iter().collect::<Option<_>>().ok_or(SearchStop::Interrupted)
    }

    fn look_up_values(&self, key: &TrialKey) -> Option<RequestValues> {
        let trial_cache = lock(&self.cache);
        let cells = trial_cache.as_ref()?.find_values(key)?;
        Some(cells.iter().map(|cell| cell.map(f64::from_bits)).collect())
    }

    /// Adds the values of a request to the cache, and writes the cache if that is due.
    fn store_values(&self, key: &TrialKey, values: &RequestValues) -> Result<(), StoreError> {
        if let Some(cache) = lock(&self.cache).as_mut() {
            let cells = values.iter().map(|number| number.map(f64::to_bits)).collect();
            cache.add_trial(key.clone(), cells)?;
        }
        self.write_cache_if(Trials::is_write_due)
    }

    /// Writes the cache if a condition holds.
    fn write_cache_if(&self, condition: impl FnOnce(&Trials) -> bool) -> Result<(), StoreError> {
        match lock(&self.cache).as_mut() {
            Some(cache) if condition(cache) => cache.write(),
            _ => Ok(()),
        }
    }

    fn count_requests(&self, count: u64) {
        let earlier_count = self.evaluated_requests.fetch_add(count, Ordering::Relaxed);
        (self.report_request_count)(earlier_count + count);
    }
}
