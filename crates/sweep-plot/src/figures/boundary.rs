//! The figure of a boundary file: the curve on which a quantity is at its limit, with its bracket.

use serde_json::Value;
use sweep_files::key;
use sweep_parameter::Worse;

use crate::axis::is_log_spaced;
use crate::chart::{Chart, ChartPanel, Series, SeriesStyle};
use crate::colour::DISTINCT_COLOURS;
use crate::error::Result;
use crate::read::bracket_columns;
use crate::table::{FigureColumn, FigureTable};
use crate::{PlotError, label, together};

/// A point of the boundary with its bracket. Coordinates are NaN if the file has no number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BoundaryPoint {
    x: f64,
    y: f64,
    low: f64,
    high: f64,
    /// Whether the quantity exceeds its limit above the point, if the file has the quantity on both
    /// sides. All points of a curve have the same value.
    is_rising: Option<bool>,
}

/// Draws a boundary file: the first column along x, the second along y, the bracket shaded; a curve
/// for every combination of the axes beyond the second.
///
/// # Errors
/// [`PlotError::Undrawable`] with fewer than two points.
pub(crate) fn boundary_chart(table: &FigureTable) -> Result<Chart> {
    let columns: Vec<&FigureColumn> =
        table.columns.iter().filter(|column| column.numbers().is_some()).collect();
    let column_names: Vec<&str> = columns.iter().map(|column| column.facts.name.as_str()).collect();
    let too_few_points_error =
        || table.source.nothing_to_draw_error("a curve needs at least two points");
    let (low, high) = bracket_columns(&column_names).ok_or_else(too_few_points_error)?;
    let x_column = columns[0];
    let y_column = columns[1];
    let xs = table.numbers(&x_column.facts.name)?;
    let ys = table.numbers(&y_column.facts.name)?;
    let lows = table.numbers(low)?;
    let highs = table.numbers(high)?;
    let mut x_values: Vec<f64> = xs.iter().copied().filter(|x| x.is_finite()).collect();
    x_values.sort_by(f64::total_cmp);
    x_values.dedup();
    if x_values.len() < 2 {
        return Err(too_few_points_error());
    }
    let quantities_at_ends = ["quantity_low", "quantity_high"]
        .map(|name| table.column(name).and_then(FigureColumn::numbers));
    let is_rising = |row: usize| {
        let [below, above] =
            quantities_at_ends.map(|values| values.map_or(f64::NAN, |values| values[row]));
        below.partial_cmp(&above).map(std::cmp::Ordering::is_lt)
    };
    let mut curves: Vec<(String, Vec<BoundaryPoint>)> = Vec::new();
    for row in 0..table.rows {
        let point = BoundaryPoint {
            x: xs[row],
            y: ys[row],
            low: lows[row],
            high: highs[row],
            is_rising: is_rising(row),
        };
        let further_axes_text = describe_further_axes(table, row);
        match curves.iter_mut().find(|(name, _)| *name == further_axes_text) {
            Some((_, points)) => points.push(point),
            None => curves.push((further_axes_text, vec![point])),
        }
    }
    let limit_text = limit_in_words(table);
    let mut series = Vec::new();
    for (k, (further_axes_text, points)) in curves.iter().enumerate() {
        let name = if further_axes_text.is_empty() {
            format!("boundary: {limit_text}, bracket shaded")
        } else {
            format!("{limit_text}, {further_axes_text}")
        };
        let colour = DISTINCT_COLOURS[k % DISTINCT_COLOURS.len()];
        series.extend(join_curves(&x_values, points).into_iter().map(|branch| {
            let collect_values =
                |value: fn(&BoundaryPoint) -> f64| branch.iter().map(value).collect::<Vec<f64>>();
            let style = SeriesStyle::Band(
                collect_values(|point| point.low),
                collect_values(|point| point.high),
            );
            Series::new(
                name.clone(),
                colour,
                x_values.clone(),
                collect_values(|point| point.y),
                style,
            )
        }));
    }
    let region_note = upper_region_note(&curves, side_words(table));
    let x_name = x_column.label().words.to_lowercase();
    let panel = ChartPanel::new("boundary", y_column.label(), series);
    Ok(Chart {
        title: match quantity_name(table) {
            growth if is_growth(growth) => "Where the machine may dwell at any speed".to_owned(),
            ratio if is_ratio(ratio) => "Boundary of the linear model's reliability".to_owned(),
            other => match label::condition(other) {
                Some(condition) => format!("Where {condition}"),
                None => format!("Where {}", limit_in_words(table)),
            },
        },
        subtitle: table
            .source
            .subtitle(&format!("{} values of {x_name}{region_note}", x_values.len())),
        x_label: x_column.label(),
        is_x_log: is_log_spaced(&x_values),
        panels: vec![ChartPanel { height: 440.0, ..panel }],
        ..Chart::default()
    })
}

/// Returns the note on the region above the uppermost points, if it is the same for all of them.
fn upper_region_note(
    curves: &[(String, Vec<BoundaryPoint>)],
    [falling_words, rising_words]: [&str; 2],
) -> String {
    let all_points = curves.iter().flat_map(|(_, points)| points);
    let mut uppermost: Vec<&BoundaryPoint> =
        all_points.filter(|point| point.y.is_finite()).collect();
    let crossing_count = uppermost.len();
    uppermost.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
    uppermost.dedup_by(|a, b| a.x == b.x);
    let is_rising = uppermost.first().and_then(|point| point.is_rising);
    let region_words =
        match is_rising.filter(|_| uppermost.iter().all(|point| point.is_rising == is_rising)) {
            Some(true) => rising_words,
            Some(false) => falling_words,
            None => return String::new(),
        };
    let line_words = if crossing_count > uppermost.len() { "highest crossing" } else { "line" };
    format!(" · {region_words} above the {line_words}")
}

/// Returns the name of the quantity, which is that of its column in a map.
fn quantity_name(table: &FigureTable) -> &str {
    table.source.find_metadata("quantity").and_then(Value::as_str).unwrap_or("ratio_max")
}

/// Returns the words for the side below the limit and for the side above it.
fn side_words(table: &FigureTable) -> [&'static str; 2] {
    let settings = table.source.find_metadata(key::BOUNDARY);
    let worse = settings.and_then(|settings| Worse::named(settings.get(key::WORSE)?.as_str()?));
    match (quantity_name(table), worse) {
        (margin, _) if label::condition(margin).is_some() => ["it does not hold", "it holds"],
        (growth, _) if is_growth(growth) => ["stable", "unstable"],
        ("ratio_min", _) => ["unreliable", "reliable"],
        (ratio, _) if is_ratio(ratio) => ["reliable", "unreliable"],
        (_, Some(Worse::Less)) => ["beyond the limit", "within the limit"],
        _ => ["within the limit", "beyond the limit"],
    }
}

/// Returns whether a quantity is a ratio of both models.
fn is_ratio(quantity: &str) -> bool {
    is_column(quantity) && quantity.starts_with("ratio_")
}

/// Returns whether a quantity is a column, not an expression of columns.
fn is_column(quantity: &str) -> bool {
    quantity.chars().all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
}

/// Returns the quantity in words, as in "least gap, nonlinear model"; an expression of columns is
/// as the user typed it.
fn quantity_in_words(quantity: &str) -> String {
    if !is_column(quantity) {
        return quantity.to_owned();
    }
    match label::split_model(quantity) {
        (words, "") => words,
        (words, model) => format!("{words}, {model} model"),
    }
}

/// Returns whether a quantity is the growth of disturbances.
fn is_growth(quantity: &str) -> bool {
    is_column(quantity) && quantity.starts_with("growth")
}

/// Returns the parts of a plan on which the boundary depends, except its limit, which the figure
/// states.
pub(crate) fn plan_sections(table: &FigureTable) -> Vec<&'static str> {
    let model_kinds = table.source.model_kinds;
    match quantity_name(table) {
        growth if is_growth(growth) => model_kinds.machine_sections.to_vec(),
        "ratio_max" | "ratio_min" => together::ratio_sections(model_kinds),
        _ => together::history_sections(model_kinds),
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
pub(crate) fn boundary_overlay(table: &FigureTable, axes: [&str; 2]) -> Result<Overlay> {
    let axis_names: Vec<&str> = table.source.planned_axes().collect();
    if axis_names != axes {
        let [own_axes, map_axes] = [&axis_names[..], &axes].map(|names| names.join(", "));
        let phrase = format!("is a boundary over {own_axes}; the map is over {map_axes}");
        return Err(PlotError::Unfit(format!("{} {phrase}", table.source.path.display())));
    }
    let chart = boundary_chart(table)?;
    let name = format!("traced boundary: {}", limit_in_words(table));
    let series = chart.panels.into_iter().flat_map(|panel| panel.series);
    let lines = series.map(|series| series.x.iter().zip(series.y).map(|(&x, y)| [x, y]).collect());
    Ok(Overlay { name, lines: lines.collect() })
}

/// Returns the limit in words: that of the metadata, or the ratio's limit if the metadata has none.
fn limit_in_words(table: &FigureTable) -> String {
    let settings = table.source.find_metadata(key::BOUNDARY);
    let limit_in_file = settings.and_then(|settings| settings.get(key::LIMIT)?.as_f64());
    let unit = table.column("quantity_low").map_or("", |column| column.facts.unit());
    let (unit, factor) = label::display_unit(unit);
    let limit = limit_in_file.map_or(table.source.ratio_limit(), |limit| limit * factor);
    let limit = label::with_value("", limit, unit);
    match quantity_name(table) {
        "ratio_max" => format!("ratio {limit}"),
        growth if is_growth(growth) && limit_in_file.is_none_or(|limit| limit == 0.0) => {
            "no growth at any speed".to_owned()
        }
        other => match label::condition(other) {
            Some(condition) => format!("limit of {condition}"),
            None => format!("{} = {limit}", quantity_in_words(other)),
        },
    }
}

/// Returns the values of the axes beyond the second, which the plan in the file names.
fn describe_further_axes(table: &FigureTable, row: usize) -> String {
    let further_values = table.source.planned_axes().skip(2).filter_map(|name| {
        let column = table.column(name)?;
        let value = *column.numbers()?.get(row)?;
        Some(label::with_value(&label::name_in_words(name), value, column.facts.unit()))
    });
    further_values.collect::<Vec<_>>().join(", ")
}

/// Joins the points of a boundary to curves with at most one point for each x. If there are several
/// points at an x, each continues the curve that has the same sides and whose last point is
/// nearest.
fn join_curves(x_values: &[f64], points: &[BoundaryPoint]) -> Vec<Vec<BoundaryPoint>> {
    /// A gap of a curve.
    const GAP_POINT: BoundaryPoint =
        BoundaryPoint { x: f64::NAN, y: f64::NAN, low: f64::NAN, high: f64::NAN, is_rising: None };
    let point_height = |point: &BoundaryPoint| {
        if point.y.is_nan() { 0.5 * (point.low + point.high) } else { point.y }
    };
    let mut curves: Vec<Vec<BoundaryPoint>> = Vec::new();
    for (k, &x) in x_values.iter().enumerate() {
        let points_at_x =
            points.iter().filter(|point| point.x == x && point_height(point).is_finite());
        let points_at_x: Vec<BoundaryPoint> = points_at_x.copied().collect();
        // Pairs of a curve that had a point at the last x and a point at this one, nearest first.
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (curve, curve_points) in curves.iter().enumerate() {
            for (point, new_point) in points_at_x.iter().enumerate() {
                let distance = (point_height(&curve_points[k - 1]) - point_height(new_point)).abs();
                if distance.is_finite() && curve_points[k - 1].is_rising == new_point.is_rising {
                    pairs.push((distance, curve, point));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut curve_by_point = vec![None; points_at_x.len()];
        for (_, curve, point) in pairs {
            if curve_by_point[point].is_none() && !curve_by_point.contains(&Some(curve)) {
                curve_by_point[point] = Some(curve);
            }
        }
        for (point, curve) in points_at_x.into_iter().zip(curve_by_point) {
            let curve = curve.unwrap_or_else(|| {
                curves.push(vec![GAP_POINT; x_values.len()]);
                curves.len() - 1
            });
            curves[curve][k] = point;
        }
    }
    curves
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fold_continues_the_nearest_curve() {
        let create_point =
            |x: f64, y: f64| BoundaryPoint { x, y, low: y - 0.1, high: y + 0.1, is_rising: None };
        let boundary_points = [
            create_point(1.0, 250.0),
            create_point(2.0, 238.0),
            create_point(2.0, 239.0),
            create_point(2.0, 259.0),
            create_point(3.0, 243.0),
            create_point(3.0, 265.0),
        ];
        let curves: Vec<Vec<f64>> = join_curves(&[1.0, 2.0, 3.0], &boundary_points)
            .iter()
            .map(|curve| curve.iter().map(|create_point| create_point.y).collect())
            .collect();
        assert_eq!(curves[0], [250.0, 259.0, 265.0]);
        assert_eq!(curves.len(), 3);
        assert!(curves[1][0].is_nan() && curves[1][1] == 238.0 && curves[1][2].is_nan());
        assert_eq!(curves[2][1..], [239.0, 243.0]);
    }

    #[test]
    fn curves_of_opposite_sides_do_not_cross() {
        let create_point = |x: f64, y: f64, rising| BoundaryPoint {
            x,
            y,
            low: y - 0.1,
            high: y + 0.1,
            is_rising: Some(rising),
        };
        let boundary_points = [
            create_point(1.0, 238.5, false),
            create_point(1.0, 239.6, true),
            create_point(2.0, 240.0, false),
            create_point(2.0, 245.4, true),
        ];
        let curves: Vec<Vec<f64>> = join_curves(&[1.0, 2.0], &boundary_points)
            .iter()
            .map(|curve| curve.iter().map(|create_point| create_point.y).collect())
            .collect();
        assert_eq!(curves, [[238.5, 240.0], [239.6, 245.4]]);
    }
}
