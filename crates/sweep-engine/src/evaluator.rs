//! An evaluator for searches: it answers requests from a cache, and has an engine evaluate the
//! rest.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::ThreadPool;

use crate::store::{Done, Key, Trials};
use crate::watch::IncompleteGroups;
use crate::{Engine, Interrupt, RunContext, StoreError, ThreadsError, threads};
use sweep_files::panics::{lock, unlocked};

/// A reason why a search stopped before its end. The responses up to then are in the cache.
#[derive(Debug)]
pub enum Stopped {
    /// The interrupt stopped the search.
    Interrupted,
    /// A response could not be stored.
    Failed(StoreError),
}

impl Stopped {
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

/// The response to a request: a number for each of its keys, `None` where it is null.
pub type RequestValues = Vec<Option<f64>>;

/// An engine with a cache of responses.
pub struct CachedEvaluator<'a> {
    engine: Box<dyn Engine + 'a>,
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
        engine: Box<dyn Engine + 'a>,
        threads: usize,
        interrupt: &'a Interrupt,
        cache: Option<Trials>,
        show_responses: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, ThreadsError> {
        Ok(Self {
            engine,
            pool: threads::pool(threads)?,
            interrupt,
            cache: Mutex::new(cache),
            responses: AtomicU64::new(0),
            show_responses,
        })
    }

    /// Returns the cache.
    pub fn into_cache(self) -> Option<Trials> {
        unlocked(self.cache)
    }

    /// Evaluates requests, each identified by its keys and covering `rows` points.
    ///
    /// `axis_values` returns the values of the axes at a point of a request. `respond` reduces the
    /// results of a request's points, in order, to its response.
    ///
    /// # Errors
    /// Any [`Stopped`].
    pub fn evaluate(
        &self,
        keys: &[Vec<Key>],
        rows: u64,
        axis_values: &(dyn Fn(usize, u64) -> Vec<f64> + Sync),
        respond: &(dyn Fn(usize, Vec<Done>) -> Result<RequestValues, StoreError> + Sync),
    ) -> Result<Vec<RequestValues>, Stopped> {
        let cached: Vec<Option<RequestValues>> =
            keys.iter().map(|keys| self.look_up(keys)).collect();
        let missing: Vec<usize> = (0..keys.len()).filter(|&k| cached[k].is_none()).collect();
        self.count_responses((keys.len() - missing.len()) as u64);
        // The points of all requests are one queue, so that they fill lanes together.
        let queue = Mutex::new(missing.iter().flat_map(|&k| (0..rows).map(move |row| (k, row))));
        let context = RunContext::new(self.interrupt);
        let source = || {
            let (k, row) = if context.stopped() { None } else { lock(&queue).next() }?;
            Some((k as u64 * rows + row, axis_values(k, row)))
        };
        let responses = Mutex::new(cached);
        let failure = Mutex::new(None);
        let groups = IncompleteGroups::default();
        let sink = |result: Done| {
            let request = result.point / rows;
            let Some(results) = groups.add(request, rows, result) else { return };
            let k = request as usize;
            let stored = respond(k, results).and_then(|response| {
                self.store(&keys[k], &response)?;
                Ok(response)
            });
            match stored {
                Ok(response) => lock(&responses)[k] = Some(response),
                Err(error) => {
                    lock(&failure).get_or_insert(error);
                    context.abort();
                }
            }
            self.count_responses(1);
        };
        if !missing.is_empty() {
            self.pool.install(|| self.engine.evaluate(&source, &sink, &context));
        }
        let flushed = lock(&self.cache).as_ref().map_or(Ok(()), Trials::settle);
        if let Some(error) = unlocked(failure).or(flushed.err()) {
            return Err(Stopped::Failed(error));
        }
        unlocked(responses).into_iter().collect::<Option<_>>().ok_or(Stopped::Interrupted)
    }

    fn look_up(&self, keys: &[Key]) -> Option<RequestValues> {
        let cache = lock(&self.cache);
        keys.iter().map(|key| cache.as_ref()?.recall(key)).collect()
    }

    fn store(&self, keys: &[Key], response: &RequestValues) -> Result<(), StoreError> {
        let mut cache = lock(&self.cache);
        let Some(cache) = cache.as_mut() else { return Ok(()) };
        for (&key, &number) in keys.iter().zip(response) {
            cache.keep(key, number)?;
        }
        Ok(())
    }

    fn count_responses(&self, count: u64) {
        let before = self.responses.fetch_add(count, Ordering::Relaxed);
        (self.show_responses)(before + count);
    }
}
