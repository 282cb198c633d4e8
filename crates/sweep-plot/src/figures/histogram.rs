//! The distribution of a quantity over a design's points, and the share of points on each side of
//! its limit.

use crate::axis::{AxisScale, extremes};
use crate::chart::{Chart, ChartPanel, Mark, Series, Style};
use crate::figures::matrix::colour;
use crate::label::{self, Label};
use crate::layer::DividingLimit;
use crate::scatter::{Scatter, Side};

/// Maximum number of bins. Basis: bins of 12 px. Doubling it makes bins too narrow to read.
const MAX_BINS: f64 = 60.0;

/// Draws the histogram of a design.
pub(crate) fn chart(scatter: &Scatter) -> Chart {
    let edges = edges(scatter);
    let ends: Vec<f64> = edges.windows(2).flatten().copied().collect();
    let with_value = scatter.count_with_value().max(1) as f64;
    let series = [Side::Good, Side::Bad].into_iter().filter_map(|side| {
        let mut counts = vec![0_u32; edges.len() - 1];
        for (value, own) in scatter.quantity.iter().zip(&scatter.sides) {
            if *own == side && value.is_finite() {
                let bin = edges[1..edges.len() - 1].partition_point(|edge| edge <= value);
                counts[bin] += 1;
            }
        }
        let share = |bin: usize| 100.0 * f64::from(counts[bin]) / with_value;
        // The bars of a side run from its first bin with points to its last.
        let filled = |bin: &usize| counts[*bin] > 0;
        let first = (0..counts.len()).find(filled)?;
        let last = (0..counts.len()).rfind(filled)?;
        let both_ends = (0..counts.len()).flat_map(|bin| {
            let within = (first..=last).contains(&bin);
            [if within { share(bin) } else { f64::NAN }; 2]
        });
        let y: Vec<f64> = both_ends.collect();
        let low = y.iter().map(|share| 0.0 * share).collect();
        let style = Style::Band(low, y.clone());
        Some(Series::new(scatter.words(side), colour(side), ends.clone(), y, style))
    });
    let series: Vec<Series> = series.collect();
    let greatest = extremes(series.iter().flat_map(|series| series.y.iter().copied()));
    let highest = greatest.map_or(100.0, |(_, greatest)| 1.06 * greatest);
    let level = level(scatter);
    let mark = level.map(|level| Mark {
        x: level.value,
        label: label::with_unit(&label::significant(level.value, 4), &scatter.label.unit)
            .replace(['(', ')'], ""),
    });
    Chart {
        title: title(scatter),
        subtitle: scatter.subtitle(&notes(scatter)),
        x_label: scatter.label.clone(),
        x_log: scatter.log,
        panels: vec![ChartPanel {
            range: Some((0.0, highest)),
            ..ChartPanel::new("points", Label::new("Share of the points", "%"), series)
        }],
        mark_meaning: level.map_or(String::new(), |level| level.line.clone()),
        marks: mark.into_iter().collect(),
        ..Chart::default()
    }
}

/// Returns the title with the share of points on the good side.
fn title(scatter: &Scatter) -> String {
    let words = match scatter.words(Side::Good) {
        // The words for the good side may be "reliable: below 2"; the title needs only the first.
        words if words.starts_with("reliable") => "reliable".to_owned(),
        words => format!("with {words}"),
    };
    match scatter.share() {
        Some(share) => {
            format!("{}: {:.1} % of the points {words}", scatter.title, 100.0 * share.part)
        }
        None => scatter.title.clone(),
    }
}

/// Returns the notes on the confidence interval of a random design and on points without a side.
fn notes(scatter: &Scatter) -> Vec<String> {
    let mut notes = Vec::new();
    let is_drawn = scatter.source.design_method() != Some("list");
    if let Some(share) = scatter.share().filter(|_| is_drawn) {
        let [low, high] = [share.low, share.high].map(|part| 100.0 * part);
        notes.push(format!("with 95 % confidence {low:.1} to {high:.1} % (Wilson)"));
    }
    let [.., undefined, failed] = scatter.counts;
    for (count, word) in [(undefined, "undefined"), (failed, "failed")] {
        if count > 0 {
            notes.push(format!("{count} {word}"));
        }
    }
    notes
}

/// Returns the limit, unless all points are so far from it that they would fill a small part of the
/// axis.
fn level(scatter: &Scatter) -> Option<&DividingLimit> {
    let level = scatter.level.as_ref()?;
    let known = scatter.quantity.iter().copied().filter(|value| !scatter.log || *value > 0.0);
    let coordinate = |value: f64| if scatter.log { value.ln() } else { value };
    let (low, high) = extremes(known.map(coordinate))?;
    let span = high - low;
    let at = coordinate(level.value);
    (low - span..=high + span).contains(&at).then_some(level)
}

/// Returns the edges of bins of equal width on the quantity's scale, one of them at the limit. The
/// number of bins is twice the cube root of the number of points (Rice's rule).
fn edges(scatter: &Scatter) -> Vec<f64> {
    let level = level(scatter).map(|level| level.value);
    let known = scatter.quantity.iter().copied().chain(level);
    let known = known.filter(|value| !scatter.log || *value > 0.0);
    let (low, high) = extremes(known).unwrap_or((1.0, 2.0));
    let scale = if scatter.log { AxisScale::log(low, high) } else { AxisScale::linear(low, high) };
    let back = |coordinate: f64| if scatter.log { coordinate.exp() } else { coordinate };
    let low = scale.coordinate(low);
    let high = scale.coordinate(high);
    let count = (2.0 * (scatter.count_with_value() as f64).cbrt()).ceil().clamp(4.0, MAX_BINS);
    let width = if high > low { (high - low) / count } else { low.abs().max(1.0) / count };
    let origin = level.map_or(low, |level| scale.coordinate(level));
    let first = ((low - origin) / width).floor() as i64;
    // The last bin must reach the greatest value.
    let last = (((high - origin) / width).ceil() as i64).max(first + 1);
    (first..=last)
        .map(|k| match level {
            Some(level) if k == 0 => level,
            _ => back(origin + k as f64 * width),
        })
        .collect()
}
