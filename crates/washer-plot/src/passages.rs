//! The chart of passages: the largest deviation of both models in each turn of the drum over its
//! speed. Resonances appear late, both while the speed rises and while it falls.

use crate::WasherFigures;
use crate::kinds::speed_mark;
use crate::trace;
use sweep_plot::chart::{Chart, Series, SeriesStyle};
use sweep_plot::label::Label;
use sweep_plot::table::FigureTable;
use sweep_plot::{DISTINCT_COLOURS, PlotError};

/// A part of a trace in which the speed only rises or only falls, by its first and last instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Ramp {
    first_row: usize,
    last_row: usize,
    is_rising: bool,
}

/// The whole turns of a ramp, each with its mean speed.
struct RampTurns {
    is_rising: bool,
    turn_rows: Vec<[usize; 2]>,
    speeds_rpm: Vec<f64>,
}

/// Draws the passages of a trace file.
///
/// # Errors
/// The errors of [`trace::trace_chart`]; [`PlotError::Undrawable`] without the speed, or if the
/// drum makes no whole turn while its speed changes.
pub(crate) fn passage_chart(
    table: &FigureTable,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let mut chart = trace::trace_chart(table, options)?;
    let times_s = table.numbers("time_s")?;
    let speeds_rpm: Vec<f64> =
        table.numbers("speed_rpm")?.iter().map(|speed| speed.abs()).collect();
    let mean_speed_rpm =
        |&[first_row, last_row]: &[usize; 2]| 0.5 * (speeds_rpm[first_row] + speeds_rpm[last_row]);
    let read_ramp_turns = |ramp: Ramp| {
        let turn_rows = find_turns(times_s, &speeds_rpm, ramp);
        RampTurns {
            is_rising: ramp.is_rising,
            speeds_rpm: turn_rows.iter().map(mean_speed_rpm).collect::<Vec<_>>(),
            turn_rows,
        }
    };
    let mut all_turns: Vec<RampTurns> =
        find_ramps(&speeds_rpm).into_iter().map(read_ramp_turns).collect();
    all_turns.retain(|turns| !turns.turn_rows.is_empty());
    if all_turns.is_empty() {
        return Err(table
            .source
            .nothing_to_draw_error("the drum makes no whole turn while its speed changes"));
    }
    chart.panels.retain(|panel| panel.name != "gap" && panel.name != "speed");
    for panel in &mut chart.panels {
        panel.series =
            panel.series.iter().flat_map(|series| series_over_speed(series, &all_turns)).collect();
        panel.height = 190.0;
    }
    chart.title = "Greatest deviation in each turn of the drum, over its speed".to_owned();
    let (resonances, note) = trace::resonances(table, options)?;
    chart.subtitle = trace::subtitle(table, &[], None) + &note;
    chart.x_label = Label::new("Spin speed", "rpm");
    chart.marks = resonances.into_iter().map(|speed| speed_mark(speed, speed)).collect();
    chart.mark_meaning = "resonance speed".to_owned();
    chart.shaded_ranges = trace::unstable_speeds(table, options)?;
    Ok(chart)
}

/// Returns a curve over time as one over speed for each ramp.
fn series_over_speed(series: &Series, all_turns: &[RampTurns]) -> Vec<Series> {
    let is_dashed = series.name.starts_with("linear") || series.name == "model";
    let ramp_series = |turns: &RampTurns| {
        let name = format!(
            "{}, speed {}",
            series.name,
            if turns.is_rising { "rising" } else { "falling" }
        );
        let y = turns
            .turn_rows
            .iter()
            .map(|&[first_row, last_row]| greatest_magnitude(&series.y[first_row..=last_row]))
            .collect();
        let style = if is_dashed { SeriesStyle::Dashed } else { SeriesStyle::Solid(1.8) };
        Series::new(
            name,
            DISTINCT_COLOURS[usize::from(!turns.is_rising)],
            turns.speeds_rpm.clone(),
            y,
            style,
        )
    };
    all_turns.iter().map(ramp_series).collect()
}

/// Returns the greatest magnitude; NaN if a value is missing.
fn greatest_magnitude(values: &[f64]) -> f64 {
    let greatest_magnitude = values
        .iter()
        .fold(0.0, |greatest_magnitude: f64, value| greatest_magnitude.max(value.abs()));
    if values.iter().any(|value| value.is_nan()) { f64::NAN } else { greatest_magnitude }
}

/// Returns the ramps of a trace; instants of constant speed belong to none.
fn find_ramps(speeds_rpm: &[f64]) -> Vec<Ramp> {
    let mut ramps: Vec<Ramp> = Vec::new();
    for k in 1..speeds_rpm.len() {
        let change = speeds_rpm[k] - speeds_rpm[k - 1];
        if change == 0.0 || change.is_nan() {
            continue;
        }
        let is_rising = change > 0.0;
        match ramps.last_mut() {
            Some(ramp) if ramp.last_row == k - 1 && ramp.is_rising == is_rising => {
                ramp.last_row = k
            }
            _ => ramps.push(Ramp { first_row: k - 1, last_row: k, is_rising }),
        }
    }
    ramps
}

/// Returns the whole turns of a ramp by first and last instant, in order of rising speed.
fn find_turns(times_s: &[f64], speeds_rpm: &[f64], ramp: Ramp) -> Vec<[usize; 2]> {
    let mut turns = Vec::new();
    let mut turn_count = 0.0;
    let mut turn_start = ramp.first_row;
    for k in ramp.first_row + 1..=ramp.last_row {
        turn_count +=
            0.5 * (speeds_rpm[k] + speeds_rpm[k - 1]) / 60.0 * (times_s[k] - times_s[k - 1]);
        if turn_count >= 1.0 {
            turns.push([turn_start, k]);
            (turn_count, turn_start) = (turn_count - 1.0, k);
        }
    }
    if !ramp.is_rising {
        turns.reverse();
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rising_and_falling_ramps_are_divided_into_turns() {
        // The speed rises by 30 rpm a second up to 4.2 s and falls from 5 s: 4.41 turns each.
        let times_s: Vec<f64> = (0..=920).map(|k| 0.01 * f64::from(k)).collect();
        let speeds_rpm: Vec<f64> =
            times_s.iter().map(|t| (30.0 * t).min(126.0).min(30.0 * (9.2 - t))).collect();
        let found_ramps = find_ramps(&speeds_rpm);
        assert_eq!(
            found_ramps.iter().map(|ramp| ramp.is_rising).collect::<Vec<_>>(),
            [true, false]
        );
        let [rising_turns, falling_turns] =
            [0, 1].map(|k| find_turns(&times_s, &speeds_rpm, found_ramps[k]));
        // On the rising ramp t^2/4 turns are made at t: the second ends at sqrt(8) s.
        assert_eq!((rising_turns.len(), falling_turns.len()), (4, 4));
        assert!((times_s[rising_turns[1][1]] - 8.0_f64.sqrt()).abs() < 0.02);
        let speed_sum = |turn: &[usize; 2]| speeds_rpm[turn[0]] + speeds_rpm[turn[1]];
        assert!(falling_turns.windows(2).all(|pair| speed_sum(&pair[0]) < speed_sum(&pair[1])));
        assert_eq!(greatest_magnitude(&[1.0, -3.0, 2.0]), 3.0);
        assert!(
            greatest_magnitude(&[1.0, f64::NAN, 2.0]).is_nan()
                && greatest_magnitude(&[f64::NAN, 2.0]).is_nan()
        );
    }
}
