//! Charts of responses at constant speeds: the growth of disturbances, and the amplitudes, over
//! speed.

use std::path::Path;

use crate::WasherFigures;
use crate::kinds::{MACHINE, MODEL_KINDS, STABILITY, speed_mark};
use crate::machine::unbalance_and_damping;
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::read::{ColumnFacts, FigureFile, list_names};
use sweep_plot::swept::{self, SweptAxis};
use sweep_plot::table::FigureTable;
use sweep_plot::together::{self, NamedPoint};
use sweep_plot::{DISTINCT, LINEAR, NONLINEAR, PlotError};

/// Maximum number of points whose growth is drawn: each needs a colour of its own.
const MAX_CURVES: usize = DISTINCT.len();

/// The channels whose responses are drawn by default, as in charts of traces.
const DEFAULT_CHANNELS: [&str; 4] = ["tub_front_y", "tub_front_z", "tub_yaw", "tub_pitch"];

/// Maximum number of edges that are marked with their speeds. Basis: labels of more would cover
/// each other.
const MAX_EDGES: usize = 16;

/// The legend entry of unstable speeds.
pub(crate) const UNSTABLE: &str = "a dwell at this speed is unstable";

/// The responses at one point over speed.
#[derive(Clone, Default)]
pub(crate) struct SpeedCurves {
    pub(crate) speed: Vec<f64>,
    /// The growth at each speed; NaN without a response.
    pub(crate) growth: Vec<f64>,
    /// The values of each requested column.
    columns: Vec<Vec<f64>>,
}

/// Draws the growth of a stability file over speed.
///
/// # Errors
/// The errors of [`HeldPoints::at`] and [`HeldPoints::read`].
pub(crate) fn growth(source: &FigureFile, at: &NamedPoint) -> Result<Chart, PlotError> {
    let mut held = HeldPoints::at(source, at, "--at")?;
    let count = held.points.len();
    if count > MAX_CURVES {
        let some = (0..MAX_CURVES).map(|k| k * (count - 1) / (MAX_CURVES - 1));
        held.points = some.map(|place| held.points[place].clone()).collect();
    }
    let swept = held.read(&[])?;
    let HeldPoints { axes, points: shown, .. } = &held;
    let differs = |k: usize| shown.iter().any(|point| point[k] != shown[0][k]);
    let name = |point: &[f64]| {
        let named = axes.iter().zip(point).enumerate().filter(|(k, _)| differs(*k));
        let named: Vec<String> =
            named.map(|(_, (axis, value))| format_value(axis, *value)).collect();
        if named.is_empty() { "growth".to_owned() } else { named.join(", ") }
    };
    let series = swept.iter().zip(shown).enumerate().map(|(k, (point, values))| {
        let x = point.speed.clone();
        let y = point.growth.clone();
        Series::new(name(values), DISTINCT[k], x, y, Style::Solid(2.2))
    });
    let common = axes.iter().zip(&shown[0]).enumerate().filter(|(k, _)| !differs(*k));
    let mut notes = source.notes(common.map(|(_, (axis, value))| format_within(axis, *value)));
    if shown.len() < count {
        notes.push(format!("{} of {count} points", shown.len()));
    }
    let label = Label::new("Growth of a small disturbance", "1/s");
    let levels = vec![(0.0, "unstable above".to_owned())];
    let panel = ChartPanel { levels, ..ChartPanel::new("growth", label, series.collect()) };
    let (alone, edges) = match &swept[..] {
        [one] => {
            (unstable_ranges(&one.speed, &one.growth), stability_edges(&one.speed, &one.growth))
        }
        _ => Default::default(),
    };
    let edges = edges.into_iter().take(MAX_EDGES);
    let marks = edges.map(|edge| speed_mark(edge, edge)).collect();
    Ok(Chart {
        title: "Where a dwell at constant speed is unstable".to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Constant spin speed", "rpm"),
        panels: vec![panel],
        marks,
        mark_meaning: "edge".to_owned(),
        shades: alone,
        shade_meaning: UNSTABLE.to_owned(),
        ..Chart::default()
    })
}

/// Draws the amplitudes of the periodic responses of both models at one point of a stability file
/// over speed.
///
/// # Errors
/// Returns the errors of [`HeldPoints::one`]; [`PlotError::Unfit`] for an unknown channel.
pub(crate) fn responses(
    source: &FigureFile,
    at: &NamedPoint,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let channels = channels_of(source, "linear");
    let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let is_shown = shown_channels(source, &names, &options.channels)?;
    let columns = columns_of(&channels, ["linear", "nonlinear"]);
    let held = HeldPoints::one(source, at, "--at")?;
    let one = held.read(&columns)?.remove(0);
    let panels = channels.iter().zip(is_shown).enumerate().map(|(k, (channel, shown))| {
        let lines = response("nonlinear model", &one, k, label::display_unit(&channel.1.unit).1);
        ChartPanel { height: 170.0, ..panel(*channel, shown, lines) }
    });
    let titles =
        ["Periodic responses at constant speed", "largest deviation from equilibrium over a turn"];
    Ok(over_speeds(titles, &held, &one, panels.collect()))
}

/// Returns a chart of one point over speed with its unstable speeds shaded. `title` is that of the
/// chart; `shown` names the quantity of its panels.
pub(crate) fn over_speeds(
    [title, shown]: [&str; 2],
    held: &HeldPoints<'_>,
    one: &SpeedCurves,
    panels: Vec<ChartPanel>,
) -> Chart {
    let mut notes = held.notes();
    notes.push(shown.to_owned());
    Chart {
        title: title.to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Constant spin speed", "rpm"),
        shades: unstable_ranges(&one.speed, &one.growth),
        shade_meaning: UNSTABLE.to_owned(),
        panels,
        ..Chart::default()
    }
}

/// Returns the channels of the nonlinear model that also have a column with the prefix `kind`.
pub(crate) fn channels_of<'a>(
    source: &'a FigureFile,
    kind: &str,
) -> Vec<(&'a str, &'a ColumnFacts)> {
    let mut channels = source.with_prefix("nonlinear_");
    channels.retain(|(name, _)| source.column(&format!("{kind}_{name}")).is_some());
    channels
}

/// Returns the columns of each channel with these prefixes.
pub(crate) fn columns_of<const N: usize>(
    channels: &[(&str, &ColumnFacts)],
    kinds: [&str; N],
) -> Vec<String> {
    channels.iter().flat_map(|(name, _)| kinds.map(|kind| format!("{kind}_{name}"))).collect()
}

/// Returns the panel of a channel.
pub(crate) fn panel(
    (name, facts): (&str, &ColumnFacts),
    shown: bool,
    series: Vec<Series>,
) -> ChartPanel {
    let words = label::capitalised(&label::channel(name));
    let label = Label::new(&words, label::display_unit(&facts.unit).0);
    ChartPanel { shown, ..ChartPanel::new(name, label, series) }
}

/// Returns the curves of the `k`-th channel, times `factor`: the linear model, and the stable and
/// the unstable part of the nonlinear model's periodic response.
pub(crate) fn response(name: &str, one: &SpeedCurves, k: usize, factor: f64) -> Vec<Series> {
    let [linear, periodic]: [Vec<f64>; 2] =
        [2 * k, 2 * k + 1].map(|k| one.columns[k].iter().map(|value| value * factor).collect());
    let part_where = |wanted: bool| stability_part(&periodic, &one.growth, wanted);
    let [stable, unstable] = ["stable", "unstable"].map(|word| format!("{name}, {word}"));
    vec![
        Series::new("linear model", LINEAR, one.speed.clone(), linear, Style::Solid(1.6)),
        Series::new(stable, NONLINEAR, one.speed.clone(), part_where(false), Style::Solid(2.2)),
        Series::new(unstable, NONLINEAR, one.speed.clone(), part_where(true), Style::Dashed),
    ]
}

/// Returns the unstable or the stable part of a curve over speed; other values are NaN. Both parts
/// share the points at which they meet.
fn stability_part(line: &[f64], growth: &[f64], wanted: bool) -> Vec<f64> {
    let at = |i: usize| growth.get(i).is_some_and(|growth| (*growth > 0.0) == wanted);
    let near = |i: usize| at(i) || (!wanted && (i > 0 && at(i - 1) || at(i + 1)));
    (0..line.len()).map(|i| if near(i) { line[i] } else { f64::NAN }).collect()
}

/// Returns whether each channel is drawn: the requested ones, or else the default ones, or else
/// all.
///
/// # Errors
/// [`PlotError::Unfit`] for an unknown channel.
pub(crate) fn shown_channels(
    source: &FigureFile,
    names: &[&str],
    requested: &[String],
) -> Result<Vec<bool>, PlotError> {
    if let Some(unknown) = requested.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(source.unknown_name("--channel", unknown, "channel", names.join(", ")));
    }
    let usual: Vec<&str> =
        DEFAULT_CHANNELS.into_iter().filter(|name| names.contains(name)).collect();
    let is_shown = |name: &&str| match (requested, &usual[..]) {
        ([], []) => true,
        ([], usual) => usual.contains(name),
        (requested, _) => requested.iter().any(|one| one == name),
    };
    Ok(names.iter().map(is_shown).collect())
}

/// The unstable speeds in a stability file for the machine of another file.
pub(crate) struct UnstableSpeeds {
    /// The ranges of unstable speeds (rpm).
    pub(crate) speeds: Vec<[f64; 2]>,
    /// The damped frequencies (cycles per minute) of the modes in resonance at each unstable speed
    /// (rpm): two, or one and NaN.
    pub(crate) participants: Vec<(f64, [f64; 2])>,
}

/// Reads the unstable speeds of the machine of a trace or modes file from a stability file.
///
/// # Errors
/// The errors of [`FigureFile::open`] and [`FigureFile::expect`]; [`PlotError::Unfit`] if the
/// stability file does not have this machine.
pub(crate) fn read_unstable(table: &FigureTable, path: &Path) -> Result<UnstableSpeeds, PlotError> {
    let source = FigureFile::open(path, MODEL_KINDS)?;
    source.expect(STABILITY, "--stability", "`sweep stability` writes a stability file")?;
    let mut at: NamedPoint = unbalance_and_damping(table)
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
    let named = together::at(&table.source);
    at.retain(|(known, _)| !named.iter().any(|(name, _)| name == known));
    at.extend(named.iter().cloned());
    let axes = swept::columns(&source);
    at.retain(|(name, _)| axes.iter().any(|axis| axis.name == *name));
    let held = HeldPoints::one(&source, &at, "--stability")?;
    let files = [(&table.source, &named), (&source, &held.values())];
    together::check_agreement("--stability", path, files, MACHINE)?;
    let one = held.read(&["mode_1_cpm", "mode_2_cpm"].map(str::to_owned))?.remove(0);
    let frequency = |place: usize, k: usize| one.columns[place].get(k).copied().unwrap_or(f64::NAN);
    Ok(UnstableSpeeds {
        speeds: unstable_ranges(&one.speed, &one.growth),
        participants: (0..one.speed.len())
            .filter(|&k| one.growth[k] > 0.0)
            .map(|k| (one.speed[k], [frequency(0, k), frequency(1, k)]))
            .collect(),
    })
}

fn format_value(axis: &ColumnFacts, value: f64) -> String {
    label::with_value(&label::words(&axis.name), value, &axis.unit)
}

/// Returns a value of an axis within a sentence: words in lower case, the unit unchanged.
fn format_within(axis: &ColumnFacts, value: f64) -> String {
    label::with_value(&label::words(&axis.name).to_lowercase(), value, &axis.unit)
}

/// A row of a file over constant speeds. Missing values are NaN.
pub(crate) struct SpeedRow<'a> {
    /// The values of the file's axes.
    point: Vec<f64>,
    pub(crate) speed: f64,
    growth: f64,
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
    fn at(source: &'a FigureFile, at: &NamedPoint, option: &str) -> Result<Self, PlotError> {
        let mut held = Self { source, axes: swept::columns(source), points: Vec::new() };
        let place = |name: &str| {
            let names = || held.axes.iter().map(|axis| axis.name.as_str());
            let place = names().position(|axis| axis == name);
            place.ok_or_else(|| source.unknown_name(option, name, "axis", list_names(names())))
        };
        let pins = at.iter().map(|(name, value)| Ok((place(name)?, *value)));
        let pins = pins.collect::<Result<Vec<_>, PlotError>>()?;
        let mut points: Vec<Vec<f64>> = Vec::new();
        let mut seen_rows = false;
        held.each_row_of_all(&[""; 0], |row| {
            seen_rows = true;
            let is_pinned =
                pins.iter().all(|&(place, value)| SweptAxis::is_near(row.point[place], value));
            // Speed varies fastest, so that the rows of a point follow each other.
            if is_pinned && points.last() != Some(&row.point) {
                points.push(row.point);
            }
        })?;
        if !seen_rows {
            return Err(source.nothing_to_draw("it has no rows"));
        }
        if points.is_empty() {
            let given = at.iter().map(|(name, value)| format!("{name}={value}"));
            let given = given.collect::<Vec<_>>().join(", ");
            return Err(source.unknown_name(option, given, "point", "other values of these axes"));
        }
        held.points = points;
        Ok(held)
    }

    /// Returns the only point of the file, or the one at the requested values.
    ///
    /// # Errors
    /// Returns the errors of [`Self::at`]; [`PlotError::Unfit`] where there are several.
    pub(crate) fn one(
        source: &'a FigureFile,
        at: &NamedPoint,
        option: &str,
    ) -> Result<Self, PlotError> {
        let held = Self::at(source, at, option)?;
        if held.points.len() > 1 {
            let free = held.axes.iter().map(|axis| axis.name.as_str());
            let free = list_names(free.filter(|axis| !at.iter().any(|(name, _)| name == axis)));
            let what = match option {
                "--at" => format!("one is wanted: give --at NAME=VALUE for {free}"),
                _ => format!("the file to be drawn does not say which by {free}"),
            };
            let path = source.path.display();
            let count = held.points.len();
            let phrase = format!("{path}: this file has {count} points, and {what}");
            return Err(PlotError::Unfit(phrase));
        }
        Ok(held)
    }

    /// Returns the axes with their values at the first point.
    pub(crate) fn values(&self) -> NamedPoint {
        let values = self.axes.iter().zip(&self.points[0]);
        values.map(|(axis, value)| (axis.name.clone(), *value)).collect()
    }

    /// Returns the notes on the run and on the first point.
    pub(crate) fn notes(&self) -> Vec<String> {
        let values = self.axes.iter().zip(&self.points[0]);
        self.source.notes(values.map(|(axis, value)| format_within(axis, *value)))
    }

    /// Calls `take` for each row of the points, with the index of its point.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`].
    pub(crate) fn each_row<S: AsRef<str>>(
        &self,
        columns: &[S],
        mut take: impl FnMut(usize, SpeedRow<'_>),
    ) -> Result<(), PlotError> {
        self.each_row_of_all(columns, |row| {
            if let Some(place) = self.points.iter().position(|point| *point == row.point) {
                take(place, row);
            }
        })
    }

    fn each_row_of_all<S: AsRef<str>>(
        &self,
        columns: &[S],
        mut take: impl FnMut(SpeedRow<'_>),
    ) -> Result<(), PlotError> {
        let names = self.axes.iter().map(|axis| axis.name.as_str());
        let names = names.chain(["speed_rpm", "growth_per_s", "kind"]);
        let names: Vec<&str> = names.chain(columns.iter().map(S::as_ref)).collect();
        let own = self.axes.len();
        self.source.each_row(&names, |row| {
            take(SpeedRow {
                point: row.numbers(0..own),
                speed: row.number(own),
                growth: row.number(own + 1),
                kind: row.word(own + 2),
                values: row.numbers(own + 3..names.len()),
            });
            Ok(())
        })
    }

    /// Reads the points over speed with some columns.
    ///
    /// # Errors
    /// Returns the errors of [`FigureFile::each_row`].
    pub(crate) fn read(&self, columns: &[String]) -> Result<Vec<SpeedCurves>, PlotError> {
        let empty =
            SpeedCurves { columns: vec![Vec::new(); columns.len()], ..SpeedCurves::default() };
        let mut swept = vec![empty; self.points.len()];
        self.each_row(columns, |place, row| {
            let point = &mut swept[place];
            // A speed can have several responses. The first is that of a machine that runs up.
            if point.speed.last() == Some(&row.speed) {
                return;
            }
            point.speed.push(row.speed);
            point.growth.push(row.growth);
            for (kept, value) in point.columns.iter_mut().zip(row.values) {
                kept.push(value);
            }
        })?;
        Ok(swept)
    }
}

/// Returns the ranges of speed in which growth exceeds 0; it is linear between the given speeds. A
/// speed without a response (NaN) ends a range at its neighbour.
pub(crate) fn unstable_ranges(speed: &[f64], growth: &[f64]) -> Vec<[f64; 2]> {
    intervals_within(speed, growth, &[[0.0, f64::INFINITY]])
}

/// Returns the speeds at which growth passes 0. The end of a range at a missing response is no
/// edge.
fn stability_edges(speed: &[f64], growth: &[f64]) -> Vec<f64> {
    let known = speed.iter().zip(growth);
    let grows = |edge: f64| known.clone().any(|(&at, &growth)| at == edge && growth > 0.0);
    unstable_ranges(speed, growth).into_iter().flatten().filter(|&edge| !grows(edge)).collect()
}

/// Returns the intervals of x in which a curve lies within one of these ranges; it is linear
/// between its points.
pub(crate) fn intervals_within(x: &[f64], y: &[f64], ranges: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    for &[low, high] in ranges {
        let first_own = found.len();
        let is_within = |k: usize| low < y[k] && y[k] < high;
        for k in 0..x.len().min(y.len()) {
            let mut add = |[from, to]: [f64; 2]| match found[first_own..].last_mut() {
                Some(last) if from <= last[1] => last[1] = to,
                _ => found.push([from, to]),
            };
            if k > 0 && y[k - 1] == y[k] && is_within(k) {
                add([x[k - 1], x[k]]);
            } else if k > 0 && (y[k] - y[k - 1]).is_finite() {
                // The part of this segment within the range, from 0 to 1 along it.
                let [a, b] = [low, high].map(|edge| (edge - y[k - 1]) / (y[k] - y[k - 1]));
                let [first, last] = [a.min(b).max(0.0), a.max(b).min(1.0)];
                let at = |share: f64| match share {
                    1.0 => x[k],
                    share => x[k - 1] + share * (x[k] - x[k - 1]),
                };
                if last > first {
                    add([at(first), at(last)]);
                }
            }
            if is_within(k) {
                add([x[k]; 2]);
            }
        }
    }
    found.sort_by(|a, b| a[0].total_cmp(&b[0]));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_where_growth_passes_zero() {
        let speed = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let growth = [-1.0, 1.0, 2.0, -2.0, f64::NAN, 1.0, 1.0];
        assert_eq!(unstable_ranges(&speed, &growth), [[1.5, 3.5], [6.0, 7.0]]);
        assert_eq!(stability_edges(&speed, &growth), [1.5, 3.5]);
        assert!(unstable_ranges(&speed[..1], &growth[..1]).is_empty());
    }

    #[test]
    fn a_ramp_is_within_a_band_on_the_way_up_and_down() {
        let time: Vec<f64> = (0..=10).map(f64::from).collect();
        let speed: Vec<f64> = time.iter().map(|t| 100.0 * (5.0 - (t - 5.0_f64).abs())).collect();
        let found = intervals_within(&time, &speed, &[[150.0, 250.0], [500.0, 600.0]]);
        assert_eq!(found, [[1.5, 2.5], [7.5, 8.5]]);
        // The first curve passes the whole band in one step, the second stays in it.
        assert_eq!(intervals_within(&[0.0, 1.0], &[0.0, 100.0], &[[20.0, 30.0]]), [[0.2, 0.3]]);
        assert_eq!(
            intervals_within(&[0.0, 1.0, 4.0], &[7.0, 7.0, 7.0], &[[5.0, 9.0]]),
            [[0.0, 4.0]]
        );
    }
}
