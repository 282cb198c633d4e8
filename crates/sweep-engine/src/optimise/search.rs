//! Evaluation of candidates by a model's engine, with a cache.

use std::sync::Mutex;

use arrow_array::RecordBatch;
use arrow_schema::ArrowError;

use super::{Candidate, Study, evolve};
use crate::evaluator::{CachedEvaluator, RequestValues, SearchStop};
use crate::store::{BatchBuilder, Layout, PointRows, RowCells, TrialKey, Trials};
use crate::{Error, Execution, Model, Progress, StoreError};
use sweep_files::panics::{into_content, lock};
use sweep_results::{Goal, Slack};

/// Evaluates all candidates of a study, with the cache of its stored trials if there is one, which
/// is returned. The candidates are `None` after an interrupt.
///
/// # Errors
/// A model without an engine, threads that cannot be started, and trials that cannot be stored.
pub fn search<M: Model>(
    study: &Study<M>,
    trials: Option<Trials>,
    execution: Execution<'_>,
) -> Result<(Option<Vec<Candidate>>, Option<Trials>), Error> {
    let stored_candidates = trials.as_ref().map_or(0, Trials::trial_count) as u64;
    let progress =
        Progress::new(execution.progress, study.evolution.candidate_count, stored_candidates);
    let show_candidates = |candidates| progress.show(candidates);
    let threads = execution.threads()?;
    let engine = M::engine(&study.plan, None)?;
    let evaluator =
        CachedEvaluator::new(engine, threads, execution.interrupt, trials, &show_candidates)?;
    let layout = M::layout(&study.plan);
    let mut next_candidate = 0;
    let result = evolve(&study.evolution, &mut |positions| {
        let candidates: Vec<Vec<f64>> =
            positions.iter().map(|position| study.parameter_values(position)).collect();
        let keys: Vec<TrialKey> = (next_candidate..)
            .zip(&candidates)
            .map(|(number, axis_values_of_row)| trial_key(number, axis_values_of_row))
            .collect();
        next_candidate += positions.len() as u64;
        let axis_values_of_row = |k: usize, row| study.axis_values(&candidates[k], row);
        let reduce_rows = |k: usize, points| evaluate_goals(study, &layout, &candidates[k], points);
        let result = evaluator.evaluate(
            &keys,
            study.rows_per_candidate(),
            &axis_values_of_row,
            &reduce_rows,
        )?;
        let goal_signs = study.objectives.iter().map(|objective| objective.sign);
        let goal_signs: Vec<f64> = goal_signs.chain(study.conditions.iter().map(|_| 1.0)).collect();
        let apply_signs = |numbers: RequestValues| {
            let signed_numbers = numbers.into_iter().zip(&goal_signs);
            // If one number is missing, the candidate has none.
            signed_numbers.map(|(number, sign)| number.map(|number| sign * number)).collect()
        };
        Ok(result.into_iter().map(apply_signs).collect())
    });
    progress.finish();
    Ok((SearchStop::interrupted_to_none(result)?, evaluator.into_cache()))
}

/// Computes the slack of each condition for the rows of a candidate; `None` after an interrupt.
///
/// # Errors
/// A model without an engine, and threads that cannot be started.
pub fn compute_slacks<M: Model>(
    study: &Study<M>,
    values: &[f64],
    execution: Execution<'_>,
) -> Result<Option<Vec<Option<Slack>>>, Error> {
    let threads = execution.threads()?;
    let engine = M::engine(&study.plan, None)?;
    let ignore_count = |_: u64| {};
    let evaluator =
        CachedEvaluator::new(engine, threads, execution.interrupt, None, &ignore_count)?;
    let layout = M::layout(&study.plan);
    let found_slacks = Mutex::new(Vec::new());
    let record_slacks = |_: usize, points: Vec<PointRows>| -> Result<RequestValues, StoreError> {
        let batch = collect_batch(study, &layout, values, points)?;
        let slack_results = study.conditions.iter().map(|goal| goal.slack(&batch));
        *lock(&found_slacks) =
            slack_results.collect::<Result<Vec<_>, ArrowError>>().map_err(row_defect)?;
        Ok(RequestValues::new())
    };
    let keys = [trial_key(0, values)];
    let result = evaluator.evaluate(
        &keys,
        study.rows_per_candidate(),
        &|_, row| study.axis_values(values, row),
        &record_slacks,
    );
    Ok(SearchStop::interrupted_to_none(result)?.map(|_| into_content(found_slacks)))
}

/// Returns the error of rows that do not fit their own columns, which is a defect of the program.
pub(crate) fn row_defect(error: ArrowError) -> StoreError {
    StoreError::Engine { first: 0, last: 0, reason: error.to_string() }
}

/// Returns the objectives of a candidate, then its constraint violations.
fn evaluate_goals<M: Model>(
    study: &Study<M>,
    layout: &Layout,
    values: &[f64],
    points: Vec<PointRows>,
) -> Result<RequestValues, StoreError> {
    let batch = collect_batch(study, layout, values, points)?;
    let objectives = study.objectives.iter().map(|objective| &objective.goal);
    let goals = objectives.chain(&study.conditions);
    let numbers = goals.map(|goal: &Goal| goal.evaluate(&batch)).collect::<Result<Vec<_>, _>>();
    // An infinite number counts as missing.
    let finite_or_none = |number: Option<f64>| number.filter(|number| number.is_finite());
    Ok(numbers.map_err(row_defect)?.into_iter().map(finite_or_none).collect())
}

/// Returns the rows of a candidate's points as a batch.
fn collect_batch<M: Model>(
    study: &Study<M>,
    layout: &Layout,
    values: &[f64],
    points: Vec<PointRows>,
) -> Result<RecordBatch, StoreError> {
    let mut batch_builder = BatchBuilder::new(layout);
    let numbered_rows = |point_rows: PointRows| {
        let row = point_rows.point % study.rows_per_candidate();
        point_rows.rows.into_iter().map(move |cells: RowCells| (row, cells))
    };
    for (row, cells) in points.into_iter().flat_map(numbered_rows) {
        batch_builder.push_row(row, study.axis_values(values, row), cells);
    }
    batch_builder.take_batch().map_err(row_defect)
}

/// Returns the key of a candidate: its number, and its parameters.
fn trial_key(number: u64, values: &[f64]) -> TrialKey {
    std::iter::once(number).chain(values.iter().map(|value| value.to_bits())).collect()
}
