//! What computes the washing machine's rows, for the engine's commands.

use sweep_engine::boundary::quantity::{Scale, TracedQuantity, ratio};
use sweep_engine::boundary::search::Distances;
use sweep_engine::estimate::Estimate;
use sweep_engine::{Engine, Error, Swept, Watch};
use washer_model::{Channel, Machine, Parameter, Spin, Target};
use washer_row::{Criterion, Demand, Outcome, Verdict};

use crate::engine::ModelEngine;
use crate::model::Washer;
use crate::plan::Plan;

/// Gaps are compared with this, so that their distances are of order one, as those of ratios.
const GAP_SCALE_M: f64 = 0.010;

impl Swept for Washer {
    fn engine(plan: &Plan) -> Result<Box<dyn Engine + '_>, Error> {
        Ok(Box::new(ModelEngine::new(plan).map_err(Error::model)?))
    }

    fn estimate(plan: &Plan, threads: usize) -> Result<Estimate, Error> {
        crate::estimate::of(plan, threads).map_err(Error::model)
    }

    fn words(plan: &Plan) -> Vec<(&'static str, String)> {
        let metrics: Vec<_> = plan.model.measures.metrics.iter().map(|one| one.name()).collect();
        if metrics.is_empty() { Vec::new() } else { vec![("metrics", metrics.join(", "))] }
    }

    fn criterion(&self) -> &'static str {
        match self.measures.criterion {
            Criterion::Peak => "",
            Criterion::Envelope => ", turn by turn of the drum",
            Criterion::Rms => ", of root mean squares",
        }
    }

    fn quantities() -> Vec<String> {
        let ratios = Channel::ALL.map(|channel| format!("ratio_{}", channel.name()));
        let further = ["min_gap_nonlinear_m", "min_gap_linear_m", "growth"].map(str::to_owned);
        std::iter::once("ratio_max".to_owned()).chain(ratios).chain(further).collect()
    }

    fn traced(plan: &Plan, name: &str) -> Result<(TracedQuantity, Plan), Error> {
        let (unit, per) = match name {
            "growth" if plan.model.growth_speeds.is_none() => {
                return Err(Error::Option {
                    option: "--quantity",
                    given: name.to_owned(),
                    expected:
                        "a grid file with constant speeds, which this one does not name: put \
                               metrics = [\"growth\"] at its top, and a section [stability] with \
                               speed_rpm = \"FROM:TO:STEP\""
                            .to_owned(),
                });
            }
            "growth" => ("1/s", 1.0),
            "min_gap_nonlinear_m" | "min_gap_linear_m" => ("m", -GAP_SCALE_M),
            _ => return Ok(ratio(plan, name)),
        };
        let (name, scale) = (name.to_owned(), Scale::Over(per));
        Ok((TracedQuantity { name, unit, limit: 0.0, scale }, plan.clone()))
    }

    fn search<'a>(
        plan: &'a Plan,
        quantity: &TracedQuantity,
    ) -> Result<Box<dyn Distances + 'a>, Error> {
        let engine = ModelEngine::new(plan).map_err(Error::model)?;
        Ok(Box::new(Searched { engine, plan, quantity: quantity.clone() }))
    }

    fn listed(plan: Option<&Plan>) -> Vec<Listed> {
        listed(plan)
    }
}

/// A line of the listing.
pub(crate) type Listed = sweep_engine::Listed<Washer>;

/// Every parameter with its value.
fn listed(plan: Option<&Plan>) -> Vec<Listed> {
    match plan {
        Some(plan) => rows(&plan.model.machine, &plan.model.spin, Some(plan.window_s)),
        // The spin's parameters exist without a grid, but have no value.
        None => rows(&Machine::paper(), &Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 }, None),
    }
}

/// Every parameter with its value; those of spin and window have one only if a grid gives its
/// window.
fn rows(machine: &Machine, spin: &Spin, window_s: Option<[f64; 2]>) -> Vec<Listed> {
    let built_in = Machine::paper();
    let row = |parameter: Parameter| {
        let of_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
        let value = match parameter.target() {
            Target::Window(edge) => window_s.map(|window_s| window_s[edge]),
            _ => parameter.get(machine, spin).filter(|_| window_s.is_some() || !of_grid),
        };
        let as_built_in = parameter.get(&built_in, spin) == value;
        let source = if of_grid || as_built_in {
            parameter.source().to_string()
        } else {
            "given".to_owned()
        };
        Listed { parameter, value, source }
    };
    Parameter::all(machine, spin).into_iter().map(row).collect()
}

/// Distances of a quantity from its limit, by the engine.
struct Searched<'a> {
    engine: ModelEngine<'a>,
    plan: &'a Plan,
    quantity: TracedQuantity,
}

impl Searched<'_> {
    /// What the engine is asked for: it makes sure of a ratio's side, and knows nothing of a gap's.
    fn demand(&self) -> Demand {
        match self.quantity.name.as_str() {
            "growth" => Demand::Growth,
            "min_gap_nonlinear_m" | "min_gap_linear_m" => Demand::Row,
            _ => Demand::Side,
        }
    }

    fn distance(&self, outcome: &Outcome) -> Option<f64> {
        let value = match self.quantity.name.as_str() {
            "growth" => outcome.growth.as_ref()?.fastest.growth_per_s(),
            "min_gap_nonlinear_m" => outcome.nonlinear.min_gap_m?,
            "min_gap_linear_m" => outcome.linear.min_gap_m?,
            _ => {
                let rule = &self.plan.reliability;
                let verdict = Verdict::new(outcome, rule.channels.len(), rule.ratio_limit);
                verdict.greatest?.1
            }
        };
        Some(self.quantity.distance(value))
    }
}

impl Distances for Searched<'_> {
    fn distances(
        &self,
        axis_values: &[Vec<f64>],
        seen: &(dyn Fn(usize, Option<f64>) + Sync),
        watch: &Watch<'_>,
    ) -> Option<Vec<Option<f64>>> {
        let shown = |outcome: &Outcome| seen(outcome.point as usize, self.distance(outcome));
        let found = self.engine.evaluate_for(axis_values, self.demand(), &shown, watch)?;
        Some(found.iter().map(|outcome| self.distance(outcome)).collect())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use sweep_engine::commands::parameters::as_json;

    #[test]
    fn json_holds_every_parameter() {
        let spin = Spin::Ramp { peak_rpm: 120.0, ramp_s: 2.0 };
        let rows = rows(&Machine::paper(), &spin, Some([0.0, 1.0]));
        let json: Value = serde_json::from_str(&as_json(&rows)).unwrap();
        assert_eq!(
            json.as_array().map(Vec::len),
            Some(Parameter::all(&Machine::paper(), &spin).len())
        );
        assert_eq!(json[0]["name"], "gravity_m_per_s2");
    }

    #[test]
    fn a_value_of_the_users_own_is_not_ascribed_to_the_paper() {
        let mut machine = Machine::paper();
        machine.tub.mass_kg = 20.0;
        let rows = rows(&machine, &Spin::Ramp { peak_rpm: 120.0, ramp_s: 2.0 }, None);
        let row = |name: &str| rows.iter().find(|row| row.parameter.name() == name).unwrap();
        assert_eq!(row("tub_mass_kg").source, "given");
        assert_eq!(row("shaft_mass_kg").source, "paper, Table 2");
        assert_eq!(row("spin_peak_rpm").value, None);
    }
}
