//! Charts of time histories of both models at one point (the paper's Figs. 6 and 9 to 11).

use std::path::Path;
use std::rc::Rc;

use crate::WasherFigures;
use crate::kinds::{MACHINE, MODEL_KINDS, speed_mark};
use crate::machine::unbalance_and_damping;
use crate::{campbell, stability};
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::read::FigureKind;
use sweep_plot::table::FigureTable;
use sweep_plot::together::{self, NamedPoint};
use sweep_plot::{INK, LINEAR, NONLINEAR, PlotError, extremes};

/// Draws the chart of a trace file.
///
/// # Errors
/// [`PlotError::Undrawable`] without time, [`PlotError::Unfit`] for an unknown channel, and the
/// errors of [`campbell::resonances`] for the modes file.
pub(crate) fn chart(table: &FigureTable, options: &WasherFigures) -> Result<Chart, PlotError> {
    let time = Rc::new(table.numbers("time_s")?.to_vec());
    if time.len() < 2 {
        return Err(table.source.nothing_to_draw("a trace needs at least two instants"));
    }
    if table.column("point").is_some() {
        let path = table.source.path.display();
        return Err(PlotError::Unfit(format!(
            "{path} holds traces of many points, and a figure shows one: `sweep trace --point N`"
        )));
    }
    let model_prefixes = model_prefixes(table);
    let found = quantities(table, model_prefixes);
    let names: Vec<&str> = found.iter().map(|quantity| quantity.name).collect();
    let is_shown = stability::shown_channels(&table.source, &names, &options.channels)?;
    // States and forces are drawn on request only.
    let any = !options.channels.is_empty();
    let shown = found
        .iter()
        .zip(is_shown)
        .filter(|(quantity, is_shown)| *is_shown && (any || quantity.channel));
    let shown: Vec<&str> = shown.map(|(quantity, _)| quantity.name).collect();
    let other = options.against.as_ref().map(|path| other_trace(path)).transpose()?;
    let names = match &other {
        Some(other) => distinct_names(table, other),
        None => model_prefixes.map(format_side),
    };
    // The second curve is translucent, so that the first one shows through.
    let front = other.as_ref().unwrap_or(table);
    let its_time = Rc::new(front.numbers("time_s")?.to_vec());
    let drawn = [(table, Rc::clone(&time), NONLINEAR), (front, its_time, LINEAR.with_alpha(165))];
    let pair = |columns: &[String; 2], factor: f64| -> Vec<Series> {
        let curve = |k: usize| {
            let ((table, time, colour), name) = (&drawn[k], names[k].clone());
            let column = table.column(&columns[if other.is_some() { 0 } else { k }])?;
            let y = column.numbers()?.iter().map(|value| value * factor).collect();
            Some(Series::new(name, *colour, Rc::clone(time), y, Style::Solid(1.3)))
        };
        (0..2).filter_map(curve).collect()
    };
    let quantity_panel = |quantity: &TraceQuantity<'_>| {
        let (name, (unit, factor)) = (quantity.name, label::display_unit(quantity.unit));
        let is_channel = quantity.channel && model_prefixes == MODELS;
        let words = if is_channel { label::channel(name) } else { label::words(name) };
        let lines = pair(&quantity.columns, factor);
        panel(name, Label::new(&words, unit), shown.contains(&name), lines)
    };
    let mut panels: Vec<ChartPanel> = found.iter().map(quantity_panel).collect();
    // Decimated rows of two files do not lie at the same instants.
    let whole =
        other.as_ref().is_some_and(|other| table.bucket_rows.or(other.bucket_rows).is_none());
    let difference_of_runs = if whole { difference(&panels) } else { None };
    for (name, column) in table.with_prefix("residual_") {
        let (unit, factor) = label::display_unit(&column.facts.unit);
        let y = column.numbers().unwrap_or_default().iter().map(|value| value * factor).collect();
        let residual = Series::new("residual", INK, Rc::clone(&time), y, Style::Dots);
        let words = format!("residual, {}", label::words(name));
        let shown = shown.contains(&name);
        let label = Label::new(&words, unit);
        panels.push(panel(&format!("residual_{name}"), label, shown, vec![residual]));
    }
    let mut gaps = pair(&["gap_nonlinear_m", "gap_linear_m"].map(str::to_owned), 1e3);
    if other.is_some() && gaps.len() < 2 {
        gaps.clear();
    }
    let least = least_gaps(&gaps);
    if !gaps.is_empty() {
        // If the gap stays wide, it would be a flat line at the top of a panel that reaches down to
        // contact.
        let widest = gaps.iter().flat_map(|series| &series.y).copied().fold(0.0, f64::max);
        let near = least.iter().any(|(_, gap)| *gap < 0.5 * widest);
        let levels = if near { vec![(0.0, "gap closed".to_owned())] } else { Vec::new() };
        let gap = panel("gap", Label::new("gap, drum to tub", "mm"), true, gaps);
        panels.push(ChartPanel { levels, ..gap });
    }
    let mut marks = Vec::new();
    let mut shades = Vec::new();
    let unstable = unstable_speeds(table, options)?;
    let (resonances, note) = resonances(table, options)?;
    if let Some(speed) = table.column("speed_rpm").and_then(|column| column.numbers()) {
        let passed = passages(&time, speed, &resonances).into_iter();
        marks.extend(passed.map(|(x, resonance)| speed_mark(x, resonance)));
        shades = stability::intervals_within(&time, speed, &unstable);
        let x = Rc::clone(&time);
        let series = Series::new("", INK, x, speed.to_vec(), Style::Solid(2.0));
        let spin = panel("speed", Label::new("spin", "rpm"), true, vec![series]);
        panels.push(ChartPanel { height: 130.0, ..spin });
    }
    Ok(Chart {
        title: match &other {
            Some(_) => "Nonlinear motion from static equilibrium".to_owned(),
            None if model_prefixes == FITTED => {
                "A measurement, and the model fitted to it".to_owned()
            }
            None => "Motion of both models from static equilibrium".to_owned(),
        },
        subtitle: match &other {
            // The point of one trace would be wrong for the other, so that the subtitle has
            // neither.
            Some(_) => common_notes(&least, difference_of_runs).join(" · "),
            None => subtitle(table, &least, difference_of_runs),
        } + &note,
        x_label: Label::new("Time", "s"),
        panels,
        marks,
        mark_meaning: "resonance speed passed".to_owned(),
        shades,
        shade_meaning: stability::UNSTABLE.to_owned(),
        ..Chart::default()
    })
}

/// The prefixes of the columns of both models in a trace.
const MODELS: [&str; 2] = ["nonlinear", "linear"];
/// The prefixes of the columns of measurement and model in the curves of a fit.
const FITTED: [&str; 2] = ["measured", "model"];

/// Returns the prefixes of a file's columns.
fn model_prefixes(table: &FigureTable) -> [&'static str; 2] {
    if table.with_prefix("measured_").is_empty() { MODELS } else { FITTED }
}

/// Returns the legend entry of a prefix.
fn format_side(side: &str) -> String {
    if MODELS.contains(&side) { format!("{side} model") } else { side.to_owned() }
}

/// A quantity that a trace has of both models over time.
struct TraceQuantity<'a> {
    /// The channel's name; for a coordinate, a speed or a force the part before the model's name:
    /// `spring_1_tension`.
    name: &'a str,
    unit: &'a str,
    channel: bool,
    /// The columns of both models.
    columns: [String; 2],
}

/// Returns the quantities of a trace: channels first, then states and forces. The gap has a panel
/// of its own.
fn quantities<'a>(table: &'a FigureTable, model_prefixes: [&str; 2]) -> Vec<TraceQuantity<'a>> {
    let channels = table.with_prefix(&format!("{}_", model_prefixes[0])).into_iter();
    let channels = channels.map(|(name, column)| {
        let own = Some(column.facts.unit.as_str()).filter(|unit| !unit.is_empty());
        let unit = own.unwrap_or(label::unit_of_channel(name));
        TraceQuantity {
            name,
            unit,
            channel: true,
            columns: model_prefixes.map(|side| format!("{side}_{name}")),
        }
    });
    let numbers = table.columns.iter().filter(|column| column.numbers().is_some());
    let further = numbers.filter_map(|column| {
        let split = column.facts.name.split_once("_nonlinear_");
        let (name, end) = split.filter(|(name, _)| *name != "gap")?;
        let columns = model_prefixes.map(|side| format!("{name}_{side}_{end}"));
        Some(TraceQuantity { name, unit: &column.facts.unit, channel: false, columns })
    });
    channels.chain(further).collect()
}

/// Returns the largest difference between the two curves of any panel shown, as a share of the
/// first curve's peak.
fn difference(panels: &[ChartPanel]) -> Option<f64> {
    let shares = panels.iter().filter(|panel| panel.shown).filter_map(|panel| {
        let [first, second] = &panel.series[..] else { return None };
        let peak = first.y.iter().fold(0.0_f64, |peak, y| peak.max(y.abs()));
        let difference_of_runs =
            first.y.iter().zip(&second.y).map(|(a, b)| (a - b).abs()).fold(0.0_f64, f64::max);
        (first.y.len() == second.y.len() && peak > 0.0).then(|| difference_of_runs / peak)
    });
    shares.reduce(f64::max)
}

/// Reads the trace whose nonlinear model is drawn in place of the linear one.
pub(crate) fn other_trace(path: &Path) -> Result<FigureTable, PlotError> {
    let table = FigureTable::open(path, MODEL_KINDS)?;
    table.source.expect(FigureKind::TRACE, "--against", "`sweep trace` writes a trace")?;
    Ok(table)
}

/// Returns the name of a file without its ending.
fn stem(table: &FigureTable) -> String {
    table.source.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns distinct names of two traces: the names of their runs, or the values in which their
/// points differ, or else their files' names.
fn distinct_names(one: &FigureTable, other: &FigureTable) -> [String; 2] {
    let tables = [one, other];
    let names = tables.map(|table| table.source.run_name.clone().unwrap_or_else(|| stem(table)));
    if names[0] != names[1] {
        return names;
    }
    let at = tables.map(|table| together::at(&table.source));
    let own = |side: usize| -> Vec<String> {
        let differs = at[side].iter().filter(|own| !at[1 - side].contains(own));
        differs.map(|(name, value)| parameter(name, *value)).collect()
    };
    let named = [own(0), own(1)].map(|words| words.join(", "));
    if named[0] != named[1] && named.iter().all(|name| !name.is_empty()) {
        return named;
    }
    tables.map(stem)
}

/// Returns a parameter and its value within a sentence.
fn parameter(name: &str, value: f64) -> String {
    label::with_value(&label::words(name).to_lowercase(), value, &label::unit_of_name(name))
}

/// Returns the notes on the least gaps and on the difference of two runs.
fn common_notes(least_gaps_mm: &[(String, f64)], difference_of_runs: Option<f64>) -> Vec<String> {
    let gaps = least_gaps_mm.iter().map(|(name, gap)| format!("{gap:.2} mm {name}"));
    let gaps = gaps.collect::<Vec<_>>().join(", ");
    let gaps = (!gaps.is_empty()).then(|| format!("least gap {gaps}"));
    let difference_of_runs = difference_of_runs.map(|difference_of_runs| {
        format!("largest difference {difference_of_runs:.1e} of the peak")
    });
    gaps.into_iter().chain(difference_of_runs).collect()
}

/// Returns the least gap of each model that has one, in the displayed unit.
fn least_gaps(gaps: &[Series]) -> Vec<(String, f64)> {
    gaps.iter()
        .filter_map(|series| {
            let (least, _) = extremes(series.y.iter().copied())?;
            Some((series.name.trim_end_matches(" model").to_owned(), least))
        })
        .collect()
}

/// Returns the subtitle: name of the run, unbalance and damping, the rest of the point if the file
/// has it, the least gaps (mm), and the difference of two runs.
pub(crate) fn subtitle(
    table: &FigureTable,
    least_gaps_mm: &[(String, f64)],
    difference_of_runs: Option<f64>,
) -> String {
    let machine_sections = unbalance_and_damping(table);
    let at = together::at(&table.source);
    let further =
        at.iter().filter(|(name, _)| machine_sections.iter().all(|(known, _)| known != name));
    let further = further.map(|(name, value)| (name.as_str(), *value));
    // Settings of the command line are part of the run's name.
    let set = table.source.find("set");
    let is_new = |(name, value): &(&str, f64)| set.is_none_or(|set| set[*name] != *value);
    let phrase = machine_sections.iter().copied().chain(further).filter(is_new);
    let mut parts = table.source.notes(phrase.map(|(name, value)| parameter(name, value)));
    parts.extend(common_notes(least_gaps_mm, difference_of_runs));
    if let Some(rows) = table.bucket_rows {
        parts.push(format!("least and greatest of every {rows} instants"));
    }
    parts.join(" · ")
}

/// Returns the ranges of unstable speeds in the options' stability file, rpm.
pub(crate) fn unstable_speeds(
    table: &FigureTable,
    options: &WasherFigures,
) -> Result<Vec<[f64; 2]>, PlotError> {
    match &options.stability {
        Some(path) => Ok(stability::read_unstable(table, path)?.speeds),
        None => Ok(Vec::new()),
    }
}

/// Returns the resonance speeds of the options, rpm, and a note for the subtitle if the modes file
/// is one of another machine. Resonances hardly depend on unbalance and damping, so that one modes
/// file serves all points of a machine.
pub(crate) fn resonances(
    table: &FigureTable,
    options: &WasherFigures,
) -> Result<(Vec<f64>, String), PlotError> {
    let mut speeds = options.resonances_rpm.clone();
    let mut note = String::new();
    if let Some(path) = &options.modes {
        let modes = FigureTable::open(path, MODEL_KINDS)?;
        speeds.extend(campbell::resonances(&modes)?);
        let files =
            [(&table.source, &together::at(&table.source)), (&modes.source, &NamedPoint::new())];
        let split_unit = together::plan_differences(files, MACHINE);
        if !split_unit.is_empty() {
            note = format!(
                " · resonances of another machine: {}",
                together::list_first(&split_unit, 1)
            );
        }
    }
    Ok((speeds, note))
}

/// Returns the instants at which the speed passes each resonance, in order of time.
fn passages(time: &[f64], speed: &[f64], resonances: &[f64]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    for k in 1..time.len().min(speed.len()) {
        for &resonance in resonances {
            let before = speed[k - 1] - resonance;
            let after = speed[k] - resonance;
            if (before < 0.0) != (after < 0.0) && before.is_finite() && after.is_finite() {
                let part = before / (before - after);
                found.push((time[k - 1] + part * (time[k] - time[k - 1]), resonance));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A peak that only touches a resonance is one passage, not two.
    found.dedup();
    found
}

fn panel(name: &str, label: Label, shown: bool, series: Vec<Series>) -> ChartPanel {
    let label = Label { words: label::capitalised(&label.words), ..label };
    ChartPanel { shown, height: 165.0, ..ChartPanel::new(name, label, series) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_is_passed_while_speed_rises_and_falls() {
        let time: Vec<f64> = (0..=8).map(f64::from).collect();
        let speed: Vec<f64> = time.iter().map(|t| 50.0 * (4.0 - (t - 4.0).abs())).collect();
        assert_eq!(passages(&time, &speed, &[75.0, 500.0]), [(1.5, 75.0), (6.5, 75.0)]);
        assert_eq!(passages(&time, &speed, &[200.0]), [(4.0, 200.0)]);
    }
}
