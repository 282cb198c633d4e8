//! Axis scales, linear or logarithmic, and their ticks.

use super::label;

/// A mapping from values to positions along an axis, linear or logarithmic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AxisScale {
    /// Whether the scale is logarithmic.
    pub(crate) is_log: bool,
    /// The value at position 0.
    pub(crate) from: f64,
    /// The value at position 1.
    pub(crate) to: f64,
}

/// A labelled value of a scale.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) value: f64,
    pub(crate) label: String,
}

impl AxisScale {
    /// Returns a linear scale.
    pub(crate) const fn linear(from: f64, to: f64) -> Self {
        Self { is_log: false, from, to }
    }

    /// Returns a logarithmic scale; from 1 to 10 if an end is not positive and finite.
    pub(crate) const fn logarithmic(from: f64, to: f64) -> Self {
        if has_logarithm(from) && has_logarithm(to) {
            Self { is_log: true, from, to }
        } else {
            Self { is_log: true, from: 1.0, to: 10.0 }
        }
    }

    /// Returns a linear scale that includes all `values` with a margin of 5 % at both ends; 0 to 1
    /// if there are none.
    pub(crate) fn around_values(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = extremes(values).unwrap_or((0.0, 1.0));
        let margin = if high > low { 0.05 * (high - low) } else { 0.05 * high.abs().max(1.0) };
        Self::linear(low - margin, high + margin)
    }

    /// Returns the coordinate of a value along the axis: its logarithm on a logarithmic scale,
    /// otherwise the value itself.
    pub(crate) fn coordinate(self, value: f64) -> f64 {
        if self.is_log { value.ln() } else { value }
    }

    /// Returns the position of a value: 0 at the start of the scale, 1 at its end.
    pub(crate) fn position(self, value: f64) -> f64 {
        let start_coordinate = self.coordinate(self.from);
        let end_coordinate = self.coordinate(self.to);
        (self.coordinate(value) - start_coordinate) / (end_coordinate - start_coordinate)
    }

    /// Returns about `count` round values within the scale.
    pub(crate) fn ticks(self, count: usize) -> Vec<Tick> {
        let low_end = self.from.min(self.to);
        let high_end = self.from.max(self.to);
        if self.is_log {
            log_ticks(low_end, high_end, count)
        } else {
            linear_ticks(low_end, high_end, count)
        }
    }
}

/// Whether a value can be shown on a logarithmic scale.
pub(crate) const fn has_logarithm(value: f64) -> bool {
    value > 0.0 && value < f64::INFINITY
}

/// Returns the least and the greatest of the finite values.
pub fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite_pairs = values.filter(|value| value.is_finite()).map(|value| (value, value));
    finite_pairs.reduce(|(low, high), (value, _)| (low.min(value), high.max(value)))
}

/// A distance between ticks: 1, 2 or 5 times a power of ten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TickStep {
    mantissa: u8,
    power: i32,
}

impl TickStep {
    /// Yields every step that a page can need in rising order: from 1e-15 to 5e15 in the axis'
    /// unit.
    pub(crate) fn all_steps() -> impl Iterator<Item = Self> {
        let steps_at_power = |power| [1, 2, 5].map(|mantissa| Self { mantissa, power });
        (-15..=15).flat_map(steps_at_power)
    }

    /// Returns the shortest step that is not shorter than `min_length`, a positive number.
    fn with_min_length(min_length: f64) -> Self {
        let power = min_length.log10().floor() as i32;
        let factor = min_length / 10_f64.powi(power);
        match [1, 2, 5].into_iter().find(|&step| f64::from(step) >= factor) {
            Some(mantissa) => Self { mantissa, power },
            None => Self { mantissa: 1, power: power + 1 },
        }
    }

    fn next_shorter(self) -> Self {
        match self.mantissa {
            5 => Self { mantissa: 2, ..self },
            2 => Self { mantissa: 1, ..self },
            _ => Self { mantissa: 5, power: self.power - 1 },
        }
    }

    /// Returns the step in the axis' unit.
    pub(crate) fn length(self) -> f64 {
        f64::from(self.mantissa) * 10_f64.powi(self.power)
    }

    /// Returns the number of decimals of tick labels; `None` from 1e6 on, where labels are powers
    /// of ten.
    pub(crate) fn decimals(self) -> Option<usize> {
        (self.power < 6).then(|| usize::try_from(-self.power).unwrap_or_default())
    }
}

fn linear_ticks(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let min_length = (high - low) / count.max(1) as f64;
    if !(min_length > 0.0 && min_length.is_finite()) {
        return Vec::new();
    }
    let shortest_length = f64::EPSILON * low.abs().max(high.abs());
    let mut step = TickStep::with_min_length(STEP_TOLERANCE * min_length);
    // A step may give fewer than `MIN_TICKS` ticks. Then shorter ones are tried, as long as the
    // labels of neighbouring ticks differ.
    while step.length() > shortest_length {
        let step_length = step.length();
        let decimals = step.decimals();
        let first_multiple = (low / step_length - 1e-9).ceil() as i64;
        let last_multiple = (high / step_length + 1e-9).floor() as i64;
        if last_multiple - first_multiple + 1 >= MIN_TICKS {
            let tick = |k: i64| {
                let value = k as f64 * step_length;
                let label = match decimals {
                    None if value != 0.0 => format!("{value:e}"),
                    _ => format!("{value:.*}", decimals.unwrap_or_default()),
                };
                Tick { value, label }
            };
            return (first_multiple..=last_multiple).map(tick).collect();
        }
        step = step.next_shorter();
    }
    Vec::new()
}

/// Minimum number of ticks of a scale. Basis: fewer do not show how a scale runs. Doubling it gives
/// dense ticks on short axes.
pub(crate) const MIN_TICKS: i64 = 3;

/// Minimum ratio of a round step to the wanted step. Basis: rounding of the range must not choose a
/// step twice as long, so that the ratio is just below 1. Half of it would allow steps that are
/// half as long as wanted.
pub(crate) const STEP_TOLERANCE: f64 = 0.999;

/// Returns the candidate sets of ticks of a logarithmic scale, from sparse to dense; empty sets if
/// an end has no logarithm.
pub(crate) fn log_tick_sets(low: f64, high: f64) -> [Vec<Tick>; 5] {
    if !has_logarithm(low) || !has_logarithm(high) {
        return Default::default();
    }
    let tick_sets: [&[f64]; 5] = [
        &[1.0],
        &[1.0, 3.0],
        &[1.0, 2.0, 5.0],
        &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
        &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
    ];
    tick_sets.map(|factors| {
        let powers = (low.log10().floor() as i32)..=(high.log10().ceil() as i32);
        let tick_values =
            powers.flat_map(|power| factors.iter().map(move |factor| factor * 10_f64.powi(power)));
        tick_values
            .filter(|value| (low * (1.0 - 1e-9)..=high * (1.0 + 1e-9)).contains(value))
            .map(|value| Tick { value, label: label::format_significant(value, 2) })
            .collect()
    })
}

fn log_ticks(low: f64, high: f64, count: usize) -> Vec<Tick> {
    let [mut ticks, denser_sets @ ..] = log_tick_sets(low, high);
    let stride = ticks.len().div_ceil(count.max(2) + 1);
    ticks = ticks.into_iter().step_by(stride.max(1)).collect();
    for set in denser_sets {
        if ticks.len() >= 2 && set.len() > count.max(2) + 1 {
            break;
        }
        ticks = set;
    }
    if ticks.len() < 2 { linear_ticks(low, high, count) } else { ticks }
}

/// Returns whether values are spaced more evenly by their logarithms than by themselves; false for
/// fewer than three values.
pub(crate) fn is_log_spaced(values: &[f64]) -> bool {
    if values.len() < 3 || values.iter().any(|&value| value <= 0.0) {
        return false;
    }
    let step_ratio = |position: &dyn Fn(f64) -> f64| {
        let steps = values.windows(2).map(|pair| position(pair[1]) - position(pair[0]));
        extremes(steps).map_or(f64::INFINITY, |(least, greatest)| greatest / least)
    };
    // A linear axis is easier to read, so that logarithmic spacing must fit clearly better.
    step_ratio(&f64::ln) * 1.2 < step_ratio(&|value| value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick_labels(scale: AxisScale, count: usize) -> Vec<String> {
        scale.ticks(count).into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_values_within_the_scale() {
        assert_eq!(
            tick_labels(AxisScale::linear(0.0, 1.0), 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            tick_labels(AxisScale::linear(46.0, 314.0), 6),
            ["50", "100", "150", "200", "250", "300"]
        );
        assert_eq!(tick_labels(AxisScale::linear(-0.3, 0.3), 3), ["-0.2", "0.0", "0.2"]);
        assert_eq!(tick_labels(AxisScale::linear(-48.0, 48.0), 3), ["-40", "-20", "0", "20", "40"]);
        assert_eq!(tick_labels(AxisScale::linear(-1.1e15, 0.0), 3), ["-1e15", "-5e14", "0"]);
        assert_eq!(tick_labels(AxisScale::logarithmic(1.0, 1000.0), 4), ["1", "10", "100", "1000"]);
        assert_eq!(tick_labels(AxisScale::logarithmic(1.0, 9.0), 4), ["1", "2", "5"]);
        assert!(tick_labels(AxisScale::linear(1.0, 1.0), 5).is_empty());
    }

    #[test]
    fn a_log_scale_over_many_decades_has_few_ticks() {
        assert_eq!(tick_labels(AxisScale::logarithmic(1e-3, 1e12), 5).len(), 6);
        assert!(tick_labels(AxisScale::logarithmic(1e-100, 1e100), 5).len() <= 6);
    }

    #[test]
    fn a_log_scale_with_an_invalid_end_runs_from_1_to_10() {
        for (from, to) in [(0.0, 1.0), (-1.0, 2.0), (1.0, f64::INFINITY), (f64::NAN, 2.0)] {
            assert_eq!(
                AxisScale::logarithmic(from, to),
                AxisScale::logarithmic(1.0, 10.0),
                "{from} to {to}"
            );
            assert!(log_tick_sets(from, to).iter().all(Vec::is_empty), "{from} to {to}");
        }
    }

    #[test]
    fn extreme_ends_give_at_most_16_ticks() {
        let min_subnormal = f64::from_bits(1);
        let min_normal = f64::MIN_POSITIVE;
        let scale_ends = [
            0.0,
            min_subnormal,
            -min_subnormal,
            min_normal,
            1.0,
            1e15,
            1e16 + 2.0,
            -1e300,
            1e300,
            f64::MAX,
            f64::MIN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ];
        for (&from, &to) in
            scale_ends.iter().flat_map(|from| scale_ends.iter().map(move |to| (from, to)))
        {
            // Pairs of neighbouring floats are tried too: no tick label can tell them apart.
            for to in [to, from.next_up(), from * (1.0 + 1e-15), from + to] {
                for scale in [AxisScale::linear(from, to), AxisScale::logarithmic(from, to)] {
                    let tick_count = scale.ticks(6).len();
                    assert!(tick_count <= 16, "{scale:?}: {tick_count}");
                }
            }
        }
    }

    #[test]
    fn tick_steps_rise_and_shorter_returns_the_one_before() {
        let steps: Vec<TickStep> = TickStep::all_steps().collect();
        for pair in steps.windows(2) {
            assert!(pair[0].length() < pair[1].length());
            assert_eq!(pair[1].next_shorter(), pair[0]);
            assert_eq!(TickStep::with_min_length(STEP_TOLERANCE * pair[1].length()), pair[1]);
        }
    }

    #[test]
    fn logarithmic_spacing_is_recognised() {
        assert!(!is_log_spaced(&[60.0, 120.0, 180.0, 240.0]));
        assert!(is_log_spaced(&[1.0, 10.0, 100.0, 1000.0]));
        assert!(!is_log_spaced(&[0.0, 1.0, 10.0]));
        assert!(!is_log_spaced(&[1.0, 10.0]));
    }
}
