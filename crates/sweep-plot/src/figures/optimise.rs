//! The figure of a study: its candidates with the other objectives over the first and the Pareto
//! front, or its single objective over the number of the candidate.

use crate::chart::{Chart, ChartPanel, Series, Style};
use crate::colour::{DISTINCT, FAILED, NONLINEAR};
use crate::error::Result;
use crate::label::{self, Label};
use crate::read::{ColumnFacts, FigureFile};

/// The kinds of candidates in words, in drawing order: the last are drawn on top.
const CANDIDATE_KINDS: [&str; 3] = ["breaks a condition", "tried", "on the front"];

/// Returns a column with its name in words.
fn in_words(column: &ColumnFacts) -> (&ColumnFacts, String) {
    (column, label::words(&column.name))
}

/// Draws the chart of a study's file.
///
/// # Errors
/// A file without objectives.
pub(crate) fn chart(source: &FigureFile) -> Result<Chart> {
    // The study's expressions are clearer than column names, which lack quantiles.
    let objectives: Vec<(&ColumnFacts, String)> = source
        .list("objective")
        .filter_map(|one| {
            let text = one.get("minimise").or_else(|| one.get("maximise"))?.as_str()?;
            Some((source.column(one["name"].as_str()?)?, text.to_owned()))
        })
        .collect();
    let [first, further @ ..] = objectives.as_slice() else {
        return Err(source.missing_column("an objective", "written by `sweep optimise`"));
    };
    let number = source
        .column("candidate")
        .ok_or_else(|| source.missing_column("candidate", "its index"))?;
    let (x, ys) = match further {
        [] => (in_words(number), &objectives[..]),
        _ => (first.clone(), further),
    };
    // Parameters stand between the generation and the first objective.
    let own = source.numeric().skip_while(|column| column.name != "generation").skip(1);
    let own = own.take_while(|column| column.name != first.0.name).map(in_words);
    let shown: Vec<(&ColumnFacts, String)> = ys.iter().cloned().chain(own).collect();
    let mut names = vec!["feasible", "on_front", x.0.name.as_str()];
    names.extend(shown.iter().map(|(column, _)| column.name.as_str()));
    let mut rows: Vec<(usize, Vec<f64>)> = Vec::new();
    source.each_row(&names, |row| {
        let is = |column| usize::from(row.word(column) == Some("true"));
        rows.push((is(0) + is(1), row.numbers(2..names.len())));
        Ok(())
    })?;
    rows.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
    let units: Vec<(&str, f64)> = std::iter::once(&x)
        .chain(&shown)
        .map(|(column, _)| label::display_unit(&column.unit))
        .collect();
    let values = |kind: usize, k: usize| -> Vec<f64> {
        let own = rows.iter().filter(|(own, values)| *own == kind && values[0].is_finite());
        own.map(|(_, values)| values[k] * units[k].1).collect()
    };
    let panels = shown.iter().enumerate().map(|(k, (column, words))| {
        let colours = [FAILED, DISTINCT[5], NONLINEAR];
        let dots = |kind: usize| {
            Series::new(
                CANDIDATE_KINDS[kind],
                colours[kind],
                values(kind, 0),
                values(kind, k + 1),
                Style::Dots,
            )
        };
        let dots = (0..CANDIDATE_KINDS.len()).map(dots).filter(|series| !series.x.is_empty());
        let label = Label::new(words, units[k + 1].0);
        ChartPanel {
            shown: k < ys.len(),
            height: 300.0,
            ..ChartPanel::new(&column.name, label, dots.collect())
        }
    });
    Ok(Chart {
        title: if further.is_empty() { "What was tried" } else { "What no other choice beats" }
            .to_owned(),
        subtitle: source.subtitle(&format!("{} candidates", source.rows)),
        x_label: Label::new(&x.1, units[0].0),
        panels: panels.collect(),
        ..Chart::default()
    })
}
