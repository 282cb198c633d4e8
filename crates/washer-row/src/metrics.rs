//! The table of metrics, the optional numbers of a row beside the amplitudes.

use sweep_parameter::{Limit, Worse, named};
use washer_model::Gauge;

named! {
    /// A kind of parts of which a machine may have several.
    pub enum PartKind {
        Stop = "stop",
        Foot = "foot",
        Damper = "damper",
    }
}

/// The source of a metric's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MetricSource {
    /// A gauge of each model's trajectory.
    Gauge(Gauge),
    /// The machine at rest.
    Machine,
    /// The held speeds of `[stability]`.
    HeldSpeeds,
}

/// The least scale of relative differences of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LeastScale {
    /// No least scale: differences are relative to the value itself.
    Value,
    /// The length of the window.
    Window,
    /// The weight of everything that moves.
    Weight,
    /// The speed [`MIN_SPEED_SCALE_M_PER_S`](crate::MIN_SPEED_SCALE_M_PER_S).
    DamperSpeed,
}

/// The properties of a metric.
pub struct MetricProperties {
    pub unit: &'static str,
    /// The description in column dictionaries and in docs, in one line.
    pub description: &'static str,
    /// The source of the value.
    pub source: MetricSource,
    /// The kind of parts to which the metric applies; a machine without such parts lacks the
    /// metric.
    pub part: Option<PartKind>,
    /// The quantity in the name of one part's column, and that column's description; `None` if
    /// parts have no columns.
    pub(crate) part_column: Option<[&'static str; 2]>,
    /// The least scale of relative differences.
    pub(crate) scale: LeastScale,
    /// The direction in which values are bad. The value of all parts is that of the worst part.
    pub worse: Worse,
    /// The limit of good values, if the metric has a natural one.
    pub limit: Option<Limit>,
}

/// The properties of metrics of the whole machine, except unit and description.
const MACHINE_METRIC: MetricProperties = MetricProperties {
    unit: "",
    description: "",
    source: MetricSource::Machine,
    part: None,
    part_column: None,
    scale: LeastScale::Value,
    worse: Worse::Greater,
    limit: None,
};

/// The common properties of the metrics of the cabinet's feet.
const FEET_METRIC: MetricProperties = MetricProperties {
    part: Some(PartKind::Foot),
    scale: LeastScale::Weight,
    worse: Worse::Less,
    limit: Some(Limit { value: 0.0, scale: 100.0 }),
    ..MACHINE_METRIC
};

/// Declares the metrics from a table with a row for each.
macro_rules! metrics {
    ($($(#[$attribute:meta])* $Metric:ident = $name:literal: $properties:expr;)+) => {
        named! {
            /// An optional number of a row in addition to the amplitudes, with its own columns.
            pub enum Metric {
                $($(#[$attribute])* $Metric = $name,)+
            }
        }

        impl Metric {
            /// Returns the metric's unit, description, source, parts, scale, bad direction and
            /// limit.
            pub const fn properties(self) -> MetricProperties {
                match self {
                    $(Self::$Metric => $properties,)+
                }
            }
        }
    };
}

metrics! {
    /// The greatest force on the cabinet.
    CabinetForce = "cabinet_force": MetricProperties {
        unit: "N",
        description: "greatest magnitude in the window of the sum of the forces of all \
                      springs, dampers, stops and bushings on the cabinet (at rest the \
                      weight)",
        source: MetricSource::Gauge(Gauge::CabinetForce),
        ..MACHINE_METRIC
    };
    /// The time for which drum and tub overlap.
    ClashTime = "clash_time": MetricProperties {
        unit: "s",
        description: "time in the window with a gap between drum and tub below zero; its \
                      error is a share of the window",
        scale: LeastScale::Window,
        source: MetricSource::Gauge(Gauge::ClashTime),
        ..MACHINE_METRIC
    };
    /// The sag of the machine under its weight.
    StaticSag = "static_sag": MetricProperties {
        unit: "m",
        description: "how far the tub's mass centre sinks from where the machine file \
                      draws it to the static equilibrium; null if there is none",
        ..MACHINE_METRIC
    };
    /// The greatest force of a stop.
    StopForce = "stop_force": MetricProperties {
        unit: "N",
        description: "greatest push of any stop in the window; the linear model has the \
                      tangents of the stops at equilibrium, next to nothing while they are \
                      open",
        part: Some(PartKind::Stop),
        part_column: Some([
            "force",
            "greatest push of the stop in the window; the linear model has its tangent at \
             equilibrium, next to nothing while it is open",
        ]),
        scale: LeastScale::Weight,
        source: MetricSource::Gauge(Gauge::StopForce),
        ..MACHINE_METRIC
    };
    /// The time for which a stop is closed.
    StopContact = "stop_contact": MetricProperties {
        unit: "s",
        description: "longest time in the window for which any one stop is closed",
        part: Some(PartKind::Stop),
        part_column: Some(["contact", "time in the window for which the stop is closed"]),
        scale: LeastScale::Window,
        source: MetricSource::Gauge(Gauge::StopContact),
        ..MACHINE_METRIC
    };
    /// The least load of a foot of the cabinet.
    FootLoad = "foot_load": MetricProperties {
        unit: "N",
        description: "least vertical load of any foot of the cabinet in the window, by \
                      statics; below zero it would lift",
        part_column: Some([
            "load",
            "least vertical load of the foot in the window, by statics; below zero it \
             would lift",
        ]),
        source: MetricSource::Gauge(Gauge::FootLoad),
        ..FEET_METRIC
    };
    /// The least margin of the cabinet against slipping.
    SlipMargin = "slip_margin": MetricProperties {
        unit: "N",
        description: "least margin of the cabinet against slipping in the window: friction \
                      on all feet together less the horizontal force",
        source: MetricSource::Gauge(Gauge::SlipMargin),
        ..FEET_METRIC
    };
    /// The least margin of the cabinet against slipping, turning or both.
    WalkMargin = "walk_margin": MetricProperties {
        unit: "N",
        description: "least margin of the cabinet against slipping, turning or both in the \
                      window: the margin against slipping less what the moment about the \
                      vertical takes of it",
        source: MetricSource::Gauge(Gauge::WalkMargin),
        ..FEET_METRIC
    };
    /// The growth of disturbances at held speeds.
    Growth = "growth": MetricProperties {
        unit: "1/s",
        description: "how fast the fastest growing disturbance of the nonlinear response \
                      grows, at that of the speeds of [stability] at which it is greatest",
        limit: Some(Limit { value: 0.0, scale: 1.0 }),
        source: MetricSource::HeldSpeeds,
        ..MACHINE_METRIC
    };
    /// The greatest speed of a damper.
    DamperSpeed = "damper_speed": MetricProperties {
        unit: "m/s",
        description: "greatest speed along any damper in the window: what \
                      `friction_linear_speed_m_per_s` should be near",
        part: Some(PartKind::Damper),
        part_column: Some(["speed", "greatest speed along the damper in the window"]),
        scale: LeastScale::DamperSpeed,
        source: MetricSource::Gauge(Gauge::DamperSpeed),
        ..MACHINE_METRIC
    };
    // The metric has a column for each channel, in the channel's unit.
    /// The deviations of the attractors at held speeds.
    Dwell = "dwell": MetricProperties {
        description: "largest deviation of any motion that the drum held at any of the \
                      speeds of [stability] ends in (`sweep dwell`)",
        source: MetricSource::HeldSpeeds,
        ..MACHINE_METRIC
    };
}
