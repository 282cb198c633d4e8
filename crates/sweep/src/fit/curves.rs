//! The curves of a fit for figures: the measurement, the model and the residual.

use serde_json::{Value, json};
use sweep_engine::Table;
use sweep_files::key;

use super::algebra::pseudo_inverse;
use super::measurement::usual_step;
use super::model::SignalComparison;
use super::spectrum::compute_spectrum;
use super::{FinishedFit, Problem};

/// The greatest distance of a profile's points from the best value, in half standard errors. Basis:
/// three standard errors include every interval of 95 %. Doubling it doubles the evaluations.
const PROFILE_HALF_STEPS: i32 = 6;

impl FinishedFit<'_> {
    /// Computes the rise of the cost about the best value of each free number, with the others
    /// fitted again to first order.
    fn profiles(&self) -> Value {
        let Problem { free, .. } = &self.problem;
        let equations = self.problem.normal_equations(&self.comparisons);
        let inverse_normal = pseudo_inverse(&equations.normal);
        let deviations: Vec<f64> =
            (-PROFILE_HALF_STEPS..=PROFILE_HALF_STEPS).map(|k| 0.5 * f64::from(k)).collect();
        let values_at_deviation = |k: usize, deviation: f64| -> Vec<f64> {
            let step = deviation / inverse_normal[k][k].max(f64::MIN_POSITIVE).sqrt();
            (0..self.x.len())
                .map(|j| {
                    let [from, to] = self.problem.unknown_range(j);
                    (self.x[j] + step * inverse_normal[k][j]).clamp(from, to)
                })
                .collect()
        };
        let value_sets: Vec<Vec<f64>> = (0..free.len())
            .flat_map(|k| deviations.iter().map(move |deviation| (k, *deviation)))
            .map(|(k, deviation)| values_at_deviation(k, deviation))
            .collect();
        let costs = self.problem.compute_costs(&value_sets);
        let profile = |k: usize| {
            let indices = k * deviations.len()..(k + 1) * deviations.len();
            let cost_increases: Vec<f64> =
                costs[indices.clone()].iter().map(|cost| cost - equations.cost).collect();
            json!({
                "name": free[k].parameter.name(),
                "values": value_sets[indices].iter().map(|values| values[k]).collect::<Vec<_>>(),
                "deviations": deviations,
                "cost_above": cost_increases,
            })
        };
        (0..free.len()).map(profile).collect()
    }

    /// Computes the spectra of a case's measurement and of its residual; missing samples count as
    /// zero.
    fn spectra(&self, case: usize) -> Value {
        let measurement = &self.problem.cases[case].measurement;
        let step_s = usual_step(&measurement.time_s).unwrap_or(1.0);
        let mut frequencies_hz = Vec::new();
        let mut column = |comparison: &SignalComparison| {
            let signal = &measurement.signals[comparison.signal];
            let mut spectral_density = |values: &[f64]| {
                let mut with_zeros = vec![0.0; measurement.time_s.len()];
                signal.samples().zip(values).for_each(|((row, _), value)| with_zeros[row] = *value);
                let density;
                (frequencies_hz, density) = compute_spectrum(&with_zeros, step_s);
                density
            };
            json!({
                "name": signal.quantity.column(),
                "unit": signal.quantity.units().0,
                "measured": spectral_density(&signal.centred_values()),
                "residual": spectral_density(&comparison.residual),
            })
        };
        let comparisons = self.comparisons.iter().filter(|comparison| comparison.case == case);
        let columns: Vec<Value> = comparisons.map(&mut column).collect();
        json!({ "hz": frequencies_hz, "columns": columns })
    }

    /// Returns the curves of a case.
    pub(crate) fn curves(&self, case: usize) -> Table {
        let fit_case = &self.problem.cases[case];
        let measurement = &fit_case.measurement;
        let mut table = Table::new(crate::identity::BUILD);
        let times = &measurement.time_s;
        table.add_numbers("time_s", "s", "time since the start", times.iter().copied().map(Some));
        let shift_s = self.problem.shift_s(case, &self.x);
        let speeds = fit_case.spin().speeds_rpm(times.iter().map(|time| time + shift_s)).map(Some);
        table.add_numbers("speed_rpm", "rpm", "spin of the shaft, smoothed if measured", speeds);
        for comparison in self.comparisons.iter().filter(|comparison| comparison.case == case) {
            let SignalComparison { signal, offset, model, .. } = comparison;
            let signal = &measurement.signals[*signal];
            let name = signal.quantity.column();
            let (unit, _) = signal.quantity.units();
            let finite_value = |value: f64| (!value.is_nan()).then_some(value);
            let mut add_column =
                |prefix: &str, description: &str, values: &mut dyn Iterator<Item = Option<f64>>| {
                    table.add_numbers(&format!("{prefix}_{name}"), &unit, description, values);
                };
            let values = signal.values.iter().copied();
            add_column("measured", "as measured", &mut values.clone().map(finite_value));
            let with_offset = || model.iter().map(|model| model + offset);
            add_column("model", "the fitted model, with the offset", &mut with_offset().map(Some));
            let residual = values
                .zip(with_offset())
                .map(|(measurement, model)| finite_value(measurement - model));
            add_column("residual", "measured less model", &mut { residual });
        }
        let mut plan = fit_case.plan.clone();
        plan.model.machine = self.problem.machine(case, &self.x).0;
        // The starting values of the search are not the fitted values.
        let free: Vec<&str> = self.problem.free.iter().map(|free| free.parameter.name()).collect();
        plan.set.retain(|(name, _)| !free.contains(&name.as_str()));
        table.add_metadata(key::PLAN, &plan.to_json());
        let mut results = json!({ "report": self.report, "spectra": self.spectra(case) });
        if self.report.follows {
            results["profiles"] = self.profiles();
        }
        table.add_metadata(key::FIT, &results);
        table
    }
}
