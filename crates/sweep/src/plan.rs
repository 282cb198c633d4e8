//! What a run is about to do, with every value resolved and checked: the one thing that flows from
//! the configuration into the engine, the store and the reports.

use serde_json::Value;
use washer_model::{Channel, Machine, Parameter, Spin, Target};
use washer_row::Measures;

use crate::design::{Design, Distribution};
use crate::method::Integrator;
use crate::speeds::Speeds;

/// Most steps that a trajectory may need by a method whose steps are bounded by its stability; at
/// this many, one point takes an hour or more.
pub(crate) const MOST_STEPS: f64 = 1e10;

/// The shortest step with which a trajectory to `end_s` takes at most [`MOST_STEPS`].
#[must_use]
pub(crate) fn shortest_step_s(end_s: f64) -> f64 {
    end_s / MOST_STEPS
}

/// A validated run: every grid point of every axis, and how each is integrated.
///
/// A plan can only be made by the configuration, which refuses bad input, so the rest of the
/// program takes its numbers as they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Name of the run; the output defaults to `results/<name>.parquet`.
    pub name: String,
    /// The machine after `[set]` and `--set`, before the axes.
    pub machine: Machine,
    /// The spin after `[set]` and `--set`, before the axes.
    pub spin: Spin,
    /// Integration runs over `0..=end_s`.
    pub end_s: f64,
    /// Amplitudes are taken over this closed interval.
    pub window_s: [f64; 2],
    /// Method and its settings.
    pub integrator: Integrator,
    /// The grid's axes; the first varies slowest. Of a design, what its points are spread over.
    pub axes: Vec<Axis>,
    /// How points are laid out if not as the grid of the axes.
    pub design: Option<Design>,
    /// What counts as reliable.
    pub reliability: Reliability,
    /// What is measured of the motions.
    pub measures: Measures,
    /// The constant speeds that the metric `growth` is about; `None` if it is not asked for.
    pub growth_speeds: Option<Speeds>,
    /// What `--set` has changed, by name.
    pub set: Vec<(String, Value)>,
}

/// One swept parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// From the parameter table.
    pub parameter: Parameter,
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
    /// Of a design: as often as a distribution says, between its bounds.
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
    #[must_use]
    pub fn len(&self) -> u64 {
        match self {
            Self::List(values) => values.len() as u64,
            Self::Linear { count, .. } | Self::Log { count, .. } => *count,
            // The bounds; a design finds the points between.
            Self::Distributed(_) => 2,
        }
    }

    /// Whether there are none; never in a plan.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i`, from 0; beyond the last, the last. Both ends are exact and every value is the
    /// same on all machines: a linear one has the bits of NumPy's `linspace`, a logarithmic one
    /// takes no platform's `pow`.
    ///
    /// # Panics
    /// If there are no values.
    #[must_use]
    pub fn value(&self, i: u64) -> f64 {
        let at = |from: f64, to: f64, count: u64, between: &dyn Fn(f64, f64) -> f64| {
            if i == 0 {
                from
            } else if i + 1 >= count {
                to
            } else {
                between(i as f64, (count - 1) as f64)
            }
        };
        match *self {
            Self::List(ref values) => {
                let last = values.len() - 1;
                values[usize::try_from(i).map_or(last, |i| i.min(last))]
            }
            Self::Linear { from, to, count } => {
                at(from, to, count, &|i, last| i * ((to - from) / last) + from)
            }
            Self::Distributed(Distribution { from, to, .. }) => at(from, to, 2, &|_, _| to),
            Self::Log { from, to, count } => at(from, to, count, &|i, last| {
                from * libm::exp10(i * (libm::log10(to / from) / last))
            }),
        }
    }

    /// The value a part `place` (0 to 1) of the way from the first to the last, evenly or by the
    /// logarithm; a list has no values between its own, and gives the nearest.
    #[must_use]
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

    /// Indices of the least and the greatest value.
    #[must_use]
    pub fn extremes(&self) -> [u64; 2] {
        match self {
            Self::List(values) => {
                let by_value = |a: &(usize, &f64), b: &(usize, &f64)| a.1.total_cmp(b.1);
                let index = |found: Option<(usize, &f64)>| found.map_or(0, |(i, _)| i as u64);
                let pairs = || values.iter().enumerate();
                [index(pairs().min_by(by_value)), index(pairs().max_by(by_value))]
            }
            Self::Distributed(_) => [0, 1],
            Self::Linear { from, to, count } | Self::Log { from, to, count } => {
                if from <= to {
                    [0, count - 1]
                } else {
                    [count - 1, 0]
                }
            }
        }
    }
}

impl Plan {
    /// Axes beyond this many are held at their least value by [`Plan::corners`].
    const CORNER_AXES: usize = 8;

    /// Most corners at which machines are made ready before a run.
    const MOST_PREPARED: u64 = 256;

    /// What gives forces corners at some point, in words; `None` where all are smooth.
    #[must_use]
    pub(crate) fn corners_of_forces(&self) -> Option<&'static str> {
        let rubs = self.machine.dampers.iter().any(|damper| damper.friction_n != 0.0);
        let may_rub = self.axes.iter().any(|axis| axis.parameter.name().ends_with("friction_n"));
        match (rubs || may_rub, self.machine.stops.is_empty()) {
            (true, true) => Some("dampers with friction"),
            (true, false) => Some("dampers with friction, and stops"),
            (false, false) => Some("stops"),
            (false, true) => None,
        }
    }

    /// Number of points, of the design or of the grid; 1 without axes.
    #[must_use]
    pub fn points(&self) -> u64 {
        if let Some(design) = &self.design {
            return design.points();
        }
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Value of each axis at a point; of a grid, the first axis varies slowest.
    #[must_use]
    pub fn axis_values(&self, point: u64) -> Vec<f64> {
        if let Some(design) = &self.design {
            let value = |(k, axis): (usize, &Axis)| match design.place(point, k) {
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

    /// Machine and spin of a grid point.
    #[must_use]
    pub fn scenario(&self, point: u64) -> Scenario {
        self.scenario_at(&self.axis_values(point))
    }

    /// Machine and spin at the given value of each axis, on the grid or between its points.
    #[must_use]
    pub fn scenario_at(&self, axis_values: &[f64]) -> Scenario {
        let mut scenario = Scenario {
            machine: self.machine.clone(),
            spin: self.spin.clone(),
            window_s: self.window_s,
        };
        self.place(&mut scenario, axis_values);
        scenario
    }

    /// Makes any scenario of this plan the one at these values of the axes: those are all that
    /// differs.
    pub(crate) fn place(&self, scenario: &mut Scenario, axis_values: &[f64]) {
        let Scenario { machine, spin, window_s } = scenario;
        for (axis, &value) in self.axes.iter().zip(axis_values) {
            write(&axis.parameter, machine, spin, window_s, value);
        }
    }

    /// Points of a grid where every axis is at its least or greatest value, beyond the eighth axis
    /// at its least; none of a design, whose points need not be there.
    #[must_use]
    pub fn corner_points(&self) -> Vec<u64> {
        if self.design.is_some() {
            return Vec::new();
        }
        let free = self.axes.len().min(Self::CORNER_AXES);
        let corner = |sides: u32| {
            self.axes.iter().enumerate().fold(0, |point, (k, axis)| {
                let greatest = k < free && sides >> k & 1 == 1;
                point * axis.values.len() + axis.values.extremes()[usize::from(greatest)]
            })
        };
        (0..1_u32 << free).map(corner).collect()
    }

    /// Number of corners: places where a condition that is monotonic along each axis is hardest to
    /// meet. Every axis is at its least or greatest value there; the corners of a list are all of
    /// its points. One without axes.
    #[must_use]
    pub fn corners(&self) -> u64 {
        match &self.design {
            Some(Design::List { points, .. }) => *points,
            _ => 1 << self.axes.len().min(Self::CORNER_AXES),
        }
    }

    /// Values of the axes at corner `corner`, from 0.
    #[must_use]
    pub fn corner(&self, corner: u64) -> Vec<f64> {
        if matches!(self.design, Some(Design::List { .. })) {
            return self.axis_values(corner);
        }
        let end = |(k, axis): (usize, &Axis)| {
            let greatest = k < Self::CORNER_AXES && corner >> k & 1 == 1;
            axis.values.value(axis.values.extremes()[usize::from(greatest)])
        };
        self.axes.iter().enumerate().map(end).collect()
    }

    /// Of the corners not more than 256, spread evenly: a list has no corners but its points, and
    /// looking at a machine's modes is expensive.
    #[must_use]
    pub fn some_corners(&self) -> Vec<Vec<f64>> {
        let every = self.corners().div_ceil(Self::MOST_PREPARED);
        (0..self.corners().div_ceil(every)).map(|k| self.corner(k * every)).collect()
    }
}

/// The verdict's rule.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// A point is reliable when its greatest ratio is below this.
    pub ratio_limit: f64,
    /// The channels that are compared, in column order.
    pub channels: Vec<Channel>,
}

/// Writes a parameter wherever it belongs.
pub(crate) fn write(
    parameter: &Parameter,
    machine: &mut Machine,
    spin: &mut Spin,
    window_s: &mut [f64; 2],
    value: f64,
) {
    match parameter.target() {
        Target::Window(edge) => window_s[edge] = value,
        _ => parameter.set(machine, spin, value),
    }
}

/// One grid point's input: machine, spin and window with that point's axis values in place.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The machine.
    pub machine: Machine,
    /// The spin.
    pub spin: Spin,
    /// Amplitudes are taken over this closed interval.
    pub window_s: [f64; 2],
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(axes: &[(&str, AxisValues)]) -> Plan {
        let machine = Machine::paper();
        let spin = Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 };
        let axis = |(name, values): &(&str, AxisValues)| Axis {
            parameter: Parameter::find(name, &machine, &spin).unwrap(),
            values: values.clone(),
        };
        Plan {
            name: "test".to_owned(),
            axes: axes.iter().map(axis).collect(),
            design: None,
            machine: machine.clone(),
            spin: spin.clone(),
            end_s: 50.0,
            window_s: [30.0, 50.0],
            integrator: Integrator::Rk4MassScaled { accuracy: 1e-3 },
            reliability: Reliability { ratio_limit: 2.0, channels: Channel::ALL.to_vec() },
            measures: Measures::default(),
            growth_speeds: None,
            set: Vec::new(),
        }
    }

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

    #[test]
    fn the_first_axis_varies_slowest() {
        let plan = plan(&[
            ("unbalance_mass_kg", AxisValues::List(vec![0.1, 0.2])),
            ("damping_n_s_per_m", AxisValues::Linear { from: 60.0, to: 80.0, count: 3 }),
        ]);
        assert_eq!(plan.points(), 6);
        let order: Vec<_> = (0..6).map(|p| plan.axis_values(p)).collect();
        let expected =
            [[0.1, 60.0], [0.1, 70.0], [0.1, 80.0], [0.2, 60.0], [0.2, 70.0], [0.2, 80.0]]
                .map(Vec::from);
        assert_eq!(order, expected);
        let scenario = plan.scenario(4);
        assert_eq!(scenario.machine.unbalance.mass_kg, 0.2);
        assert!(scenario.machine.dampers.iter().all(|d| d.damping_n_s_per_m == 70.0));
        assert_eq!(scenario.spin, plan.spin);
    }

    #[test]
    fn corners_are_the_extreme_points_even_of_unordered_lists() {
        let plan = plan(&[
            ("unbalance_mass_kg", AxisValues::List(vec![0.3, 0.1, 0.2])),
            ("damping_n_s_per_m", AxisValues::Linear { from: 80.0, to: 60.0, count: 3 }),
        ]);
        let corners: Vec<_> = (0..plan.corners()).map(|corner| plan.corner(corner)).collect();
        assert_eq!(corners, [[0.1, 60.0], [0.3, 60.0], [0.1, 80.0], [0.3, 80.0]].map(Vec::from));
    }

    #[test]
    fn a_plan_without_axes_is_one_point() {
        let plan = plan(&[]);
        assert_eq!(plan.points(), 1);
        assert_eq!((plan.corners(), plan.corner(0)), (1, Vec::new()));
        assert_eq!(plan.scenario(0).machine, plan.machine);
    }

    #[test]
    fn a_design_spreads_its_points_over_the_axes_ranges() {
        let mut plan = plan(&[
            ("unbalance_mass_kg", AxisValues::Linear { from: 0.1, to: 0.9, count: 2 }),
            ("bearing_stiffness_n_per_m", AxisValues::Log { from: 1e6, to: 1e8, count: 2 }),
        ]);
        plan.design = Some(Design::Sobol { points: 1024, seed: 1 });
        assert_eq!(plan.points(), 1024);
        let points: Vec<Vec<f64>> = (0..1024).map(|point| plan.axis_values(point)).collect();
        let below =
            |axis: usize, middle: f64| points.iter().filter(|point| point[axis] < middle).count();
        assert_eq!([below(0, 0.5), below(1, 1e7)], [512, 512]);
        assert!(points.iter().all(|p| (0.1..0.9).contains(&p[0]) && (1e6..1e8).contains(&p[1])));
        assert_eq!(plan.corners(), 4);
        assert_eq!(plan.scenario(7).machine.unbalance.mass_kg, points[7][0]);
    }
}
