//! What held speeds end in: every motion a dot over the speed, in the colour of its kind, and the
//! periodic response as a line.

use std::path::Path;

use crate::WasherFigures;
use crate::kinds::MACHINE;
use crate::stability::{Held, channels_of, columns_of, over_speeds, panel, response, shown};
use crate::{passages, trace};
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::read::{ColumnFacts, Source};
use sweep_plot::together::{self, At};
use sweep_plot::{Colour, DISTINCT, FAILED, INK, NONLINEAR, PlotError, extremes};

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

/// The curve of a trace's way up.
const RISING: &str = "nonlinear model, speed rising";

/// Deviations that differ by this factor are drawn by their logarithms.
const WIDE: f64 = 10.0;

/// Columns of states once a turn: their turn, yaw and pitch of the tub.
const TURN: &str = "turn";
const YAW: &str = "q5_rad";
const PITCH: &str = "q6_rad";

/// A motion: its speed, kind, and deviation by channel.
type Motion = (f64, usize, Vec<f64>);

/// The chart of a dwell file's one point: deviations over speed.
///
/// # Errors
/// As [`Held::one`] and [`shown`].
pub(crate) fn chart(source: &Source, at: &At, options: &WasherFigures) -> Result<Chart, PlotError> {
    let channels = channels_of(source, "periodic");
    let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let is_shown = shown(source, &names, &options.channels)?;
    let held = Held::one(source, at, "--at")?;
    let motions = motions(source, &held, &channels)?;
    let one = held.read(&columns_of(&channels, ["linear", "periodic"]))?.remove(0);
    let passing = options.against.as_ref().map(|path| passing(source, &held, path)).transpose()?;
    let of_kind = |kind: usize| motions.iter().filter(move |(_, of, _)| *of == kind);
    let (first, last) = (one.speed.first().copied(), one.speed.last().copied());
    let is_held = |speed: &f64| first <= Some(*speed) && Some(*speed) <= last;
    let panels = channels.iter().enumerate().map(|(k, (name, facts))| {
        let (_, factor) = label::shown(&facts.unit);
        let mut series = response("periodic response", &one, k, factor);
        for (kind, (_, words, colour)) in KINDS.iter().enumerate() {
            let ends = of_kind(kind).map(|(speed, _, values)| (speed, values[k] * factor));
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
        let motions = series.iter().flat_map(|series| &series.y).copied();
        let log =
            extremes(motions.filter(|y| *y > 0.0)).is_some_and(|(low, high)| high > WIDE * low);
        ChartPanel { height: 190.0, log, ..panel((name, facts), is_shown[k], series) }
    });
    let titles = ["What a held speed ends in", "largest deviation from equilibrium"];
    Ok(over_speeds(titles, &held, &one, panels.collect()))
}

/// The chart of how far a run goes in each turn that passes over these speeds.
///
/// # Errors
/// [`PlotError::Unfit`] for a file that is no trace or of another machine.
fn passing(source: &Source, held: &Held<'_>, path: &Path) -> Result<Chart, PlotError> {
    let trace = trace::other_trace(path)?;
    let files = [(&trace.source, &together::at(&trace.source)), (source, &held.values())];
    together::agree("--against", path, files, MACHINE)?;
    passages::chart(&trace, &WasherFigures::default())
}

/// The motions at every speed.
fn motions(
    source: &Source,
    held: &Held<'_>,
    channels: &[(&str, &ColumnFacts)],
) -> Result<Vec<Motion>, PlotError> {
    let mut columns = columns_of(channels, ["nonlinear"]);
    columns.push(TURN.to_owned());
    let has_turns = source.column(TURN).is_some();
    let mut motions = Vec::new();
    held.each_row(&columns, |_, mut row| {
        // The first turn of each motion.
        if row.values.pop().is_some_and(|turn| turn <= 0.0) || !has_turns {
            motions.push((row.speed, place_of(row.kind), row.values));
        }
    })?;
    Ok(motions)
}

/// The place of a kind in [`KINDS`].
fn place_of(kind: Option<&str>) -> usize {
    let kind = kind.unwrap_or_default();
    KINDS.iter().position(|(known, ..)| *known == kind).unwrap_or(KINDS.len() - 1)
}

/// The chart of a dwell file's states once a turn: pitch of the tub over its yaw, the motions of
/// each speed in a panel.
///
/// # Errors
/// As [`Held::one`]; [`PlotError::Undrawable`] where no states were kept.
pub(crate) fn sections(source: &Source, at: &At) -> Result<Chart, PlotError> {
    let held = Held::one(source, at, "--at")?;
    let columns = ["motion", YAW, PITCH];
    if columns.into_iter().any(|name| source.column(name).is_none()) {
        return Err(source.empty("it keeps no states: `sweep dwell --sections N` does"));
    }
    // Speed, motion, its kind, and its states by yaw.
    let mut found: Vec<(f64, f64, usize, Vec<[f64; 2]>)> = Vec::new();
    held.each_row(&columns, |_, row| {
        let [motion, yaw, pitch] = [0, 1, 2].map(|k| row.values[k]);
        let state = [1e3 * yaw, 1e3 * pitch];
        match found.last_mut().filter(|last| (last.0, last.1) == (row.speed, motion)) {
            Some((.., states)) => states.push(state),
            None => found.push((row.speed, motion, place_of(row.kind), vec![state])),
        }
    })?;
    let mut panels: Vec<ChartPanel> = Vec::new();
    for (speed, motion, kind, mut states) in found {
        states.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let (_, words, colour) = KINDS[kind];
        let said = format!("{} rpm", label::significant(speed, 6));
        let further = DISTINCT[motion as usize % DISTINCT.len()];
        let colour = if motion == 0.0 { colour } else { further };
        let name = format!("motion {motion}: {words}");
        let [yaw, pitch]: [Vec<f64>; 2] =
            [0, 1].map(|k| states.iter().map(|state| state[k]).collect());
        let series = Series::new(name, colour, yaw, pitch, Style::Dots);
        match panels.last_mut().filter(|panel| panel.name == said) {
            Some(panel) => panel.series.push(series),
            None => {
                let label = Label::new(&format!("Pitch at {said}"), "mrad");
                panels.push(ChartPanel::new(&said, label, vec![series]));
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
