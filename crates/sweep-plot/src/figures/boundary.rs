//! The traced curve on which a quantity is at its limit, with the bracket it is known to lie in.

use serde_json::Value;
use sweep_files::key;
use sweep_parameter::Worse;

use crate::axis::evenly_by_log;
use crate::chart::{Chart, ChartPanel, Series, Style};
use crate::colour::DISTINCT;
use crate::error::Result;
use crate::read::bracket;
use crate::table::{Column, Table};
use crate::{PlotError, label, together};

/// One place of the file: where it is, and the bracket it lies in. The place is NaN where there is
/// no such number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    x: f64,
    y: f64,
    low: f64,
    high: f64,
    /// The quantity is above its limit on the far side, where the file says so: a curve keeps its
    /// sides.
    rising: Option<bool>,
}

/// The chart of a boundary file: its first column across, its second up, the bracket shaded; a
/// curve for every combination of the axes beyond the second.
///
/// # Errors
/// [`PlotError::Undrawable`] with fewer than two points.
pub(crate) fn chart(table: &Table) -> Result<Chart> {
    let columns: Vec<&Column> =
        table.columns.iter().filter(|column| column.numbers().is_some()).collect();
    let names: Vec<&str> = columns.iter().map(|column| column.facts.name.as_str()).collect();
    let empty = || table.source.empty("a curve needs at least two points");
    let (low, high) = bracket(&names).ok_or_else(empty)?;
    let (x, y) = (columns[0], columns[1]);
    let (xs, ys) = (table.numbers(&x.facts.name)?, table.numbers(&y.facts.name)?);
    let (lows, highs) = (table.numbers(low)?, table.numbers(high)?);
    let mut grid: Vec<f64> = xs.iter().copied().filter(|x| x.is_finite()).collect();
    grid.sort_by(f64::total_cmp);
    grid.dedup();
    if grid.len() < 2 {
        return Err(empty());
    }
    let sides =
        ["quantity_low", "quantity_high"].map(|name| table.column(name).and_then(Column::numbers));
    let rising = |row: usize| {
        let [below, above] = sides.map(|values| values.map_or(f64::NAN, |values| values[row]));
        below.partial_cmp(&above).map(std::cmp::Ordering::is_lt)
    };
    let mut curves: Vec<(String, Vec<Place>)> = Vec::new();
    for row in 0..table.rows {
        let place =
            Place { x: xs[row], y: ys[row], low: lows[row], high: highs[row], rising: rising(row) };
        let further = further(table, row);
        match curves.iter_mut().find(|(name, _)| *name == further) {
            Some((_, places)) => places.push(place),
            None => curves.push((further, vec![place])),
        }
    }
    let said = limit(table);
    let mut series = Vec::new();
    for (k, (further, places)) in curves.iter().enumerate() {
        let name = if further.is_empty() {
            format!("boundary: {said}, bracket shaded")
        } else {
            format!("{said}, {further}")
        };
        let colour = DISTINCT[k % DISTINCT.len()];
        series.extend(branches(&grid, places).into_iter().map(|branch| {
            let pick = |of: fn(&Place) -> f64| branch.iter().map(of).collect::<Vec<f64>>();
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
        x_log: evenly_by_log(&grid),
        panels: vec![ChartPanel { height: 440.0, ..panel }],
        ..Chart::default()
    })
}

/// What the region above the uppermost places is, where all of these say the same.
fn far_side(curves: &[(String, Vec<Place>)], [falling, rising]: [&str; 2]) -> String {
    let all = curves.iter().flat_map(|(_, places)| places);
    let mut uppermost: Vec<&Place> = all.filter(|place| place.y.is_finite()).collect();
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

/// The quantity that is at its limit: its column's name in a map.
fn quantity(table: &Table) -> &str {
    table.source.find("quantity").and_then(Value::as_str).unwrap_or("ratio_max")
}

/// What the side is towards which the quantity falls below its limit, and the other.
fn side_words(table: &Table) -> [&'static str; 2] {
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

/// Whether that is a ratio of both models.
fn is_ratio(quantity: &str) -> bool {
    quantity.starts_with("ratio_")
}

/// As in "least gap, nonlinear model".
fn in_words(quantity: &str) -> String {
    match label::of_model(quantity) {
        (words, "") => words,
        (words, model) => format!("{words}, {model} model"),
    }
}

/// Whether that is the growth of disturbances.
fn is_growth(quantity: &str) -> bool {
    quantity.starts_with("growth")
}

/// What of its plan the boundary follows from, beside its limit, which is named.
pub(crate) fn follows_from(table: &Table) -> Vec<&'static str> {
    let known = table.source.known;
    match quantity(table) {
        growth if is_growth(growth) => known.of_machine.to_vec(),
        "ratio_max" | "ratio_min" => together::of_ratios(known),
        _ => together::of_runs(known),
    }
}

/// A boundary over a map's two axes.
pub(crate) struct Overlay {
    /// What it says.
    pub(crate) name: String,
    /// Its lines, by the values of both axes; NaN where a line has a gap.
    pub(crate) lines: Vec<Vec<[f64; 2]>>,
}

/// The lines of a boundary file over these two axes.
///
/// # Errors
/// [`PlotError::Unfit`] if it has others, or further ones; otherwise as [`chart`].
pub(crate) fn overlay(table: &Table, axes: [&str; 2]) -> Result<Overlay> {
    let names: Vec<&str> = table.source.planned_axes().collect();
    if names != axes {
        let [names, axes] = [&names[..], &axes].map(|all| all.join(", "));
        let said = format!("is a boundary over {names}; the map is over {axes}");
        return Err(PlotError::Unfit(format!("{} {said}", table.source.path.display())));
    }
    let chart = chart(table)?;
    let name = format!("traced boundary: {}", limit(table));
    let series = chart.panels.into_iter().flat_map(|panel| panel.series);
    let lines = series.map(|series| series.x.iter().zip(series.y).map(|(&x, y)| [x, y]).collect());
    Ok(Overlay { name, lines: lines.collect() })
}

/// What is at its limit, as the file says, or else the ratio.
fn limit(table: &Table) -> String {
    let about = table.source.find(key::BOUNDARY);
    let told = about.and_then(|about| about.get(key::LIMIT)?.as_f64());
    let unit = table.column("quantity_low").map_or("", |column| &column.facts.unit);
    let (unit, factor) = label::shown(unit);
    let limit = told.map_or(table.source.ratio_limit(), |limit| limit * factor);
    let limit = label::valued("", limit, unit);
    match quantity(table) {
        "ratio_max" => format!("ratio {limit}"),
        growth if is_growth(growth) && told.is_none_or(|limit| limit == 0.0) => {
            "no growth at any speed".to_owned()
        }
        other => format!("{} {limit}", in_words(other)),
    }
}

/// The values of the axes beyond the second, which the plan in the file names.
fn further(table: &Table, row: usize) -> String {
    let said = table.source.planned_axes().skip(2).filter_map(|name| {
        let column = table.column(name)?;
        let value = *column.numbers()?.get(row)?;
        Some(label::valued(&label::words(name), value, &column.facts.unit))
    });
    said.collect::<Vec<_>>().join(", ")
}

/// A curve's places as lines that have one each along the grid: where there are several, each goes
/// on from the line, of those with the same sides, whose last place is nearest.
fn branches(grid: &[f64], places: &[Place]) -> Vec<Vec<Place>> {
    const NOWHERE: Place =
        Place { x: f64::NAN, y: f64::NAN, low: f64::NAN, high: f64::NAN, rising: None };
    let height =
        |place: &Place| if place.y.is_nan() { 0.5 * (place.low + place.high) } else { place.y };
    let mut lines: Vec<Vec<Place>> = Vec::new();
    for (k, &x) in grid.iter().enumerate() {
        let here = places.iter().filter(|place| place.x == x && height(place).is_finite());
        let here: Vec<Place> = here.copied().collect();
        // Pairs of a line that was there at the last value and a place here, nearest first.
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
                lines.push(vec![NOWHERE; grid.len()]);
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
    fn a_fold_goes_on_from_the_nearest_line() {
        let place = |x: f64, y: f64| Place { x, y, low: y - 0.1, high: y + 0.1, rising: None };
        let places = [
            place(1.0, 250.0),
            place(2.0, 238.0),
            place(2.0, 239.0),
            place(2.0, 259.0),
            place(3.0, 243.0),
            place(3.0, 265.0),
        ];
        let lines: Vec<Vec<f64>> = branches(&[1.0, 2.0, 3.0], &places)
            .iter()
            .map(|line| line.iter().map(|place| place.y).collect())
            .collect();
        assert_eq!(lines[0], [250.0, 259.0, 265.0]);
        assert_eq!(lines.len(), 3);
        assert!(lines[1][0].is_nan() && lines[1][1] == 238.0 && lines[1][2].is_nan());
        assert_eq!(lines[2][1..], [239.0, 243.0]);
    }

    #[test]
    fn the_edges_of_a_pocket_do_not_cross() {
        let place = |x: f64, y: f64, rising| Place {
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
        let lines: Vec<Vec<f64>> = branches(&[1.0, 2.0], &places)
            .iter()
            .map(|line| line.iter().map(|place| place.y).collect())
            .collect();
        assert_eq!(lines, [[238.5, 240.0], [239.6, 245.4]]);
    }
}
