//! Charts of dwell files: a dot for each attractor over the held speed, in the colour of its kind,
//! and the periodic response as a line.

use std::path::Path;

use crate::WasherFigures;
use crate::kinds::MACHINE_SECTIONS;
use crate::stability::{
    HeldPoints, channel_columns, channel_panel, channels_with_kind, response_series,
    shown_channels, speed_chart,
};
use crate::{passages, trace};
use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::{self, Label};
use sweep_plot::read::{ColumnFacts, FigureFile};
use sweep_plot::together::{self, NamedPoint};
use sweep_plot::{
    Colour, DISTINCT_COLOURS, FAILED_COLOUR, INK, NONLINEAR_COLOUR, PlotError, extremes,
};

/// The kinds of attractors by their name in the file, in words, and with their colours. The last
/// one stands for motions that did not settle.
const ATTRACTOR_KINDS: [(&str, &str, Colour); 6] = [
    ("periodic", "repeats every turn", NONLINEAR_COLOUR),
    ("periodic_2", "every second turn", DISTINCT_COLOURS[2]),
    ("periodic_m", "every few turns", DISTINCT_COLOURS[5]),
    ("quasi_periodic", "two frequencies", DISTINCT_COLOURS[4]),
    ("chaotic", "chaotic", DISTINCT_COLOURS[3]),
    ("", "not settled", FAILED_COLOUR),
];

/// The name of the curve of a trace while the speed rises.
const RISING_SERIES: &str = "nonlinear model, speed rising";

/// Minimum ratio of the largest to the smallest deviation for a logarithmic axis. Basis: on a
/// linear axis the smaller deviations would be flat. Doubling it gives linear axes to wider ranges.
const MIN_LOG_RATIO: f64 = 10.0;

/// The column of the turn at which a state was recorded.
const TURN_COLUMN: &str = "turn";
/// The column of the tub's yaw in states once a turn.
const YAW_COLUMN: &str = "q5_rad";
/// The column of the tub's pitch in states once a turn.
const PITCH_COLUMN: &str = "q6_rad";

/// An attractor: its speed, the index of its kind, and its deviation by channel.
type DrawnAttractor = (f64, usize, Vec<f64>);

/// Draws the deviations at one point of a dwell file over speed.
///
/// # Errors
/// The errors of [`HeldPoints::single`] and [`shown_channels`].
pub(crate) fn dwell_chart(
    source: &FigureFile,
    fixed_values: &NamedPoint,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let channels = channels_with_kind(source, "periodic");
    let channel_names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let is_shown = shown_channels(source, &channel_names, &options.channels)?;
    let held_points = HeldPoints::single(source, fixed_values, "--at")?;
    let attractors = read_attractors(source, &held_points, &channels)?;
    let curves = held_points.read(&channel_columns(&channels, ["linear", "periodic"]))?.remove(0);
    let passing_chart = options
        .against
        .as_ref()
        .map(|path| draw_passing_run(source, &held_points, path))
        .transpose()?;
    let attractors_by_kind = |kind: usize| {
        attractors.iter().filter(move |(_, kind_of_attractor, _)| *kind_of_attractor == kind)
    };
    let first_speed_rpm = curves.speeds_rpm.first().copied();
    let last_speed_rpm = curves.speeds_rpm.last().copied();
    let is_in_range =
        |speed_rpm: &f64| first_speed_rpm <= Some(*speed_rpm) && Some(*speed_rpm) <= last_speed_rpm;
    let panels = channels.iter().enumerate().map(|(k, (name, facts))| {
        let (_, factor) = label::display_unit(facts.unit());
        let mut series = response_series("periodic response", &curves, k, factor);
        for (kind, (_, words, colour)) in ATTRACTOR_KINDS.iter().enumerate() {
            let attractor_points = attractors_by_kind(kind)
                .map(|(speed_rpm, _, values)| (speed_rpm, values[k] * factor));
            let (x, y): (Vec<f64>, Vec<f64>) = attractor_points.unzip();
            if !y.is_empty() {
                let name = format!("motion at a held speed: {words}");
                series.push(Series::new(name, *colour, x, y, SeriesStyle::Dots));
            }
        }
        let run_curves =
            passing_chart.iter().flat_map(|run| &run.panels).filter(|panel| panel.name == *name);
        let run_curves = run_curves.flat_map(|panel| &panel.series);
        let rising_curves = run_curves.filter(|run| run.name == RISING_SERIES);
        series.extend(rising_curves.map(|run| {
            let turns_in_range =
                run.x.iter().zip(&run.y).filter(|(speed_rpm, _)| is_in_range(speed_rpm));
            let (x, y): (Vec<f64>, Vec<f64>) = turns_in_range.unzip();
            Series::new("a run that passes these speeds", INK, x, y, SeriesStyle::Solid(1.4))
        }));
        let drawn_values = series.iter().flat_map(|series| &series.y).copied();
        let is_log = extremes(drawn_values.filter(|y| *y > 0.0))
            .is_some_and(|(low, high)| high > MIN_LOG_RATIO * low);
        ChartPanel { height: 190.0, is_log, ..channel_panel((name, facts), is_shown[k], series) }
    });
    let titles = ["What a held speed ends in", "largest deviation from equilibrium"];
    Ok(speed_chart(titles, &held_points, &curves, panels.collect()))
}

/// Draws the largest deviation in each turn of a run that passes these speeds.
///
/// # Errors
/// [`PlotError::Unfit`] for a file that is no trace or of another machine.
fn draw_passing_run(
    source: &FigureFile,
    held_points: &HeldPoints<'_>,
    path: &Path,
) -> Result<Chart, PlotError> {
    let trace = trace::read_other_trace(path)?;
    let files = [
        (&trace.source, &together::point_of_trace(&trace.source)),
        (source, &held_points.axis_values()),
    ];
    together::check_agreement("--against", path, files, MACHINE_SECTIONS)?;
    passages::passage_chart(&trace, &WasherFigures::default())
}

/// Reads the attractors at every speed.
fn read_attractors(
    source: &FigureFile,
    held_points: &HeldPoints<'_>,
    channels: &[(&str, &ColumnFacts)],
) -> Result<Vec<DrawnAttractor>, PlotError> {
    let mut columns = channel_columns(channels, ["nonlinear"]);
    columns.push(TURN_COLUMN.to_owned());
    let has_turns = source.column(TURN_COLUMN).is_some();
    let mut attractors = Vec::new();
    held_points.each_row(&columns, |_, mut row| {
        // An attractor has a row for each turn; the first one stands for it.
        if row.values.pop().is_some_and(|turn| turn <= 0.0) || !has_turns {
            attractors.push((row.speed_rpm, kind_index(row.kind), row.values));
        }
    })?;
    Ok(attractors)
}

/// Returns the index of a kind in [`ATTRACTOR_KINDS`].
fn kind_index(kind: Option<&str>) -> usize {
    let kind = kind.unwrap_or_default();
    ATTRACTOR_KINDS
        .iter()
        .position(|(known_kind, ..)| *known_kind == kind)
        .unwrap_or(ATTRACTOR_KINDS.len() - 1)
}

/// Draws the states once a turn of a dwell file (a Poincaré section): pitch of the tub over its
/// yaw, with a panel for each speed.
///
/// # Errors
/// The errors of [`HeldPoints::single`]; [`PlotError::Undrawable`] if the file has no states.
pub(crate) fn section_chart(
    source: &FigureFile,
    fixed_values: &NamedPoint,
) -> Result<Chart, PlotError> {
    let held_points = HeldPoints::single(source, fixed_values, "--at")?;
    let columns = ["motion", YAW_COLUMN, PITCH_COLUMN];
    if columns.into_iter().any(|name| source.column(name).is_none()) {
        return Err(
            source.nothing_to_draw_error("it keeps no states: `sweep dwell --sections N` does")
        );
    }
    // Each entry has the speed, the attractor's number, its kind, and its states.
    let mut attractors: Vec<(f64, f64, usize, Vec<[f64; 2]>)> = Vec::new();
    held_points.each_row(&columns, |_, row| {
        let [motion, yaw, pitch] = [0, 1, 2].map(|k| row.values[k]);
        let angles_mrad = [1e3 * yaw, 1e3 * pitch];
        match attractors.last_mut().filter(|last| (last.0, last.1) == (row.speed_rpm, motion)) {
            Some((.., states)) => states.push(angles_mrad),
            None => {
                attractors.push((row.speed_rpm, motion, kind_index(row.kind), vec![angles_mrad]))
            }
        }
    })?;
    let mut panels: Vec<ChartPanel> = Vec::new();
    for (speed_rpm, motion, kind, mut states) in attractors {
        states.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let (_, words, colour) = ATTRACTOR_KINDS[kind];
        let panel_name = format!("{} rpm", label::format_significant(speed_rpm, 6));
        let colour_of_further_motion = DISTINCT_COLOURS[motion as usize % DISTINCT_COLOURS.len()];
        let colour = if motion == 0.0 { colour } else { colour_of_further_motion };
        let name = format!("motion {motion}: {words}");
        let [yaw, pitch]: [Vec<f64>; 2] =
            [0, 1].map(|k| states.iter().map(|state| state[k]).collect());
        let series = Series::new(name, colour, yaw, pitch, SeriesStyle::Dots);
        match panels.last_mut().filter(|panel| panel.name == panel_name) {
            Some(panel) => panel.series.push(series),
            None => {
                let label = Label::new(&format!("Pitch at {panel_name}"), "mrad");
                panels.push(ChartPanel::new(&panel_name, label, vec![series]));
            }
        }
    }
    Ok(Chart {
        title: "States once a turn, where the unbalance is up".to_owned(),
        subtitle: held_points.notes().join(" · "),
        x_label: Label::new("Yaw of the tub from equilibrium", "mrad"),
        panels,
        ..Chart::default()
    })
}
