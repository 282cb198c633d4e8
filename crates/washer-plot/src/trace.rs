//! Time histories of both models at one point (the paper's Figs. 6 and 9 to 11).

use std::path::Path;
use std::rc::Rc;

use crate::WasherFigures;
use crate::kinds::{KNOWN, MACHINE, mark_of_speed};
use crate::machine::machine;
use crate::{campbell, stability};
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::read::Kind;
use sweep_plot::table::Table;
use sweep_plot::together::{self, At};
use sweep_plot::{INK, LINEAR, NONLINEAR, PlotError, extremes};

/// The chart of a trace file.
///
/// # Errors
/// [`PlotError::Undrawable`] without time, [`PlotError::Unfit`] for an unknown channel, and as
/// [`campbell::resonances`] for the modes file that gives the resonance speeds.
pub(crate) fn chart(table: &Table, options: &WasherFigures) -> Result<Chart, PlotError> {
    let time = Rc::new(table.numbers("time_s")?.to_vec());
    if time.len() < 2 {
        return Err(table.source.empty("a trace needs at least two instants"));
    }
    if table.column("point").is_some() {
        let path = table.source.path.display();
        return Err(PlotError::Unfit(format!(
            "{path} holds traces of many points, and a figure shows one: `sweep trace --point N`"
        )));
    }
    let sides = sides(table);
    let found = quantities(table, sides);
    let names: Vec<&str> = found.iter().map(|quantity| quantity.name).collect();
    let is_shown = stability::shown(&table.source, &names, &options.channels)?;
    // Where no channel is usual, all are, and nothing else that is in the file.
    let any = !options.channels.is_empty();
    let shown =
        found.iter().zip(is_shown).filter(|(of, is_shown)| *is_shown && (any || of.channel));
    let shown: Vec<&str> = shown.map(|(quantity, _)| quantity.name).collect();
    let other = options.against.as_ref().map(|path| other_trace(path)).transpose()?;
    let names = match &other {
        Some(other) => told_apart(table, other),
        None => sides.map(format_side),
    };
    // The second curve lies in front; where it hides the first one, this must shine through.
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
    let of = |quantity: &Quantity<'_>| {
        let (name, (unit, factor)) = (quantity.name, label::shown(quantity.unit));
        let is_channel = quantity.channel && sides == MODELS;
        let words = if is_channel { label::channel(name) } else { label::words(name) };
        let lines = pair(&quantity.columns, factor);
        panel(name, Label::new(&words, unit), shown.contains(&name), lines)
    };
    let mut panels: Vec<ChartPanel> = found.iter().map(of).collect();
    // Rows of two files that were thinned do not lie at the same instants.
    let whole = other.as_ref().is_some_and(|other| table.stretch.or(other.stretch).is_none());
    let apart = if whole { difference(&panels) } else { None };
    for (name, column) in table.with_prefix("residual_") {
        let (unit, factor) = label::shown(&column.facts.unit);
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
        // A gap that stays wide would be a flat line at the top of a panel that reaches down to
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
        marks.extend(passed.map(|(x, resonance)| mark_of_speed(x, resonance)));
        shades = stability::stretches_within(&time, speed, &unstable);
        let x = Rc::clone(&time);
        let series = Series::new("", INK, x, speed.to_vec(), Style::Solid(2.0));
        let spin = panel("speed", Label::new("spin", "rpm"), true, vec![series]);
        panels.push(ChartPanel { height: 130.0, ..spin });
    }
    Ok(Chart {
        title: match &other {
            Some(_) => "Nonlinear motion from static equilibrium".to_owned(),
            None if sides == FITTED => "A measurement, and the model fitted to it".to_owned(),
            None => "Motion of both models from static equilibrium".to_owned(),
        },
        subtitle: match &other {
            // What one of them is would be wrong of the other.
            Some(_) => of_both(&least, apart).join(" · "),
            None => subtitle(table, &least, apart),
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

/// What stands before the columns of both sides of a trace, and of a fit.
const MODELS: [&str; 2] = ["nonlinear", "linear"];
const FITTED: [&str; 2] = ["measured", "model"];

/// The sides of a file.
fn sides(table: &Table) -> [&'static str; 2] {
    if table.with_prefix("measured_").is_empty() { MODELS } else { FITTED }
}

/// A side in the legend.
fn format_side(side: &str) -> String {
    if MODELS.contains(&side) { format!("{side} model") } else { side.to_owned() }
}

/// What a trace holds of both models over time.
struct Quantity<'a> {
    /// A channel's name; of a coordinate, a speed or a force what stands before the model's name:
    /// `spring_1_tension`.
    name: &'a str,
    unit: &'a str,
    channel: bool,
    /// Of both sides.
    columns: [String; 2],
}

/// Channels first, then states and forces; the gap has its own panel.
fn quantities<'a>(table: &'a Table, sides: [&str; 2]) -> Vec<Quantity<'a>> {
    let channels = table.with_prefix(&format!("{}_", sides[0])).into_iter();
    let channels = channels.map(|(name, column)| {
        let own = Some(column.facts.unit.as_str()).filter(|unit| !unit.is_empty());
        let unit = own.unwrap_or(label::unit_of_channel(name));
        Quantity { name, unit, channel: true, columns: sides.map(|side| format!("{side}_{name}")) }
    });
    let numbers = table.columns.iter().filter(|column| column.numbers().is_some());
    let further = numbers.filter_map(|column| {
        let split = column.facts.name.split_once("_nonlinear_");
        let (name, end) = split.filter(|(name, _)| *name != "gap")?;
        let columns = sides.map(|side| format!("{name}_{side}_{end}"));
        Some(Quantity { name, unit: &column.facts.unit, channel: false, columns })
    });
    channels.chain(further).collect()
}

/// The largest difference of two curves over the same instants in any panel shown, as a share of
/// the first one's peak.
fn difference(panels: &[ChartPanel]) -> Option<f64> {
    let shares = panels.iter().filter(|panel| panel.shown).filter_map(|panel| {
        let [first, second] = &panel.series[..] else { return None };
        let peak = first.y.iter().fold(0.0_f64, |peak, y| peak.max(y.abs()));
        let apart =
            first.y.iter().zip(&second.y).map(|(a, b)| (a - b).abs()).fold(0.0_f64, f64::max);
        (first.y.len() == second.y.len() && peak > 0.0).then(|| apart / peak)
    });
    shares.reduce(f64::max)
}

/// The trace whose nonlinear model is drawn in place of the linear one.
pub(crate) fn other_trace(path: &Path) -> Result<Table, PlotError> {
    let table = Table::open(path, KNOWN)?;
    table.source.expect(Kind::TRACE, "--against", "`sweep trace` writes a trace")?;
    Ok(table)
}

/// The name of a file without its ending.
fn stem(table: &Table) -> String {
    table.source.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// What two traces are called, so that they are told apart: by their runs' names, or what `--at`
/// says otherwise of them, or else by their files.
fn told_apart(one: &Table, other: &Table) -> [String; 2] {
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

/// A parameter and its value within a sentence.
fn parameter(name: &str, value: f64) -> String {
    label::valued(&label::words(name).to_lowercase(), value, &label::unit_of_name(name))
}

/// What is so of both motions together.
fn of_both(least_gaps_mm: &[(String, f64)], apart: Option<f64>) -> Vec<String> {
    let gaps = least_gaps_mm.iter().map(|(name, gap)| format!("{gap:.2} mm {name}"));
    let gaps = gaps.collect::<Vec<_>>().join(", ");
    let gaps = (!gaps.is_empty()).then(|| format!("least gap {gaps}"));
    let apart = apart.map(|apart| format!("largest difference {apart:.1e} of the peak"));
    gaps.into_iter().chain(apart).collect()
}

/// The least gap of each model that has one, in the unit shown.
fn least_gaps(gaps: &[Series]) -> Vec<(String, f64)> {
    gaps.iter()
        .filter_map(|series| {
            let (least, _) = extremes(series.y.iter().copied())?;
            Some((series.name.trim_end_matches(" model").to_owned(), least))
        })
        .collect()
}

/// Name of the run, its unbalance and damping, the rest of the point if the file says which, the
/// least gaps (mm), and how far two runs are apart.
pub(crate) fn subtitle(
    table: &Table,
    least_gaps_mm: &[(String, f64)],
    apart: Option<f64>,
) -> String {
    let (of_machine, at) = (machine(table), together::at(&table.source));
    let further = at.iter().filter(|(name, _)| of_machine.iter().all(|(known, _)| known != name));
    let further = further.map(|(name, value)| (name.as_str(), *value));
    // What was set stands in the name.
    let set = table.source.find("set");
    let is_new = |(name, value): &(&str, f64)| set.is_none_or(|set| set[*name] != *value);
    let said = of_machine.iter().copied().chain(further).filter(is_new);
    let mut parts = table.source.notes(said.map(|(name, value)| parameter(name, value)));
    parts.extend(of_both(least_gaps_mm, apart));
    if let Some(rows) = table.stretch {
        parts.push(format!("least and greatest of every {rows} instants"));
    }
    parts.join(" · ")
}

/// The ranges of unstable speeds that the options name, rpm.
pub(crate) fn unstable_speeds(
    table: &Table,
    options: &WasherFigures,
) -> Result<Vec<[f64; 2]>, PlotError> {
    match &options.stability {
        Some(path) => Ok(stability::unstable_of(table, path)?.speeds),
        None => Ok(Vec::new()),
    }
}

/// The resonance speeds that the options name, rpm, and for the subtitle where the machine whose
/// modes they are is another one. Resonances hardly move with unbalance and damping, so the modes
/// of a machine serve all its points.
pub(crate) fn resonances(
    table: &Table,
    options: &WasherFigures,
) -> Result<(Vec<f64>, String), PlotError> {
    let mut speeds = options.resonances_rpm.clone();
    let mut note = String::new();
    if let Some(path) = &options.modes {
        let modes = Table::open(path, KNOWN)?;
        speeds.extend(campbell::resonances(&modes)?);
        let files = [(&table.source, &together::at(&table.source)), (&modes.source, &At::new())];
        let parted = together::parted(files, MACHINE);
        if !parted.is_empty() {
            note = format!(" · resonances of another machine: {}", together::some(&parted, 1));
        }
    }
    Ok((speeds, note))
}

/// Instants at which the speed passes each resonance, upwards or downwards, in order of time.
fn passages(time: &[f64], speed: &[f64], resonances: &[f64]) -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    for k in 1..time.len().min(speed.len()) {
        for &resonance in resonances {
            let (before, after) = (speed[k - 1] - resonance, speed[k] - resonance);
            if (before < 0.0) != (after < 0.0) && before.is_finite() && after.is_finite() {
                let part = before / (before - after);
                found.push((time[k - 1] + part * (time[k] - time[k - 1]), resonance));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A peak that only touches a resonance is one passage, not one up and one down.
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
    fn a_resonance_is_passed_on_the_way_up_and_down() {
        let time: Vec<f64> = (0..=8).map(f64::from).collect();
        let speed: Vec<f64> = time.iter().map(|t| 50.0 * (4.0 - (t - 4.0).abs())).collect();
        assert_eq!(passages(&time, &speed, &[75.0, 500.0]), [(1.5, 75.0), (6.5, 75.0)]);
        assert_eq!(passages(&time, &speed, &[200.0]), [(4.0, 200.0)]);
    }
}
