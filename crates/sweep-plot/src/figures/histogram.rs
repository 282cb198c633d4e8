//! How a quantity is distributed over a design's points, and the share of them on either side.

use crate::axis::{Scale, extremes};
use crate::chart::{Chart, ChartPanel, Mark, Series, Style};
use crate::figures::matrix::colour;
use crate::label::{self, Label};
use crate::layer::Level;
use crate::scatter::{Scatter, Side};

/// Most bins.
const MOST_BINS: f64 = 60.0;

/// The chart of a design: how many points have which value of the quantity.
pub(crate) fn chart(scatter: &Scatter) -> Chart {
    let edges = edges(scatter);
    let ends: Vec<f64> = edges.windows(2).flatten().copied().collect();
    let valued = scatter.valued().max(1) as f64;
    let series = [Side::Good, Side::Bad].into_iter().filter_map(|side| {
        let mut counts = vec![0_u32; edges.len() - 1];
        for (value, own) in scatter.quantity.iter().zip(&scatter.sides) {
            if *own == side && value.is_finite() {
                let bin = edges[1..edges.len() - 1].partition_point(|edge| edge <= value);
                counts[bin] += 1;
            }
        }
        let share = |bin: usize| 100.0 * f64::from(counts[bin]) / valued;
        // From its first bin that is not empty to its last.
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

/// What share of the points is on the good side.
fn title(scatter: &Scatter) -> String {
    let words = match scatter.words(Side::Good) {
        // The first word of "reliable: below 2".
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

/// How sure the share is, where points are drawn, and which it does not count.
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

/// The level, unless all points are so far from it that they would fill a small part of the axis.
fn level(scatter: &Scatter) -> Option<&Level> {
    let level = scatter.level.as_ref()?;
    let known = scatter.quantity.iter().copied().filter(|value| !scatter.log || *value > 0.0);
    let even = |value: f64| if scatter.log { value.ln() } else { value };
    let (low, high) = extremes(known.map(even))?;
    let (span, at) = (high - low, even(level.value));
    (low - span..=high + span).contains(&at).then_some(level)
}

/// Rising borders of bins as wide as each other on the quantity's scale, one of them at the level.
/// Their number grows with the cube root of the points': twice that, after Rice's rule.
fn edges(scatter: &Scatter) -> Vec<f64> {
    let level = level(scatter).map(|level| level.value);
    let known = scatter.quantity.iter().copied().chain(level);
    let known = known.filter(|value| !scatter.log || *value > 0.0);
    let (low, high) = extremes(known).unwrap_or((1.0, 2.0));
    let scale = if scatter.log { Scale::log(low, high) } else { Scale::linear(low, high) };
    let back = |even: f64| if scatter.log { even.exp() } else { even };
    let (low, high) = (scale.even(low), scale.even(high));
    let count = (2.0 * (scatter.valued() as f64).cbrt()).ceil().clamp(4.0, MOST_BINS);
    let width = if high > low { (high - low) / count } else { low.abs().max(1.0) / count };
    let origin = level.map_or(low, |level| scale.even(level));
    let first = ((low - origin) / width).floor() as i64;
    // The greatest value lies within the last bin or at its end.
    let last = (((high - origin) / width).ceil() as i64).max(first + 1);
    (first..=last)
        .map(|k| match level {
            Some(level) if k == 0 => level,
            _ => back(origin + k as f64 * width),
        })
        .collect()
}
