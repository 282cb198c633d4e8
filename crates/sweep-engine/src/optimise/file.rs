//! The file of a study: a row for each candidate, in the order of evaluation.

use sweep_files::key;
use sweep_results::Goal;

use super::study::Objective;
use super::{Candidate, Study, find_pareto_front};
use crate::store::{CellType, DeclaredColumn, TrialColumns};
use crate::{Axis, GridInput, Model, Table};

/// Returns the table of a study's candidates.
pub fn candidates_table<M: Model>(study: &Study<M>, candidates: &[Candidate]) -> Table {
    let objective_count = study.objectives.len();
    let pareto_front = find_pareto_front(candidates, objective_count);
    let mut table = Table::new(M::ABOUT.build);
    table.add_counts("candidate", "index, in the order of trial", 0..candidates.len() as u64);
    table.add_counts(
        "generation",
        "from 0",
        candidates.iter().map(|candidate| candidate.generation),
    );
    let values_by_candidate: Vec<Vec<f64>> =
        candidates.iter().map(|one| study.parameter_values(&one.position)).collect();
    for (k, Axis { parameter, .. }) in parameter_axes(study).iter().enumerate() {
        let parameter_values =
            values_by_candidate.iter().map(|values_by_candidate| Some(values_by_candidate[k]));
        table.add_parameter(parameter, parameter_values);
    }
    let signed_numbers = |k: usize, sign: f64| {
        candidates
            .iter()
            .map(move |one| one.evaluation.as_ref().map(|responses| sign * responses[k]))
    };
    for (k, one) in study.objectives.iter().enumerate() {
        let unit = objective_unit(&one.goal);
        let verb = if one.sign > 0.0 { "minimised" } else { "maximised" };
        let description = format!("{}, {verb}; null where a row has no value", one.goal.text());
        table.add_numbers(&one.name, unit, &description, signed_numbers(k, one.sign));
    }
    for (k, goal) in study.conditions.iter().enumerate() {
        let description =
            format!("how far the rows are from keeping {}; 0 where they do", goal.text());
        table.add_numbers(
            &excess_name(k),
            "1",
            &description,
            signed_numbers(objective_count + k, 1.0),
        );
    }
    let feasible_flags = candidates.iter().map(|candidate| candidate.is_feasible(objective_count));
    table.add_flags("feasible", "whether every condition holds", feasible_flags);
    let front_flags = (0..candidates.len()).map(|k| pareto_front.contains(&k));
    table.add_flags(
        "on_front",
        "whether no feasible candidate beats it in every objective",
        front_flags,
    );
    let mut optimum_json = study.settings_json();
    optimum_json["best"] = find_best(candidates, &pareto_front, objective_count).into();
    let job = study.job();
    table.add_metadata(key::PLAN, &job.plan);
    table.add_text(key::PLAN_HASH, job.hash().to_hex().to_string());
    table.add_metadata(key::OPTIMISE, &optimum_json);
    table
}

/// Returns the columns of trials: the candidate and its parameters, then its objectives and its
/// excesses over the conditions.
pub fn trial_columns<M: Model>(study: &Study<M>) -> TrialColumns {
    let candidate_column =
        DeclaredColumn::new("candidate", "1", "index, in the order of trial", CellType::Count);
    let mut key_columns = vec![candidate_column];
    key_columns.extend(parameter_axes(study).iter().map(|Axis { parameter, .. }| {
        DeclaredColumn::new(&*parameter.name, parameter.unit, parameter.description, CellType::Axis)
    }));
    let mut value_columns = Vec::with_capacity(study.evaluation_len());
    for Objective { name, goal, .. } in &study.objectives {
        value_columns.push(DeclaredColumn::new(
            name,
            objective_unit(goal),
            goal.text(),
            CellType::Measured,
        ));
    }
    for (k, goal) in study.conditions.iter().enumerate() {
        value_columns.push(DeclaredColumn::new(
            excess_name(k),
            "1",
            goal.text(),
            CellType::Measured,
        ));
    }
    TrialColumns { key_columns, value_columns }
}

/// Returns the unit of an objective.
fn objective_unit(goal: &Goal) -> &str {
    if goal.unit().is_empty() { "1" } else { goal.unit() }
}

/// Returns the name of the column of the excess over a condition.
fn excess_name(condition: usize) -> String {
    format!("excess_{}", condition + 1)
}

/// Returns the axes of a study's parameters.
pub fn parameter_axes<M: Model>(study: &Study<M>) -> &[Axis<M>] {
    &study.plan.axes[study.grid.axes.len()..]
}

/// Returns the candidate of the front that is closest to the minimum of every objective, each as a
/// share of its range over the front.
fn find_best(candidates: &[Candidate], front: &[usize], objectives: usize) -> Option<usize> {
    let objective_value = |candidate: usize, k: usize| {
        candidates[candidate].evaluation.as_ref().map_or(f64::INFINITY, |responses| responses[k])
    };
    let objective_ranges: Vec<[f64; 2]> = (0..objectives)
        .map(|k| {
            let values = || front.iter().map(|&candidate| objective_value(candidate, k));
            [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
        })
        .collect();
    let squared_distance = |candidate: usize| -> f64 {
        let scaled_distances = objective_ranges.iter().enumerate().map(|(k, [low, high])| {
            (objective_value(candidate, k) - low) / (high - low).max(f64::MIN_POSITIVE)
        });
        scaled_distances.map(|scaled_distance| scaled_distance * scaled_distance).sum()
    };
    front.iter().copied().min_by(|&a, &b| squared_distance(a).total_cmp(&squared_distance(b)))
}

/// Returns the model's own file with these values of the parameters, if the model has one.
pub fn format_model_file<M: Model>(study: &Study<M>, values: &[f64]) -> Option<String> {
    let mut plan = study.grid.clone();
    for (axis, &value) in parameter_axes(study).iter().zip(values) {
        plan.write(&axis.parameter, value);
    }
    GridInput::<M>::from_plan(&study.name, &plan.to_json()).model_file
}
