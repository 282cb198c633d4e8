//! The distribution of a quantity over a design's points, and the share of points on each side of
//! its limit.

use crate::axis::{AxisScale, extremes};
use crate::chart::{Chart, ChartPanel, Mark, Series, SeriesStyle};
use crate::figures::matrix::side_colour;
use crate::label::{self, Label};
use crate::layer::DividingLimit;
use crate::scatter::{Scatter, Side};

/// Maximum number of bins. Basis: bins of 12 px. Doubling it makes bins too narrow to read.
const MAX_HISTOGRAM_BINS: f64 = 60.0;

/// Draws the histogram of a design.
pub(crate) fn histogram_chart(scatter: &Scatter) -> Chart {
    let bin_edges = compute_bin_edges(scatter);
    let bin_ends: Vec<f64> = bin_edges.windows(2).flatten().copied().collect();
    let value_count = scatter.count_with_value().max(1) as f64;
    let series = [Side::Good, Side::Bad].into_iter().filter_map(|side| {
        let mut counts = vec![0_u32; bin_edges.len() - 1];
        for (value, side_of_point) in scatter.quantity_values.iter().zip(&scatter.sides) {
            if *side_of_point == side && value.is_finite() {
                let bin = bin_edges[1..bin_edges.len() - 1].partition_point(|edge| edge <= value);
                counts[bin] += 1;
            }
        }
        let percentage = |bin: usize| 100.0 * f64::from(counts[bin]) / value_count;
        // The bars of a side run from its first bin with points to its last.
        let has_points = |bin: &usize| counts[*bin] > 0;
        let first_bin = (0..counts.len()).find(has_points)?;
        let last_bin = (0..counts.len()).rfind(has_points)?;
        let percentages_at_ends = (0..counts.len()).flat_map(|bin| {
            let is_in_range = (first_bin..=last_bin).contains(&bin);
            [if is_in_range { percentage(bin) } else { f64::NAN }; 2]
        });
        let y: Vec<f64> = percentages_at_ends.collect();
        let base_percentages = y.iter().map(|percentage| 0.0 * percentage).collect();
        let style = SeriesStyle::Band(base_percentages, y.clone());
        Some(Series::new(scatter.side_meaning(side), side_colour(side), bin_ends.clone(), y, style))
    });
    let series: Vec<Series> = series.collect();
    let greatest_percentage = extremes(series.iter().flat_map(|series| series.y.iter().copied()));
    let y_top =
        greatest_percentage.map_or(100.0, |(_, greatest_percentage)| 1.06 * greatest_percentage);
    let limit = shown_limit(scatter);
    let mark = limit.map(|limit| Mark {
        x: limit.value,
        label: label::with_unit(&label::format_significant(limit.value, 4), &scatter.label.unit)
            .replace(['(', ')'], ""),
    });
    Chart {
        title: histogram_title(scatter),
        subtitle: scatter.subtitle(&histogram_notes(scatter)),
        x_label: scatter.label.clone(),
        is_x_log: scatter.is_log,
        panels: vec![ChartPanel {
            y_range: Some((0.0, y_top)),
            ..ChartPanel::new("points", Label::new("Share of the points", "%"), series)
        }],
        mark_meaning: limit.map_or(String::new(), |limit| limit.line_name.clone()),
        marks: mark.into_iter().collect(),
        ..Chart::default()
    }
}

/// Returns the title with the share of points on the good side.
fn histogram_title(scatter: &Scatter) -> String {
    let side_words = match scatter.side_meaning(Side::Good) {
        // The words for the good side may be "reliable: below 2"; the title needs only the first.
        words if words.starts_with("reliable") => "reliable".to_owned(),
        words => format!("with {words}"),
    };
    match scatter.good_share() {
        Some(share) => {
            format!("{}: {:.1} % of the points {side_words}", scatter.title, 100.0 * share.fraction)
        }
        None => scatter.title.clone(),
    }
}

/// Returns the notes on the confidence interval of a random design and on points without a side.
fn histogram_notes(scatter: &Scatter) -> Vec<String> {
    let mut notes = Vec::new();
    let is_random = scatter.source.design_method() != Some("list");
    if let Some(share) = scatter.good_share().filter(|_| is_random) {
        let [low, high] = [share.low, share.high].map(|fraction| 100.0 * fraction);
        notes.push(format!("with 95 % confidence {low:.1} to {high:.1} % (Wilson)"));
    }
    let [.., undefined, failed] = scatter.side_counts;
    for (count, word) in [(undefined, "undefined"), (failed, "failed")] {
        if count > 0 {
            notes.push(format!("{count} {word}"));
        }
    }
    notes
}

/// Returns the limit, unless all points are so far from it that they would fill a small part of the
/// axis.
fn shown_limit(scatter: &Scatter) -> Option<&DividingLimit> {
    let limit = scatter.limit.as_ref()?;
    let shown_values =
        scatter.quantity_values.iter().copied().filter(|value| !scatter.is_log || *value > 0.0);
    let to_coordinate = |value: f64| if scatter.is_log { value.ln() } else { value };
    let (low, high) = extremes(shown_values.map(to_coordinate))?;
    let value_span = high - low;
    let limit_coordinate = to_coordinate(limit.value);
    (low - value_span..=high + value_span).contains(&limit_coordinate).then_some(limit)
}

/// Returns the edges of bins of equal width on the quantity's scale, one of them at the limit. The
/// number of bins is twice the cube root of the number of points (Rice's rule).
fn compute_bin_edges(scatter: &Scatter) -> Vec<f64> {
    let limit = shown_limit(scatter).map(|limit| limit.value);
    let shown_values = scatter.quantity_values.iter().copied().chain(limit);
    let shown_values = shown_values.filter(|value| !scatter.is_log || *value > 0.0);
    let (low, high) = extremes(shown_values).unwrap_or((1.0, 2.0));
    let scale = if scatter.is_log {
        AxisScale::logarithmic(low, high)
    } else {
        AxisScale::linear(low, high)
    };
    let from_coordinate =
        |coordinate: f64| if scatter.is_log { coordinate.exp() } else { coordinate };
    let low_coordinate = scale.coordinate(low);
    let high_coordinate = scale.coordinate(high);
    let bin_count =
        (2.0 * (scatter.count_with_value() as f64).cbrt()).ceil().clamp(4.0, MAX_HISTOGRAM_BINS);
    let bin_width = if high_coordinate > low_coordinate {
        (high_coordinate - low_coordinate) / bin_count
    } else {
        low_coordinate.abs().max(1.0) / bin_count
    };
    let origin = limit.map_or(low_coordinate, |limit| scale.coordinate(limit));
    let first_edge_index = ((low_coordinate - origin) / bin_width).floor() as i64;
    // The last bin must reach the greatest value.
    let last_edge_index =
        (((high_coordinate - origin) / bin_width).ceil() as i64).max(first_edge_index + 1);
    (first_edge_index..=last_edge_index)
        .map(|k| match limit {
            Some(limit) if k == 0 => limit,
            _ => from_coordinate(origin + k as f64 * bin_width),
        })
        .collect()
}
