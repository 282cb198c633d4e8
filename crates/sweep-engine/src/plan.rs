//! A run with every value resolved and checked. The configuration makes it; engine, store and
//! reports read it.

use std::collections::BTreeMap;

use serde_json::Value;
use sweep_parameter::{Parameter as _, Range, RatioLimits};

use crate::{Design, Distribution, Model};

/// Most grid points that are accepted. A hundred thousand points a second would take four months.
pub const MOST_POINTS: u64 = 1_000_000_000_000;

/// Longest integration that is accepted: eleven days.
pub const LONGEST_S: f64 = 1e6;

/// What `ratio_min` may be.
pub const RATIO_MIN: Range = Range::Within(0.0, 1.0);

/// Most steps that a trajectory may need by a method whose steps are bounded by its stability; at
/// this many, one point takes an hour or more.
pub const MOST_STEPS: f64 = 1e10;

/// The shortest step with which a trajectory to `end_s` takes at most [`MOST_STEPS`].
pub fn shortest_step_s(end_s: f64) -> f64 {
    end_s / MOST_STEPS
}

/// A validated run: every grid point of every axis, and how each is integrated.
///
/// A plan can only be made by the configuration, which refuses bad input, so the rest of the
/// program takes its numbers as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan<M: Model> {
    /// Name of the run; the output defaults to `results/<name>.parquet`.
    pub name: String,
    /// The model after `[set]` and `--set`, before the axes.
    pub model: M,
    /// Integration runs over `0..=end_s`.
    pub end_s: f64,
    /// Amplitudes are taken over this closed interval.
    pub window_s: [f64; 2],
    /// Method and its settings.
    pub integrator: M::Integrator,
    /// The grid's axes; the first varies slowest. Of a design, what its points are spread over.
    pub axes: Vec<Axis<M>>,
    /// The design of the points, if they are not the grid of the axes.
    pub design: Option<Design>,
    /// What counts as reliable.
    pub reliability: Reliability<M>,
    /// What `--set` has changed, by name.
    pub set: Vec<(String, Value)>,
    /// Where numbers were written.
    pub written: WrittenIn,
}

/// The beginning of the source of a number that follows from others by a rule.
pub const ASSUMED: &str = "assumed: ";

/// The file or option in which each single number was last written, by its parameter's name; or the
/// rule by which a number that was left out has its value, which begins with [`ASSUMED`]. No
/// result depends on it, so plans that differ in nothing else are equal.
#[derive(Clone, Debug, Default)]
pub struct WrittenIn(pub BTreeMap<String, String>);

impl WrittenIn {
    /// Where single numbers of these names were written, in words; `None` of what was not.
    pub fn source(&self, names: &[impl AsRef<str>]) -> Option<String> {
        let mut places: Vec<&str> =
            names.iter().filter_map(|name| Some(self.0.get(name.as_ref())?.as_str())).collect();
        places.dedup();
        let rules: Vec<&str> = places.extract_if(.., |place| place.starts_with(ASSUMED)).collect();
        let given = (!places.is_empty()).then(|| format!("given: {}", places.join(", ")));
        let all: Vec<&str> = given.as_deref().into_iter().chain(rules).collect();
        (!all.is_empty()).then(|| all.join("; "))
    }

    /// Returns whether a number was left out and has its value by a rule.
    pub fn is_assumed(&self, name: &str) -> bool {
        self.0.get(name).is_some_and(|place| place.starts_with(ASSUMED))
    }
}

impl PartialEq for WrittenIn {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// One swept parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis<M: Model> {
    /// From the model's table.
    pub parameter: M::Parameter,
    /// The values along it.
    pub values: AxisValues,
}

/// Values of an axis, made on demand: an axis of a million values takes no memory.
#[derive(Clone, Debug, PartialEq)]
pub enum AxisValues {
    /// As listed.
    List(Vec<f64>),
    /// Evenly spaced, both ends included.
    Linear {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// How many, at least 1.
        count: u64,
    },
    /// In a design: by a distribution, between its bounds.
    Distributed(Distribution),
    /// Evenly spaced in the logarithm, both ends included.
    Log {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// How many, at least 1.
        count: u64,
    },
}

impl AxisValues {
    /// How many values.
    pub fn len(&self) -> u64 {
        match self {
            Self::List(values) => values.len() as u64,
            Self::Linear { count, .. } | Self::Log { count, .. } => *count,
            // The bounds; a design finds the points between.
            Self::Distributed(_) => 2,
        }
    }

    /// Whether there are none; never in a plan.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i`, from 0; beyond the last, the last. Both ends are exact and every value is the
    /// same on all machines: a linear one has the bits of NumPy's `linspace`, a logarithmic one
    /// takes no platform's `pow`.
    ///
    /// # Panics
    /// If there are no values.
    pub fn value(&self, i: u64) -> f64 {
        let (from, to, count) = match *self {
            Self::List(ref values) => {
                let last = values.len() - 1;
                return values[usize::try_from(i).map_or(last, |i| i.min(last))];
            }
            Self::Linear { from, to, count } | Self::Log { from, to, count } => (from, to, count),
            Self::Distributed(Distribution { from, to, .. }) => (from, to, 2),
        };
        let (step, last) = (i as f64, (count - 1) as f64);
        match self {
            _ if i == 0 => from,
            _ if i + 1 >= count => to,
            Self::Log { .. } => from * libm::exp10(step * (libm::log10(to / from) / last)),
            _ => step * ((to - from) / last) + from,
        }
    }

    /// The value a part `place` (0 to 1) of the way from the first to the last, evenly or by the
    /// logarithm; a list has no values between its own, and gives the nearest.
    pub fn between(&self, place: f64) -> f64 {
        match *self {
            Self::List(ref values) => {
                values[((place * values.len() as f64) as usize).min(values.len() - 1)]
            }
            Self::Linear { from, to, .. } => from + place * (to - from),
            Self::Distributed(ref distribution) => distribution.quantile(place),
            Self::Log { from, to, .. } => from * libm::exp10(place * libm::log10(to / from)),
        }
    }

    /// The least and the greatest value.
    ///
    /// # Panics
    /// If there are no values.
    pub fn extremes(&self) -> [f64; 2] {
        let ends = [0, self.len() - 1].map(|i| self.value(i));
        let all = if let Self::List(values) = self { values } else { &ends[..] };
        let all = || all.iter().copied();
        let found = [all().min_by(f64::total_cmp), all().max_by(f64::total_cmp)];
        found.map(Option::unwrap_or_default)
    }
}

impl<M: Model> Plan<M> {
    /// Axes beyond this many are held at their least value by [`Plan::corners`].
    const CORNER_AXES: usize = 8;

    /// Most corners at which machines are made ready before a run.
    const MOST_PREPARED: u64 = 256;

    /// Number of points, of the design or of the grid; 1 without axes.
    pub fn points(&self) -> u64 {
        if let Some(design) = &self.design {
            return design.points();
        }
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Value of each axis at a point; of a grid, the first axis varies slowest.
    pub fn axis_values(&self, point: u64) -> Vec<f64> {
        if let Some(design) = &self.design {
            let value = |(k, axis): (usize, &Axis<M>)| match design.place(point, k) {
                Some(place) => axis.values.between(place),
                None => axis.values.value(point),
            };
            return self.axes.iter().enumerate().map(value).collect();
        }
        let mut values = vec![0.0; self.axes.len()];
        let mut rest = point;
        for (value, axis) in values.iter_mut().zip(&self.axes).rev() {
            *value = axis.values.value(rest % axis.values.len());
            rest /= axis.values.len();
        }
        values
    }

    /// The model at a grid point.
    pub fn scenario(&self, point: u64) -> Scenario<M> {
        self.scenario_at(&self.axis_values(point))
    }

    /// The model at the given value of each axis, on the grid or between its points.
    pub fn scenario_at(&self, axis_values: &[f64]) -> Scenario<M> {
        let mut scenario = Scenario { model: self.model.clone(), window_s: self.window_s };
        self.place(&mut scenario, axis_values);
        scenario
    }

    /// Makes any scenario of this plan the one at these values of the axes: those are all that
    /// differs.
    pub fn place(&self, scenario: &mut Scenario<M>, axis_values: &[f64]) {
        for (axis, &value) in self.axes.iter().zip(axis_values) {
            scenario.write(&axis.parameter, value);
        }
    }

    /// Number of corners: places where a condition that is monotonic along each axis is hardest to
    /// meet. Every axis is at its least or greatest value there; the corners of a list are all of
    /// its points. One without axes.
    pub fn corners(&self) -> u64 {
        match &self.design {
            Some(Design::List { points, .. }) => *points,
            _ => 1 << self.axes.len().min(Self::CORNER_AXES),
        }
    }

    /// Values of the axes at corner `corner`, from 0.
    pub fn corner(&self, corner: u64) -> Vec<f64> {
        if matches!(self.design, Some(Design::List { .. })) {
            return self.axis_values(corner);
        }
        let end = |(k, axis): (usize, &Axis<M>)| {
            let greatest = k < Self::CORNER_AXES && corner >> k & 1 == 1;
            axis.values.extremes()[usize::from(greatest)]
        };
        self.axes.iter().enumerate().map(end).collect()
    }

    /// At most 256 of the corners, spread evenly. The corners of a list are all of its points, and
    /// a machine's modes are expensive.
    pub fn some_corners(&self) -> Vec<Vec<f64>> {
        let every = self.corners().div_ceil(Self::MOST_PREPARED);
        (0..self.corners().div_ceil(every)).map(|k| self.corner(k * every)).collect()
    }
}

/// The verdict's rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability<M: Model> {
    /// A point is reliable when its ratios are between these.
    pub limits: RatioLimits,
    /// The channels that are compared, in column order.
    pub channels: Vec<M::Channel>,
}

/// One grid point's input: the model and the window with that point's axis values in place.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario<M> {
    /// The model.
    pub model: M,
    /// Amplitudes are taken over this closed interval.
    pub window_s: [f64; 2],
}

impl<M: Model> Scenario<M> {
    /// Writes a parameter wherever it belongs.
    pub fn write(&mut self, parameter: &M::Parameter, value: f64) {
        match parameter.window_edge() {
            Some(edge) => self.window_s[edge] = value,
            None => self.model.write(parameter, value),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_values_are_numpys_linspace() {
        // linspace is i * step + start with the last value replaced by the end; these are its
        // doubles in Python.
        let masses = AxisValues::Linear { from: 0.05, to: 1.0, count: 39 };
        let numpy = [
            (0, 0.05),
            (1, 0.075),
            (2, 0.1),
            (20, 0.549_999_999_999_999_9),
            (37, 0.975),
            (38, 1.0),
        ];
        for (i, value) in numpy {
            assert_eq!(masses.value(i), value, "{i}");
        }
        let dampings = AxisValues::Linear { from: 60.0, to: 300.0, count: 33 };
        assert_eq!(
            [dampings.value(1), dampings.value(31), dampings.value(32)],
            [67.5, 292.5, 300.0]
        );
    }

    #[test]
    fn logarithmic_values_hit_the_decades_and_both_ends() {
        let log = AxisValues::Log { from: 1e4, to: 1e9, count: 6 };
        let values: Vec<_> = (0..6).map(|i| log.value(i)).collect();
        assert_eq!(values, [1e4, 1e5, 1e6, 1e7, 1e8, 1e9]);
        let odd = AxisValues::Log { from: 0.3, to: 7.7, count: 5 };
        assert_eq!([odd.value(0), odd.value(4)], [0.3, 7.7]);
        let ratio = odd.value(2) / odd.value(1);
        assert!((odd.value(3) / odd.value(2) / ratio - 1.0).abs() < 1e-14);
    }

    #[test]
    fn an_axis_of_a_million_million_values_takes_no_memory() {
        let axis = AxisValues::Linear { from: 0.0, to: 1.0, count: 1_000_000_000_000 };
        assert_eq!([axis.value(0), axis.value(999_999_999_999)], [0.0, 1.0]);
        let middle = axis.value(500_000_000_000);
        assert!((middle - 0.5).abs() < 1e-11, "{middle}");
    }
}
