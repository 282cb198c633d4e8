//! What a run measures: the amplitude by which the two models are compared, and metrics.

use sweep_parameter::{Limit, Worse, named};
use washer_model::{Channel, Gauge, Reading, Recorders};

use crate::outcome::{Deviations, Outcome};

/// The greatest deviation of a machine at rest, as a share of the clearance between drum and tub
/// (angles: of the clearance over a lever of one metre).
///
/// Basis: rounding of an equilibrium leaves some 1e-15 of the clearance, and no machine feels a
/// billionth of it. Doubling it is without effect.
pub(crate) const REST_SHARE: f64 = 1e-9;

/// Deviations below this count as this (m, rad) where turns are compared: neither 0 over 0 nor what
/// no machine feels decides.
pub(crate) const TURN_FLOOR: f64 = 1e-5;

/// The speed (m/s) of a damper that friction all but holds. What bearings ring is a part of slower
/// ones.
pub const CREEPING_M_PER_S: f64 = 0.01;

named! {
    /// What counts as the amplitude of a motion, and so as a ratio of two.
    #[derive(Default)]
    pub enum Criterion {
        /// The largest deviation from equilibrium in the window.
        #[default]
        Peak = "peak",
        /// The same in every turn of the drum; of the ratios by turn the largest.
        Envelope = "envelope",
        /// The root mean square of the deviation from equilibrium over the window.
        Rms = "rms",
    }
}

impl Criterion {
    /// What a channel's column of one model holds.
    pub const fn amplitude(self) -> &'static str {
        match self {
            Self::Peak | Self::Envelope => "largest deviation from equilibrium in the window",
            Self::Rms => "root mean square of the deviation from equilibrium in the window",
        }
    }

    /// What a channel's ratio is, and where there is none.
    pub const fn ratio(self) -> &'static str {
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

named! {
    /// A number beside the amplitudes, in columns of its own when asked for.
    pub enum Metric {
        /// The greatest force on the cabinet.
        CabinetForce = "cabinet_force",
        /// How long drum and tub overlap.
        ClashTime = "clash_time",
        /// How far the machine sinks under its weight.
        StaticSag = "static_sag",
        /// The greatest push of a stop.
        StopForce = "stop_force",
        /// How long a stop is closed.
        StopContact = "stop_contact",
        /// The least load of a foot of the cabinet.
        FootLoad = "foot_load",
        /// The least margin of the cabinet against slipping.
        SlipMargin = "slip_margin",
        /// The least margin of the cabinet against slipping, turning or both.
        WalkMargin = "walk_margin",
        /// How fast disturbances grow at constant speeds.
        Growth = "growth",
        /// The greatest speed of a damper.
        DamperSpeed = "damper_speed",
        /// How far the motions go that constant speeds end in.
        Dwell = "dwell",
    }
}

impl Metric {
    /// What it is read from, if each model has its own: the gauge of its name.
    fn gauge(self) -> Option<Gauge> {
        Gauge::named(self.name())
    }

    /// Whether each model has its own; else it belongs to the machine.
    pub fn is_of_model(self) -> bool {
        self.gauge().is_some()
    }

    /// Whether it is of the constant speeds of `[stability]`.
    pub const fn is_of_speeds(self) -> bool {
        matches!(self, Self::Growth | Self::Dwell)
    }

    /// Whether a motion that goes on for ever has it: a force or a speed, not a time within a
    /// window.
    pub fn is_of_turns(self) -> bool {
        self.is_of_model() && !matches!(self, Self::ClashTime | Self::StopContact)
    }

    /// The column's name; `model` only if each has its own.
    pub fn column(self, model: &str) -> String {
        column(self.name(), if self.is_of_model() { model } else { "" }, self.facts().unit)
    }

    /// Returns the scale that differences of the metric are measured against where its value is
    /// less, in the metric's unit.
    pub fn scale(self, window_s: [f64; 2], weight_n: f64) -> f64 {
        match self.facts().scale {
            Scale::Value => 0.0,
            Scale::Window => window_s[1] - window_s[0],
            Scale::Weight => weight_n,
            Scale::Creeping => CREEPING_M_PER_S,
        }
    }

    /// What there is to say of it.
    pub const fn facts(self) -> Facts {
        match self {
            Self::CabinetForce => Facts {
                unit: "N",
                description: "greatest magnitude in the window of the sum of the forces of all \
                              springs, dampers, stops and bushings on the cabinet (at rest the \
                              weight)",
                ..PLAIN
            },
            Self::ClashTime => Facts {
                unit: "s",
                description: "time in the window with a gap between drum and tub below zero; its \
                              error is a share of the window",
                scale: Scale::Window,
                ..PLAIN
            },
            Self::StaticSag => Facts {
                unit: "m",
                description: "how far the tub's mass centre sinks from where the machine file \
                              draws it to the static equilibrium; null if there is none",
                ..PLAIN
            },
            Self::StopForce => Facts {
                unit: "N",
                description: "greatest push of any stop in the window; the linear model has the \
                              tangents of the stops at equilibrium, next to nothing while they are \
                              open",
                part: Some(Part::Stop),
                of_each: Some([
                    "force",
                    "greatest push of the stop in the window; the linear model has its tangent at \
                     equilibrium, next to nothing while it is open",
                ]),
                scale: Scale::Weight,
                ..PLAIN
            },
            Self::StopContact => Facts {
                unit: "s",
                description: "longest time in the window for which any one stop is closed",
                part: Some(Part::Stop),
                of_each: Some(["contact", "time in the window for which the stop is closed"]),
                scale: Scale::Window,
                ..PLAIN
            },
            Self::FootLoad => Facts {
                unit: "N",
                description: "least vertical load of any foot of the cabinet in the window, by \
                              statics; below zero it would lift",
                of_each: Some([
                    "load",
                    "least vertical load of the foot in the window, by statics; below zero it \
                     would lift",
                ]),
                ..OF_FEET
            },
            Self::SlipMargin => Facts {
                unit: "N",
                description: "least margin of the cabinet against slipping in the window: friction \
                              on all feet together less the horizontal force",
                ..OF_FEET
            },
            Self::WalkMargin => Facts {
                unit: "N",
                description: "least margin of the cabinet against slipping, turning or both in the \
                              window: the margin against slipping less what the moment about the \
                              vertical takes of it",
                ..OF_FEET
            },
            Self::Growth => Facts {
                unit: "1/s",
                description: "how fast the fastest growing disturbance of the nonlinear response \
                              grows, at that of the speeds of [stability] at which it is greatest",
                limit: Some(Limit { value: 0.0, scale: 1.0 }),
                ..PLAIN
            },
            Self::DamperSpeed => Facts {
                unit: "m/s",
                description: "greatest speed along any damper in the window: what \
                              `friction_linear_speed_m_per_s` should be near",
                part: Some(Part::Damper),
                of_each: Some(["speed", "greatest speed along the damper in the window"]),
                scale: Scale::Creeping,
                ..PLAIN
            },
            // Each channel has a column of its own, in its unit.
            Self::Dwell => Facts {
                description: "largest deviation of any motion that the drum held at any of the \
                              speeds of [stability] ends in (`sweep dwell`)",
                ..PLAIN
            },
        }
    }
}

/// A column's name: what it holds, of which model, in which unit.
fn column(what: &str, model: &str, unit: &str) -> String {
    let unit = unit.to_lowercase().replace("1/", "per_").replace('/', "_per_");
    [what, model, &unit].into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join("_")
}

named! {
    /// A part that a machine may have several of.
    pub enum Part {
        /// A stop.
        Stop = "stop",
        /// A foot of the cabinet.
        Foot = "foot",
        /// A damper.
        Damper = "damper",
    }
}

/// The scale that differences of a metric are measured against where its value is less.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scale {
    /// The value itself.
    Value,
    /// The window's length.
    Window,
    /// The weight of everything that moves.
    Weight,
    /// [`CREEPING_M_PER_S`].
    Creeping,
}

/// What there is to say of a metric, once.
pub struct Facts {
    /// Unit.
    pub unit: &'static str,
    /// One line for column dictionaries and docs.
    pub description: &'static str,
    /// What the machine must have.
    pub part: Option<Part>,
    /// In the column of one part, and what that holds; none if parts have no columns.
    of_each: Option<[&'static str; 2]>,
    /// The scale of its differences.
    scale: Scale,
    /// Which way it is bad: of several parts, the worst stands for all.
    pub worse: Worse,
    /// Up to where it is good, if that has a meaning of its own.
    pub limit: Option<Limit>,
}

/// The facts of a metric of the whole machine that is always known.
const PLAIN: Facts = Facts {
    unit: "",
    description: "",
    part: None,
    of_each: None,
    scale: Scale::Value,
    worse: Worse::Greater,
    limit: None,
};

/// What the metrics of the cabinet's stand have in common.
const OF_FEET: Facts = Facts {
    part: Some(Part::Foot),
    scale: Scale::Weight,
    worse: Worse::Less,
    limit: Some(Limit { value: 0.0, scale: 100.0 }),
    ..PLAIN
};

/// A number that each model has of its own: a metric of the whole machine, or what one stop or foot
/// has of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Measured {
    /// The metric, of all parts together or of one.
    pub metric: Metric,
    /// Which part, from 0; none for all together.
    pub part: Option<usize>,
}

impl Measured {
    /// In the column's name and what it holds, of one part.
    fn of_part(self) -> Option<([&'static str; 2], String)> {
        let Facts { part, of_each, .. } = self.metric.facts();
        let part = format!("{}_{}", part?.name(), self.part? + 1);
        Some((of_each?, part))
    }

    /// The column's name.
    pub fn column(self, model: &str) -> String {
        match self.of_part() {
            Some(([what, _], part)) => {
                column(&format!("{part}_{what}"), model, self.metric.facts().unit)
            }
            None => self.metric.column(model),
        }
    }

    /// One line for column dictionaries and docs.
    pub fn description(self) -> &'static str {
        self.of_part().map_or(self.metric.facts().description, |([_, of_one], _)| of_one)
    }

    /// Its value in a trajectory's records, if it was recorded.
    pub fn of(self, extra: &Reading) -> Option<f64> {
        let mut values = extra.gauge(self.metric.gauge()?).iter().copied();
        match self.part {
            Some(part) => values.nth(part),
            None if self.metric.facts().worse == Worse::Less => values.reduce(f64::min),
            None => values.reduce(f64::max),
        }
    }
}

/// What a run measures beyond peaks and gaps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measures {
    /// What the models are compared by.
    pub criterion: Criterion,
    /// Metrics asked for, in column order.
    pub metrics: Vec<Metric>,
    /// How many stops the machine has.
    pub stops: usize,
    /// How many feet the machine has.
    pub feet: usize,
    /// How many dampers the machine has.
    pub dampers: usize,
}

impl Measures {
    /// Numbers that each model has its own of, in the order of trajectories and columns.
    pub fn of_model(&self) -> impl Iterator<Item = Measured> + '_ {
        self.metrics
            .iter()
            .filter(|metric| metric.is_of_model())
            .flat_map(|metric| self.numbers_of(*metric))
    }

    /// The numbers of a metric that each model has its own of: of all parts, then of each if there
    /// are several.
    pub fn numbers_of(&self, metric: Metric) -> impl Iterator<Item = Measured> + use<> {
        let parts = match metric.facts().of_each.and(metric.facts().part) {
            Some(Part::Stop) => self.stops,
            Some(Part::Foot) => self.feet,
            Some(Part::Damper) => self.dampers,
            None => 0,
        };
        let of_each = if parts > 1 { 0..parts } else { 0..0 };
        let of_all = Measured { metric, part: None };
        std::iter::once(of_all).chain(of_each.map(move |k| Measured { part: Some(k), ..of_all }))
    }

    /// What trajectories must record.
    pub fn wanted(&self) -> Recorders {
        Recorders {
            root_mean_squares: self.criterion == Criterion::Rms,
            turns: self.criterion == Criterion::Envelope,
            gauges: Gauge::ALL.map(|gauge| self.metrics.iter().any(|it| it.gauge() == Some(gauge))),
            ..Recorders::default()
        }
    }
}

impl Outcome {
    /// Compares the two models turn by turn, if both have turns.
    pub fn compare_turns(&mut self, channels: &[Channel]) {
        let (nonlinear, linear) = (&self.nonlinear.turns, &self.linear.turns);
        self.turn_ratios.clear();
        if nonlinear.is_empty() || linear.is_empty() {
            return;
        }
        self.turn_ratios.extend(channels.iter().map(|channel| {
            let i = channel.index();
            let moves = linear.iter().any(|turn| turn[i] != 0.0);
            let ratio = |(nonlinear, linear): (&Deviations, &Deviations)| {
                nonlinear[i].max(TURN_FLOOR) / linear[i].max(TURN_FLOOR)
            };
            moves.then(|| nonlinear.iter().zip(linear).map(ratio).fold(0.0, f64::max))
        }));
    }

    /// Lets go of what only the comparison needs.
    pub fn forget_turns(&mut self) {
        self.nonlinear.turns = Vec::new();
        self.linear.turns = Vec::new();
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
    fn the_greatest_ratio_over_the_turns_counts_wherever_the_peaks_are() {
        let compared = outcome(&[[5e-3, 1e-3], [3e-3, 1e-3]], &[[4e-3, 1e-3], [1e-3, 5e-3]]);
        assert_eq!(compared.turn_ratios, [Some(3.0), Some(1.0)]);
    }

    #[test]
    fn motions_below_the_floor_decide_nothing() {
        // A thousand times as large, and still nothing that counts; then from the floor upwards
        // without a leap.
        let compared = outcome(&[[1e-6, 4e-5], [1e-3, 1e-3]], &[[1e-9, 1e-9], [1e-3, 1e-3]]);
        let [Some(first), Some(second)] = compared.turn_ratios[..] else { panic!("{compared:?}") };
        assert_eq!(first, 1.0);
        assert!((second - 4.0).abs() < 1e-12);
    }

    #[test]
    fn without_any_linear_motion_there_is_no_ratio() {
        assert_eq!(outcome(&[[1e-3, 1e-3]; 3], &[[0.0, 1e-3]; 3]).turn_ratios, [None, Some(1.0)]);
        assert!(outcome(&[], &[[1.0, 1.0]]).turn_ratios.is_empty(), "a model failed");
    }

    #[test]
    fn each_of_several_stops_and_feet_has_columns_behind_those_of_all() {
        let metrics = vec![Metric::SlipMargin, Metric::StopContact, Metric::FootLoad];
        let mut measures = Measures { metrics, stops: 3, feet: 1, ..Measures::default() };
        let columns = |measures: &Measures| -> Vec<String> {
            measures.of_model().map(|number| number.column("linear")).collect()
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
    fn the_number_of_all_is_the_extreme_of_each() {
        let mut extra = Reading::default();
        for (gauge, numbers) in [
            (Gauge::StopForce, vec![20.0, 50.0]),
            (Gauge::StopContact, vec![0.3, 0.1]),
            (Gauge::FootLoad, vec![90.0, -5.0, 70.0]),
        ] {
            extra.gauges[gauge as usize] = numbers;
        }
        let metrics = vec![Metric::StopForce, Metric::StopContact, Metric::FootLoad];
        let measures = Measures { metrics, stops: 2, feet: 3, ..Measures::default() };
        let found: Vec<_> = measures.of_model().filter_map(|number| number.of(&extra)).collect();
        assert_eq!(found, [50.0, 20.0, 50.0, 0.3, 0.3, 0.1, -5.0, 90.0, -5.0, 70.0]);
    }

    #[test]
    fn each_metric_has_the_row_of_its_name() {
        let names = Metric::ALL.map(|metric| format!("{metric:?}").to_lowercase());
        assert_eq!(names, Metric::ALL.map(|metric| metric.name().replace('_', "")));
        let columns = [Metric::StaticSag, Metric::Growth, Metric::DamperSpeed];
        let columns = columns.map(|metric| metric.column("linear"));
        assert_eq!(columns, ["static_sag_m", "growth_per_s", "damper_speed_linear_m_per_s"]);
    }

    #[test]
    fn what_is_not_asked_for_is_not_recorded() {
        assert_eq!(Measures::default().wanted(), Recorders::default());
        let sag = Measures { metrics: vec![Metric::StaticSag], ..Measures::default() };
        assert_eq!(
            sag.wanted(),
            Recorders::default(),
            "the equilibrium is known without a trajectory"
        );
    }
}
