//! What held speeds end in: every motion a dot over the speed, in the colour of its kind, and the
//! periodic response as a line.

use crate::PlotOptions;
use crate::chart::{Chart, ChartPanel, Series, Style};
use crate::colour::{DISTINCT, FAILED, LINEAR, NONLINEAR};
use crate::error::PlotError;
use crate::figures::stability::{
    UNSTABLE, axes, axis_columns, one_point, part, row_values, said_within, shown, unstable,
};
use crate::label::{self, Label};
use crate::read::{ColumnFacts, Source};
use crate::scene::Colour;

/// Kinds of motions as the file has them, in words, and their colours; the last is what did not
/// settle.
const KINDS: [(&str, &str, Colour); 6] = [
    ("periodic", "repeats every turn", NONLINEAR),
    ("periodic_2", "every second turn", DISTINCT[2]),
    ("periodic_m", "every few turns", DISTINCT[5]),
    ("quasi_periodic", "two frequencies", DISTINCT[4]),
    ("chaotic", "chaotic", DISTINCT[3]),
    ("", "not settled", FAILED),
];

/// The file's one point over speed.
struct Held {
    speed: Vec<f64>,
    growth: Vec<f64>,
    /// Of each channel by the linear model, and of the periodic response.
    lines: Vec<[Vec<f64>; 2]>,
    /// Of each motion its speed and kind, and of each channel its deviation.
    motions: Vec<(f64, usize, Vec<f64>)>,
}

/// The chart of a dwell file's one point: deviations over speed.
///
/// # Errors
/// As [`one_point`] and [`shown`].
pub(crate) fn chart(source: &Source, options: &PlotOptions) -> Result<Chart, PlotError> {
    let channels: Vec<(&str, &ColumnFacts)> = source
        .with_prefix("nonlinear_")
        .into_iter()
        .filter(|(name, _)| source.column(&format!("periodic_{name}")).is_some())
        .collect();
    let is_shown = shown(source, &channels, &options.channels)?;
    let axes = axes(source);
    let point = one_point(source, &axes, &options.at, "--at")?;
    let held = read(source, &axes, &point, &channels)?;
    // A grid of speeds of the lines, then one of the motions of each kind.
    let of_kind = |kind: usize| held.motions.iter().filter(move |(_, of, _)| *of == kind);
    let mut grids = vec![held.speed.clone()];
    grids.extend((0..KINDS.len()).map(|kind| of_kind(kind).map(|(speed, ..)| *speed).collect()));
    let panels = channels.iter().enumerate().map(|(k, (name, facts))| {
        let (unit, factor) = label::shown(&facts.unit);
        let scaled = |values: &[f64]| values.iter().map(|value| value * factor).collect();
        let [linear, periodic]: [Vec<f64>; 2] =
            [scaled(&held.lines[k][0]), scaled(&held.lines[k][1])];
        let line = |name: &str, colour, y, style| Series {
            name: name.to_owned(),
            colour,
            grid: 0,
            y,
            style,
        };
        let of = |wanted| part(&periodic, &held.growth, wanted);
        let mut series = vec![
            line("linear model", LINEAR, linear, Style::Solid(1.6)),
            line("periodic response, stable", NONLINEAR, of(false), Style::Solid(2.2)),
            line("periodic response, unstable", NONLINEAR, of(true), Style::Dashed),
        ];
        for (kind, (_, words, colour)) in KINDS.iter().enumerate() {
            let y: Vec<f64> = of_kind(kind).map(|(_, _, values)| values[k] * factor).collect();
            if !y.is_empty() {
                let name = format!("ends in: {words}");
                series.push(Series {
                    name,
                    colour: *colour,
                    grid: 1 + kind,
                    y,
                    style: Style::Dots,
                });
            }
        }
        let words = label::capitalised(&label::channel(name));
        ChartPanel {
            shown: is_shown[k],
            height: 190.0,
            ..ChartPanel::new(name, Label::new(&words, unit), series)
        }
    });
    let panels = panels.collect();
    let mut notes: Vec<String> = source.run_name().map(str::to_owned).into_iter().collect();
    notes.extend(axes.iter().zip(&point).map(|(axis, value)| said_within(axis, *value)));
    notes.push("largest deviation from equilibrium".to_owned());
    Ok(Chart {
        title: "What a held speed ends in".to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Constant spin speed", "rpm"),
        shades: unstable(&held.speed, &held.growth),
        shade_meaning: UNSTABLE.to_owned(),
        grids,
        panels,
        ..Chart::default()
    })
}

fn read(
    source: &Source,
    axes: &[&ColumnFacts],
    point: &[f64],
    channels: &[(&str, &ColumnFacts)],
) -> Result<Held, PlotError> {
    let columns: Vec<String> = channels
        .iter()
        .flat_map(|(name, _)| ["linear", "periodic", "nonlinear"].map(|of| format!("{of}_{name}")))
        .collect();
    let mut names: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
    names.extend(["speed_rpm", "growth_per_s", "kind"]);
    names.extend(columns.iter().map(String::as_str));
    let mut held = Held {
        speed: Vec::new(),
        growth: Vec::new(),
        lines: vec![[Vec::new(), Vec::new()]; channels.len()],
        motions: Vec::new(),
    };
    for batch in source.batches(&names)? {
        let batch = batch?;
        let of_axes = axis_columns(&batch, axes)?;
        let (speed, growth) = (batch.numbers("speed_rpm")?, batch.numbers("growth_per_s")?);
        let kinds = batch.words("kind")?;
        let values: Vec<Vec<f64>> =
            columns.iter().map(|name| batch.numbers(name)).collect::<Result<_, _>>()?;
        for row in (0..batch.rows).filter(|&row| row_values(&of_axes, row) == point) {
            if held.speed.last() != Some(&speed[row]) {
                held.speed.push(speed[row]);
                held.growth.push(growth[row]);
                for (k, [linear, periodic]) in held.lines.iter_mut().enumerate() {
                    linear.push(values[3 * k][row]);
                    periodic.push(values[3 * k + 1][row]);
                }
            }
            let kind = kinds[row].unwrap_or_default();
            let kind = KINDS.iter().position(|(known, ..)| *known == kind);
            let deviations = (0..channels.len()).map(|k| values[3 * k + 2][row]).collect();
            held.motions.push((speed[row], kind.unwrap_or(KINDS.len() - 1), deviations));
        }
    }
    Ok(held)
}
