//! The Campbell diagram: natural frequencies over spin speed, and the speeds at which they meet it
//! (the paper's Fig. 7).

use crate::WasherFigures;
use crate::kinds::MODES;
use crate::stability::{self, UnstableSpeeds};
use sweep_files::key;
use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::Label;
use sweep_plot::table::FigureTable;
use sweep_plot::{DISTINCT_COLOURS, INK, MUTED_COLOUR, PlotError, extremes};

/// The frequency of a mode, or a sum of two modes' frequencies, over speed.
pub(crate) struct FrequencyCurve {
    pub(crate) name: String,
    pub(crate) speeds_rpm: Vec<f64>,
    pub(crate) frequencies_rpm: Vec<f64>,
    /// The speeds (rpm) that equal the frequency.
    pub(crate) resonances_rpm: Vec<f64>,
    /// The least and the greatest frequency over a turn, if the file has them.
    pub(crate) band: Option<(Vec<f64>, Vec<f64>)>,
}

/// Draws the chart of a modes file. Modes whose frequency is above the greatest speed everywhere
/// are only counted. With a stability file, the sums of the frequencies of modes in parametric
/// resonance are drawn too, with a star where a sum is the speed.
///
/// # Errors
/// [`PlotError::Undrawable`] without a column or with fewer than two speeds; the errors of
/// [`stability::read_unstable`].
pub(crate) fn campbell_chart(
    table: &FigureTable,
    options: &WasherFigures,
) -> Result<Chart, PlotError> {
    let stability_file = options.stability.as_ref();
    let unstable_speeds =
        stability_file.map(|path| stability::read_unstable(table, path)).transpose()?;
    let modes = read_modes(table)?;
    let max_speed_rpm = modes
        .iter()
        .flat_map(|mode| &mode.speeds_rpm)
        .fold(0.0_f64, |max_speed_rpm, &speed| max_speed_rpm.max(speed));
    if max_speed_rpm <= 0.0 || modes.iter().all(|mode| mode.speeds_rpm.len() < 2) {
        return Err(table.source.nothing_to_draw_error("the modes are given at one speed only"));
    }
    let is_in_range = |mode: &FrequencyCurve| {
        mode.frequencies_rpm.iter().any(|&frequency| frequency < 1.06 * max_speed_rpm)
    };
    let (shown_modes, higher_modes): (Vec<FrequencyCurve>, Vec<FrequencyCurve>) =
        modes.into_iter().partition(is_in_range);
    let frequency_sum_curves = unstable_speeds
        .as_ref()
        .map_or_else(Vec::new, |unstable_speeds| frequency_sums(&shown_modes, unstable_speeds));
    let frequencies = shown_modes
        .iter()
        .chain(&frequency_sum_curves)
        .flat_map(|mode| mode.frequencies_rpm.iter().copied());
    let (_, highest_frequency_rpm) = extremes(frequencies).unwrap_or((0.0, max_speed_rpm));
    let frequency_range_rpm = (0.0, (1.06 * max_speed_rpm).min(1.25 * highest_frequency_rpm));

    let mut series = Vec::new();
    let mut stars = Vec::new();
    let mode_curves = shown_modes.into_iter().enumerate().map(|(k, mut mode)| {
        let band = mode.band.take();
        let style =
            band.map_or(SeriesStyle::Solid(2.2), |(low, high)| SeriesStyle::Band(low, high));
        (mode, DISTINCT_COLOURS[k % DISTINCT_COLOURS.len()], style)
    });
    let sum_curves =
        frequency_sum_curves.into_iter().map(|sum| (sum, MUTED_COLOUR, SeriesStyle::Dashed));
    for (mode, colour, style) in mode_curves.chain(sum_curves) {
        stars.extend(
            mode.resonances_rpm.iter().map(|&speed| (speed, speed, format!("{speed:.1} rpm"))),
        );
        series.push(Series::new(mode.name, colour, mode.speeds_rpm, mode.frequencies_rpm, style));
    }
    let diagonal = vec![0.0, max_speed_rpm];
    series.push(Series::new(
        "frequency = spin speed",
        INK,
        diagonal.clone(),
        diagonal,
        SeriesStyle::Dashed,
    ));
    let mut notes = table.source.notes([]);
    if series.iter().any(|series| matches!(series.style, SeriesStyle::Band(..))) {
        notes.push("shaded: least to greatest over a turn of the drum".to_owned());
    }
    if !higher_modes.is_empty() {
        let noun_and_verb = if higher_modes.len() == 1 { "mode lies" } else { "modes lie" };
        notes.push(format!("{} {noun_and_verb} above", higher_modes.len()));
    }
    let label = Label::new("Damped natural frequency", "cycles per minute");
    let panel = ChartPanel::new("frequency", label, series);
    Ok(Chart {
        title: "Natural frequencies over spin speed".to_owned(),
        subtitle: notes.join(" · "),
        x_label: Label::new("Spin speed", "rpm"),
        panels: vec![ChartPanel {
            y_range: Some(frequency_range_rpm),
            height: 500.0,
            stars,
            ..panel
        }],
        shaded_ranges: unstable_speeds
            .map_or_else(Vec::new, |unstable_speeds| unstable_speeds.speed_ranges_rpm),
        shade_meaning: stability::UNSTABLE_SPEEDS_MEANING.to_owned(),
        ..Chart::default()
    })
}

/// Returns the resonance speeds of a modes file in rising order, rpm: those at which a mode's
/// damped frequency is the spin speed.
///
/// # Errors
/// [`PlotError::Unfit`] when the file is not a modes file,
/// [`PlotError::Undrawable`] when it lacks a column.
pub(crate) fn read_resonances_rpm(table: &FigureTable) -> Result<Vec<f64>, PlotError> {
    table.source.expect_kind(MODES, "--modes", "`sweep modes --out FILE` writes a modes file")?;
    let mut speeds: Vec<f64> =
        read_modes(table)?.into_iter().flat_map(|mode| mode.resonances_rpm).collect();
    speeds.sort_by(f64::total_cmp);
    Ok(speeds)
}

/// Returns the sums of frequencies behind parametric resonances: of the two modes that take part,
/// or twice the frequency of a single one.
fn frequency_sums(
    modes: &[FrequencyCurve],
    unstable_speeds: &UnstableSpeeds,
) -> Vec<FrequencyCurve> {
    let mut mode_pairs: Vec<[usize; 2]> = Vec::new();
    for (speed, frequencies) in &unstable_speeds.mode_frequencies_cpm {
        let nearest_mode = |frequency: f64| {
            let distance_to_frequency =
                |mode: &FrequencyCurve| (frequency_at_speed(mode, *speed) - frequency).abs();
            let indices = 0..modes.len();
            indices.min_by(|&a, &b| {
                distance_to_frequency(&modes[a]).total_cmp(&distance_to_frequency(&modes[b]))
            })
        };
        // Among all pairs of participating modes, that with the sum nearest to the speed is taken.
        let participants: Vec<usize> = frequencies
            .iter()
            .filter(|frequency| frequency.is_finite())
            .filter_map(|frequency| nearest_mode(*frequency))
            .collect();
        let candidates = participants
            .iter()
            .flat_map(|&a| participants.iter().map(move |&b| [a.min(b), a.max(b)]));
        let distance_to_speed = |mode_pair: &[usize; 2]| {
            let sum_curve: f64 =
                mode_pair.iter().map(|&mode| frequency_at_speed(&modes[mode], *speed)).sum();
            (sum_curve - speed).abs()
        };
        if let Some(mode_pair) =
            candidates.min_by(|a, b| distance_to_speed(a).total_cmp(&distance_to_speed(b)))
            && !mode_pairs.contains(&mode_pair)
        {
            mode_pairs.push(mode_pair);
        }
    }
    mode_pairs.sort_unstable();
    let sum_curve = |[a, b]: [usize; 2]| {
        let mode_number = |mode: usize| {
            let name = modes[mode].name.trim_start_matches("mode ");
            name.split(' ').next().unwrap_or_default()
        };
        let name = if a == b {
            format!("twice the frequency of mode {}", mode_number(a))
        } else {
            format!("sum of the frequencies of modes {} and {}", mode_number(a), mode_number(b))
        };
        let speeds_rpm = modes[a].speeds_rpm.clone();
        let sum_at_speed = |speed: &f64| {
            frequency_at_speed(&modes[a], *speed) + frequency_at_speed(&modes[b], *speed)
        };
        let frequencies_rpm: Vec<f64> = speeds_rpm.iter().map(sum_at_speed).collect();
        FrequencyCurve {
            name,
            resonances_rpm: resonance_speeds(&speeds_rpm, &frequencies_rpm),
            speeds_rpm,
            frequencies_rpm,
            band: None,
        }
    };
    mode_pairs.into_iter().map(sum_curve).collect()
}

/// Returns a mode's frequency at a speed.
fn frequency_at_speed(mode: &FrequencyCurve, speed: f64) -> f64 {
    interpolate(&mode.speeds_rpm, &mode.frequencies_rpm, speed)
}

/// Interpolates linearly at `x`; beyond the given values the curve is constant.
pub(crate) fn interpolate(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    let upper_index = xs.partition_point(|known_x| *known_x < x).min(xs.len() - 1);
    let lower_index = upper_index.saturating_sub(1);
    let step = xs[upper_index] - xs[lower_index];
    if step == 0.0 {
        return ys[upper_index];
    }
    let fraction = ((x - xs[lower_index]) / step).clamp(0.0, 1.0);
    ys[lower_index] + fraction * (ys[upper_index] - ys[lower_index])
}

/// Returns the modes of a file by number.
pub(crate) fn read_modes(table: &FigureTable) -> Result<Vec<FrequencyCurve>, PlotError> {
    let speeds_rpm = table.numbers("speed_rpm")?;
    let mode_numbers = table.numbers("mode")?;
    let frequencies_rpm = table.numbers("frequency_rpm")?;
    let find_turn_extreme = |word: &str| {
        let mut columns = table.columns.iter().filter(|column| {
            column.facts.name.starts_with("frequency")
                && column.facts.unit() == "rpm"
                && column.facts.name.split('_').any(|part| part == word)
        });
        columns.next().and_then(|column| column.numbers())
    };
    let band = find_turn_extreme("min").zip(find_turn_extreme("max"));
    let mode_names =
        table.column("name").or_else(|| table.column("shape")).and_then(|column| column.words());

    // A row without a number belongs to no mode.
    let mut distinct_numbers: Vec<f64> =
        mode_numbers.iter().copied().filter(|number| number.is_finite()).collect();
    distinct_numbers.sort_by(f64::total_cmp);
    distinct_numbers.dedup();
    let read_mode = |number: f64| {
        let mut rows: Vec<usize> =
            (0..table.rows).filter(|&row| mode_numbers[row] == number).collect();
        rows.sort_by(|&a, &b| speeds_rpm[a].total_cmp(&speeds_rpm[b]));
        let select_rows =
            |values: &[f64]| rows.iter().map(|&row| values[row]).collect::<Vec<f64>>();
        let mode_name_in_file = mode_names.and_then(|mode_names| mode_names.get(*rows.first()?));
        let resonances_in_file = || -> Option<Vec<f64>> {
            let mut modes_in_file = table.source.metadata_list(key::MODES);
            let resonances_rpm =
                modes_in_file.find(|mode| mode["mode"] == number)?["resonances"].as_array()?;
            resonances_rpm.iter().map(|resonance| resonance["speed_rpm"].as_f64()).collect()
        };
        let speeds_rpm = select_rows(speeds_rpm);
        let frequencies_rpm = select_rows(frequencies_rpm);
        FrequencyCurve {
            name: mode_name_in_file.map_or(format!("mode {number}"), |mode_name_in_file| {
                format!("{number} {mode_name_in_file}")
            }),
            resonances_rpm: resonances_in_file()
                .unwrap_or_else(|| resonance_speeds(&speeds_rpm, &frequencies_rpm)),
            speeds_rpm,
            frequencies_rpm,
            band: band.map(|(low, high)| (select_rows(low), select_rows(high))),
        }
    };
    Ok(distinct_numbers.into_iter().map(read_mode).collect())
}

/// Returns the speeds at which a mode's frequency, linear between the given speeds, is the speed.
fn resonance_speeds(speeds_rpm: &[f64], frequencies_rpm: &[f64]) -> Vec<f64> {
    let frequencies_and_speeds = frequencies_rpm.iter().zip(speeds_rpm);
    let excesses_rpm: Vec<f64> =
        frequencies_and_speeds.map(|(frequency, speed)| frequency - speed).collect();
    (1..excesses_rpm.len())
        .filter(|&k| excesses_rpm[k - 1] > 0.0 && excesses_rpm[k] <= 0.0)
        .map(|k| {
            let fraction = excesses_rpm[k - 1] / (excesses_rpm[k - 1] - excesses_rpm[k]);
            speeds_rpm[k - 1] + fraction * (speeds_rpm[k] - speeds_rpm[k - 1])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_is_where_the_frequency_is_the_speed() {
        let speeds_rpm: Vec<f64> = (0..=10).map(|k| 30.0 * f64::from(k)).collect();
        let frequencies_rpm: Vec<f64> =
            speeds_rpm.iter().map(|speed| 150.0 - 0.02 * speed).collect();
        let resonances = resonance_speeds(&speeds_rpm, &frequencies_rpm);
        assert_eq!(resonances.len(), 1);
        assert!((resonances[0] - 150.0 / 1.02).abs() < 1e-9);
    }
}
