//! Charts of time histories of both models at one point (the paper's Figs. 6 and 9 to 11).

use std::path::Path;
use std::rc::Rc;

use crate::WasherFigures;
use crate::kinds::{MACHINE_SECTIONS, MODEL_KINDS, speed_mark};
use crate::machine::unbalance_and_damping;
use crate::{campbell, stability};
use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::{self, Label};
use sweep_plot::read::FigureKind;
use sweep_plot::table::FigureTable;
use sweep_plot::together::{self, NamedPoint};
use sweep_plot::{INK, LINEAR_COLOUR, NONLINEAR_COLOUR, PlotError, extremes};

/// Draws the chart of a trace file.
///
/// # Errors
/// [`PlotError::Undrawable`] without time, [`PlotError::Unfit`] for an unknown channel, and the
/// errors of [`campbell::read_resonances_rpm`] for the modes file.
pub(crate) fn trace_chart(
    table: &FigureTable,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let times_s = Rc::new(table.numbers("time_s")?.to_vec());
    if times_s.len() < 2 {
        return Err(table.source.nothing_to_draw_error("a trace needs at least two instants"));
    }
    if table.column("point").is_some() {
        let path = table.source.path.display();
        return Err(PlotError::Unfit(format!(
            "{path} holds traces of many points, and a figure shows one: `sweep trace --point N`"
        )));
    }
    let model_prefixes = model_prefixes(table);
    let quantities = trace_quantities(table, model_prefixes);
    let quantity_names: Vec<&str> = quantities.iter().map(|quantity| quantity.name).collect();
    let is_shown = stability::shown_channels(&table.source, &quantity_names, &options.channels)?;
    // States and forces are drawn on request only.
    let is_any_requested = !options.channels.is_empty();
    let shown_names = quantities
        .iter()
        .zip(is_shown)
        .filter(|(quantity, is_shown)| *is_shown && (is_any_requested || quantity.is_channel));
    let shown_names: Vec<&str> = shown_names.map(|(quantity, _)| quantity.name).collect();
    let compared_trace = options.against.as_ref().map(|path| read_other_trace(path)).transpose()?;
    let curve_names = match &compared_trace {
        Some(compared_trace) => distinct_names(table, compared_trace),
        None => model_prefixes.map(curve_name),
    };
    // The second curve is translucent, so that the first one shows through.
    let front_table = compared_trace.as_ref().unwrap_or(table);
    let front_times_s = Rc::new(front_table.numbers("time_s")?.to_vec());
    let curve_sources = [
        (table, Rc::clone(&times_s), NONLINEAR_COLOUR),
        (front_table, front_times_s, LINEAR_COLOUR.with_alpha(165)),
    ];
    let model_curves = |columns: &[String; 2], factor: f64| -> Vec<Series> {
        let model_curve = |k: usize| {
            let ((table, times_s, colour), name) = (&curve_sources[k], curve_names[k].clone());
            let column = table.column(&columns[if compared_trace.is_some() { 0 } else { k }])?;
            let y = column.numbers()?.iter().map(|value| value * factor).collect();
            Some(Series::new(name, *colour, Rc::clone(times_s), y, SeriesStyle::Solid(1.3)))
        };
        (0..2).filter_map(model_curve).collect()
    };
    let quantity_panel = |quantity: &TraceQuantity<'_>| {
        let (name, (unit, factor)) = (quantity.name, label::display_unit(quantity.unit));
        let is_channel = quantity.is_channel && model_prefixes == MODEL_PREFIXES;
        let label_words =
            if is_channel { label::channel_in_words(name) } else { label::name_in_words(name) };
        let series = model_curves(&quantity.columns, factor);
        trace_panel(name, Label::new(&label_words, unit), shown_names.contains(&name), series)
    };
    let mut panels: Vec<ChartPanel> = quantities.iter().map(quantity_panel).collect();
    // Decimated rows of two files do not lie at the same instants.
    let is_comparable = compared_trace
        .as_ref()
        .is_some_and(|compared_trace| table.bucket_rows.or(compared_trace.bucket_rows).is_none());
    let difference_of_runs = if is_comparable { largest_difference(&panels) } else { None };
    for (name, column) in table.with_prefix("residual_") {
        let (unit, factor) = label::display_unit(column.facts.unit());
        let y = column.numbers().unwrap_or_default().iter().map(|value| value * factor).collect();
        let residual = Series::new("residual", INK, Rc::clone(&times_s), y, SeriesStyle::Dots);
        let label_words = format!("residual, {}", label::name_in_words(name));
        let is_shown = shown_names.contains(&name);
        let label = Label::new(&label_words, unit);
        panels.push(trace_panel(&format!("residual_{name}"), label, is_shown, vec![residual]));
    }
    let mut gap_series = model_curves(&["gap_nonlinear_m", "gap_linear_m"].map(str::to_owned), 1e3);
    if compared_trace.is_some() && gap_series.len() < 2 {
        gap_series.clear();
    }
    let least_gaps = least_gaps(&gap_series);
    if !gap_series.is_empty() {
        // If the gap stays wide, it would be a flat line at the top of a panel that reaches down to
        // contact.
        let greatest_gap =
            gap_series.iter().flat_map(|series| &series.y).copied().fold(0.0, f64::max);
        let is_gap_small = least_gaps.iter().any(|(_, gap)| *gap < 0.5 * greatest_gap);
        let levels = if is_gap_small { vec![(0.0, "gap closed".to_owned())] } else { Vec::new() };
        let gap_panel = trace_panel("gap", Label::new("gap, drum to tub", "mm"), true, gap_series);
        panels.push(ChartPanel { levels, ..gap_panel });
    }
    let mut marks = Vec::new();
    let mut shaded_ranges = Vec::new();
    let unstable_ranges = unstable_speeds(table, options)?;
    let (resonances, other_machine_note) = resonances(table, options)?;
    if let Some(speed) = table.column("speed_rpm").and_then(|column| column.numbers()) {
        let passages = passage_times(&times_s, speed, &resonances).into_iter();
        marks.extend(passages.map(|(x, resonance)| speed_mark(x, resonance)));
        shaded_ranges = stability::intervals_within(&times_s, speed, &unstable_ranges);
        let x = Rc::clone(&times_s);
        let series = Series::new("", INK, x, speed.to_vec(), SeriesStyle::Solid(2.0));
        let speed_panel = trace_panel("speed", Label::new("spin", "rpm"), true, vec![series]);
        panels.push(ChartPanel { height: 130.0, ..speed_panel });
    }
    Ok(Chart {
        title: match &compared_trace {
            Some(_) => "Nonlinear motion from static equilibrium".to_owned(),
            None if model_prefixes == FIT_PREFIXES => {
                "A measurement, and the model fitted to it".to_owned()
            }
            None => "Motion of both models from static equilibrium".to_owned(),
        },
        subtitle: match &compared_trace {
            // The point of one trace would be wrong for the other, so that the subtitle has
            // neither.
            Some(_) => common_notes(&least_gaps, difference_of_runs).join(" · "),
            None => subtitle(table, &least_gaps, difference_of_runs),
        } + &other_machine_note,
        x_label: Label::new("Time", "s"),
        panels,
        marks,
        mark_meaning: "resonance speed passed".to_owned(),
        shaded_ranges,
        shade_meaning: stability::UNSTABLE_SPEEDS_MEANING.to_owned(),
        ..Chart::default()
    })
}

/// The prefixes of the columns of both models in a trace.
const MODEL_PREFIXES: [&str; 2] = ["nonlinear", "linear"];
/// The prefixes of the columns of measurement and model in the curves of a fit.
const FIT_PREFIXES: [&str; 2] = ["measured", "model"];

/// Returns the prefixes of a file's columns.
fn model_prefixes(table: &FigureTable) -> [&'static str; 2] {
    if table.with_prefix("measured_").is_empty() { MODEL_PREFIXES } else { FIT_PREFIXES }
}

/// Returns the legend entry of a prefix.
fn curve_name(prefix: &str) -> String {
    if MODEL_PREFIXES.contains(&prefix) { format!("{prefix} model") } else { prefix.to_owned() }
}

/// A quantity that a trace has of both models over time.
struct TraceQuantity<'a> {
    /// The channel's name; for a coordinate, a speed or a force the part before the model's name:
    /// `spring_1_tension`.
    name: &'a str,
    unit: &'a str,
    is_channel: bool,
    /// The columns of both models.
    columns: [String; 2],
}

/// Returns the quantities of a trace: channels first, then states and forces. The gap has a
/// separate panel.
fn trace_quantities<'a>(
    table: &'a FigureTable,
    model_prefixes: [&str; 2],
) -> Vec<TraceQuantity<'a>> {
    let channels = table.with_prefix(&format!("{}_", model_prefixes[0])).into_iter();
    let channels = channels.map(|(name, column)| {
        let file_unit = Some(column.facts.unit()).filter(|unit| !unit.is_empty());
        let unit = file_unit.unwrap_or(label::unit_of_channel(name));
        TraceQuantity {
            name,
            unit,
            is_channel: true,
            columns: model_prefixes.map(|prefix| format!("{prefix}_{name}")),
        }
    });
    let number_columns = table.columns.iter().filter(|column| column.numbers().is_some());
    let states_and_forces = number_columns.filter_map(|column| {
        let name_and_suffix = column.facts.name.split_once("_nonlinear_");
        let (name, unit_suffix) = name_and_suffix.filter(|(name, _)| *name != "gap")?;
        let columns = model_prefixes.map(|prefix| format!("{name}_{prefix}_{unit_suffix}"));
        Some(TraceQuantity { name, unit: column.facts.unit(), is_channel: false, columns })
    });
    channels.chain(states_and_forces).collect()
}

/// Returns the largest difference between the two curves of any panel shown, relative to the first
/// curve's peak.
fn largest_difference(panels: &[ChartPanel]) -> Option<f64> {
    let differences = panels.iter().filter(|panel| panel.is_shown).filter_map(|panel| {
        let [first, second] = &panel.series[..] else { return None };
        let peak = first.y.iter().fold(0.0_f64, |peak, y| peak.max(y.abs()));
        let difference =
            first.y.iter().zip(&second.y).map(|(a, b)| (a - b).abs()).fold(0.0_f64, f64::max);
        (first.y.len() == second.y.len() && peak > 0.0).then(|| difference / peak)
    });
    differences.reduce(f64::max)
}

/// Reads the trace whose nonlinear model is drawn in place of the linear one.
pub(crate) fn read_other_trace(path: &Path) -> Result<FigureTable, PlotError> {
    let table = FigureTable::open(path, MODEL_KINDS)?;
    table.source.expect_kind(FigureKind::TRACE, "--against", "`sweep trace` writes a trace")?;
    Ok(table)
}

/// Returns the name of a file without its ending.
fn file_stem(table: &FigureTable) -> String {
    table.source.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns distinct names of two traces: the names of their runs, or the values in which their
/// points differ, or else their files' names.
fn distinct_names(first: &FigureTable, second: &FigureTable) -> [String; 2] {
    let tables = [first, second];
    let run_names =
        tables.map(|table| table.source.run_name.clone().unwrap_or_else(|| file_stem(table)));
    if run_names[0] != run_names[1] {
        return run_names;
    }
    let points = tables.map(|table| together::point_of_trace(&table.source));
    let differing_values = |index: usize| -> Vec<String> {
        let differing_values_of_point =
            points[index].iter().filter(|value| !points[1 - index].contains(value));
        differing_values_of_point.map(|(name, value)| format_parameter(name, *value)).collect()
    };
    let value_names = [differing_values(0), differing_values(1)].map(|words| words.join(", "));
    if value_names[0] != value_names[1] && value_names.iter().all(|name| !name.is_empty()) {
        return value_names;
    }
    tables.map(file_stem)
}

/// Returns a parameter and its value within a sentence.
fn format_parameter(name: &str, value: f64) -> String {
    label::with_value(&label::name_in_words(name).to_lowercase(), value, &label::unit_of_name(name))
}

/// Returns the notes on the least gaps and on the difference of two runs.
fn common_notes(least_gaps_mm: &[(String, f64)], difference: Option<f64>) -> Vec<String> {
    let gap_phrases = least_gaps_mm.iter().map(|(name, gap)| format!("{gap:.2} mm {name}"));
    let gap_phrases = gap_phrases.collect::<Vec<_>>().join(", ");
    let gap_phrases = (!gap_phrases.is_empty()).then(|| format!("least gap {gap_phrases}"));
    let difference =
        difference.map(|difference| format!("largest difference {difference:.1e} of the peak"));
    gap_phrases.into_iter().chain(difference).collect()
}

/// Returns the least gap of each model that has one, in the displayed unit.
fn least_gaps(gaps: &[Series]) -> Vec<(String, f64)> {
    gaps.iter()
        .filter_map(|series| {
            let (least_gap_mm, _) = extremes(series.y.iter().copied())?;
            Some((series.name.trim_end_matches(" model").to_owned(), least_gap_mm))
        })
        .collect()
}

/// Returns the subtitle: name of the run, unbalance and damping, the other values of the point if
/// the file has them, the least gaps (mm), and the difference of two runs.
pub(crate) fn subtitle(
    table: &FigureTable,
    least_gaps_mm: &[(String, f64)],
    difference_of_runs: Option<f64>,
) -> String {
    let machine_values = unbalance_and_damping(table);
    let point = together::point_of_trace(&table.source);
    let further_values =
        point.iter().filter(|(name, _)| machine_values.iter().all(|(known, _)| known != name));
    let further_values = further_values.map(|(name, value)| (name.as_str(), *value));
    // Settings of the command line are part of the run's name.
    let settings = table.source.find_metadata("set");
    let is_not_in_run_name =
        |(name, value): &(&str, f64)| settings.is_none_or(|settings| settings[*name] != *value);
    let subtitle_values =
        machine_values.iter().copied().chain(further_values).filter(is_not_in_run_name);
    let mut parts =
        table.source.notes(subtitle_values.map(|(name, value)| format_parameter(name, value)));
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
        Some(path) => Ok(stability::read_unstable(table, path)?.speed_ranges_rpm),
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
    let mut speeds_rpm = options.resonances_rpm.clone();
    let mut note = String::new();
    if let Some(path) = &options.modes {
        let modes = FigureTable::open(path, MODEL_KINDS)?;
        speeds_rpm.extend(campbell::read_resonances_rpm(&modes)?);
        let files = [
            (&table.source, &together::point_of_trace(&table.source)),
            (&modes.source, &NamedPoint::new()),
        ];
        let differences = together::plan_differences(files, MACHINE_SECTIONS);
        if !differences.is_empty() {
            note = format!(
                " · resonances of another machine: {}",
                together::join_first(&differences, 1)
            );
        }
    }
    Ok((speeds_rpm, note))
}

/// Returns the instants at which the speed passes each resonance, in order of time.
fn passage_times(times_s: &[f64], speeds_rpm: &[f64], resonances_rpm: &[f64]) -> Vec<(f64, f64)> {
    let mut passages = Vec::new();
    for k in 1..times_s.len().min(speeds_rpm.len()) {
        for &resonance_rpm in resonances_rpm {
            let distance_before = speeds_rpm[k - 1] - resonance_rpm;
            let distance_after = speeds_rpm[k] - resonance_rpm;
            if (distance_before < 0.0) != (distance_after < 0.0)
                && distance_before.is_finite()
                && distance_after.is_finite()
            {
                let fraction = distance_before / (distance_before - distance_after);
                passages.push((
                    times_s[k - 1] + fraction * (times_s[k] - times_s[k - 1]),
                    resonance_rpm,
                ));
            }
        }
    }
    passages.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A peak that only touches a resonance is one passage, not two.
    passages.dedup();
    passages
}

fn trace_panel(name: &str, label: Label, is_shown: bool, series: Vec<Series>) -> ChartPanel {
    let label = Label { words: label::capitalise(&label.words), ..label };
    ChartPanel { is_shown, height: 165.0, ..ChartPanel::new(name, label, series) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_is_passed_while_speed_rises_and_falls() {
        let times_s: Vec<f64> = (0..=8).map(f64::from).collect();
        let speeds_rpm: Vec<f64> = times_s.iter().map(|t| 50.0 * (4.0 - (t - 4.0).abs())).collect();
        assert_eq!(
            passage_times(&times_s, &speeds_rpm, &[75.0, 500.0]),
            [(1.5, 75.0), (6.5, 75.0)]
        );
        assert_eq!(passage_times(&times_s, &speeds_rpm, &[200.0]), [(4.0, 200.0)]);
    }
}
