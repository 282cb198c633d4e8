//! Evaluation of candidates by a model's engine, with a cache.

use std::sync::Mutex;

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;

use super::{Candidate, Study, evolve};
use crate::evaluator::{CachedEvaluator, RequestValues, Stopped};
use crate::store::{Done, Key, Layout, ResultRows, Row, Trials};
use crate::{Effort, Error, Progress, StoreError, Swept};
use sweep_files::panics::{lock, unlocked};
use sweep_results::{Goal, Slack};

/// Evaluates all candidates of a study, with the cache of its stored trials if there is one, which
/// is returned. The candidates are `None` after an interrupt.
///
/// # Errors
/// A model without an engine, threads that cannot be started, and trials that cannot be stored.
pub fn search<M: Swept>(
    study: &Study<M>,
    trials: Option<Trials>,
    effort: Effort<'_>,
) -> Result<(Option<Vec<Candidate>>, Option<Trials>), Error> {
    let there = trials.as_ref().map_or(0, |trials| trials.count() / study.answers()) as u64;
    let progress = Progress::new(effort.progress, study.evolution.candidates, there);
    let shown = |candidates| progress.show(candidates);
    let threads = effort.threads()?;
    let engine = M::engine(&study.plan, None)?;
    let evaluator = CachedEvaluator::new(engine, threads, effort.interrupt, trials, &shown)?;
    let layout = M::layout(&study.plan);
    let mut count = 0;
    let found = evolve(&study.evolution, &mut |places| {
        let candidates: Vec<Vec<f64>> = places.iter().map(|place| study.values(place)).collect();
        let keys = (count..).zip(&candidates).map(|(number, values)| {
            (0..study.answers()).map(|answer| key(number, answer, values)).collect()
        });
        let keys: Vec<Vec<Key>> = keys.collect();
        count += places.len() as u64;
        let values = |k: usize, row| study.axis_values(&candidates[k], row);
        let answer = |k: usize, points| answer(study, &layout, &candidates[k], points);
        let found = evaluator.evaluate(&keys, study.rows(), &values, &answer)?;
        // A candidate without one of its numbers has none.
        Ok(found.into_iter().map(|numbers| numbers.into_iter().collect()).collect())
    });
    progress.finish();
    Ok((Stopped::interrupted_to_none(found)?, evaluator.into_cache()))
}

/// Computes the slack of each condition for the rows of a candidate; `None` after an interrupt.
///
/// # Errors
/// A model without an engine, and threads that cannot be started.
pub fn slacks<M: Swept>(
    study: &Study<M>,
    values: &[f64],
    effort: Effort<'_>,
) -> Result<Option<Vec<Option<Slack>>>, Error> {
    let threads = effort.threads()?;
    let engine = M::engine(&study.plan, None)?;
    let silent = |_: u64| {};
    let evaluator = CachedEvaluator::new(engine, threads, effort.interrupt, None, &silent)?;
    let layout = M::layout(&study.plan);
    let found = Mutex::new(Vec::new());
    let answer = |_: usize, points: Vec<Done>| -> Result<RequestValues, StoreError> {
        let batch = batch(study, &layout, values, points)?;
        let slacks = study.conditions.iter().map(|goal| goal.slack(&batch));
        *lock(&found) = slacks.collect::<Result<Vec<_>, ArrowError>>().map_err(defect)?;
        Ok(RequestValues::new())
    };
    let keys = [vec![key(0, 0, values)]];
    let evaluated =
        evaluator.evaluate(&keys, study.rows(), &|_, row| study.axis_values(values, row), &answer);
    Ok(Stopped::interrupted_to_none(evaluated)?.map(|_| unlocked(found)))
}

/// Returns the error of rows that do not fit their own columns, which is a defect of the program.
fn defect(error: ArrowError) -> StoreError {
    StoreError::Engine { first: 0, last: 0, reason: error.to_string() }
}

/// Returns the objectives of a candidate as they are minimised, then its constraint violations.
fn answer<M: Swept>(
    study: &Study<M>,
    layout: &Layout,
    values: &[f64],
    points: Vec<Done>,
) -> Result<RequestValues, StoreError> {
    let batch = batch(study, layout, values, points)?;
    let number = |goal: &Goal, sign: f64| Ok(goal.evaluate(&batch)?.map(|number| sign * number));
    let objectives = study.objectives.iter().map(|one| number(&one.goal, one.sign));
    let excesses = study.conditions.iter().map(|goal| number(goal, 1.0));
    let numbers = objectives.chain(excesses).collect::<Result<Vec<_>, ArrowError>>();
    // An infinite number counts as missing.
    let finite = |number: Option<f64>| number.filter(|number| number.is_finite());
    Ok(numbers.map_err(defect)?.into_iter().map(finite).collect())
}

/// Returns the rows of a candidate's points as a batch.
fn batch<M: Swept>(
    study: &Study<M>,
    layout: &Layout,
    values: &[f64],
    points: Vec<Done>,
) -> Result<RecordBatch, StoreError> {
    let mut rows = ResultRows::new(layout);
    let keyed_rows = |done: Done| {
        let row = done.point % study.rows();
        done.rows.into_iter().map(move |cells: Row| (row, cells))
    };
    for (row, cells) in points.into_iter().flat_map(keyed_rows) {
        rows.push(row, study.axis_values(values, row), cells);
    }
    rows.take().map_err(defect)
}

/// Returns the key under which an answer is stored: the numbers of candidate and answer, and a hash
/// of the candidate.
fn key(number: u64, answer: usize, values: &[f64]) -> Key {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let hash = blake3::hash(&bytes);
    let word = hash.as_bytes().first_chunk().copied().unwrap_or_default();
    [number, answer as u64, u64::from_le_bytes(word)]
}
