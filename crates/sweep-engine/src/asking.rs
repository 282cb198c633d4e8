//! What a search asks of an engine, round by round, with a memory of the answers.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::ThreadPool;

use crate::store::{Done, Key, Trials};
use crate::watch::Parts;
use crate::{Engine, Interrupt, StoreError, ThreadsError, Watch, threads};
use sweep_files::panics::{lock, unlocked};

/// Why a search stopped. The answers that it was given are kept.
#[derive(Debug)]
pub enum Stopped {
    /// The interrupt stopped it.
    Interrupted,
    /// An answer could not be kept.
    Failed(StoreError),
}

impl Stopped {
    /// What a search has found; `None` where the interrupt stopped it.
    ///
    /// # Errors
    /// An answer could not be kept.
    pub fn found<T>(found: Result<T, Self>) -> Result<Option<T>, StoreError> {
        match found {
            Ok(found) => Ok(Some(found)),
            Err(Self::Interrupted) => Ok(None),
            Err(Self::Failed(error)) => Err(error),
        }
    }
}

/// The answer to a question: a number for each of its keys, `None` where it is null.
pub type Answer = Vec<Option<f64>>;

/// An engine that answers questions, each about some points.
pub struct Asking<'a> {
    engine: Box<dyn Engine + 'a>,
    pool: ThreadPool,
    interrupt: &'a Interrupt,
    /// What is known from before, and where answers are kept as they come.
    trials: Mutex<Option<Trials>>,
    answered: AtomicU64,
    tell: &'a (dyn Fn(u64) + Sync),
}

impl<'a> Asking<'a> {
    /// Asks on so many threads; `tell` hears how many questions are answered.
    ///
    /// # Errors
    /// [`ThreadsError::Start`].
    pub fn new(
        engine: Box<dyn Engine + 'a>,
        threads: usize,
        interrupt: &'a Interrupt,
        trials: Option<Trials>,
        tell: &'a (dyn Fn(u64) + Sync),
    ) -> Result<Self, ThreadsError> {
        let (pool, trials) = (threads::pool(threads)?, Mutex::new(trials));
        Ok(Self { engine, pool, interrupt, trials, answered: AtomicU64::new(0), tell })
    }

    /// The memory, at the end.
    pub fn into_trials(self) -> Option<Trials> {
        unlocked(self.trials)
    }

    /// The answers to some questions, each known by its keys and about `rows` points. `values` are
    /// those of the axes at a point of a question; `answer` makes the answer of the points, in
    /// order.
    ///
    /// # Errors
    /// Any [`Stopped`].
    pub fn ask(
        &self,
        keys: &[Vec<Key>],
        rows: u64,
        values: &(dyn Fn(usize, u64) -> Vec<f64> + Sync),
        answer: &(dyn Fn(usize, Vec<Done>) -> Result<Answer, StoreError> + Sync),
    ) -> Result<Vec<Answer>, Stopped> {
        let known: Vec<Option<Answer>> = keys.iter().map(|keys| self.recall(keys)).collect();
        let unknown: Vec<usize> = (0..keys.len()).filter(|&k| known[k].is_none()).collect();
        self.count((keys.len() - unknown.len()) as u64);
        // Points of all questions, one after the other: they share lanes.
        let queue = Mutex::new(unknown.iter().flat_map(|&k| (0..rows).map(move |row| (k, row))));
        let watch = Watch::new(self.interrupt);
        let next = || {
            let (k, row) = if watch.stopped() { None } else { lock(&queue).next() }?;
            Some((k as u64 * rows + row, values(k, row)))
        };
        let (answers, failure) = (Mutex::new(known), Mutex::new(None));
        let parts = Parts::default();
        let keep = |done: Done| {
            let question = done.point / rows;
            let Some(whole) = parts.add(question, rows, done) else { return };
            let k = question as usize;
            let kept = answer(k, whole).and_then(|found| {
                self.keep(&keys[k], &found)?;
                Ok(found)
            });
            match kept {
                Ok(found) => lock(&answers)[k] = Some(found),
                Err(error) => {
                    lock(&failure).get_or_insert(error);
                    watch.abort();
                }
            }
            self.count(1);
        };
        if !unknown.is_empty() {
            self.pool.install(|| self.engine.evaluate(&next, &keep, &watch));
        }
        let settled = lock(&self.trials).as_ref().map_or(Ok(()), Trials::settle);
        if let Some(error) = unlocked(failure).or(settled.err()) {
            return Err(Stopped::Failed(error));
        }
        unlocked(answers).into_iter().collect::<Option<_>>().ok_or(Stopped::Interrupted)
    }

    fn recall(&self, keys: &[Key]) -> Option<Answer> {
        let trials = lock(&self.trials);
        keys.iter().map(|key| trials.as_ref()?.recall(key)).collect()
    }

    fn keep(&self, keys: &[Key], answer: &Answer) -> Result<(), StoreError> {
        let mut trials = lock(&self.trials);
        let Some(trials) = trials.as_mut() else { return Ok(()) };
        keys.iter().zip(answer).try_for_each(|(&key, &number)| trials.keep(key, number))
    }

    fn count(&self, answered: u64) {
        (self.tell)(self.answered.fetch_add(answered, Ordering::Relaxed) + answered);
    }
}
