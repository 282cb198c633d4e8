//! Responses at constant speeds: how fast disturbances grow, and how far the machine moves, over
//! the speed.

use std::path::Path;

use crate::WasherFigures;
use crate::kinds::{KNOWN, MACHINE, STABILITY, mark_of_speed};
use crate::machine::machine;
use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::read::{ColumnFacts, Source, some_of};
use sweep_plot::swept::{self, SweptAxis};
use sweep_plot::table::Table;
use sweep_plot::together::{self, At};
use sweep_plot::{DISTINCT, LINEAR, NONLINEAR, PlotError};

/// Most points whose growth is drawn: each needs a colour.
const MOST_CURVES: usize = DISTINCT.len();

/// Channels whose responses are drawn by default: as of a trace.
const USUAL: [&str; 4] = ["tub_front_y", "tub_front_z", "tub_yaw", "tub_pitch"];

/// Most edges that are marked with their speeds.
const MOST_EDGES: usize = 16;

/// What shades mean, in the legend.
pub(crate) const UNSTABLE: &str = "a dwell at this speed is unstable";

/// One point over speed.
#[derive(Clone, Default)]
pub(crate) struct Swept {
    pub(crate) speed: Vec<f64>,
    /// NaN where there is no response.
    pub(crate) growth: Vec<f64>,
    /// Values of each column asked for.
    columns: Vec<Vec<f64>>,
}

/// The chart of a stability file: growth over speed.
///
/// # Errors
/// As [`Held::at`], [`Held::read`].
pub(crate) fn growth(source: &Source, at: &At) -> Result<Chart, PlotError> {
    let mut held = Held::at(source, at, "--at")?;
    let count = held.points.len();
    if count > MOST_CURVES {
        let some = (0..MOST_CURVES).map(|k| k * (count - 1) / (MOST_CURVES - 1));
        held.points = some.map(|place| held.points[place].clone()).collect();
    }
    let swept = held.read(&[])?;
    let Held { axes, points: shown, .. } = &held;
    let differs = |k: usize| shown.iter().any(|point| point[k] != shown[0][k]);
    let name = |point: &[f64]| {
        let named = axes.iter().zip(point).enumerate().filter(|(k, _)| differs(*k));
        let named: Vec<String> =
            named.map(|(_, (axis, value))| format_value(axis, *value)).collect();
        if named.is_empty() { "growth".to_owned() } else { named.join(", ") }
    };
    let series = swept.iter().zip(shown).enumerate().map(|(k, (point, values))| {
        let (x, y) = (point.speed.clone(), point.growth.clone());
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
        [one] => (unstable(&one.speed, &one.growth), edges(&one.speed, &one.growth)),
        _ => Default::default(),
    };
    let edges = edges.into_iter().take(MOST_EDGES);
    let marks = edges.map(|edge| mark_of_speed(edge, edge)).collect();
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

/// The chart of a stability file's one point: amplitudes of the periodic responses of both models
/// over speed.
///
/// # Errors
/// As [`Held::one`]; [`PlotError::Unfit`] for an unknown channel.
pub(crate) fn responses(
    source: &Source,
    at: &At,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let channels = channels_of(source, "linear");
    let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    let is_shown = shown(source, &names, &options.channels)?;
    let columns = columns_of(&channels, ["linear", "nonlinear"]);
    let held = Held::one(source, at, "--at")?;
    let one = held.read(&columns)?.remove(0);
    let panels = channels.iter().zip(is_shown).enumerate().map(|(k, (channel, shown))| {
        let lines = response("nonlinear model", &one, k, label::shown(&channel.1.unit).1);
        ChartPanel { height: 170.0, ..panel(*channel, shown, lines) }
    });
    let titles =
        ["Periodic responses at constant speed", "largest deviation from equilibrium over a turn"];
    Ok(over_speeds(titles, &held, &one, panels.collect()))
}

/// The chart of one point over speed, its unstable speeds shaded; with a title and what its panels
/// show.
pub(crate) fn over_speeds(
    [title, shown]: [&str; 2],
    held: &Held<'_>,
    one: &Swept,
    panels: Vec<ChartPanel>,
) -> Chart {
    let mut notes = held.notes();
    notes.push(shown.to_owned());
    Chart {
        title: title.to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Constant spin speed", "rpm"),
        shades: unstable(&one.speed, &one.growth),
        shade_meaning: UNSTABLE.to_owned(),
        panels,
        ..Chart::default()
    }
}

/// Channels of the nonlinear model for which the file has a column of this kind too.
pub(crate) fn channels_of<'a>(source: &'a Source, kind: &str) -> Vec<(&'a str, &'a ColumnFacts)> {
    let mut channels = source.with_prefix("nonlinear_");
    channels.retain(|(name, _)| source.column(&format!("{kind}_{name}")).is_some());
    channels
}

/// The columns of these kinds of each channel.
pub(crate) fn columns_of<const N: usize>(
    channels: &[(&str, &ColumnFacts)],
    kinds: [&str; N],
) -> Vec<String> {
    channels.iter().flat_map(|(name, _)| kinds.map(|kind| format!("{kind}_{name}"))).collect()
}

/// The panel of a channel.
pub(crate) fn panel(
    (name, facts): (&str, &ColumnFacts),
    shown: bool,
    series: Vec<Series>,
) -> ChartPanel {
    let words = label::capitalised(&label::channel(name));
    let label = Label::new(&words, label::shown(&facts.unit).0);
    ChartPanel { shown, ..ChartPanel::new(name, label, series) }
}

/// The `k`-th channel's lines, so many times as high: in the linear model and in the periodic
/// response of the nonlinear one, where that is stable and where it is not.
pub(crate) fn response(name: &str, one: &Swept, k: usize, factor: f64) -> Vec<Series> {
    let [linear, periodic]: [Vec<f64>; 2] =
        [2 * k, 2 * k + 1].map(|k| one.columns[k].iter().map(|value| value * factor).collect());
    let of = |wanted: bool| part(&periodic, &one.growth, wanted);
    let [stable, unstable] = ["stable", "unstable"].map(|word| format!("{name}, {word}"));
    vec![
        Series::new("linear model", LINEAR, one.speed.clone(), linear, Style::Solid(1.6)),
        Series::new(stable, NONLINEAR, one.speed.clone(), of(false), Style::Solid(2.2)),
        Series::new(unstable, NONLINEAR, one.speed.clone(), of(true), Style::Dashed),
    ]
}

/// The part of a line over speed where the response is unstable, or where it is not. Each dash
/// begins and ends where the solid line does.
fn part(line: &[f64], growth: &[f64], wanted: bool) -> Vec<f64> {
    let at = |i: usize| growth.get(i).is_some_and(|growth| (*growth > 0.0) == wanted);
    let near = |i: usize| at(i) || (!wanted && (i > 0 && at(i - 1) || at(i + 1)));
    (0..line.len()).map(|i| if near(i) { line[i] } else { f64::NAN }).collect()
}

/// Which of the channels a picture shows: those asked for, else the usual ones, else all.
///
/// # Errors
/// [`PlotError::Unfit`] for an unknown channel.
pub(crate) fn shown(
    source: &Source,
    names: &[&str],
    asked: &[String],
) -> Result<Vec<bool>, PlotError> {
    if let Some(unknown) = asked.iter().find(|asked| !names.contains(&asked.as_str())) {
        return Err(source.not_there("--channel", unknown, "channel", names.join(", ")));
    }
    let usual: Vec<&str> = USUAL.into_iter().filter(|name| names.contains(name)).collect();
    let is_shown = |name: &&str| match (asked, &usual[..]) {
        ([], []) => true,
        ([], usual) => usual.contains(name),
        (asked, _) => asked.iter().any(|asked| asked == name),
    };
    Ok(names.iter().map(is_shown).collect())
}

/// What a stability file says of another file's machine.
pub(crate) struct Unstable {
    /// Ranges of unstable speeds (rpm).
    pub(crate) speeds: Vec<[f64; 2]>,
    /// At each unstable speed of the file (rpm) the damped frequencies of the one or two modes that
    /// take part in what grows (cycles per minute), NaN for none.
    pub(crate) participants: Vec<(f64, [f64; 2])>,
}

/// The unstable speeds of the machine that a trace or a modes file is of.
///
/// # Errors
/// As [`Source::open`] and [`Source::expect`]; [`PlotError::Unfit`] where the stability file does
/// not have this machine.
pub(crate) fn unstable_of(table: &Table, path: &Path) -> Result<Unstable, PlotError> {
    let source = Source::open(path, KNOWN)?;
    source.expect(STABILITY, "--stability", "`sweep stability` writes a stability file")?;
    let mut at: At =
        machine(table).into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
    let named = together::at(&table.source);
    at.retain(|(known, _)| !named.iter().any(|(name, _)| name == known));
    at.extend(named.iter().cloned());
    let axes = swept::columns(&source);
    at.retain(|(name, _)| axes.iter().any(|axis| axis.name == *name));
    let held = Held::one(&source, &at, "--stability")?;
    let files = [(&table.source, &named), (&source, &held.values())];
    together::agree("--stability", path, files, MACHINE)?;
    let one = held.read(&["mode_1_cpm", "mode_2_cpm"].map(str::to_owned))?.remove(0);
    let frequency = |place: usize, k: usize| one.columns[place].get(k).copied().unwrap_or(f64::NAN);
    Ok(Unstable {
        speeds: unstable(&one.speed, &one.growth),
        participants: (0..one.speed.len())
            .filter(|&k| one.growth[k] > 0.0)
            .map(|k| (one.speed[k], [frequency(0, k), frequency(1, k)]))
            .collect(),
    })
}

fn format_value(axis: &ColumnFacts, value: f64) -> String {
    label::valued(&label::words(&axis.name), value, &axis.unit)
}

/// As [`said`], within a sentence: the words are small, the unit keeps its letters.
fn format_within(axis: &ColumnFacts, value: f64) -> String {
    label::valued(&label::words(&axis.name).to_lowercase(), value, &axis.unit)
}

/// A row of a file over constant speeds. What the file does not have is NaN.
pub(crate) struct Row<'a> {
    /// Values of the file's axes.
    point: Vec<f64>,
    pub(crate) speed: f64,
    growth: f64,
    pub(crate) kind: Option<&'a str>,
    /// Of the columns asked for.
    pub(crate) values: Vec<f64>,
}

/// Points of a file over constant speeds.
pub(crate) struct Held<'a> {
    source: &'a Source,
    axes: Vec<&'a ColumnFacts>,
    /// Values of the axes, in file order.
    points: Vec<Vec<f64>>,
}

impl<'a> Held<'a> {
    /// Every point of the file at the values asked for.
    ///
    /// # Errors
    /// As [`Source::each_row`]; [`PlotError::Unfit`] for what is no axis, or no value of it;
    /// [`PlotError::Undrawable`] without rows.
    fn at(source: &'a Source, at: &At, option: &str) -> Result<Self, PlotError> {
        let mut held = Self { source, axes: swept::columns(source), points: Vec::new() };
        let place = |name: &str| {
            let names = || held.axes.iter().map(|axis| axis.name.as_str());
            let place = names().position(|axis| axis == name);
            place.ok_or_else(|| source.not_there(option, name, "axis", some_of(names())))
        };
        let pins = at.iter().map(|(name, value)| Ok((place(name)?, *value)));
        let pins = pins.collect::<Result<Vec<_>, PlotError>>()?;
        let mut points: Vec<Vec<f64>> = Vec::new();
        let mut seen_rows = false;
        held.each_row_of_all(&[""; 0], |row| {
            seen_rows = true;
            let is_pinned =
                pins.iter().all(|&(place, value)| SweptAxis::near(row.point[place], value));
            // Speeds vary fastest: a point's rows follow each other.
            if is_pinned && points.last() != Some(&row.point) {
                points.push(row.point);
            }
        })?;
        if !seen_rows {
            return Err(source.empty("it has no rows"));
        }
        if points.is_empty() {
            let given = at.iter().map(|(name, value)| format!("{name}={value}"));
            let given = given.collect::<Vec<_>>().join(", ");
            return Err(source.not_there(option, given, "point", "other values of these axes"));
        }
        held.points = points;
        Ok(held)
    }

    /// The one point of the file, or the one at the values asked for.
    ///
    /// # Errors
    /// As [`Self::at`]; [`PlotError::Unfit`] where there are several.
    pub(crate) fn one(source: &'a Source, at: &At, option: &str) -> Result<Self, PlotError> {
        let held = Self::at(source, at, option)?;
        if held.points.len() > 1 {
            let free = held.axes.iter().map(|axis| axis.name.as_str());
            let free = some_of(free.filter(|axis| !at.iter().any(|(name, _)| name == axis)));
            let what = match option {
                "--at" => format!("one is wanted: give --at NAME=VALUE for {free}"),
                _ => format!("the file to be drawn does not say which by {free}"),
            };
            let (path, count) = (source.path.display(), held.points.len());
            let said = format!("{path}: this file has {count} points, and {what}");
            return Err(PlotError::Unfit(said));
        }
        Ok(held)
    }

    /// The axes with their values at the first point.
    pub(crate) fn values(&self) -> At {
        let values = self.axes.iter().zip(&self.points[0]);
        values.map(|(axis, value)| (axis.name.clone(), *value)).collect()
    }

    /// The run and the first point, in words.
    pub(crate) fn notes(&self) -> Vec<String> {
        let values = self.axes.iter().zip(&self.points[0]);
        self.source.notes(values.map(|(axis, value)| format_within(axis, *value)))
    }

    /// The points' rows, each with the place of its point.
    ///
    /// # Errors
    /// As [`Source::each_row`].
    pub(crate) fn each_row<S: AsRef<str>>(
        &self,
        columns: &[S],
        mut take: impl FnMut(usize, Row<'_>),
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
        mut take: impl FnMut(Row<'_>),
    ) -> Result<(), PlotError> {
        let names = self.axes.iter().map(|axis| axis.name.as_str());
        let names = names.chain(["speed_rpm", "growth_per_s", "kind"]);
        let names: Vec<&str> = names.chain(columns.iter().map(S::as_ref)).collect();
        let own = self.axes.len();
        self.source.each_row(&names, |row| {
            take(Row {
                point: row.numbers(0..own),
                speed: row.number(own),
                growth: row.number(own + 1),
                kind: row.word(own + 2),
                values: row.numbers(own + 3..names.len()),
            });
            Ok(())
        })
    }

    /// The points over speed, with some columns.
    ///
    /// # Errors
    /// As [`Source::each_row`].
    pub(crate) fn read(&self, columns: &[String]) -> Result<Vec<Swept>, PlotError> {
        let empty = Swept { columns: vec![Vec::new(); columns.len()], ..Swept::default() };
        let mut swept = vec![empty; self.points.len()];
        self.each_row(columns, |place, row| {
            let point = &mut swept[place];
            // Further rows of a speed are other responses; a machine that runs up is on the first.
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

/// The ranges of speed in which growth is above 0, taken as linear between the given speeds. A
/// speed without an answer has no growth (NaN), and gives no edge to its neighbours.
pub(crate) fn unstable(speed: &[f64], growth: &[f64]) -> Vec<[f64; 2]> {
    stretches_within(speed, growth, &[[0.0, f64::INFINITY]])
}

/// The speeds at which growth passes 0. Where a range ends because there is no answer beyond, it is
/// not known to.
fn edges(speed: &[f64], growth: &[f64]) -> Vec<f64> {
    let known = speed.iter().zip(growth);
    let grows = |edge: f64| known.clone().any(|(&at, &growth)| at == edge && growth > 0.0);
    unstable(speed, growth).into_iter().flatten().filter(|&edge| !grows(edge)).collect()
}

/// The stretches of x in which a curve over it is within one of these ranges; straight between its
/// points.
pub(crate) fn stretches_within(x: &[f64], y: &[f64], ranges: &[[f64; 2]]) -> Vec<[f64; 2]> {
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
                // The part of this piece, from 0 to 1, that is within.
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
        assert_eq!(unstable(&speed, &growth), [[1.5, 3.5], [6.0, 7.0]]);
        assert_eq!(edges(&speed, &growth), [1.5, 3.5]);
        assert!(unstable(&speed[..1], &growth[..1]).is_empty());
    }

    #[test]
    fn a_ramp_is_within_a_band_on_the_way_up_and_down() {
        let time: Vec<f64> = (0..=10).map(f64::from).collect();
        let speed: Vec<f64> = time.iter().map(|t| 100.0 * (5.0 - (t - 5.0_f64).abs())).collect();
        let found = stretches_within(&time, &speed, &[[150.0, 250.0], [500.0, 600.0]]);
        assert_eq!(found, [[1.5, 2.5], [7.5, 8.5]]);
        // A whole band within one step, and a dwell.
        assert_eq!(stretches_within(&[0.0, 1.0], &[0.0, 100.0], &[[20.0, 30.0]]), [[0.2, 0.3]]);
        assert_eq!(
            stretches_within(&[0.0, 1.0, 4.0], &[7.0, 7.0, 7.0], &[[5.0, 9.0]]),
            [[0.0, 4.0]]
        );
    }
}
