//! The curves of a fit for figures: the measurement, the model and the residual.

use serde_json::{Value, json};
use sweep_engine::Table;
use sweep_files::key;

use super::algebra::pseudo_inverse;
use super::measurement::usual_step;
use super::model::SignalComparison;
use super::spectrum::compute_spectrum;
use super::{FinishedFit, Problem};

/// The greatest distance of a cost profile's points from the fitted value, in half standard errors.
/// Basis: three standard errors include every interval of 95 %. Doubling it doubles the
/// evaluations.
const PROFILE_HALF_STEPS: i32 = 6;

impl FinishedFit<'_> {
    /// Computes the cost profile of each free number: the rise of the cost at values about the
    /// fitted one, with the other numbers fitted again to first order.
    fn profiles_json(&self) -> Value {
        let Problem { free_parameters: free, .. } = &self.problem;
        let equations = self.problem.normal_equations(&self.comparisons);
        let inverse_normal_matrix = pseudo_inverse(&equations.normal_matrix);
        let standard_deviations: Vec<f64> =
            (-PROFILE_HALF_STEPS..=PROFILE_HALF_STEPS).map(|k| 0.5 * f64::from(k)).collect();
        let values_at_deviation = |k: usize, deviation: f64| -> Vec<f64> {
            let step = deviation / inverse_normal_matrix[k][k].max(f64::MIN_POSITIVE).sqrt();
            (0..self.x.len())
                .map(|j| {
                    let [from, to] = self.problem.unknown_range(j);
                    (self.x[j] + step * inverse_normal_matrix[k][j]).clamp(from, to)
                })
                .collect()
        };
        let sampled_unknowns: Vec<Vec<f64>> = (0..free.len())
            .flat_map(|k| standard_deviations.iter().map(move |deviation| (k, *deviation)))
            .map(|(k, deviation)| values_at_deviation(k, deviation))
            .collect();
        let costs = self.problem.compute_costs(&sampled_unknowns);
        let profile_json = |k: usize| {
            let sample_indices = k * standard_deviations.len()..(k + 1) * standard_deviations.len();
            let cost_increases: Vec<f64> =
                costs[sample_indices.clone()].iter().map(|cost| cost - equations.cost).collect();
            json!({
                "name": free[k].parameter.name(),
                "values": sampled_unknowns[sample_indices]
                    .iter()
                    .map(|values| values[k])
                    .collect::<Vec<_>>(),
                "deviations": standard_deviations,
                "cost_above": cost_increases,
            })
        };
        (0..free.len()).map(profile_json).collect()
    }

    /// Computes the spectra of a case's measurement and of its residual; missing samples count as
    /// zero.
    fn spectra_json(&self, case: usize) -> Value {
        let measurement = &self.problem.cases[case].measurement;
        let step_s = usual_step(&measurement.time_s).unwrap_or(1.0);
        let mut frequencies_hz = Vec::new();
        let mut column_json = |comparison: &SignalComparison| {
            let signal = &measurement.signals[comparison.signal_index];
            let mut spectral_density = |values: &[f64]| {
                let mut values_with_zeros = vec![0.0; measurement.time_s.len()];
                signal
                    .samples()
                    .zip(values)
                    .for_each(|((row, _), value)| values_with_zeros[row] = *value);
                let density;
                (frequencies_hz, density) = compute_spectrum(&values_with_zeros, step_s);
                density
            };
            json!({
                "name": signal.quantity.column(),
                "unit": signal.quantity.units().0,
                "measured": spectral_density(&signal.centred_values()),
                "residual": spectral_density(&comparison.residual),
            })
        };
        let comparisons =
            self.comparisons.iter().filter(|comparison| comparison.case_index == case);
        let columns: Vec<Value> = comparisons.map(&mut column_json).collect();
        json!({ "hz": frequencies_hz, "columns": columns })
    }

    /// Returns the curves of a case.
    pub(crate) fn curve_table(&self, case: usize) -> Table {
        let fit_case = &self.problem.cases[case];
        let measurement = &fit_case.measurement;
        let mut table = Table::new(crate::identity::BUILD);
        let times = &measurement.time_s;
        table.add_numbers("time_s", "s", "time since the start", times.iter().copied().map(Some));
        let shift_s = self.problem.shift_s(case, &self.x);
        let speeds = fit_case.spin().speeds_rpm(times.iter().map(|time| time + shift_s)).map(Some);
        table.add_numbers("speed_rpm", "rpm", "spin of the shaft, smoothed if measured", speeds);
        for comparison in self.comparisons.iter().filter(|comparison| comparison.case_index == case)
        {
            let SignalComparison { signal_index: signal, offset, model_values: model, .. } =
                comparison;
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
            let model_with_offset = || model.iter().map(|model| model + offset);
            add_column(
                "model",
                "the fitted model, with the offset",
                &mut model_with_offset().map(Some),
            );
            let residual = values
                .zip(model_with_offset())
                .map(|(measurement, model)| finite_value(measurement - model));
            add_column("residual", "measured less model", &mut { residual });
        }
        let mut plan = fit_case.plan.clone();
        plan.model.machine = self.problem.machine(case, &self.x).0;
        // The plan does not store the starting values of the search as constants, because the
        // fitted values differ from them.
        let free_names: Vec<&str> =
            self.problem.free_parameters.iter().map(|free| free.parameter.name()).collect();
        plan.set.retain(|(name, _)| !free_names.contains(&name.as_str()));
        table.add_metadata(key::PLAN, &plan.to_json());
        let mut fit_metadata = json!({ "report": self.report, "spectra": self.spectra_json(case) });
        if self.report.follows {
            fit_metadata["profiles"] = self.profiles_json();
        }
        table.add_metadata(key::FIT, &fit_metadata);
        table
    }
}
