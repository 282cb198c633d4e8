//! Candidates through a model's engine, with a memory.

use std::collections::BTreeMap;
use std::sync::Mutex;

use arrow_schema::ArrowError;
use rayon::ThreadPool;

use super::{Candidate, Evolution, Study, evolve};
use crate::boundary::search::Stopped;
use crate::store::{Done, Key, Layout, ResultRows, Row, Trials};
use crate::{Effort, Engine, Error, Progress, StoreError, Swept, Watch, threads};
use sweep_files::panics::{lock, unlocked};
use sweep_results::Goal;

/// Everything that a study tries, with a memory of trials if there is one, which it gives back.
///
/// # Errors
/// No engine, no threads.
pub fn search<M: Swept>(
    study: &Study<M>,
    trials: Option<Trials>,
    effort: Effort<'_>,
) -> Result<(Result<Vec<Candidate>, Stopped>, Option<Trials>), Error> {
    let pool = threads::pool(effort.threads()?)?;
    let there = trials.as_ref().map_or(0, |trials| trials.count() / study.answers()) as u64;
    let mut asked = Asked {
        study,
        engine: M::engine(&study.plan)?,
        layout: M::layout(&study.plan),
        pool,
        effort,
        progress: Mutex::new(Progress::new(effort.progress, study.candidates, there)),
        count: 0,
        trials: Mutex::new(trials),
    };
    let evolution = Evolution {
        parameters: study.parameters.len(),
        objectives: study.objectives.len(),
        population: study.population,
        candidates: study.candidates,
        seed: study.seed,
    };
    let found = evolve(&evolution, &mut |places| asked.ask(places));
    lock(&asked.progress).finish();
    let trials = unlocked(asked.trials);
    Ok((found, trials))
}

/// What candidates are asked of.
struct Asked<'a, M: Swept> {
    study: &'a Study<M>,
    engine: Box<dyn Engine + 'a>,
    layout: Layout,
    pool: ThreadPool,
    effort: Effort<'a>,
    progress: Mutex<Progress>,
    /// Candidates answered.
    count: u64,
    trials: Mutex<Option<Trials>>,
}

/// Objectives as they are minimised, then excesses; none if one is missing.
type Answers = Option<Vec<f64>>;

impl<M: Swept> Asked<'_, M> {
    fn ask(&mut self, places: &[Vec<f64>]) -> Result<Vec<Answers>, Stopped> {
        let first = self.count;
        let values: Vec<Vec<f64>> = places.iter().map(|place| self.study.values(place)).collect();
        let known = (0..).zip(&values).map(|(k, values)| self.recall(first + k, values));
        let known: Vec<Option<Answers>> = known.collect();
        let (rows, unknown): (u64, Vec<usize>) =
            (self.study.rows(), (0..places.len()).filter(|&k| known[k].is_none()).collect());
        // Rows of all candidates, one after the other: they share lanes.
        let queue = Mutex::new(unknown.iter().flat_map(|&k| (0..rows).map(move |row| (k, row))));
        let watch = Watch::new(self.effort.interrupt);
        let next = || {
            let (k, row) = if watch.stopped() { None } else { lock(&queue).next() }?;
            Some((k as u64 * rows + row, self.study.axis_values(&values[k], row)))
        };
        let answers = Mutex::new(known);
        let (parts, failure) = (Mutex::new(BTreeMap::<usize, Vec<Done>>::new()), Mutex::new(None));
        let keep = |done: Done| {
            let k = (done.point / rows) as usize;
            let whole = {
                let mut parts = lock(&parts);
                let part = parts.entry(k).or_default();
                part.push(done);
                if (part.len() as u64) < rows { None } else { parts.remove(&k) }
            };
            let Some(whole) = whole else { return };
            let kept = self.answers(&values[k], whole);
            let kept = kept.and_then(|found| {
                self.keep(first + k as u64, &values[k], &found)?;
                Ok(found)
            });
            match kept {
                Ok(found) => lock(&answers)[k] = Some(found),
                Err(error) => {
                    lock(&failure).get_or_insert(error);
                    watch.abort();
                }
            }
            watch.done(1);
            // A thread that finds another showing it goes on.
            if let Ok(mut progress) = self.progress.try_lock() {
                progress.show(first + (places.len() - unknown.len()) as u64 + watch.points_done());
            }
        };
        if !unknown.is_empty() {
            self.pool.install(|| self.engine.evaluate(&next, &keep, &watch));
        }
        let settled = lock(&self.trials).as_ref().map_or(Ok(()), Trials::settle);
        let failure = unlocked(failure);
        if let Some(error) = failure.or(settled.err()) {
            return Err(Stopped::Failed(error));
        }
        let answers = unlocked(answers);
        self.count += places.len() as u64;
        answers.into_iter().collect::<Option<_>>().ok_or(Stopped::Interrupted)
    }

    /// The answers of a candidate by its rows.
    fn answers(&self, values: &[f64], mut whole: Vec<Done>) -> Result<Answers, StoreError> {
        whole.sort_by_key(|done| done.point);
        let defect =
            |error: ArrowError| StoreError::Engine { first: 0, last: 0, reason: error.to_string() };
        let mut rows = ResultRows::new(&self.layout);
        let of = |done: Done| {
            let row = done.point % self.study.rows();
            done.rows.into_iter().map(move |cells: Row| (row, cells))
        };
        for (row, cells) in whole.into_iter().flat_map(of) {
            rows.push(row, self.study.axis_values(values, row), cells);
        }
        let batch = rows.take().map_err(defect)?;
        let number = |goal: &Goal, sign: f64| Ok(goal.over(&batch)?.map(|number| sign * number));
        let objectives = self.study.objectives.iter().map(|one| number(&one.goal, one.sign));
        let excesses = self.study.conditions.iter().map(|goal| number(goal, 1.0));
        let numbers = objectives.chain(excesses).collect::<Result<Vec<_>, ArrowError>>();
        // An infinite number is as good as none.
        let finite = |number: Option<f64>| number.filter(|number| number.is_finite());
        Ok(numbers.map_err(defect)?.into_iter().map(finite).collect())
    }

    fn recall(&self, number: u64, values: &[f64]) -> Option<Answers> {
        let trials = lock(&self.trials);
        let recalled =
            (0..self.study.answers()).map(|k| trials.as_ref()?.recall(&key(number, k, values)));
        // Without one number there are none.
        Some(recalled.collect::<Option<Vec<Option<f64>>>>()?.into_iter().collect())
    }

    fn keep(&self, number: u64, values: &[f64], found: &Answers) -> Result<(), StoreError> {
        let mut trials = lock(&self.trials);
        let Some(trials) = trials.as_mut() else { return Ok(()) };
        let of = |k: usize| found.as_ref().map(|found| found[k]);
        (0..self.study.answers()).try_for_each(|k| trials.keep(key(number, k, values), of(k)))
    }
}

/// The key under which an answer is stored: the candidate's number, the answer's, the candidate.
fn key(number: u64, answer: usize, values: &[f64]) -> Key {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let hash = blake3::hash(&bytes);
    let word = hash.as_bytes().first_chunk().copied().unwrap_or_default();
    [number, answer as u64, u64::from_le_bytes(word)]
}
