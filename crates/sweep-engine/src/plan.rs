//! The plan of a run, with every value resolved and checked. The configuration makes it; engine,
//! store and reports read it.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;
use sweep_parameter::{Channel, Range, RatioLimits};

use crate::method::Integrator;
use crate::{Design, Distribution, Model, ModelParameter};

/// The greatest number of grid points that is accepted. Basis: these take four months at a hundred
/// thousand points per second. Doubling it accepts runs of eight months.
pub const MAX_POINTS: u64 = 1_000_000_000_000;

/// The greatest `end_s` that is accepted, s. Basis: eleven days, far beyond any spin cycle.
/// Doubling it accepts twice the longest trajectory.
pub const MAX_END_S: f64 = 1e6;

/// The range of `ratio_min`: up to 1, the ratio of equal amplitudes.
pub const RATIO_MIN_RANGE: Range = Range::Within(0.0, 1.0);

/// The greatest number of steps of a trajectory by a method whose steps are bounded by stability.
/// Basis: one such point takes an hour or more. Doubling it accepts points of twice that time.
pub const MAX_STEPS: f64 = 1e10;

/// Returns the shortest step (s) with which a trajectory to `end_s` takes at most [`MAX_STEPS`].
pub fn shortest_step_s(end_s: f64) -> f64 {
    end_s / MAX_STEPS
}

/// A validated plan: the points, and the method by which each is integrated.
///
/// Only the configuration makes plans, and refuses invalid input. The rest of the program does not
/// check the numbers again.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan<M: Model> {
    /// The name of the run; the output defaults to `results/<name>.parquet`.
    pub name: String,
    /// The model after `[set]` and `--set`, before the axes.
    pub model: M,
    /// The end of the integration, which begins at 0.
    pub end_s: f64,
    /// The closed interval over which amplitudes are taken.
    pub window_s: [f64; 2],
    /// The method and its settings.
    pub integrator: Integrator,
    /// The axes of the grid, the first of which varies slowest, or the parameters of the design.
    pub axes: Vec<Axis<M>>,
    /// The design of the points, if they are not the grid of the axes.
    pub design: Option<Design>,
    /// The rule of the verdict.
    pub reliability: Reliability,
    /// The values of `--set`, by name.
    pub set: Vec<(String, Value)>,
    /// The sources of the numbers.
    pub sources: NumberSources,
    /// The notes of reading the grid file.
    pub reading_notes: ReadingNotes,
}

/// The notes of reading a grid file. Results do not depend on them, and plans that differ only in
/// them are equal.
#[derive(Clone, Debug, Default)]
pub struct ReadingNotes {
    /// The headers of columns in lists and measurements, with the names that they stand for.
    pub columns: Vec<(String, String)>,
    /// The notes for the user, a line each.
    pub notes: Vec<String>,
}

impl PartialEq for ReadingNotes {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The prefix of the source of an assumed number, whose value follows from other numbers by a rule.
pub const ASSUMED_PREFIX: &str = "assumed: ";

/// The source of each number, by its parameter's name: the file or option that wrote it last, or
/// the rule of an assumed number, which begins with [`ASSUMED_PREFIX`]. Results do not depend on
/// sources, and plans that differ only in them are equal.
#[derive(Clone, Debug, Default)]
pub struct NumberSources(pub BTreeMap<String, String>);

impl NumberSources {
    /// Returns the sources of the numbers of these names, in words; `None` if these numbers have no
    /// source.
    pub fn source(&self, names: &[impl AsRef<str>]) -> Option<String> {
        let mut sources: Vec<&str> =
            names.iter().filter_map(|name| Some(self.0.get(name.as_ref())?.as_str())).collect();
        sources.dedup();
        let assumption_rules: Vec<&str> =
            sources.extract_if(.., |source| source.starts_with(ASSUMED_PREFIX)).collect();
        let given_text = (!sources.is_empty()).then(|| format!("given: {}", sources.join(", ")));
        let all_sources: Vec<&str> =
            given_text.as_deref().into_iter().chain(assumption_rules).collect();
        (!all_sources.is_empty()).then(|| all_sources.join("; "))
    }

    /// Returns whether a number is assumed.
    pub fn is_assumed(&self, name: &str) -> bool {
        self.0.get(name).is_some_and(|source| source.starts_with(ASSUMED_PREFIX))
    }
}

impl PartialEq for NumberSources {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A swept parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis<M: Model> {
    /// The parameter.
    pub parameter: ModelParameter<M>,
    /// The values along the axis.
    pub values: AxisValues,
    /// The tolerance about the model's own number from which the values follow, if the grid file
    /// gives one.
    pub tolerance: Option<AxisTolerance>,
}

/// The tolerance of an axis about the model's own number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisTolerance {
    /// The distance between the number and the ends, in the parameter's unit.
    Distance(f64),
    /// A distance in percent of the number.
    Percent(f64),
}

impl AxisTolerance {
    /// Returns the value in grid files.
    pub fn to_json(self) -> Value {
        match self {
            Self::Distance(distance) => distance.into(),
            Self::Percent(percent) => format!("{percent} %").into(),
        }
    }
}

/// The values of an axis, computed on demand, so that an axis of a million values takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisValues {
    /// Listed values.
    List(Vec<f64>),
    /// Evenly spaced values, with both ends.
    Linear {
        /// The first value.
        from: f64,
        /// The last value.
        to: f64,
        /// The number of values, at least 1.
        count: u64,
    },
    /// Values of a distribution between two bounds, in a design.
    Distributed(Distribution),
    /// Values evenly spaced in the logarithm, with both ends.
    Log {
        /// The first value.
        from: f64,
        /// The last value.
        to: f64,
        /// The number of values, at least 1.
        count: u64,
    },
}

impl AxisValues {
    /// Returns the number of values.
    pub fn len(&self) -> u64 {
        match self {
            Self::List(values) => values.len() as u64,
            Self::Linear { count, .. } | Self::Log { count, .. } => *count,
            // The two bounds; the design chooses the points between them.
            Self::Distributed(_) => 2,
        }
    }

    /// Returns whether there are no values, which never holds in a plan.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the value at index `i`; an index beyond the last value returns the last value.
    ///
    /// Both ends are exact, and every value is the same on all machines: linear values have the
    /// bits of NumPy's `linspace`, and logarithmic ones use no platform's `pow`.
    ///
    /// # Panics
    /// Panics on an axis without values.
    pub fn value(&self, i: u64) -> f64 {
        let (from, to, count) = match *self {
            Self::List(ref values) => {
                let last_index = values.len() - 1;
                return values[usize::try_from(i).map_or(last_index, |i| i.min(last_index))];
            }
            Self::Linear { from, to, count } | Self::Log { from, to, count } => (from, to, count),
            Self::Distributed(Distribution { from, to, .. }) => (from, to, 2),
        };
        let step_index = i as f64;
        let last_index = (count - 1) as f64;
        match self {
            _ if i == 0 => from,
            _ if i + 1 >= count => to,
            Self::Log { .. } => {
                from * libm::exp10(step_index * (libm::log10(to / from) / last_index))
            }
            _ => step_index * ((to - from) / last_index) + from,
        }
    }

    /// Returns the value at a fraction (0 to 1) of the way from the first to the last value, on a
    /// linear or logarithmic scale. A list returns one of its own values.
    pub fn interpolate(&self, fraction: f64) -> f64 {
        match *self {
            Self::List(ref values) => {
                values[((fraction * values.len() as f64) as usize).min(values.len() - 1)]
            }
            Self::Linear { from, to, .. } => from + fraction * (to - from),
            Self::Distributed(ref distribution) => distribution.quantile(fraction),
            Self::Log { from, to, .. } => from * libm::exp10(fraction * libm::log10(to / from)),
        }
    }

    /// Returns the least and the greatest value.
    ///
    /// # Panics
    /// Panics on an axis without values.
    pub fn extremes(&self) -> [f64; 2] {
        let end_values = [0, self.len() - 1].map(|i| self.value(i));
        let values = if let Self::List(values) = self { values } else { &end_values[..] };
        let least_value = values.iter().copied().min_by(f64::total_cmp);
        let greatest_value = values.iter().copied().max_by(f64::total_cmp);
        [least_value, greatest_value].map(Option::unwrap_or_default)
    }
}

impl<M: Model> Plan<M> {
    /// The number of axes whose least and greatest values [`Plan::corner_count`] combines; further
    /// axes stay at their least value. Basis: these are 2^8 combinations. Each additional axis
    /// doubles them.
    const MAX_CORNER_AXES: usize = 8;

    /// The greatest number of points at which machines are prepared before a run. Basis: the
    /// preparation of that many points takes a second. Doubling it doubles that time.
    const MAX_PREPARED_CORNERS: u64 = 256;

    /// Returns the number of points of the design or grid; 1 without axes.
    pub fn points(&self) -> u64 {
        if let Some(design) = &self.design {
            return design.points();
        }
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Returns the value of each axis at a point. The first axis of a grid varies slowest.
    pub fn axis_values(&self, point: u64) -> Vec<f64> {
        if let Some(design) = &self.design {
            let axis_value = |(k, axis): (usize, &Axis<M>)| match design.position(point, k) {
                Some(fraction) => axis.values.interpolate(fraction),
                None => axis.values.value(point),
            };
            return self.axes.iter().enumerate().map(axis_value).collect();
        }
        let mut values = vec![0.0; self.axes.len()];
        let mut remaining_index = point;
        for (axis_value, axis) in values.iter_mut().zip(&self.axes).rev() {
            *axis_value = axis.values.value(remaining_index % axis.values.len());
            remaining_index /= axis.values.len();
        }
        values
    }

    /// Writes a parameter's value into the model or the window.
    pub fn write(&mut self, parameter: &ModelParameter<M>, value: f64) {
        match parameter.window_edge {
            Some(edge) => self.window_s[edge] = value,
            None => self.model.write(&parameter.handle, value),
        }
    }

    /// Returns the window at values of the axes.
    pub fn window_at(&self, axis_values: &[f64]) -> [f64; 2] {
        let mut window_s = self.window_s;
        for (axis, &value) in self.axes.iter().zip(axis_values) {
            if let Some(edge) = axis.parameter.window_edge {
                window_s[edge] = value;
            }
        }
        window_s
    }

    /// Returns the number of corners: the points at which every axis has its least or greatest
    /// value, where conditions that are monotonic along each axis are hardest to meet. The corners
    /// of a list are all of its points. A plan without axes has one.
    pub fn corner_count(&self) -> u64 {
        match &self.design {
            Some(Design::List { points, .. }) => *points,
            _ => 1 << self.axes.len().min(Self::MAX_CORNER_AXES),
        }
    }

    /// Returns the values of the axes at a corner, from 0.
    pub fn corner_values(&self, corner: u64) -> Vec<f64> {
        if matches!(self.design, Some(Design::List { .. })) {
            return self.axis_values(corner);
        }
        let extreme_value = |(k, axis): (usize, &Axis<M>)| {
            let takes_greatest = k < Self::MAX_CORNER_AXES && corner >> k & 1 == 1;
            axis.values.extremes()[usize::from(takes_greatest)]
        };
        self.axes.iter().enumerate().map(extreme_value).collect()
    }

    /// Returns at most `MAX_PREPARED_CORNERS` corners, because a list may have many and a machine's
    /// modes are expensive to compute. Of a longer list, the points at which an axis has its least
    /// or greatest value come first, and the rest are spread evenly.
    pub fn corners_to_prepare(&self) -> Vec<Vec<f64>> {
        let corners = self.corner_count();
        if corners <= Self::MAX_PREPARED_CORNERS {
            return (0..corners).map(|corner| self.corner_values(corner)).collect();
        }
        let mut selected_corners = self.extreme_points();
        let remaining_count =
            Self::MAX_PREPARED_CORNERS.saturating_sub(selected_corners.len() as u64).max(1);
        selected_corners.extend(
            (0..remaining_count)
                .map(|k| u128::from(k) * u128::from(corners) / u128::from(remaining_count))
                .map(|corner| corner as u64),
        );
        selected_corners.iter().map(|corner| self.corner_values(*corner)).collect()
    }

    /// Returns the points of a list at which an axis has its least or greatest value first.
    fn extreme_points(&self) -> BTreeSet<u64> {
        let mut points = BTreeSet::new();
        for axis in &self.axes {
            for extreme in axis.values.extremes() {
                let has_extreme = |point: &u64| axis.values.value(*point) == extreme;
                points.extend((0..axis.values.len()).find(has_extreme));
            }
        }
        points
    }
}

/// The rule of the verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// The limits between which the ratios of a reliable point are.
    pub limits: RatioLimits,
    /// The compared channels, in column order.
    pub channels: Vec<Channel>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_values_equal_numpy_linspace() {
        // The values of numpy.linspace(0.05, 1.0, 39), which computes i * step + start and replaces
        // the last value by the end.
        let masses = AxisValues::Linear { from: 0.05, to: 1.0, count: 39 };
        let expected_values = [
            (0, 0.05),
            (1, 0.075),
            (2, 0.1),
            (20, 0.549_999_999_999_999_9),
            (37, 0.975),
            (38, 1.0),
        ];
        for (i, value) in expected_values {
            assert_eq!(masses.value(i), value, "{i}");
        }
        let dampings = AxisValues::Linear { from: 60.0, to: 300.0, count: 33 };
        assert_eq!(
            [dampings.value(1), dampings.value(31), dampings.value(32)],
            [67.5, 292.5, 300.0]
        );
    }

    #[test]
    fn logarithmic_values_have_exact_decades_and_ends() {
        let log_axis = AxisValues::Log { from: 1e4, to: 1e9, count: 6 };
        let values: Vec<_> = (0..6).map(|i| log_axis.value(i)).collect();
        assert_eq!(values, [1e4, 1e5, 1e6, 1e7, 1e8, 1e9]);
        let uneven_axis = AxisValues::Log { from: 0.3, to: 7.7, count: 5 };
        assert_eq!([uneven_axis.value(0), uneven_axis.value(4)], [0.3, 7.7]);
        let ratio = uneven_axis.value(2) / uneven_axis.value(1);
        assert!((uneven_axis.value(3) / uneven_axis.value(2) / ratio - 1.0).abs() < 1e-14);
    }

    #[test]
    fn an_axis_of_1e12_values_takes_no_memory() {
        let axis = AxisValues::Linear { from: 0.0, to: 1.0, count: 1_000_000_000_000 };
        assert_eq!([axis.value(0), axis.value(999_999_999_999)], [0.0, 1.0]);
        let middle_value = axis.value(500_000_000_000);
        assert!((middle_value - 0.5).abs() < 1e-11, "{middle_value}");
    }
}
