//! The problem of a fit and the model's signals: trajectories of a point and its neighbours side by
//! side in lanes.

use std::f64::consts::TAU;
use std::sync::Arc;

use lane_ode::Simd;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use rayon::slice::ParallelSlice as _;
use washer_model::{
    Machine, MachineParameter, Method, ModelKind, Point, Recorders, Snapshot, Spin, StepSelector,
    Timing, prepare, simulate_until,
};

use super::algebra::{dot, subtract_mean};
use super::measurement::{Measurement, Signal, SignalQuantity};
use super::speed::SmoothedSpin;
use crate::engine::reference_step_s;
use crate::method::direct_method;
use crate::plan::{Plan, prepare_point};
use lane_ode::Cancel;
use sweep_engine::plan::NumberSources;

/// The step of a difference quotient, as a part of the number. Basis: the square root of the
/// rounding error of a trajectory. Doubling it doubles the error of derivatives by curvature.
const RELATIVE_DIFFERENCE_STEP: f64 = 1e-5;
/// The greatest shift of a measurement's clock (s). Basis: a logger that starts by hand is set to
/// the run's start more exactly. Doubling it lengthens every trajectory by a quarter of a second.
pub(super) const MAX_SHIFT_S: f64 = 0.25;
/// The step of a difference quotient by the clock's shift (s). Basis: a thousandth of a turn at
/// 6000 rpm. Doubling it doubles the error of that derivative by curvature.
const SHIFT_DIFFERENCE_STEP_S: f64 = 1e-5;

/// A measurement and the run that was measured.
#[derive(Clone, Debug)]
pub(crate) struct FitCase {
    /// The grid with this run's own constants.
    pub(crate) plan: Plan,
    pub(crate) measurement: Measurement,
    /// The spin, if it was measured.
    pub(crate) smoothed_spin: Option<SmoothedSpin>,
}

impl FitCase {
    /// Returns the spin of the run.
    pub(crate) fn spin(&self) -> &Spin {
        self.smoothed_spin
            .as_ref()
            .map_or(&self.plan.model.spin, |smoothed_spin| &smoothed_spin.spin)
    }

    /// Returns the measured spin at time 0 (rpm).
    pub(crate) fn first_rpm(&self) -> Option<f64> {
        self.smoothed_spin.as_ref()?.spin.speeds_rpm([0.0]).next()
    }

    /// Returns the run's greatest speed (rpm).
    pub(crate) fn greatest_rpm(&self) -> f64 {
        self.spin().max_speed_rad_per_s(self.end_s()) * 60.0 / TAU
    }

    /// Returns the number of samples of a signal in a second, on average.
    pub(crate) fn sampling_rate_hz(&self, signal: &Signal) -> f64 {
        let times = &self.measurement.time_s;
        signal.samples().count() as f64 / (times[times.len() - 1] - times[0])
    }

    /// Returns the end of the run (s), which is later than the record by the greatest shift.
    fn end_s(&self) -> f64 {
        self.measurement.time_s.last().copied().unwrap_or_default() + MAX_SHIFT_S
    }
}

/// A parameter of the machine that is fitted.
#[derive(Clone, Debug)]
pub(crate) struct FreeParameter {
    pub(crate) parameter: MachineParameter,
    /// The least and the greatest value.
    pub(crate) range: [f64; 2],
    pub(crate) start: f64,
    /// The case that has a value of its own; `None` if all cases share the value.
    pub(crate) case: Option<usize>,
}

impl FreeParameter {
    pub(crate) fn belongs_to(&self, case: usize) -> bool {
        self.case.is_none_or(|parameter_case| parameter_case == case)
    }
}

/// A least-squares problem. Its unknowns are the free parameters, then the shift of each case's
/// clock, if shifts are fitted. The offsets of signals are no unknowns, because means are
/// subtracted.
pub(crate) struct Problem<'a> {
    pub(crate) cases: Vec<FitCase>,
    pub(crate) free_parameters: Vec<FreeParameter>,
    pub(crate) model_kind: ModelKind,
    pub(crate) fits_shift: bool,
    pub(crate) method: Method,
    pub(crate) simd: Simd,
    /// The cancellation, after which results are meaningless.
    pub(crate) cancel: Cancel<'a>,
}

/// A machine, its spin, and the shift of the measurement's clock (s).
type CaseRun = (Machine, Spin, f64);

/// The comparison of a measured signal with the model.
#[derive(Clone, Debug)]
pub(crate) struct SignalComparison {
    pub(crate) case_index: usize,
    pub(crate) signal_index: usize,
    /// The values of the model at every row, without the offset.
    pub(crate) model_values: Vec<f64>,
    pub(crate) offset: f64,
    /// The difference of measurement and model less the offset, at each sample.
    pub(crate) residual: Vec<f64>,
    /// The derivatives of the model by each unknown at the samples, less their means; empty for an
    /// unknown that does not matter to the case.
    pub(crate) slopes: Vec<Vec<f64>>,
}

/// The cost at a point and its normal equations, of Gauss and Newton. The cost is twice the
/// negative log-likelihood, where the variance of each signal's noise is that of its residual.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NormalEquations {
    pub(crate) cost: f64,
    /// The standard deviation of each signal's noise.
    pub(crate) sigma: Vec<f64>,
    /// The normal matrix J' W J, with the Jacobian J and the weights W.
    pub(crate) normal_matrix: Vec<Vec<f64>>,
    /// The right side J' W r, with the residual r.
    pub(crate) rhs: Vec<f64>,
}

impl Problem<'_> {
    /// Selects the integration method: that of the grid if it is a method of fixed steps, or else
    /// Runge and Kutta's with the step of references, which depends on the machine at the start.
    pub(crate) fn select_method(cases: &[FitCase]) -> Result<Method, washer_model::NoEquilibrium> {
        if let Some(method) = cases.iter().find_map(|case| direct_method(&case.plan.integrator)) {
            return Ok(method);
        }
        let mut step_s = f64::INFINITY;
        for case in cases {
            let end_s = case.end_s();
            let machine = case.plan.model.machine.clone();
            let timing = Timing { end_s, window_s: [0.0, end_s], checkpoints: 0 };
            let point = prepare_point(machine, case.spin().clone(), &timing)?;
            step_s =
                step_s.min(reference_step_s(&StepSelector::new([(&point, case.spin())], end_s)));
        }
        Ok(Method::rk4(step_s))
    }

    /// Returns the number of unknowns.
    pub(crate) fn unknown_count(&self) -> usize {
        self.free_parameters.len() + if self.fits_shift { self.cases.len() } else { 0 }
    }

    /// Returns the range of an unknown.
    pub(crate) fn unknown_range(&self, unknown: usize) -> [f64; 2] {
        self.free_parameters.get(unknown).map_or([-MAX_SHIFT_S, MAX_SHIFT_S], |free| free.range)
    }

    /// Returns the unknowns at the start.
    pub(crate) fn start_point(&self) -> Vec<f64> {
        let shift_count = self.unknown_count() - self.free_parameters.len();
        self.free_parameters
            .iter()
            .map(|free| free.start)
            .chain(std::iter::repeat_n(0.0, shift_count))
            .collect()
    }

    /// Iterates over the signals of all cases, in order.
    pub(crate) fn signals(&self) -> impl Iterator<Item = (usize, usize, &Signal)> {
        self.cases.iter().enumerate().flat_map(|(c, case)| {
            case.measurement.signals.iter().enumerate().map(move |(s, signal)| (c, s, signal))
        })
    }

    /// Returns the shift of a case's clock (s).
    pub(crate) fn shift_s(&self, case: usize, x: &[f64]) -> f64 {
        if self.fits_shift { x[self.free_parameters.len() + case] } else { 0.0 }
    }

    /// Returns the machine and the spin of a case.
    pub(crate) fn machine(&self, case: usize, x: &[f64]) -> (Machine, Spin) {
        let mut machine = self.cases[case].plan.model.machine.clone();
        let mut spin = self.cases[case].spin().clone();
        for (free, value) in
            self.free_parameters.iter().zip(x).filter(|(free, _)| free.belongs_to(case))
        {
            free.parameter.set(&mut machine, &mut spin, *value);
        }
        (machine, spin)
    }

    /// Returns the sources of the numbers of the first case's machine.
    pub(crate) fn number_sources(&self) -> NumberSources {
        let plan = &self.cases[0].plan;
        let mut number_sources = plan.sources.clone();
        for free in self.free_parameters.iter().filter(|free| free.belongs_to(0)) {
            let cases_with_value =
                self.cases.iter().enumerate().filter(|(case, _)| free.belongs_to(*case));
            let file_names: Vec<&str> =
                cases_with_value.map(|(_, case)| &*case.measurement.name).collect();
            let source = format!("fit to {}", file_names.join(", "));
            let single_names = free.parameter.single_names(&plan.model.machine).into_iter();
            number_sources.0.extend(single_names.map(|part| (part.into_owned(), source.clone())));
        }
        number_sources
    }

    /// Returns whether an unknown matters to a case.
    fn unknown_affects_case(&self, unknown: usize, case: usize) -> bool {
        match self.free_parameters.get(unknown) {
            Some(free) => free.belongs_to(case),
            None => unknown - self.free_parameters.len() == case,
        }
    }

    /// Returns the step of the difference quotient by an unknown, which stays within its range.
    fn difference_step(&self, unknown: usize, x: &[f64]) -> f64 {
        let step = self.free_parameters.get(unknown).map_or(SHIFT_DIFFERENCE_STEP_S, |free| {
            let width = free.range[1] - free.range[0];
            let magnitude = x[unknown].abs().max(free.start.abs());
            RELATIVE_DIFFERENCE_STEP
                * if width.is_finite() { magnitude.max(0.01 * width) } else { magnitude }
        });
        if x[unknown] + step > self.unknown_range(unknown)[1] { -step } else { step }
    }

    /// Returns the run of a case at some unknowns.
    fn case_run(&self, case: usize, x: &[f64]) -> CaseRun {
        let (machine, spin) = self.machine(case, x);
        (machine, spin, self.shift_s(case, x))
    }

    /// Simulates `count` runs of a case and reduces the signals of each. The result is `None` for a
    /// run without a possible machine or with a failed trajectory, and for all runs after a
    /// cancellation. The runs share lanes and use all threads of the current rayon pool.
    fn simulate_signals<T: Send>(
        &self,
        case: usize,
        count: usize,
        machine_and_shift: impl Fn(usize) -> CaseRun + Sync,
        reduce_signals: impl Fn(Vec<Vec<f64>>) -> T + Sync,
    ) -> Vec<Option<T>> {
        let measurement = &self.cases[case].measurement;
        let end_s = self.cases[case].end_s();
        let timing = Timing { end_s, window_s: [0.0, end_s], checkpoints: 0 };
        let recorders = Recorders { with_snapshots: true, ..Recorders::default() };
        let simulate_group = |group: &[usize]| {
            let numbered_runs = group.iter().map(|&k| machine_and_shift(k)).enumerate();
            let valid_runs =
                numbered_runs.filter(|(_, (machine, ..))| machine.violations().is_empty());
            let (shifts, machines): (Vec<(usize, f64)>, Vec<(Machine, Spin)>) = valid_runs
                .map(|(run_index, (machine, spin, shift_s))| {
                    ((run_index, shift_s), (machine, spin))
                })
                .unzip();
            let points: Vec<(usize, Point)> = shifts
                .into_iter()
                .zip(prepare(self.simd, &machines, &timing))
                .filter_map(|((run_index, shift_s), point)| {
                    let instants: Arc<[f64]> =
                        measurement.time_s.iter().map(|time| (time + shift_s).max(0.0)).collect();
                    Some((run_index, point.ok()?.with_snapshots_at(instants)))
                })
                .collect();
            let point_references: Vec<&Point> = points.iter().map(|(_, point)| point).collect();
            let model = self.model_kind;
            let simulation = simulate_until(
                self.simd,
                model,
                &self.method,
                &point_references,
                recorders,
                self.cancel,
            );
            let recorder_outputs = simulation.map_or_else(Vec::new, |(_, extras)| extras);
            let mut results: Vec<Option<T>> = group.iter().map(|_| None).collect();
            for ((run_index, point), extra) in points.iter().zip(recorder_outputs) {
                let snapshots = extra.snapshots;
                if snapshots.len() < measurement.time_s.len() {
                    continue;
                }
                let signal_values = |signal: &Signal| -> Vec<f64> {
                    snapshots
                        .iter()
                        .map(|snapshot| self.signal_value(snapshot, signal, point))
                        .collect()
                };
                results[*run_index] =
                    Some(reduce_signals(measurement.signals.iter().map(signal_values).collect()));
            }
            results
        };
        let indices: Vec<usize> = (0..count).collect();
        indices.par_chunks(self.simd.lanes().max(2)).flat_map_iter(simulate_group).collect()
    }

    fn signal_value(&self, snapshot: &Snapshot, signal: &Signal, point: &Point) -> f64 {
        match signal.quantity {
            SignalQuantity::Motion(channel, order) => snapshot.channels[channel.index()][order],
            SignalQuantity::CabinetForce(axis) => {
                snapshot.cabinet_force_n(point, self.model_kind)[axis]
            }
        }
    }

    /// Compares every signal with the model. It uses all threads of the current rayon pool.
    pub(crate) fn compare(&self, x: &[f64]) -> Option<Vec<SignalComparison>> {
        let unknown_count = self.unknown_count();
        let steps: Vec<f64> = (0..unknown_count).map(|k| self.difference_step(k, x)).collect();
        // A run with each unknown that matters to the case shifted, then the run at the point.
        let simulate_varied_runs = |case: usize| {
            let varied_unknowns: Vec<usize> =
                (0..unknown_count).filter(|&k| self.unknown_affects_case(k, case)).collect();
            let varied_run = |index: usize| {
                let mut x = x.to_vec();
                if let Some(&k) = varied_unknowns.get(index) {
                    x[k] += steps[k];
                }
                self.case_run(case, &x)
            };
            let mut varied_signals =
                self.simulate_signals(case, varied_unknowns.len() + 1, varied_run, |values| values);
            let unvaried_signals = varied_signals.pop()??;
            let mut signals_by_unknown = vec![None; unknown_count];
            for (&k, values) in varied_unknowns.iter().zip(varied_signals) {
                signals_by_unknown[k] = Some(values?);
            }
            Some((unvaried_signals, signals_by_unknown))
        };
        let simulations = (0..self.cases.len()).into_par_iter().map(simulate_varied_runs);
        let simulations_by_case: Vec<_> = simulations.collect::<Option<_>>()?;
        let compare_signal = |(case, s, signal): (usize, usize, &Signal)| {
            let (signals, shifted) = &simulations_by_case[case];
            let model = signals[s].clone();
            let slope_by_unknown =
                |varied_signals: &Option<Vec<Vec<f64>>>, step: f64| -> Vec<f64> {
                    let Some(shifted) = varied_signals else { return Vec::new() };
                    let slope_at = |(row, _)| (shifted[s][row] - model[row]) / step;
                    subtract_mean(signal.samples().map(slope_at).collect()).0
                };
            let slopes =
                shifted.iter().zip(&steps).map(|(shifted, step)| slope_by_unknown(shifted, *step));
            let slopes = slopes.collect();
            let difference = signal.samples().map(|(row, measurement)| measurement - model[row]);
            let (residual, offset) = subtract_mean(difference.collect());
            SignalComparison {
                case_index: case,
                signal_index: s,
                model_values: model,
                offset,
                residual,
                slopes,
            }
        };
        Some(self.signals().map(compare_signal).collect())
    }

    /// Computes the differences that each of `count` changes of a case's machine and spin makes to
    /// its signals at their samples, and reduces them; `None` for a run that fails. `comparisons`
    /// is the comparison without a change.
    pub(crate) fn compute_changes<T: Send>(
        &self,
        case: usize,
        x: &[f64],
        comparisons: &[SignalComparison],
        (count, apply_change): (usize, impl Fn(usize, &mut Machine, &mut Spin) + Sync),
        reduce: impl Fn(Vec<Vec<f64>>) -> T + Sync,
    ) -> Vec<Option<T>> {
        let changed_run = |k: usize| {
            let (mut machine, mut spin, shift_s) = self.case_run(case, x);
            apply_change(k, &mut machine, &mut spin);
            (machine, spin, shift_s)
        };
        let case_comparisons: Vec<&SignalComparison> =
            comparisons.iter().filter(|comparison| comparison.case_index == case).collect();
        let reduce_to_changes = |values: Vec<Vec<f64>>| {
            let signal_change =
                |(values, comparison): (&Vec<f64>, &&SignalComparison)| -> Vec<f64> {
                    let signal = &self.cases[case].measurement.signals[comparison.signal_index];
                    signal
                        .samples()
                        .map(|(row, _)| values[row] - comparison.model_values[row])
                        .collect()
                };
            reduce(values.iter().zip(&case_comparisons).map(signal_change).collect())
        };
        self.simulate_signals(case, count, changed_run, reduce_to_changes)
    }

    /// Computes for each of `count` changes of a case's machine and spin the change of the normal
    /// equations' right side; `None` for a run that fails. `comparisons` is the comparison
    /// without a change, and `sigma` the noise of each signal.
    pub(crate) fn compute_right_sides(
        &self,
        case: usize,
        x: &[f64],
        (comparisons, sigma): (&[SignalComparison], &[f64]),
        count: usize,
        apply_change: impl Fn(usize, &mut Machine, &mut Spin) + Sync,
    ) -> Vec<Option<Vec<f64>>> {
        let case_comparisons: Vec<(&SignalComparison, f64)> = comparisons
            .iter()
            .zip(sigma)
            .filter(|(comparison, _)| comparison.case_index == case)
            .map(|(comparison, sigma)| (comparison, *sigma))
            .collect();
        let change_right_side = |changes: Vec<Vec<f64>>| {
            let mut rhs_change = vec![0.0; self.unknown_count()];
            for (change, (comparison, sigma)) in changes.iter().zip(&case_comparisons) {
                for (rhs_change, slope) in rhs_change.iter_mut().zip(&comparison.slopes) {
                    *rhs_change += dot(slope, change) / (sigma * sigma);
                }
            }
            rhs_change
        };
        self.compute_changes(case, x, comparisons, (count, apply_change), change_right_side)
    }

    /// Computes the costs of many sets of unknowns, without derivatives. The cost of a run that
    /// fails is infinite.
    pub(crate) fn compute_costs(&self, unknown_sets: &[Vec<f64>]) -> Vec<f64> {
        let case_costs = |case: usize| {
            let cost_of_models = |models: Vec<Vec<f64>>| -> f64 {
                let signals = self.cases[case].measurement.signals.iter().zip(models);
                let cost_of_signal = |(signal, model): (&Signal, Vec<f64>)| {
                    let difference = signal.samples().map(|(row, value)| value - model[row]);
                    let (residual, _) = subtract_mean(difference.collect());
                    compute_cost_and_noise(&residual, signal).0
                };
                signals.map(cost_of_signal).sum()
            };
            self.simulate_signals(
                case,
                unknown_sets.len(),
                |k| self.case_run(case, &unknown_sets[k]),
                cost_of_models,
            )
        };
        let costs_by_case: Vec<_> = (0..self.cases.len()).into_par_iter().map(case_costs).collect();
        let mut costs = vec![0.0; unknown_sets.len()];
        for case_costs in costs_by_case {
            for (sum, cost) in costs.iter_mut().zip(case_costs) {
                *sum += cost.unwrap_or(f64::INFINITY);
            }
        }
        costs
    }

    /// Computes the cost and the normal equations of a comparison.
    pub(crate) fn normal_equations(&self, comparisons: &[SignalComparison]) -> NormalEquations {
        let unknown_count = self.unknown_count();
        let mut equations = NormalEquations {
            cost: 0.0,
            sigma: Vec::new(),
            normal_matrix: vec![vec![0.0; unknown_count]; unknown_count],
            rhs: vec![0.0; unknown_count],
        };
        for ((.., signal), comparisons) in self.signals().zip(comparisons) {
            let (cost, sigma) = compute_cost_and_noise(&comparisons.residual, signal);
            equations.cost += cost;
            equations.sigma.push(sigma);
            let weight = 1.0 / (sigma * sigma);
            for i in 0..unknown_count {
                equations.rhs[i] += weight * dot(&comparisons.slopes[i], &comparisons.residual);
                for j in 0..=i {
                    let product = weight * dot(&comparisons.slopes[i], &comparisons.slopes[j]);
                    equations.normal_matrix[i][j] += product;
                    if i != j {
                        equations.normal_matrix[j][i] += product;
                    }
                }
            }
        }
        equations
    }
}

/// Returns the part of the cost of a signal, and the standard deviation of its noise, which is that
/// of the residual, and at least a millionth of the signal's.
fn compute_cost_and_noise(residual: &[f64], signal: &Signal) -> (f64, f64) {
    let centred_values = signal.centred_values();
    let sample_count = residual.len() as f64;
    let min_square_sum = 1e-12 * dot(&centred_values, &centred_values) + f64::MIN_POSITIVE;
    let mean_square = (dot(residual, residual) + min_square_sum) / sample_count;
    (sample_count * libm::log(mean_square), mean_square.sqrt())
}
