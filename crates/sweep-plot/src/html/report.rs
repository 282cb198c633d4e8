//! The summary of a run: facts that a reader of a page needs and that its figure does not show.

use serde_json::Value;

use super::table;
use crate::gather::{CellMap, Counts};
use crate::label::{significant, words};
use crate::model::Figures;
use crate::read::FigureFile;
use sweep_files::key;

/// Writes the summary of a run in HTML, from the plan in the file if there is one, with the model's
/// own lines and tables.
pub(crate) fn run_summary(source: &FigureFile, model: &dyn Figures) -> String {
    let plan_lines = |plan: &Value| {
        let common = [
            ("Time", time(&plan["time"])),
            ("Method", method(&plan["integrator"])),
            ("Verdict", verdict(&plan["reliability"])),
        ];
        let common = common.into_iter().filter_map(|(title, text)| Some((title, text?)));
        model.plan_summary(plan).into_iter().chain(common).collect::<Vec<_>>()
    };
    let lines = source.find(key::PLAN).map(plan_lines).into_iter().flatten();
    let run: Vec<_> = lines.map(|(title, text)| vec![title.to_owned(), text]).collect();
    table("What was run", &["", ""], &run) + &model.tables()
}

/// Writes the notes on what to be careful about in a map.
pub(crate) fn cautions(map: &CellMap, model: &dyn Figures) -> String {
    let what = if map.grid.merged() { "cells" } else { "points" };
    let count = |has: fn(&Counts) -> bool| map.counts.iter().filter(|cell| has(cell)).count();
    let all = count(|cell| cell.points > 0);
    let [chaotic, failed] = [count(|cell| cell.sensitive > 0), count(|cell| cell.failed > 0)];
    let mut found = Vec::new();
    if chaotic > 0 {
        found.push(format!(
            "{chaotic} of {all} {what} are sensitive: the motion is chaotic, and its digits are \
             those of one trajectory."
        ));
    }
    if failed > 0 {
        found.push(format!("{failed} of {all} {what} failed; the map hatches them."));
    }
    if map.grid.merged() {
        let phrase = "A cell holds several points and shows the worst of them. The file has all.";
        found.push(phrase.to_owned());
    }
    found.extend(model.cautions().iter().chain([&ASSUMED]).map(|&phrase| phrase.to_owned()));
    let items: String = found.iter().map(|text| format!("<li>{text}</li>\n")).collect();
    format!("<h2>What to be careful about</h2>\n<ul>\n{items}</ul>\n")
}

/// The note that holds for every map.
const ASSUMED: &str = "Numbers that nobody gave are assumed. The command sweep parameters says of \
                       each where it is from.";

fn time(time: &Value) -> Option<String> {
    let [from, to] = [time["window_s"][0].as_f64()?, time["window_s"][1].as_f64()?];
    let end = time["end_s"].as_f64()?;
    Some(format!("0 to {end} s; amplitudes are the largest deviations from {from} to {to} s"))
}

fn method(integrator: &Value) -> Option<String> {
    let name = integrator["method"].as_str()?;
    let settings = integrator.as_object()?.iter().filter(|(key, _)| *key != "method");
    let settings = settings.map(|(key, value)| format!("{} {value}", words(key).to_lowercase()));
    let phrase: Vec<String> = std::iter::once(name.to_owned()).chain(settings).collect();
    Some(phrase.join(", "))
}

fn verdict(reliability: &Value) -> Option<String> {
    let limit = significant(reliability["ratio_limit"].as_f64()?, 4);
    let channels = reliability["channels"].as_array()?.len();
    let least = reliability["ratio_min"].as_f64();
    let least =
        least.map_or(String::new(), |least| format!(" and above {}", significant(least, 4)));
    Some(format!(
        "the linear model is reliable where the ratio of nonlinear to linear amplitude is below \
         {limit}{least} in all of {channels} channels"
    ))
}
