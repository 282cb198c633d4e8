//! How far both models go in each turn of the drum, over its speed: resonances come late on the way
//! up and on the way down.

use crate::WasherFigures;
use crate::kinds::mark_of_speed;
use crate::trace;
use sweep_plot::chart::{Chart, Series, Style};
use sweep_plot::label::Label;
use sweep_plot::table::Table;
use sweep_plot::{DISTINCT, PlotError};

/// A stretch of a trace over which the drum only gains or only loses speed: first and last instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stretch {
    from: usize,
    to: usize,
    gains: bool,
}

/// The whole turns in a stretch, and the mean speed of each.
struct Way {
    gains: bool,
    turns: Vec<[usize; 2]>,
    speed: Vec<f64>,
}

/// The chart of a trace file.
///
/// # Errors
/// As [`trace::chart`]; besides [`PlotError::Undrawable`] without the speed, or where the
/// drum makes no whole turn while its speed changes.
pub(crate) fn chart(table: &Table, options: &WasherFigures) -> Result<Chart, PlotError> {
    let mut chart = trace::chart(table, options)?;
    let time = table.numbers("time_s")?;
    let speed: Vec<f64> = table.numbers("speed_rpm")?.iter().map(|speed| speed.abs()).collect();
    let mean = |&[from, to]: &[usize; 2]| 0.5 * (speed[from] + speed[to]);
    let way = |stretch: Stretch| {
        let turns = turns(time, &speed, stretch);
        Way { gains: stretch.gains, speed: turns.iter().map(mean).collect::<Vec<_>>(), turns }
    };
    let mut turns: Vec<Way> = stretches(&speed).into_iter().map(way).collect();
    turns.retain(|way| !way.turns.is_empty());
    if turns.is_empty() {
        return Err(table.source.empty("the drum makes no whole turn while its speed changes"));
    }
    chart.panels.retain(|panel| panel.name != "gap" && panel.name != "speed");
    for panel in &mut chart.panels {
        panel.series = panel.series.iter().flat_map(|series| by_turn(series, &turns)).collect();
        panel.height = 190.0;
    }
    chart.title = "Greatest deviation in each turn of the drum, over its speed".to_owned();
    let (resonances, note) = trace::resonances(table, options)?;
    chart.subtitle = trace::subtitle(table, &[], None) + &note;
    chart.x_label = Label::new("Spin speed", "rpm");
    chart.marks = resonances.into_iter().map(|speed| mark_of_speed(speed, speed)).collect();
    chart.mark_meaning = "resonance speed".to_owned();
    chart.shades = trace::unstable_speeds(table, options)?;
    Ok(chart)
}

/// A curve over time as one over speed for each stretch.
fn by_turn(series: &Series, ways: &[Way]) -> Vec<Series> {
    let linear = series.name.starts_with("linear") || series.name == "model";
    let curve = |way: &Way| {
        let name =
            format!("{}, speed {}", series.name, if way.gains { "rising" } else { "falling" });
        let y = way.turns.iter().map(|&[from, to]| greatest(&series.y[from..=to])).collect();
        let style = if linear { Style::Dashed } else { Style::Solid(1.8) };
        Series::new(name, DISTINCT[usize::from(!way.gains)], way.speed.clone(), y, style)
    };
    ways.iter().map(curve).collect()
}

/// The greatest magnitude; NaN where there is no value.
fn greatest(values: &[f64]) -> f64 {
    let most = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    if values.iter().any(|value| value.is_nan()) { f64::NAN } else { most }
}

/// The stretches of a trace; instants of constant speed belong to none.
fn stretches(speed: &[f64]) -> Vec<Stretch> {
    let mut found: Vec<Stretch> = Vec::new();
    for k in 1..speed.len() {
        let change = speed[k] - speed[k - 1];
        if change == 0.0 || change.is_nan() {
            continue;
        }
        let gains = change > 0.0;
        match found.last_mut() {
            Some(last) if last.to == k - 1 && last.gains == gains => last.to = k,
            _ => found.push(Stretch { from: k - 1, to: k, gains }),
        }
    }
    found
}

/// The whole turns in a stretch as first and last instant, in order of rising speed.
fn turns(time: &[f64], speed: &[f64], stretch: Stretch) -> Vec<[usize; 2]> {
    let mut found = Vec::new();
    let (mut made, mut from) = (0.0, stretch.from);
    for k in stretch.from + 1..=stretch.to {
        made += 0.5 * (speed[k] + speed[k - 1]) / 60.0 * (time[k] - time[k - 1]);
        if made >= 1.0 {
            found.push([from, k]);
            (made, from) = (made - 1.0, k);
        }
    }
    if !stretch.gains {
        found.reverse();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_up_and_the_way_down_are_cut_into_turns() {
        // 30 rpm a second up to 4.2 s and down from 5 s, held between: 4.41 turns each way.
        let time: Vec<f64> = (0..=920).map(|k| 0.01 * f64::from(k)).collect();
        let speed: Vec<f64> =
            time.iter().map(|t| (30.0 * t).min(126.0).min(30.0 * (9.2 - t))).collect();
        let both = stretches(&speed);
        assert_eq!(both.iter().map(|stretch| stretch.gains).collect::<Vec<_>>(), [true, false]);
        let [up, down] = [0, 1].map(|k| turns(&time, &speed, both[k]));
        // A quarter t^2 turns on the way up: the second turn ends at sqrt(8) s.
        assert_eq!((up.len(), down.len()), (4, 4));
        assert!((time[up[1][1]] - 8.0_f64.sqrt()).abs() < 0.02);
        let middle = |turn: &[usize; 2]| speed[turn[0]] + speed[turn[1]];
        assert!(down.windows(2).all(|pair| middle(&pair[0]) < middle(&pair[1])));
        assert_eq!(greatest(&[1.0, -3.0, 2.0]), 3.0);
        assert!(greatest(&[1.0, f64::NAN, 2.0]).is_nan() && greatest(&[f64::NAN, 2.0]).is_nan());
    }
}
