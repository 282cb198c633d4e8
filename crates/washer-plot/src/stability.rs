//! Charts of responses at constant speeds: the growth of disturbances, and the amplitudes, over
//! speed.

use std::path::Path;

use crate::WasherFigures;
use crate::kinds::{MACHINE_SECTIONS, MODEL_KINDS, STABILITY, speed_mark};
use crate::machine::unbalance_and_damping;
use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::{self, Label};
use sweep_plot::read::{ColumnFacts, FigureFile, list_names};
use sweep_plot::swept::{self, SweptAxis};
use sweep_plot::table::FigureTable;
use sweep_plot::together::{self, NamedPoint};
use sweep_plot::{DISTINCT_COLOURS, LINEAR_COLOUR, NONLINEAR_COLOUR, PlotError};

/// Maximum number of points whose growth is drawn. Basis: each point needs a distinct colour.
/// Doubling it repeats colours.
const MAX_CURVES: usize = DISTINCT_COLOURS.len();

/// The channels whose responses are drawn by default, as in charts of traces.
const DEFAULT_CHANNELS: [&str; 4] = ["tub_front_y", "tub_front_z", "tub_yaw", "tub_pitch"];

/// Maximum number of edges that are marked with their speeds. Basis: labels of more would cover
/// each other.
const MAX_EDGE_MARKS: usize = 16;

/// The legend entry of unstable speeds.
pub(crate) const UNSTABLE_SPEEDS_MEANING: &str =
    "speeds at which the periodic response is unstable";

/// The responses at one point over speed.
#[derive(Clone, Default)]
pub(crate) struct SpeedCurves {
    pub(crate) speeds_rpm: Vec<f64>,
    /// The growth at each speed; NaN without a response.
    pub(crate) growths_per_s: Vec<f64>,
    /// The values of each requested column.
    column_values: Vec<Vec<f64>>,
}

/// Draws the growth of a stability file over speed.
///
/// # Errors
/// The errors of [`HeldPoints::matching`] and [`HeldPoints::read`].
pub(crate) fn growth_chart(
    source: &FigureFile,
    fixed_values: &NamedPoint,
) -> Result<Chart, PlotError> {
    let mut held_points = HeldPoints::matching(source, fixed_values, "--at")?;
    let point_count = held_points.points.len();
    if point_count > MAX_CURVES {
        let curve_indices = (0..MAX_CURVES).map(|k| k * (point_count - 1) / (MAX_CURVES - 1));
        held_points.points = curve_indices.map(|index| held_points.points[index].clone()).collect();
    }
    let curves = held_points.read(&[])?;
    let HeldPoints { axes, points: shown_points, .. } = &held_points;
    let is_varying_axis =
        |k: usize| shown_points.iter().any(|curve| curve[k] != shown_points[0][k]);
    let curve_name = |curve: &[f64]| {
        let varying_axes = axes.iter().zip(curve).enumerate().filter(|(k, _)| is_varying_axis(*k));
        let varying_axes: Vec<String> =
            varying_axes.map(|(_, (axis, value))| format_value(axis, *value)).collect();
        if varying_axes.is_empty() { "growth".to_owned() } else { varying_axes.join(", ") }
    };
    let series = curves.iter().zip(shown_points).enumerate().map(|(k, (curve, values))| {
        let x = curve.speeds_rpm.clone();
        let y = curve.growths_per_s.clone();
        Series::new(curve_name(values), DISTINCT_COLOURS[k], x, y, SeriesStyle::Solid(2.2))
    });
    let constant_axes =
        axes.iter().zip(&shown_points[0]).enumerate().filter(|(k, _)| !is_varying_axis(*k));
    let mut notes =
        source.notes(constant_axes.map(|(_, (axis, value))| format_in_lower_case(axis, *value)));
    if shown_points.len() < point_count {
        notes.push(format!("{} of {point_count} points", shown_points.len()));
    }
    let label = Label::new("Growth of a small disturbance", "1/s");
    let levels = vec![(0.0, "unstable above".to_owned())];
    let channel_panel = ChartPanel { levels, ..ChartPanel::new("growth", label, series.collect()) };
    let (shaded_ranges, edges) = match &curves[..] {
        [curve] => (
            unstable_ranges(&curve.speeds_rpm, &curve.growths_per_s),
            stability_edges(&curve.speeds_rpm, &curve.growths_per_s),
        ),
        _ => Default::default(),
    };
    let edges = edges.into_iter().take(MAX_EDGE_MARKS);
    let marks = edges.map(|edge| speed_mark(edge, edge)).collect();
    Ok(Chart {
        title: "Where a dwell at constant speed is unstable".to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Constant spin speed", "rpm"),
        panels: vec![channel_panel],
        marks,
        mark_meaning: "edge".to_owned(),
        shaded_ranges,
        shade_meaning: UNSTABLE_SPEEDS_MEANING.to_owned(),
        ..Chart::default()
    })
}

/// Draws the amplitudes of the periodic responses of both models at one point of a stability file
/// over speed.
///
/// # Errors
/// Returns the errors of [`HeldPoints::single`]; [`PlotError::Unfit`] for an unknown channel.
pub(crate) fn response_chart(
    source: &FigureFile,
    fixed_values: &NamedPoint,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let channels = channels_with_kind(source, "linear");
    let channel_names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let is_shown = shown_channels(source, &channel_names, &options.channels)?;
    let columns = channel_columns(&channels, ["linear", "nonlinear"]);
    let held_points = HeldPoints::single(source, fixed_values, "--at")?;
    let curves = held_points.read(&columns)?.remove(0);
    let panels =
        channels.iter().zip(is_shown).enumerate().map(|(k, (channel, is_channel_shown))| {
            let series = response_series(
                "nonlinear model",
                &curves,
                k,
                label::display_unit(channel.1.unit()).1,
            );
            ChartPanel { height: 170.0, ..channel_panel(*channel, is_channel_shown, series) }
        });
    let titles =
        ["Periodic responses at constant speed", "largest deviation from equilibrium over a turn"];
    Ok(speed_chart(titles, &held_points, &curves, panels.collect()))
}

/// Returns a chart of one point over speed with its unstable speeds shaded. `title` is that of the
/// chart; `quantity` names that of its panels.
pub(crate) fn speed_chart(
    [title, quantity]: [&str; 2],
    held_points: &HeldPoints<'_>,
    curves: &SpeedCurves,
    panels: Vec<ChartPanel>,
) -> Chart {
    let mut notes = held_points.notes();
    notes.push(quantity.to_owned());
    Chart {
        title: title.to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Constant spin speed", "rpm"),
        shaded_ranges: unstable_ranges(&curves.speeds_rpm, &curves.growths_per_s),
        shade_meaning: UNSTABLE_SPEEDS_MEANING.to_owned(),
        panels,
        ..Chart::default()
    }
}

/// Returns the channels of the nonlinear model that also have a column with the prefix `kind`.
pub(crate) fn channels_with_kind<'a>(
    source: &'a FigureFile,
    kind: &str,
) -> Vec<(&'a str, &'a ColumnFacts)> {
    let mut channels = source.with_prefix("nonlinear_");
    channels.retain(|(name, _)| source.column(&format!("{kind}_{name}")).is_some());
    channels
}

/// Returns the columns of each channel with these prefixes.
pub(crate) fn channel_columns<const N: usize>(
    channels: &[(&str, &ColumnFacts)],
    kinds: [&str; N],
) -> Vec<String> {
    channels.iter().flat_map(|(name, _)| kinds.map(|kind| format!("{kind}_{name}"))).collect()
}

/// Returns the panel of a channel.
pub(crate) fn channel_panel(
    (name, facts): (&str, &ColumnFacts),
    is_shown: bool,
    series: Vec<Series>,
) -> ChartPanel {
    let label_words = label::capitalise(&label::channel_in_words(name));
    let label = Label::new(&label_words, label::display_unit(facts.unit()).0);
    ChartPanel { is_shown, ..ChartPanel::new(name, label, series) }
}

/// Returns the curves of the `k`-th channel, times `factor`: the linear model, and the stable and
/// the unstable part of the nonlinear model's periodic response.
pub(crate) fn response_series(
    name: &str,
    curves: &SpeedCurves,
    k: usize,
    factor: f64,
) -> Vec<Series> {
    let [linear, periodic]: [Vec<f64>; 2] = [2 * k, 2 * k + 1]
        .map(|k| curves.column_values[k].iter().map(|value| value * factor).collect());
    let [stable, unstable] = stability_parts(&curves.speeds_rpm, &periodic, &curves.growths_per_s);
    let part_series = |word: &str, colour, (speed, values): (Vec<f64>, Vec<f64>), style| {
        Series::new(format!("{name}, {word}"), colour, speed, values, style)
    };
    vec![
        Series::new(
            "linear model",
            LINEAR_COLOUR,
            curves.speeds_rpm.clone(),
            linear,
            SeriesStyle::Solid(1.6),
        ),
        part_series("stable", NONLINEAR_COLOUR, stable, SeriesStyle::Solid(2.2)),
        part_series("unstable", NONLINEAR_COLOUR, unstable, SeriesStyle::Dashed),
    ]
}

/// Returns the stable and the unstable part of a curve over speed, each with its speeds; gaps are
/// NaN. The parts meet where growth passes 0, as the shaded ranges end there.
fn stability_parts(
    speed_rpm: &[f64],
    curve: &[f64],
    growth_per_s: &[f64],
) -> [(Vec<f64>, Vec<f64>); 2] {
    let mut parts = [(Vec::new(), Vec::new()), (Vec::new(), Vec::new())];
    let mut add_point = |part: usize, speed_rpm: f64, value: f64| {
        parts[part].0.push(speed_rpm);
        parts[part].1.push(value);
    };
    for k in 0..speed_rpm.len() {
        let part = usize::from(growth_per_s[k] > 0.0);
        let value = if growth_per_s[k].is_nan() { f64::NAN } else { curve[k] };
        add_point(part, speed_rpm[k], value);
        let Some(&next_growth) = growth_per_s.get(k + 1) else { continue };
        let next_part = usize::from(next_growth > 0.0);
        if next_growth.is_nan() || growth_per_s[k].is_nan() {
            add_point(part, speed_rpm[k], f64::NAN);
        } else if next_part != part {
            let edge_fraction = growth_per_s[k] / (growth_per_s[k] - next_growth);
            let interpolate_between =
                |values: &[f64]| values[k] + edge_fraction * (values[k + 1] - values[k]);
            let edge_speed = interpolate_between(speed_rpm);
            add_point(part, edge_speed, interpolate_between(curve));
            add_point(part, edge_speed, f64::NAN);
            add_point(next_part, edge_speed, interpolate_between(curve));
        }
    }
    parts
}

/// Returns whether each channel is drawn: the requested channels, by default the default ones, or
/// all if the file has none of these.
///
/// # Errors
///
/// [`PlotError::Unfit`] for an unknown channel.
pub(crate) fn shown_channels(
    source: &FigureFile,
    names: &[&str],
    requested_channels: &[String],
) -> Result<Vec<bool>, PlotError> {
    if let Some(unknown) = requested_channels.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(source.unknown_name_error("--channel", unknown, "channel", names.join(", ")));
    }
    let default_channels: Vec<&str> =
        DEFAULT_CHANNELS.into_iter().filter(|name| names.contains(name)).collect();
    let is_shown = |name: &&str| match (requested_channels, &default_channels[..]) {
        ([], []) => true,
        ([], default_channels) => default_channels.contains(name),
        (requested_channels, _) => {
            requested_channels.iter().any(|name_requested| name_requested == name)
        }
    };
    Ok(names.iter().map(is_shown).collect())
}

/// The unstable speeds in a stability file for the machine of another file.
pub(crate) struct UnstableSpeeds {
    /// The ranges of unstable speeds (rpm).
    pub(crate) speed_ranges_rpm: Vec<[f64; 2]>,
    /// The damped frequencies (cycles per minute) of the modes in resonance at each unstable speed
    /// (rpm): two, or one and NaN.
    pub(crate) mode_frequencies_cpm: Vec<(f64, [f64; 2])>,
}

/// Reads the unstable speeds of the machine of a trace or modes file from a stability file.
///
/// # Errors
/// The errors of [`FigureFile::open`] and [`FigureFile::expect_kind`]; [`PlotError::Unfit`] if the
/// stability file does not have this machine.
pub(crate) fn read_unstable(table: &FigureTable, path: &Path) -> Result<UnstableSpeeds, PlotError> {
    let source = FigureFile::open(path, MODEL_KINDS)?;
    source.expect_kind(STABILITY, "--stability", "`sweep stability` writes a stability file")?;
    let mut point: NamedPoint = unbalance_and_damping(table)
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    let point_of_file = together::point_of_trace(&table.source);
    point.retain(|(known_name, _)| !point_of_file.iter().any(|(name, _)| name == known_name));
    point.extend(point_of_file.iter().cloned());
    let axes = swept::axis_columns(&source);
    point.retain(|(name, _)| axes.iter().any(|axis| axis.name == *name));
    let held_points = HeldPoints::single(&source, &point, "--stability")?;
    let files = [(&table.source, &point_of_file), (&source, &held_points.axis_values())];
    together::check_agreement("--stability", path, files, MACHINE_SECTIONS)?;
    let curves = held_points.read(&["mode_1_cpm", "mode_2_cpm"].map(str::to_owned))?.remove(0);
    let frequency =
        |column: usize, k: usize| curves.column_values[column].get(k).copied().unwrap_or(f64::NAN);
    Ok(UnstableSpeeds {
        speed_ranges_rpm: unstable_ranges(&curves.speeds_rpm, &curves.growths_per_s),
        mode_frequencies_cpm: (0..curves.speeds_rpm.len())
            .filter(|&k| curves.growths_per_s[k] > 0.0)
            .map(|k| (curves.speeds_rpm[k], [frequency(0, k), frequency(1, k)]))
            .collect(),
    })
}

fn format_value(axis: &ColumnFacts, value: f64) -> String {
    label::with_value(&label::name_in_words(&axis.name), value, axis.unit())
}

/// Returns a value of an axis within a sentence: words in lower case, the unit unchanged.
fn format_in_lower_case(axis: &ColumnFacts, value: f64) -> String {
    label::with_value(&label::name_in_words(&axis.name).to_lowercase(), value, axis.unit())
}

/// A row of a file over constant speeds. Missing values are NaN.
pub(crate) struct SpeedRow<'a> {
    /// The values of the file's axes.
    point: Vec<f64>,
    pub(crate) speed_rpm: f64,
    growth_per_s: f64,
    pub(crate) kind: Option<&'a str>,
    /// The values of the requested columns.
    pub(crate) values: Vec<f64>,
}

/// The points of a file over constant speeds that a figure shows.
pub(crate) struct HeldPoints<'a> {
    source: &'a FigureFile,
    axes: Vec<&'a ColumnFacts>,
    /// The values of the axes at each point, in file order.
    points: Vec<Vec<f64>>,
}

impl<'a> HeldPoints<'a> {
    /// Returns the points of the file at the requested values.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`]; [`PlotError::Unfit`] for a name that is no
    /// axis or a number that is no value of it; [`PlotError::Undrawable`] without rows.
    fn matching(
        source: &'a FigureFile,
        requested_values: &NamedPoint,
        option: &str,
    ) -> Result<Self, PlotError> {
        let mut held_points =
            Self { source, axes: swept::axis_columns(source), points: Vec::new() };
        let axis_index = |name: &str| {
            let axis_names = || held_points.axes.iter().map(|axis| axis.name.as_str());
            let axis_index = axis_names().position(|axis| axis == name);
            axis_index.ok_or_else(|| {
                source.unknown_name_error(option, name, "axis", list_names(axis_names()))
            })
        };
        let requested_values_by_axis =
            requested_values.iter().map(|(name, value)| Ok((axis_index(name)?, *value)));
        let requested_values_by_axis =
            requested_values_by_axis.collect::<Result<Vec<_>, PlotError>>()?;
        let mut points: Vec<Vec<f64>> = Vec::new();
        let mut has_rows = false;
        held_points.each_row_of_file(&[""; 0], |row| {
            has_rows = true;
            let is_requested = requested_values_by_axis
                .iter()
                .all(|&(axis_index, value)| SweptAxis::is_same_value(row.point[axis_index], value));
            // Speed varies fastest, so that the rows of a point follow each other.
            if is_requested && points.last() != Some(&row.point) {
                points.push(row.point);
            }
        })?;
        if !has_rows {
            return Err(source.nothing_to_draw_error("it has no rows"));
        }
        if points.is_empty() {
            let values_in_words =
                requested_values.iter().map(|(name, value)| format!("{name}={value}"));
            let values_in_words = values_in_words.collect::<Vec<_>>().join(", ");
            return Err(source.unknown_name_error(
                option,
                values_in_words,
                "point",
                "other values of these axes",
            ));
        }
        held_points.points = points;
        Ok(held_points)
    }

    /// Returns the only point of the file, or the one at the requested values.
    ///
    /// # Errors
    /// Returns the errors of [`Self::matching`]; [`PlotError::Unfit`] where there are several.
    pub(crate) fn single(
        source: &'a FigureFile,
        requested_values: &NamedPoint,
        option: &str,
    ) -> Result<Self, PlotError> {
        let held_points = Self::matching(source, requested_values, option)?;
        if held_points.points.len() > 1 {
            let free_axes = held_points.axes.iter().map(|axis| axis.name.as_str());
            let free_axes = list_names(
                free_axes.filter(|axis| !requested_values.iter().any(|(name, _)| name == axis)),
            );
            let hint = match option {
                "--at" => format!("one is wanted: give --at NAME=VALUE for {free_axes}"),
                _ => format!("the file to be drawn does not say which by {free_axes}"),
            };
            let path = source.path.display();
            let point_count = held_points.points.len();
            let phrase = format!("{path}: this file has {point_count} points, and {hint}");
            return Err(PlotError::Unfit(phrase));
        }
        Ok(held_points)
    }

    /// Returns the axes with their values at the first point.
    pub(crate) fn axis_values(&self) -> NamedPoint {
        let axis_values = self.axes.iter().zip(&self.points[0]);
        axis_values.map(|(axis, value)| (axis.name.clone(), *value)).collect()
    }

    /// Returns the notes on the run and on the first point.
    pub(crate) fn notes(&self) -> Vec<String> {
        let axis_values = self.axes.iter().zip(&self.points[0]);
        self.source.notes(axis_values.map(|(axis, value)| format_in_lower_case(axis, *value)))
    }

    /// Calls `visit` for each row of the points, with the index of its point.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`].
    pub(crate) fn each_row<S: AsRef<str>>(
        &self,
        columns: &[S],
        mut visit: impl FnMut(usize, SpeedRow<'_>),
    ) -> Result<(), PlotError> {
        self.each_row_of_file(columns, |row| {
            if let Some(point_index) = self.points.iter().position(|point| *point == row.point) {
                visit(point_index, row);
            }
        })
    }

    fn each_row_of_file<S: AsRef<str>>(
        &self,
        columns: &[S],
        mut visit: impl FnMut(SpeedRow<'_>),
    ) -> Result<(), PlotError> {
        let column_names = self.axes.iter().map(|axis| axis.name.as_str());
        let column_names = column_names.chain(["speed_rpm", "growth_per_s", "kind"]);
        let column_names: Vec<&str> = column_names.chain(columns.iter().map(S::as_ref)).collect();
        let axis_count = self.axes.len();
        self.source.each_row(&column_names, |row| {
            visit(SpeedRow {
                point: row.numbers(0..axis_count),
                speed_rpm: row.number(axis_count),
                growth_per_s: row.number(axis_count + 1),
                kind: row.word(axis_count + 2),
                values: row.numbers(axis_count + 3..column_names.len()),
            });
            Ok(())
        })
    }

    /// Reads the points over speed with some columns.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`].
    pub(crate) fn read(&self, columns: &[String]) -> Result<Vec<SpeedCurves>, PlotError> {
        let empty_curves = SpeedCurves {
            column_values: vec![Vec::new(); columns.len()],
            ..SpeedCurves::default()
        };
        let mut curves = vec![empty_curves; self.points.len()];
        self.each_row(columns, |point_index, row| {
            let curve = &mut curves[point_index];
            // A speed can have several responses. The first is that of a machine that runs up.
            if curve.speeds_rpm.last() == Some(&row.speed_rpm) {
                return;
            }
            curve.speeds_rpm.push(row.speed_rpm);
            curve.growths_per_s.push(row.growth_per_s);
            for (values, value) in curve.column_values.iter_mut().zip(row.values) {
                values.push(value);
            }
        })?;
        Ok(curves)
    }
}

/// Returns the ranges of speed in which growth exceeds 0; it is linear between the given speeds. A
/// speed without a response (NaN) ends a range at its neighbour.
pub(crate) fn unstable_ranges(speeds_rpm: &[f64], growths_per_s: &[f64]) -> Vec<[f64; 2]> {
    intervals_within(speeds_rpm, growths_per_s, &[[0.0, f64::INFINITY]])
}

/// Returns the speeds at which growth passes 0. The end of a range at a missing response is no
/// edge.
fn stability_edges(speeds_rpm: &[f64], growths_per_s: &[f64]) -> Vec<f64> {
    let speeds_and_growths = speeds_rpm.iter().zip(growths_per_s);
    let is_growing = |edge: f64| {
        speeds_and_growths.clone().any(|(&speed, &growth)| speed == edge && growth > 0.0)
    };
    unstable_ranges(speeds_rpm, growths_per_s)
        .into_iter()
        .flatten()
        .filter(|&edge| !is_growing(edge))
        .collect()
}

/// Returns the intervals of x in which a curve lies within one of these ranges; it is linear
/// between its points.
pub(crate) fn intervals_within(x: &[f64], y: &[f64], ranges: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut intervals: Vec<[f64; 2]> = Vec::new();
    for &[low, high] in ranges {
        let first_interval = intervals.len();
        let is_within = |k: usize| low < y[k] && y[k] < high;
        for k in 0..x.len().min(y.len()) {
            let mut add_interval =
                |[from, to]: [f64; 2]| match intervals[first_interval..].last_mut() {
                    Some(last) if from <= last[1] => last[1] = to,
                    _ => intervals.push([from, to]),
                };
            if k > 0 && y[k - 1] == y[k] && is_within(k) {
                add_interval([x[k - 1], x[k]]);
            } else if k > 0 && (y[k] - y[k - 1]).is_finite() {
                // The part of this segment within the range, as fractions of the segment from 0 to
                // 1.
                let [fraction_at_low, fraction_at_high] =
                    [low, high].map(|edge| (edge - y[k - 1]) / (y[k] - y[k - 1]));
                let [first_fraction, last_fraction] = [
                    fraction_at_low.min(fraction_at_high).max(0.0),
                    fraction_at_low.max(fraction_at_high).min(1.0),
                ];
                let interpolate_x = |fraction: f64| match fraction {
                    1.0 => x[k],
                    fraction => x[k - 1] + fraction * (x[k] - x[k - 1]),
                };
                if last_fraction > first_fraction {
                    add_interval([interpolate_x(first_fraction), interpolate_x(last_fraction)]);
                }
            }
            if is_within(k) {
                add_interval([x[k]; 2]);
            }
        }
    }
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    intervals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_where_growth_passes_zero() {
        let speeds_rpm = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let growths_per_s = [-1.0, 1.0, 2.0, -2.0, f64::NAN, 1.0, 1.0];
        assert_eq!(unstable_ranges(&speeds_rpm, &growths_per_s), [[1.5, 3.5], [6.0, 7.0]]);
        assert_eq!(stability_edges(&speeds_rpm, &growths_per_s), [1.5, 3.5]);
        assert!(unstable_ranges(&speeds_rpm[..1], &growths_per_s[..1]).is_empty());
    }

    #[test]
    fn a_curve_is_dashed_from_edge_to_edge_of_its_unstable_range() {
        let speeds_rpm = [200.0, 210.0, 220.0, 230.0, 240.0];
        let growths_per_s = [-1.0, 1.0, -3.0, f64::NAN, 1.0];
        let curve_values = [1.0, 3.0, 7.0, 9.0, 11.0];
        let [stable, unstable] = stability_parts(&speeds_rpm, &curve_values, &growths_per_s);
        let finite_part = |(speeds, values): (Vec<f64>, Vec<f64>)| -> Vec<(f64, f64)> {
            speeds.into_iter().zip(values).filter(|(_, value)| !value.is_nan()).collect()
        };
        assert_eq!(finite_part(stable), [(200.0, 1.0), (205.0, 2.0), (212.5, 4.0), (220.0, 7.0)]);
        assert_eq!(
            finite_part(unstable),
            [(205.0, 2.0), (210.0, 3.0), (212.5, 4.0), (240.0, 11.0)]
        );
        // A last speed alone in its part is the end of a line, no dot.
        let [_, unstable] =
            stability_parts(&speeds_rpm[..2], &curve_values[..2], &growths_per_s[..2]);
        assert_eq!(finite_part(unstable), [(205.0, 2.0), (210.0, 3.0)]);
    }

    #[test]
    fn a_ramp_is_within_a_band_on_the_way_up_and_down() {
        let times_s: Vec<f64> = (0..=10).map(f64::from).collect();
        let speeds_rpm: Vec<f64> =
            times_s.iter().map(|t| 100.0 * (5.0 - (t - 5.0_f64).abs())).collect();
        let intervals = intervals_within(&times_s, &speeds_rpm, &[[150.0, 250.0], [500.0, 600.0]]);
        assert_eq!(intervals, [[1.5, 2.5], [7.5, 8.5]]);
        // The first curve passes the whole band in one step, the second stays in it.
        assert_eq!(intervals_within(&[0.0, 1.0], &[0.0, 100.0], &[[20.0, 30.0]]), [[0.2, 0.3]]);
        assert_eq!(
            intervals_within(&[0.0, 1.0, 4.0], &[7.0, 7.0, 7.0], &[[5.0, 9.0]]),
            [[0.0, 4.0]]
        );
    }
}
