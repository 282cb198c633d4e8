//! The figure of a study: its candidates with the other objectives over the first and the Pareto
//! front, or its single objective over the number of the candidate.

use crate::chart::{Chart, ChartPanel, Series, SeriesStyle};
use crate::colour::{DISTINCT_COLOURS, FAILED_COLOUR, NONLINEAR_COLOUR};
use crate::error::Result;
use crate::label::{self, Label};
use crate::read::{ColumnFacts, FigureFile};

/// The kinds of candidates in words, in drawing order: the last are drawn on top.
const CANDIDATE_KINDS: [&str; 3] = ["breaks a condition", "tried", "on the front"];

/// Returns a column with its name in words.
fn with_name_in_words(column: &ColumnFacts) -> (&ColumnFacts, String) {
    (column, label::name_in_words(&column.name))
}

/// Draws the chart of a study's file.
///
/// # Errors
/// A file without objectives.
pub(crate) fn study_chart(source: &FigureFile) -> Result<Chart> {
    // The study's expressions are clearer than column names, which lack quantiles.
    let objectives: Vec<(&ColumnFacts, String)> = source
        .metadata_list("objective")
        .filter_map(|objective| {
            let text = objective.get("minimise").or_else(|| objective.get("maximise"))?.as_str()?;
            Some((source.column(objective["name"].as_str()?)?, text.to_owned()))
        })
        .collect();
    let [first_objective, further_objectives @ ..] = objectives.as_slice() else {
        return Err(source.missing_column_error("an objective", "written by `sweep optimise`"));
    };
    let candidate_column = source
        .column("candidate")
        .ok_or_else(|| source.missing_column_error("candidate", "its index"))?;
    let (x_column, y_objectives) = match further_objectives {
        [] => (with_name_in_words(candidate_column), &objectives[..]),
        _ => (first_objective.clone(), further_objectives),
    };
    // Parameters stand between the generation and the first objective.
    let parameters =
        source.number_columns().skip_while(|column| column.name != "generation").skip(1);
    let parameters = parameters
        .take_while(|column| column.name != first_objective.0.name)
        .map(with_name_in_words);
    let y_columns: Vec<(&ColumnFacts, String)> =
        y_objectives.iter().cloned().chain(parameters).collect();
    let mut column_names = vec!["feasible", "on_front", x_column.0.name.as_str()];
    column_names.extend(y_columns.iter().map(|(column, _)| column.name.as_str()));
    let mut candidates: Vec<(usize, Vec<f64>)> = Vec::new();
    source.each_row(&column_names, |row| {
        let is_true = |column| usize::from(row.word(column) == Some("true"));
        candidates.push((is_true(0) + is_true(1), row.numbers(2..column_names.len())));
        Ok(())
    })?;
    candidates.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
    let units: Vec<(&str, f64)> = std::iter::once(&x_column)
        .chain(&y_columns)
        .map(|(column, _)| label::display_unit(column.unit()))
        .collect();
    let candidate_values = |kind: usize, k: usize| -> Vec<f64> {
        let candidates_of_kind =
            candidates.iter().filter(|(kind_of_candidate, candidate_values)| {
                *kind_of_candidate == kind && candidate_values[0].is_finite()
            });
        candidates_of_kind.map(|(_, candidate_values)| candidate_values[k] * units[k].1).collect()
    };
    let panels = y_columns.iter().enumerate().map(|(k, (column, words))| {
        let colours = [FAILED_COLOUR, DISTINCT_COLOURS[5], NONLINEAR_COLOUR];
        let kind_series = |kind: usize| {
            Series::new(
                CANDIDATE_KINDS[kind],
                colours[kind],
                candidate_values(kind, 0),
                candidate_values(kind, k + 1),
                SeriesStyle::Dots,
            )
        };
        let kind_series =
            (0..CANDIDATE_KINDS.len()).map(kind_series).filter(|series| !series.x.is_empty());
        let label = Label::new(words, units[k + 1].0);
        ChartPanel {
            is_shown: k < y_objectives.len(),
            height: 300.0,
            ..ChartPanel::new(&column.name, label, kind_series.collect())
        }
    });
    Ok(Chart {
        title: if further_objectives.is_empty() {
            "What was tried"
        } else {
            "What no other choice beats"
        }
        .to_owned(),
        subtitle: source.subtitle(&format!("{} candidates", source.rows)),
        x_label: Label::new(&x_column.1, units[0].0),
        panels: panels.collect(),
        ..Chart::default()
    })
}
