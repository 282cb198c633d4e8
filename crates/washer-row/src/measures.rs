//! Measures of a trajectory: the amplitude by which the two models are compared, and metrics.

use sweep_parameter::{RatioLimits, Worse, named};
use washer_model::{Channel, Gauge, Reading, Recorders};

use crate::metrics::{LeastScale, Metric, MetricProperties, MetricSource, PartKind};
use crate::outcome::{Deviations, Outcome};
use crate::verdict::verdict;

/// The least deviation (m, rad) in the ratio of the models' deviations in a turn; smaller
/// deviations are replaced by it.
///
/// Basis: a motion of 10 um is invisible, and the quotient of two such motions says nothing about
/// the models. Doubling it lowers the ratios of turns in which the machine hardly moves.
pub(crate) const TURN_FLOOR: f64 = 1e-5;

/// The least scale of differences of a damper's speed (m/s).
///
/// Basis: at lower speeds friction nearly holds the damper, and much of the speed comes from
/// ringing bearings. Doubling it halves the relative differences of slower dampers.
pub const MIN_SPEED_SCALE_M_PER_S: f64 = 0.01;

named! {
    /// The measure of a motion by which the two models are compared.
    #[derive(Default)]
    pub enum Criterion {
        /// The largest deviation from equilibrium in the window.
        #[default]
        Peak = "peak",
        /// The largest deviation in every turn of the drum; the largest ratio of all turns counts.
        Envelope = "envelope",
        /// The root mean square of the deviation from equilibrium over the window.
        Rms = "rms",
    }
}

impl Criterion {
    /// Describes a channel's column of one model.
    pub const fn amplitude_description(self) -> &'static str {
        match self {
            Self::Peak | Self::Envelope => "largest deviation from equilibrium in the window",
            Self::Rms => "root mean square of the deviation from equilibrium in the window",
        }
    }

    /// Describes the column of a channel's ratio, and when it is null.
    pub const fn ratio_description(self) -> &'static str {
        match self {
            Self::Peak => {
                "nonlinear over linear amplitude; null where the linear one is zero or a model \
                 failed"
            }
            Self::Envelope => {
                "greatest ratio over the drum's turns in the window, nonlinear over linear \
                 largest deviation in the same turn, \
                 both counted as 1e-5 at least; null where the linear motion is zero in all of \
                 them or a model failed"
            }
            Self::Rms => {
                "nonlinear over linear root mean square; null where the linear one is zero or a \
                 model failed"
            }
        }
    }
}

impl Metric {
    /// Returns the gauge that records the metric; `None` if the models do not have separate values.
    const fn gauge(self) -> Option<Gauge> {
        match self.properties().source {
            MetricSource::Gauge(gauge) => Some(gauge),
            MetricSource::Machine | MetricSource::HeldSpeeds => None,
        }
    }

    /// Whether each model has a separate value. Otherwise both models have the same value.
    pub const fn is_per_model(self) -> bool {
        self.gauge().is_some()
    }

    /// Whether the metric is computed at the held speeds of `[stability]`.
    pub const fn is_at_held_speeds(self) -> bool {
        matches!(self.properties().source, MetricSource::HeldSpeeds)
    }

    /// Whether the metric has a value for a periodic motion, which has no window. Forces and speeds
    /// have one, times within the window do not.
    pub fn has_periodic_value(self) -> bool {
        self.is_per_model() && self.properties().scale != LeastScale::Window
    }

    /// Returns the name of the column. It contains `model` only if each model has a value.
    pub fn column(self, model: &str) -> String {
        column(self.name(), if self.is_per_model() { model } else { "" }, self.properties().unit)
    }

    /// Returns the least scale of relative differences, in the metric's unit. Differences of values
    /// above it are relative to the value itself.
    pub fn scale(self, window_s: [f64; 2], weight_n: f64) -> f64 {
        match self.properties().scale {
            LeastScale::Value => 0.0,
            LeastScale::Window => window_s[1] - window_s[0],
            LeastScale::Weight => weight_n,
            LeastScale::DamperSpeed => MIN_SPEED_SCALE_M_PER_S,
        }
    }
}

/// Returns the name of a column from quantity, model and unit, without those that are empty.
fn column(quantity: &str, model: &str, unit: &str) -> String {
    let unit = unit.to_lowercase().replace("1/", "per_").replace('/', "_per_");
    let name_parts = [quantity, model, &unit].into_iter().filter(|word| !word.is_empty());
    name_parts.collect::<Vec<_>>().join("_")
}

/// A metric's column, which each model has: of the whole machine, or of one stop, foot or damper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MetricColumn {
    /// The metric.
    pub metric: Metric,
    /// The index of the part; `None` for all parts together.
    pub part: Option<usize>,
}

impl MetricColumn {
    /// Returns the part with its number, such as `stop_1`, with the quantity in the column's name
    /// and the column's description. `None` for the column of all parts.
    fn part_name_and_texts(self) -> Option<(String, [&'static str; 2])> {
        let MetricProperties { part, part_column, .. } = self.metric.properties();
        let part = format!("{}_{}", part?.name(), self.part? + 1);
        Some((part, part_column?))
    }

    /// Returns the name of the column.
    pub fn column(self, model: &str) -> String {
        match self.part_name_and_texts() {
            Some((part, [quantity, _])) => {
                column(&format!("{part}_{quantity}"), model, self.metric.properties().unit)
            }
            None => self.metric.column(model),
        }
    }

    /// Returns the description in column dictionaries and in docs, in one line.
    pub fn description(self) -> &'static str {
        match self.part_name_and_texts() {
            Some((_, [_, description])) => description,
            None => self.metric.properties().description,
        }
    }

    /// Returns the value from a trajectory's reading; `None` if it was not recorded.
    pub fn value(self, reading: &Reading) -> Option<f64> {
        let mut values = reading.gauge_values(self.metric.gauge()?).iter().copied();
        match self.part {
            Some(part) => values.nth(part),
            None if self.metric.properties().worse == Worse::Less => values.reduce(f64::min),
            None => values.reduce(f64::max),
        }
    }
}

/// The measures of a run: the criterion, the metrics, and the numbers of the machine's parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measures {
    /// The measure by which the models are compared.
    pub criterion: Criterion,
    /// The requested metrics, in the order of columns.
    pub metrics: Vec<Metric>,
    pub stops: usize,
    pub feet: usize,
    pub dampers: usize,
}

impl Measures {
    /// Returns the columns that each model has. [`Trajectory::metrics`](crate::Trajectory::metrics)
    /// has the same order.
    pub fn model_columns(&self) -> impl Iterator<Item = MetricColumn> + '_ {
        self.metrics
            .iter()
            .filter(|metric| metric.is_per_model())
            .flat_map(|metric| self.metric_columns(*metric))
    }

    /// Returns the columns of a metric: first that of all parts together, then one for each part if
    /// there are several.
    pub fn metric_columns(&self, metric: Metric) -> impl Iterator<Item = MetricColumn> + use<> {
        let part_count = match metric.properties().part_column.and(metric.properties().part) {
            Some(PartKind::Stop) => self.stops,
            Some(PartKind::Foot) => self.feet,
            Some(PartKind::Damper) => self.dampers,
            None => 0,
        };
        let numbered_parts = if part_count > 1 { 0..part_count } else { 0..0 };
        let machine_column = MetricColumn { metric, part: None };
        let part_columns =
            numbered_parts.map(move |part| MetricColumn { metric, part: Some(part) });
        std::iter::once(machine_column).chain(part_columns)
    }

    /// Returns the recorders that the measures need.
    pub fn recorders(&self) -> Recorders {
        Recorders {
            with_root_mean_squares: self.criterion == Criterion::Rms,
            with_turns: self.criterion == Criterion::Envelope,
            gauges: Gauge::ALL
                .map(|gauge| self.metrics.iter().any(|metric| metric.gauge() == Some(gauge))),
            ..Recorders::default()
        }
    }
}

impl Outcome {
    /// Compares the amplitudes of both models, or their turns if both have turns.
    pub fn compare(&mut self, channels: &[Channel], limits: RatioLimits) {
        self.compare_turns(channels);
        self.verdict = verdict(self, channels.len(), limits);
    }

    /// Computes [`Outcome::turn_ratios`] from the turns of both models, if both have turns.
    fn compare_turns(&mut self, channels: &[Channel]) {
        let nonlinear_turns = &self.nonlinear.turns;
        let linear_turns = &self.linear.turns;
        self.turn_ratios.clear();
        if nonlinear_turns.is_empty() || linear_turns.is_empty() {
            return;
        }
        self.turn_ratios.extend(channels.iter().map(|channel| {
            let i = channel.index();
            let has_motion = linear_turns.iter().any(|turn| turn[i] != 0.0);
            let ratio = |(nonlinear, linear): (&Deviations, &Deviations)| {
                nonlinear[i].max(TURN_FLOOR) / linear[i].max(TURN_FLOOR)
            };
            has_motion
                .then(|| nonlinear_turns.iter().zip(linear_turns).map(ratio).fold(0.0, f64::max))
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::{Status, Trajectory};

    fn outcome(nonlinear: &[[f64; 2]], linear: &[[f64; 2]]) -> Outcome {
        let model = |turns: &[[f64; 2]]| {
            let turn = |&[first, second]: &[f64; 2]| [first, 0.0, second, 0.0, 0.0, 0.0, 0.0, 0.0];
            Trajectory { turns: turns.iter().map(turn).collect(), ..Trajectory::failed(Status::Ok) }
        };
        let mut outcome = Outcome::new(0, model(nonlinear), model(linear));
        outcome.compare_turns(&[Channel::TubFrontY, Channel::DrumFrontY]);
        outcome
    }

    #[test]
    fn the_ratio_is_the_greatest_of_all_turns() {
        let compared = outcome(&[[5e-3, 1e-3], [3e-3, 1e-3]], &[[4e-3, 1e-3], [1e-3, 5e-3]]);
        assert_eq!(compared.turn_ratios, [Some(3.0), Some(1.0)]);
    }

    #[test]
    fn deviations_below_the_floor_count_as_the_floor() {
        // In the first channel both deviations are below the floor, so that the ratio is 1, not
        // 1000. In the second channel the nonlinear deviation is four times the floor.
        let compared = outcome(&[[1e-6, 4e-5], [1e-3, 1e-3]], &[[1e-9, 1e-9], [1e-3, 1e-3]]);
        let [Some(first), Some(second)] = compared.turn_ratios[..] else { panic!("{compared:?}") };
        assert_eq!(first, 1.0);
        assert!((second - 4.0).abs() < 1e-12);
    }

    #[test]
    fn without_linear_motion_the_ratio_is_undefined() {
        assert_eq!(outcome(&[[1e-3, 1e-3]; 3], &[[0.0, 1e-3]; 3]).turn_ratios, [None, Some(1.0)]);
        assert!(outcome(&[], &[[1.0, 1.0]]).turn_ratios.is_empty(), "a model failed");
    }

    #[test]
    fn columns_for_single_parts_follow_the_column_for_all() {
        let metrics = vec![Metric::SlipMargin, Metric::StopContact, Metric::FootLoad];
        let mut measures = Measures { metrics, stops: 3, feet: 1, ..Measures::default() };
        let columns = |measures: &Measures| -> Vec<String> {
            measures.model_columns().map(|column| column.column("linear")).collect()
        };
        let expected = [
            "slip_margin_linear_n",
            "stop_contact_linear_s",
            "stop_1_contact_linear_s",
            "stop_2_contact_linear_s",
            "stop_3_contact_linear_s",
            "foot_load_linear_n",
        ];
        assert_eq!(columns(&measures), expected);
        measures.stops = 1;
        measures.feet = 3;
        assert_eq!(columns(&measures)[1..3], ["stop_contact_linear_s", "foot_load_linear_n"]);
        assert_eq!(columns(&measures)[5], "foot_3_load_linear_n");
    }

    #[test]
    fn the_value_for_all_parts_is_that_of_the_worst_part() {
        let mut reading = Reading::default();
        for (gauge, numbers) in [
            (Gauge::StopForce, vec![20.0, 50.0]),
            (Gauge::StopContact, vec![0.3, 0.1]),
            (Gauge::FootLoad, vec![90.0, -5.0, 70.0]),
        ] {
            reading.gauges[gauge as usize] = numbers;
        }
        let metrics = vec![Metric::StopForce, Metric::StopContact, Metric::FootLoad];
        let measures = Measures { metrics, stops: 2, feet: 3, ..Measures::default() };
        let values: Vec<_> =
            measures.model_columns().filter_map(|column| column.value(&reading)).collect();
        assert_eq!(values, [50.0, 20.0, 50.0, 0.3, 0.3, 0.1, -5.0, 90.0, -5.0, 70.0]);
    }

    #[test]
    fn names_of_metrics_equal_the_names_of_their_variants() {
        let names = Metric::ALL.map(|metric| format!("{metric:?}").to_lowercase());
        assert_eq!(names, Metric::ALL.map(|metric| metric.name().replace('_', "")));
        let columns = [Metric::StaticSag, Metric::Growth, Metric::DamperSpeed];
        let columns = columns.map(|metric| metric.column("linear"));
        assert_eq!(columns, ["static_sag_m", "growth_per_s", "damper_speed_linear_m_per_s"]);
    }

    #[test]
    fn metrics_are_read_from_the_gauges_with_their_names() {
        for metric in Metric::ALL {
            assert_eq!(metric.gauge(), Gauge::named(metric.name()), "{metric:?}");
        }
    }

    #[test]
    fn only_metrics_of_trajectories_need_recorders() {
        assert_eq!(Measures::default().recorders(), Recorders::default());
        let sag_measures = Measures { metrics: vec![Metric::StaticSag], ..Measures::default() };
        assert_eq!(
            sag_measures.recorders(),
            Recorders::default(),
            "the equilibrium is known without a trajectory"
        );
    }
}
