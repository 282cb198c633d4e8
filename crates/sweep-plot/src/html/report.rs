//! The summary of a run: facts that a reader of a page needs and that its figure does not show.

use serde_json::Value;

use super::html_table;
use crate::gather::{CellMap, PointCounts};
use crate::label::{format_significant, name_in_words};
use crate::model::Figures;
use crate::read::FigureFile;
use sweep_files::key;

/// Writes the summary of a run in HTML, from the plan in the file if there is one, with the model's
/// own lines and tables.
pub(crate) fn run_summary(source: &FigureFile, model: &dyn Figures) -> String {
    let plan_lines = |plan: &Value| {
        let common_lines = [
            ("Time", describe_time(&plan["time"])),
            ("Method", describe_method(&plan["integrator"])),
            ("Verdict", describe_verdict(&plan["reliability"])),
        ];
        let common_lines =
            common_lines.into_iter().filter_map(|(title, text)| Some((title, text?)));
        model.plan_summary(plan).into_iter().chain(common_lines).collect::<Vec<_>>()
    };
    let summary_lines = source.find_metadata(key::PLAN).map(plan_lines).into_iter().flatten();
    let rows: Vec<_> = summary_lines.map(|(title, text)| vec![title.to_owned(), text]).collect();
    html_table("What was run", &["", ""], &rows) + &model.tables()
}

/// Writes the cautions about the results of a map.
pub(crate) fn cautions(map: &CellMap, model: &dyn Figures) -> String {
    let item_name = if map.grid.merges_points() { "cells" } else { "points" };
    let count_cells = |is_counted: fn(&PointCounts) -> bool| {
        map.point_counts.iter().filter(|cell| is_counted(cell)).count()
    };
    let filled_count = count_cells(|cell| cell.points > 0);
    let [sensitive_cells, failed_cells] =
        [count_cells(|cell| cell.sensitive_points > 0), count_cells(|cell| cell.failed_points > 0)];
    let mut notes = Vec::new();
    if sensitive_cells > 0 {
        notes.push(format!(
            "{sensitive_cells} of {filled_count} {item_name} are sensitive: the motion is chaotic, \
             and its digits are those of one trajectory."
        ));
    }
    if failed_cells > 0 {
        notes.push(format!(
            "{failed_cells} of {filled_count} {item_name} failed; the map hatches them."
        ));
    }
    if map.grid.merges_points() {
        let phrase = "A cell holds several points and shows the worst of them. The file has all.";
        notes.push(phrase.to_owned());
    }
    notes.extend(
        model.cautions().iter().chain([&ASSUMPTIONS_NOTE]).map(|&phrase| phrase.to_owned()),
    );
    let item_list: String = notes.iter().map(|text| format!("<li>{text}</li>\n")).collect();
    format!("<h2>What to be careful about</h2>\n<ul>\n{item_list}</ul>\n")
}

/// The note that holds for every map.
const ASSUMPTIONS_NOTE: &str = "Numbers that nobody gave are assumed. The command sweep \
                                parameters says of each where it is from.";

fn describe_time(time: &Value) -> Option<String> {
    let [from, to] = [time["window_s"][0].as_f64()?, time["window_s"][1].as_f64()?];
    let end_s = time["end_s"].as_f64()?;
    Some(format!("0 to {end_s} s; amplitudes are the largest deviations from {from} to {to} s"))
}

fn describe_method(integrator: &Value) -> Option<String> {
    let name = integrator["method"].as_str()?;
    let settings = integrator.as_object()?.iter().filter(|(key, _)| *key != "method");
    let settings =
        settings.map(|(key, value)| format!("{} {value}", name_in_words(key).to_lowercase()));
    let phrase: Vec<String> = std::iter::once(name.to_owned()).chain(settings).collect();
    Some(phrase.join(", "))
}

fn describe_verdict(reliability: &Value) -> Option<String> {
    let limit = format_significant(reliability["ratio_limit"].as_f64()?, 4);
    let channels = reliability["channels"].as_array()?.len();
    let lower_limit = reliability["ratio_min"].as_f64();
    let lower_limit = lower_limit.map_or(String::new(), |lower_limit| {
        format!(" and above {}", format_significant(lower_limit, 4))
    });
    Some(format!(
        "the linear model is reliable where the ratio of nonlinear to linear amplitude is below \
         {limit}{lower_limit} in all of {channels} channels"
    ))
}
