//! The figure of a boundary file: the curve on which a quantity is at its limit, with its bracket.

use serde_json::Value;
use sweep_files::key;
use sweep_parameter::Worse;

use crate::axis::is_log_spaced;
use crate::chart::{Chart, ChartPanel, Series, Style};
use crate::colour::DISTINCT;
use crate::error::Result;
use crate::read::bracket;
use crate::table::{FigureColumn, FigureTable};
use crate::{PlotError, label, together};

/// A point of the boundary with its bracket. Coordinates are NaN if the file has no number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BoundaryPoint {
    x: f64,
    y: f64,
    low: f64,
    high: f64,
    /// Whether the quantity exceeds its limit above the point, if the file says so. A curve keeps
    /// its sides.
    rising: Option<bool>,
}

/// Draws a boundary file: the first column along x, the second along y, the bracket shaded; a curve
/// for every combination of the axes beyond the second.
///
/// # Errors
/// [`PlotError::Undrawable`] with fewer than two points.
pub(crate) fn chart(table: &FigureTable) -> Result<Chart> {
    let columns: Vec<&FigureColumn> =
        table.columns.iter().filter(|column| column.numbers().is_some()).collect();
    let names: Vec<&str> = columns.iter().map(|column| column.facts.name.as_str()).collect();
    let empty = || table.source.nothing_to_draw("a curve needs at least two points");
    let (low, high) = bracket(&names).ok_or_else(empty)?;
    let x = columns[0];
    let y = columns[1];
    let xs = table.numbers(&x.facts.name)?;
    let ys = table.numbers(&y.facts.name)?;
    let lows = table.numbers(low)?;
    let highs = table.numbers(high)?;
    let mut grid: Vec<f64> = xs.iter().copied().filter(|x| x.is_finite()).collect();
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    if grid.len() < 2 {
        return Err(empty());
    }
    let sides = ["quantity_low", "quantity_high"]
        .map(|name| table.column(name).and_then(FigureColumn::numbers));
    let rising = |row: usize| {
        let [below, above] = sides.map(|values| values.map_or(f64::NAN, |values| values[row]));
        below.partial_cmp(&above).map(std::cmp::Ordering::is_lt)
    };
    let mut curves: Vec<(String, Vec<BoundaryPoint>)> = Vec::new();
    for row in 0..table.rows {
        let place = BoundaryPoint {
            x: xs[row],
            y: ys[row],
            low: lows[row],
            high: highs[row],
            rising: rising(row),
        };
        let further_axes = further_axes(table, row);
        match curves.iter_mut().find(|(name, _)| *name == further_axes) {
            Some((_, places)) => places.push(place),
            None => curves.push((further_axes, vec![place])),
        }
    }
    let phrase = limit(table);
    let mut series = Vec::new();
    for (k, (further_axes, places)) in curves.iter().enumerate() {
        let name = if further_axes.is_empty() {
            format!("boundary: {phrase}, bracket shaded")
        } else {
            format!("{phrase}, {further_axes}")
        };
        let colour = DISTINCT[k % DISTINCT.len()];
        series.extend(join_curves(&grid, places).into_iter().map(|branch| {
            let pick =
                |value: fn(&BoundaryPoint) -> f64| branch.iter().map(value).collect::<Vec<f64>>();
            let style = Style::Band(pick(|place| place.low), pick(|place| place.high));
            Series::new(name.clone(), colour, grid.clone(), pick(|place| place.y), style)
        }));
    }
    let side = far_side(&curves, side_words(table));
    let words = x.label().words.to_lowercase();
    let panel = ChartPanel::new("boundary", y.label(), series);
    Ok(Chart {
        title: match quantity(table) {
            growth if is_growth(growth) => "Where the machine may dwell at any speed".to_owned(),
            ratio if is_ratio(ratio) => "Boundary of the linear model's reliability".to_owned(),
            other => format!("Limit of the {}", in_words(other)),
        },
        subtitle: table.source.subtitle(&format!("{} values of {words}{side}", grid.len())),
        x_label: x.label(),
        x_log: is_log_spaced(&grid),
        panels: vec![ChartPanel { height: 440.0, ..panel }],
        ..Chart::default()
    })
}

/// Returns the note on the region above the uppermost points, if it is the same for all of them.
fn far_side(curves: &[(String, Vec<BoundaryPoint>)], [falling, rising]: [&str; 2]) -> String {
    let all = curves.iter().flat_map(|(_, places)| places);
    let mut uppermost: Vec<&BoundaryPoint> = all.filter(|place| place.y.is_finite()).collect();
    let crossings = uppermost.len();
    uppermost.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
    uppermost.dedup_by(|a, b| a.x == b.x);
    let side = uppermost.first().and_then(|place| place.rising);
    let side = match side.filter(|_| uppermost.iter().all(|place| place.rising == side)) {
        Some(true) => rising,
        Some(false) => falling,
        None => return String::new(),
    };
    let line = if crossings > uppermost.len() { "highest crossing" } else { "line" };
    format!(" · {side} above the {line}")
}

/// Returns the name of the quantity, which is that of its column in a map.
fn quantity(table: &FigureTable) -> &str {
    table.source.find("quantity").and_then(Value::as_str).unwrap_or("ratio_max")
}

/// Returns the words for the side below the limit and for the side above it.
fn side_words(table: &FigureTable) -> [&'static str; 2] {
    let about = table.source.find(key::BOUNDARY);
    let worse = about.and_then(|about| Worse::named(about.get(key::WORSE)?.as_str()?));
    match (quantity(table), worse) {
        (growth, _) if is_growth(growth) => ["stable", "unstable"],
        ("ratio_min", _) => ["unreliable", "reliable"],
        (ratio, _) if is_ratio(ratio) => ["reliable", "unreliable"],
        (_, Some(Worse::Less)) => ["beyond the limit", "within the limit"],
        _ => ["within the limit", "beyond the limit"],
    }
}

/// Returns whether a quantity is a ratio of both models.
fn is_ratio(quantity: &str) -> bool {
    quantity.starts_with("ratio_")
}

/// Returns the quantity in words, as in "least gap, nonlinear model".
fn in_words(quantity: &str) -> String {
    match label::split_model(quantity) {
        (words, "") => words,
        (words, model) => format!("{words}, {model} model"),
    }
}

/// Returns whether a quantity is the growth of disturbances.
fn is_growth(quantity: &str) -> bool {
    quantity.starts_with("growth")
}

/// Returns the parts of a plan on which the boundary depends, except its limit, which the figure
/// states.
pub(crate) fn follows_from(table: &FigureTable) -> Vec<&'static str> {
    let known = table.source.model_kinds;
    match quantity(table) {
        growth if is_growth(growth) => known.machine_sections.to_vec(),
        "ratio_max" | "ratio_min" => together::ratio_parts(known),
        _ => together::history_parts(known),
    }
}

/// The curves of a boundary file over the two axes of a map.
pub(crate) struct Overlay {
    /// The legend entry.
    pub(crate) name: String,
    /// The curves in values of both axes; NaN where a curve has a gap.
    pub(crate) lines: Vec<Vec<[f64; 2]>>,
}

/// Returns the curves of a boundary file over these two axes.
///
/// # Errors
/// [`PlotError::Unfit`] if it has other axes; otherwise as [`chart`].
pub(crate) fn overlay(table: &FigureTable, axes: [&str; 2]) -> Result<Overlay> {
    let names: Vec<&str> = table.source.planned_axes().collect();
    if names != axes {
        let [names, axes] = [&names[..], &axes].map(|all| all.join(", "));
        let phrase = format!("is a boundary over {names}; the map is over {axes}");
        return Err(PlotError::Unfit(format!("{} {phrase}", table.source.path.display())));
    }
    let chart = chart(table)?;
    let name = format!("traced boundary: {}", limit(table));
    let series = chart.panels.into_iter().flat_map(|panel| panel.series);
    let lines = series.map(|series| series.x.iter().zip(series.y).map(|(&x, y)| [x, y]).collect());
    Ok(Overlay { name, lines: lines.collect() })
}

/// Returns the limit in words, from the metadata or else that of the ratio.
fn limit(table: &FigureTable) -> String {
    let about = table.source.find(key::BOUNDARY);
    let limit_in_file = about.and_then(|about| about.get(key::LIMIT)?.as_f64());
    let unit = table.column("quantity_low").map_or("", |column| &column.facts.unit);
    let (unit, factor) = label::display_unit(unit);
    let limit = limit_in_file.map_or(table.source.ratio_limit(), |limit| limit * factor);
    let limit = label::with_value("", limit, unit);
    match quantity(table) {
        "ratio_max" => format!("ratio {limit}"),
        growth if is_growth(growth) && limit_in_file.is_none_or(|limit| limit == 0.0) => {
            "no growth at any speed".to_owned()
        }
        other => format!("{} {limit}", in_words(other)),
    }
}

/// Returns the values of the axes beyond the second, which the plan in the file names.
fn further_axes(table: &FigureTable, row: usize) -> String {
    let phrase = table.source.planned_axes().skip(2).filter_map(|name| {
        let column = table.column(name)?;
        let value = *column.numbers()?.get(row)?;
        Some(label::with_value(&label::words(name), value, &column.facts.unit))
    });
    phrase.collect::<Vec<_>>().join(", ")
}

/// Joins the points of a boundary to curves with at most one point for each x. If there are several
/// points at an x, each continues the curve that has the same sides and whose last point is
/// nearest.
fn join_curves(grid: &[f64], places: &[BoundaryPoint]) -> Vec<Vec<BoundaryPoint>> {
    /// A gap of a curve.
    const GAP: BoundaryPoint =
        BoundaryPoint { x: f64::NAN, y: f64::NAN, low: f64::NAN, high: f64::NAN, rising: None };
    let height = |place: &BoundaryPoint| {
        if place.y.is_nan() { 0.5 * (place.low + place.high) } else { place.y }
    };
    let mut lines: Vec<Vec<BoundaryPoint>> = Vec::new();
    for (k, &x) in grid.iter().enumerate() {
        let here = places.iter().filter(|place| place.x == x && height(place).is_finite());
        let here: Vec<BoundaryPoint> = here.copied().collect();
        // Pairs of a curve that had a point at the last x and a point at this one, nearest first.
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (line, known) in lines.iter().enumerate() {
            for (place, new) in here.iter().enumerate() {
                let apart = (height(&known[k - 1]) - height(new)).abs();
                if apart.is_finite() && known[k - 1].rising == new.rising {
                    pairs.push((apart, line, place));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut taken = vec![None; here.len()];
        for (_, line, place) in pairs {
            if taken[place].is_none() && !taken.contains(&Some(line)) {
                taken[place] = Some(line);
            }
        }
        for (place, line) in here.into_iter().zip(taken) {
            let line = line.unwrap_or_else(|| {
                lines.push(vec![GAP; grid.len()]);
                lines.len() - 1
            });
            lines[line][k] = place;
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fold_continues_the_nearest_curve() {
        let place =
            |x: f64, y: f64| BoundaryPoint { x, y, low: y - 0.1, high: y + 0.1, rising: None };
        let places = [
            place(1.0, 250.0),
            place(2.0, 238.0),
            place(2.0, 239.0),
            place(2.0, 259.0),
            place(3.0, 243.0),
            place(3.0, 265.0),
        ];
        let lines: Vec<Vec<f64>> = join_curves(&[1.0, 2.0, 3.0], &places)
            .iter()
            .map(|line| line.iter().map(|place| place.y).collect())
            .collect();
        assert_eq!(lines[0], [250.0, 259.0, 265.0]);
        assert_eq!(lines.len(), 3);
        assert!(lines[1][0].is_nan() && lines[1][1] == 238.0 && lines[1][2].is_nan());
        assert_eq!(lines[2][1..], [239.0, 243.0]);
    }

    #[test]
    fn curves_of_opposite_sides_do_not_cross() {
        let place = |x: f64, y: f64, rising| BoundaryPoint {
            x,
            y,
            low: y - 0.1,
            high: y + 0.1,
            rising: Some(rising),
        };
        let places = [
            place(1.0, 238.5, false),
            place(1.0, 239.6, true),
            place(2.0, 240.0, false),
            place(2.0, 245.4, true),
        ];
        let lines: Vec<Vec<f64>> = join_curves(&[1.0, 2.0], &places)
            .iter()
            .map(|line| line.iter().map(|place| place.y).collect())
            .collect();
        assert_eq!(lines, [[238.5, 240.0], [239.6, 245.4]]);
    }
}
