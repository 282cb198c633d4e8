//! A run in words: what a reader of the page must know of it without the program.

use serde_json::Value;

use super::table;
use crate::Live;
use crate::gather::{Counts, Map};
use crate::label::{significant, unit_of_name, words};
use crate::read::Source;
use sweep_files::key;

/// The run as HTML: what was run, from the plan in the file if it carries one, and what a live page
/// knows of the machine's resonances.
pub(crate) fn told(source: &Source, live: Option<&Live>) -> String {
    let of_plan = |plan: &Value| {
        [
            ("Machine", machine(&plan["machine"])),
            ("Spin", spin(&plan["spin"])),
            ("Time", time(&plan["time"])),
            ("Method", method(&plan["integrator"])),
            ("Verdict", verdict(&plan["reliability"])),
        ]
    };
    let lines = source.find(key::PLAN).map(of_plan).into_iter().flatten();
    let run: Vec<_> =
        lines.filter_map(|(title, text)| Some(vec![title.to_owned(), text?])).collect();
    let resonances: Vec<_> =
        live.into_iter().flat_map(|live| live.resonances.iter().cloned().map(Vec::from)).collect();
    let heads = ["Motion", "Resonance", "Damping ratio"];
    table("What was run", &["", ""], &run)
        + &table("Resonances at the middle of the map", &heads, &resonances)
}

/// What to be careful about, of a map.
pub(crate) fn caveats(map: &Map) -> String {
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
        let said = "A cell holds several points and shows the worst of them. The file has all.";
        found.push(said.to_owned());
    }
    found.extend(ALWAYS.map(str::to_owned));
    let items: String = found.iter().map(|text| format!("<li>{text}</li>\n")).collect();
    format!("<h2>What to be careful about</h2>\n<ul>\n{items}</ul>\n")
}

/// What is true of every map.
const ALWAYS: [&str; 2] = [
    "A map shows one course of speeds. Whether the machine may stay at a speed is another \
     question; the command sweep stability answers it.",
    "Numbers that nobody gave are assumed. The command sweep parameters says of each where it is \
     from.",
];

/// A number under a key, with the unit that the key's end says.
fn quantity(of: &Value, key: &str) -> Option<String> {
    let value = significant(of.get(key)?.as_f64()?, 4);
    Some(format!("{value} {}", unit_of_name(key)).trim_end().to_owned())
}

fn machine(machine: &Value) -> Option<String> {
    let mass = |body: &str| quantity(&machine[body], "mass_kg");
    let (tub, shaft, drum) = (mass("tub")?, mass("shaft")?, mass("drum")?);
    let (unbalance, radius) = (mass("unbalance")?, quantity(&machine["unbalance"], "radius_m")?);
    let mut parts = vec![format!(
        "tub {tub}, shaft {shaft}, drum {drum}, unbalance {unbalance} at radius {radius}"
    )];
    // Numbers of a list's elements, each behind its word: the one that they have in common, or the
    // least and the greatest.
    let elements = |(list, numbers): (&str, &[(&str, &str)])| {
        let all = machine.get(list).and_then(Value::as_array)?;
        let said = numbers.iter().filter_map(|(word, number)| {
            // What an element does not say is 0; what none says is not told.
            let size = |of: &Value| of[*number].as_f64().unwrap_or_default();
            let most = all.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
            let least = all.iter().map(size).fold(f64::INFINITY, f64::min);
            let from = match least == size(most) {
                true => String::new(),
                false => format!("{} to ", significant(least, 4)),
            };
            Some(format!(" {word} {from}{}", quantity(most, number)?))
        });
        let words = list.replace('_', " ");
        let words = if all.len() == 1 { words.trim_end_matches('s') } else { &words };
        Some(format!("{} {words}{}", all.len(), said.collect::<Vec<_>>().join(",")))
    };
    let lists: [(&str, &[(&str, &str)]); 6] = [
        ("springs", &[("of", "stiffness_n_per_m")]),
        ("dampers", &[("of", "damping_n_s_per_m"), ("with friction of", "friction_n")]),
        ("stops", &[("of", "stiffness_n_per_m"), ("after", "clearance_m")]),
        ("bushings", &[]),
        ("further_unbalances", &[("of", "mass_kg")]),
        ("feet", &[]),
    ];
    parts.extend(lists.into_iter().filter_map(elements));
    if let Some(mass) = machine.get("cabinet").and_then(|cabinet| quantity(cabinet, "mass_kg")) {
        parts.push(format!("a cabinet of {mass}"));
    }
    if let Some(gap) = quantity(machine, "radial_clearance_m") {
        parts.push(format!("a gap of {gap} between drum and tub"));
    }
    Some(format!("{}; what the axes name is each point's own", parts.join("; ")))
}

fn spin(spin: &Value) -> Option<String> {
    let profile = spin["profile"].as_str()?;
    match (quantity(spin, "peak_rpm"), quantity(spin, "ramp_s")) {
        (Some(peak), Some(ramp)) => Some(format!("{profile}, up to {peak} in {ramp}")),
        _ => Some(format!("{profile} of {} points", spin["time_s"].as_array()?.len())),
    }
}

fn time(time: &Value) -> Option<String> {
    let [from, to] = [time["window_s"][0].as_f64()?, time["window_s"][1].as_f64()?];
    let end = time["end_s"].as_f64()?;
    Some(format!("0 to {end} s; amplitudes are the largest deviations from {from} to {to} s"))
}

fn method(integrator: &Value) -> Option<String> {
    let name = integrator["method"].as_str()?;
    let settings = integrator.as_object()?.iter().filter(|(key, _)| *key != "method");
    let settings = settings.map(|(key, value)| format!("{} {value}", words(key).to_lowercase()));
    let said: Vec<String> = std::iter::once(name.to_owned()).chain(settings).collect();
    Some(said.join(", "))
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
