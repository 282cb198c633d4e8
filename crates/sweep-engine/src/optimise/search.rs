//! Candidates through a model's engine, with a memory.

use std::sync::Mutex;

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;

use super::{Candidate, Study, evolve};
use crate::evaluator::{CachedEvaluator, RequestValues, Stopped};
use crate::store::{Done, Key, Layout, ResultRows, Row, Trials};
use crate::{Effort, Error, Progress, StoreError, Swept};
use sweep_files::panics::{lock, unlocked};
use sweep_results::{Goal, Slack};

/// Everything that a study tries, with a memory of trials if there is one, which it gives back;
/// nothing where the interrupt was raised.
///
/// # Errors
/// No engine, no threads; trials that could not be kept.
pub fn search<M: Swept>(
    study: &Study<M>,
    trials: Option<Trials>,
    effort: Effort<'_>,
) -> Result<(Option<Vec<Candidate>>, Option<Trials>), Error> {
    let there = trials.as_ref().map_or(0, |trials| trials.count() / study.answers()) as u64;
    let progress = Progress::new(effort.progress, study.evolution.candidates, there);
    let shown = |candidates| progress.show(candidates);
    let (threads, engine) = (effort.threads()?, M::engine(&study.plan, None)?);
    let asking = CachedEvaluator::new(engine, threads, effort.interrupt, trials, &shown)?;
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
        let found = asking.evaluate(&keys, study.rows(), &values, &answer)?;
        // Without one number there are none.
        Ok(found.into_iter().map(|numbers| numbers.into_iter().collect()).collect())
    });
    progress.finish();
    Ok((Stopped::interrupted_to_none(found)?, asking.into_cache()))
}

/// Computes how far the points of a candidate are from the limit of each condition; nothing where
/// the interrupt was raised.
///
/// # Errors
/// No engine, no threads.
pub fn slacks<M: Swept>(
    study: &Study<M>,
    values: &[f64],
    effort: Effort<'_>,
) -> Result<Option<Vec<Option<Slack>>>, Error> {
    let (threads, engine) = (effort.threads()?, M::engine(&study.plan, None)?);
    let silent = |_: u64| {};
    let asking = CachedEvaluator::new(engine, threads, effort.interrupt, None, &silent)?;
    let layout = M::layout(&study.plan);
    let found = Mutex::new(Vec::new());
    let answer = |_: usize, points: Vec<Done>| -> Result<RequestValues, StoreError> {
        let batch = batch(study, &layout, values, points)?;
        let slacks = study.conditions.iter().map(|goal| goal.slack(&batch));
        *lock(&found) = slacks.collect::<Result<Vec<_>, ArrowError>>().map_err(defect)?;
        Ok(RequestValues::new())
    };
    let keys = [vec![key(0, 0, values)]];
    let asked =
        asking.evaluate(&keys, study.rows(), &|_, row| study.axis_values(values, row), &answer);
    Ok(Stopped::interrupted_to_none(asked)?.map(|_| unlocked(found)))
}

/// A defect of the program: its own rows do not fit its own columns.
fn defect(error: ArrowError) -> StoreError {
    StoreError::Engine { first: 0, last: 0, reason: error.to_string() }
}

/// The objectives of a candidate as they are minimised, then its excesses, by its points.
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
    // An infinite number is as good as none.
    let finite = |number: Option<f64>| number.filter(|number| number.is_finite());
    Ok(numbers.map_err(defect)?.into_iter().map(finite).collect())
}

/// The rows of a candidate's points.
fn batch<M: Swept>(
    study: &Study<M>,
    layout: &Layout,
    values: &[f64],
    points: Vec<Done>,
) -> Result<RecordBatch, StoreError> {
    let mut rows = ResultRows::new(layout);
    let of = |done: Done| {
        let row = done.point % study.rows();
        done.rows.into_iter().map(move |cells: Row| (row, cells))
    };
    for (row, cells) in points.into_iter().flat_map(of) {
        rows.push(row, study.axis_values(values, row), cells);
    }
    rows.take().map_err(defect)
}

/// The key under which an answer is stored: the candidate's number, the answer's, the candidate.
fn key(number: u64, answer: usize, values: &[f64]) -> Key {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let hash = blake3::hash(&bytes);
    let word = hash.as_bytes().first_chunk().copied().unwrap_or_default();
    [number, answer as u64, u64::from_le_bytes(word)]
}
