//! Charts of dwell files: a dot for each attractor over the held speed, in the colour of its kind,
//! and the periodic response as a line.

use std::path::Path;

use crate::WasherFigures;
use crate::kinds::MACHINE;
use crate::stability::{
    HeldPoints, channels_of, columns_of, over_speeds, panel, response, shown_channels,
};
use crate::{passages, trace};
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::read::{ColumnFacts, FigureFile};
use sweep_plot::together::{self, NamedPoint};
use sweep_plot::{Colour, DISTINCT, FAILED, INK, NONLINEAR, PlotError, extremes};

/// The kinds of attractors by their name in the file, in words, and with their colours. The last
/// one stands for motions that did not settle.
const ATTRACTOR_KINDS: [(&str, &str, Colour); 6] = [
    ("periodic", "repeats every turn", NONLINEAR),
    ("periodic_2", "every second turn", DISTINCT[2]),
    ("periodic_m", "every few turns", DISTINCT[5]),
    ("quasi_periodic", "two frequencies", DISTINCT[4]),
    ("chaotic", "chaotic", DISTINCT[3]),
    ("", "not settled", FAILED),
];

/// The name of the curve of a trace while the speed rises.
const RISING: &str = "nonlinear model, speed rising";

/// Minimum ratio of the largest to the smallest deviation for a logarithmic axis. Basis: on a
/// linear axis the smaller ones would be flat.
const LOG_RATIO: f64 = 10.0;

/// The column of the turn at which a state was recorded.
const TURN: &str = "turn";
/// The column of the tub's yaw in states once a turn.
const YAW: &str = "q5_rad";
/// The column of the tub's pitch in states once a turn.
const PITCH: &str = "q6_rad";

/// An attractor: its speed, the index of its kind, and its deviation by channel.
type Attractor = (f64, usize, Vec<f64>);

/// Draws the deviations at one point of a dwell file over speed.
///
/// # Errors
/// The errors of [`HeldPoints::one`] and [`shown_channels`].
pub(crate) fn chart(
    source: &FigureFile,
    at: &NamedPoint,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let channels = channels_of(source, "periodic");
    let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let is_shown = shown_channels(source, &names, &options.channels)?;
    let held = HeldPoints::one(source, at, "--at")?;
    let attractors = attractors(source, &held, &channels)?;
    let one = held.read(&columns_of(&channels, ["linear", "periodic"]))?.remove(0);
    let passing =
        options.against.as_ref().map(|path| passing_run(source, &held, path)).transpose()?;
    let attractors_of = |kind: usize| attractors.iter().filter(move |(_, own, _)| *own == kind);
    let first = one.speed.first().copied();
    let last = one.speed.last().copied();
    let is_held = |speed: &f64| first <= Some(*speed) && Some(*speed) <= last;
    let panels = channels.iter().enumerate().map(|(k, (name, facts))| {
        let (_, factor) = label::display_unit(&facts.unit);
        let mut series = response("periodic response", &one, k, factor);
        for (kind, (_, words, colour)) in ATTRACTOR_KINDS.iter().enumerate() {
            let ends = attractors_of(kind).map(|(speed, _, values)| (speed, values[k] * factor));
            let (x, y): (Vec<f64>, Vec<f64>) = ends.unzip();
            if !y.is_empty() {
                let name = format!("ends in: {words}");
                series.push(Series::new(name, *colour, x, y, Style::Dots));
            }
        }
        let runs = passing.iter().flat_map(|run| &run.panels).filter(|panel| panel.name == *name);
        let runs = runs.flat_map(|panel| &panel.series);
        let rising = runs.filter(|run| run.name == RISING);
        series.extend(rising.map(|run| {
            let held = run.x.iter().zip(&run.y).filter(|(speed, _)| is_held(speed));
            let (x, y): (Vec<f64>, Vec<f64>) = held.unzip();
            Series::new("a run that passes these speeds", INK, x, y, Style::Solid(1.4))
        }));
        let attractors = series.iter().flat_map(|series| &series.y).copied();
        let log = extremes(attractors.filter(|y| *y > 0.0))
            .is_some_and(|(low, high)| high > LOG_RATIO * low);
        ChartPanel { height: 190.0, log, ..panel((name, facts), is_shown[k], series) }
    });
    let titles = ["What a held speed ends in", "largest deviation from equilibrium"];
    Ok(over_speeds(titles, &held, &one, panels.collect()))
}

/// Draws the largest deviation in each turn of a run that passes these speeds.
///
/// # Errors
/// [`PlotError::Unfit`] for a file that is no trace or of another machine.
fn passing_run(
    source: &FigureFile,
    held: &HeldPoints<'_>,
    path: &Path,
) -> Result<Chart, PlotError> {
    let trace = trace::other_trace(path)?;
    let files = [(&trace.source, &together::at(&trace.source)), (source, &held.values())];
    together::check_agreement("--against", path, files, MACHINE)?;
    passages::chart(&trace, &WasherFigures::default())
}

/// Reads the attractors at every speed.
fn attractors(
    source: &FigureFile,
    held: &HeldPoints<'_>,
    channels: &[(&str, &ColumnFacts)],
) -> Result<Vec<Attractor>, PlotError> {
    let mut columns = columns_of(channels, ["nonlinear"]);
    columns.push(TURN.to_owned());
    let has_turns = source.column(TURN).is_some();
    let mut attractors = Vec::new();
    held.each_row(&columns, |_, mut row| {
        // An attractor has a row for each turn; the first one stands for it.
        if row.values.pop().is_some_and(|turn| turn <= 0.0) || !has_turns {
            attractors.push((row.speed, kind_index(row.kind), row.values));
        }
    })?;
    Ok(attractors)
}

/// Returns the index of a kind in [`ATTRACTOR_KINDS`].
fn kind_index(kind: Option<&str>) -> usize {
    let kind = kind.unwrap_or_default();
    ATTRACTOR_KINDS
        .iter()
        .position(|(known, ..)| *known == kind)
        .unwrap_or(ATTRACTOR_KINDS.len() - 1)
}

/// Draws the states once a turn of a dwell file (a Poincaré section): pitch of the tub over its
/// yaw, with a panel for each speed.
///
/// # Errors
/// The errors of [`HeldPoints::one`]; [`PlotError::Undrawable`] if the file has no states.
pub(crate) fn sections(source: &FigureFile, at: &NamedPoint) -> Result<Chart, PlotError> {
    let held = HeldPoints::one(source, at, "--at")?;
    let columns = ["motion", YAW, PITCH];
    if columns.into_iter().any(|name| source.column(name).is_none()) {
        return Err(source.nothing_to_draw("it keeps no states: `sweep dwell --sections N` does"));
    }
    // Each entry has the speed, the attractor's number, its kind, and its states.
    let mut found: Vec<(f64, f64, usize, Vec<[f64; 2]>)> = Vec::new();
    held.each_row(&columns, |_, row| {
        let [motion, yaw, pitch] = [0, 1, 2].map(|k| row.values[k]);
        let state = [1e3 * yaw, 1e3 * pitch];
        match found.last_mut().filter(|last| (last.0, last.1) == (row.speed, motion)) {
            Some((.., states)) => states.push(state),
            None => found.push((row.speed, motion, kind_index(row.kind), vec![state])),
        }
    })?;
    let mut panels: Vec<ChartPanel> = Vec::new();
    for (speed, motion, kind, mut states) in found {
        states.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let (_, words, colour) = ATTRACTOR_KINDS[kind];
        let phrase = format!("{} rpm", label::significant(speed, 6));
        let further = DISTINCT[motion as usize % DISTINCT.len()];
        let colour = if motion == 0.0 { colour } else { further };
        let name = format!("motion {motion}: {words}");
        let [yaw, pitch]: [Vec<f64>; 2] =
            [0, 1].map(|k| states.iter().map(|state| state[k]).collect());
        let series = Series::new(name, colour, yaw, pitch, Style::Dots);
        match panels.last_mut().filter(|panel| panel.name == phrase) {
            Some(panel) => panel.series.push(series),
            None => {
                let label = Label::new(&format!("Pitch at {phrase}"), "mrad");
                panels.push(ChartPanel::new(&phrase, label, vec![series]));
            }
        }
    }
    Ok(Chart {
        title: "States once a turn, where the unbalance is up".to_owned(),
        subtitle: held.notes().join(" · "),
        x_label: Label::new("Yaw of the tub from equilibrium", "mrad"),
        panels,
        ..Chart::default()
    })
}
