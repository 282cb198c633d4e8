//! The washing machine as a model of the engine's commands.

use sweep_engine::{Engine, Error, Estimate, Swept};
use washer_model::{Machine, Parameter, Point, Profile, Spin, Target, stops_at_rest_n};
use washer_row::{Criterion, Demand, Metric};

use crate::config::grid::missing_part;
use crate::engine::ModelEngine;
use crate::model::Washer;
use crate::plan::{Plan, prepare_point, timing};

/// Minimum force of a stop at rest, as a share of the machine's weight, at which a note reports it.
/// Basis: softened stops that are open have a small force. Doubling it may hide a stop that is
/// barely closed.
const RESTING_SHARE: f64 = 0.01;

/// Returns a note on the equilibrium of the first point's machine: the reason why it has none, or
/// the stop with the greatest load, if it rests on one.
fn rest_note(plan: &Plan) -> Option<(&'static str, String)> {
    let Washer { machine, spin, .. } = plan.scenario(0).model;
    match prepare_point(machine, spin, &timing(plan)) {
        Ok(point) => most_loaded_stop(&point).map(|stop| ("stops", stop)),
        Err(why) => Some(("rest", format!("{why} (first point)"))),
    }
}

/// Returns a text on the stop with the greatest force at rest, if the machine rests on it.
fn most_loaded_stop(point: &Point) -> Option<String> {
    let forces_n = stops_at_rest_n(point).into_iter().map(f64::abs).zip(1..);
    let (force_n, stop) = forces_n.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (force_n > RESTING_SHARE * point.weight_n()).then(|| {
        let [force_n, weight_n] = [force_n, point.weight_n()].map(f64::round);
        format!(
            "stop {stop} carries {force_n} of {weight_n} N at rest: it is closed in both models, \
             and `clearance_m` is measured from the position before loading"
        )
    })
}

impl Swept for Washer {
    fn engine<'a>(plan: &'a Plan, only: Option<&str>) -> Result<Box<dyn Engine + 'a>, Error> {
        // A search for a ratio's limit needs only the side of the limit. The limits of other
        // columns are not known to the engine, so these need complete rows.
        let has_prefix = |prefix| only.is_some_and(|only| only.starts_with(prefix));
        let mut engine = ModelEngine::new(plan)?;
        engine.demand = if has_prefix("ratio_") {
            Demand::Side
        } else if has_prefix("growth_") || has_prefix("dwell_") {
            Demand::Growth
        } else {
            Demand::Row
        };
        Ok(Box::new(engine))
    }

    fn estimate(plan: &Plan, threads: usize) -> Result<Estimate, Error> {
        crate::estimate::estimate(plan, threads)
    }

    fn words(plan: &Plan) -> Vec<(&'static str, String)> {
        let metrics: Vec<_> = plan.model.measures.metrics.iter().map(|one| one.name()).collect();
        let mut words = Vec::new();
        if !metrics.is_empty() {
            words.push(("metrics", metrics.join(", ")));
        }
        if let Spin::Table { speed_rpm, .. } = &plan.model.spin
            && let Some(first) = speed_rpm.first().filter(|first| **first != 0.0)
        {
            let note = "from the first instant, with the suspension at rest: the speed jumps";
            words.push(("spin", format!("{first} rpm {note}")));
        }
        words.extend(rest_note(plan));
        words
    }

    fn criterion(&self) -> &'static str {
        match self.measures.criterion {
            Criterion::Peak => "",
            Criterion::Envelope => ", turn by turn of the drum",
            Criterion::Rms => ", of root mean squares",
        }
    }

    fn needed(column: &str) -> Option<&'static str> {
        Some(match column.split('_').next()? {
            "growth" | "dwell" => "[stability] in the grid file, with the speeds of dwells",
            "foot" | "slip" | "walk" => "a machine with [cabinet] and [[feet]]",
            "stop" => "a machine with [[stops]]",
            _ => return None,
        })
    }

    const FURTHER: &'static str = "; a machine with [cabinet] and feet, with stops, and a grid \
                                   file with [stability] have more";

    fn variants(plan: &Plan) -> Vec<Plan> {
        let with_metric = |metric| {
            let mut plan = plan.clone();
            plan.model.measures.metrics = vec![metric];
            plan
        };
        metrics(plan).map(with_metric).collect()
    }

    fn complete(plan: &Plan) -> Plan {
        let mut complete = plan.clone();
        complete.model.measures.metrics = metrics(plan).collect();
        complete
    }

    fn listed(plan: Option<&Plan>) -> Vec<ListedParameter> {
        let paper = Machine::paper();
        // Without a grid the spin's parameters are listed without a value.
        let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 };
        let (machine, spin) =
            plan.map_or((&paper, &spin), |plan| (&plan.model.machine, &plan.model.spin));
        let row = |parameter: Parameter| {
            let is_in_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
            let value = match parameter.target() {
                Target::Window(edge) => plan.map(|plan| plan.window_s[edge]),
                _ => parameter.get(machine, spin).filter(|_| plan.is_some() || !is_in_grid),
            };
            // A parameter of several elements has the sources of all of them.
            let given = |plan: &Plan| plan.written.source(&parameter.parts(machine));
            let given = plan.filter(|_| !is_in_grid).and_then(given);
            let source = given.unwrap_or_else(|| parameter.source().to_owned());
            ListedParameter { parameter, value, source }
        };
        Parameter::all(machine, spin).into_iter().map(row).collect()
    }
}

/// Iterates over the metrics that rows of a plan can have.
fn metrics(plan: &Plan) -> impl Iterator<Item = Metric> {
    let can_have = |metric: &Metric| match metric {
        metric if metric.is_at_held_speeds() => plan.model.held_speeds.is_some(),
        metric => missing_part(*metric, &plan.model.machine).is_none(),
    };
    Metric::ALL.into_iter().filter(can_have)
}

/// A line of the listing.
pub(crate) type ListedParameter = sweep_engine::Listed<Washer>;

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use sweep_engine::commands::parameters::as_json;
    use sweep_engine::plan::WrittenIn;

    #[test]
    fn json_has_every_parameter() {
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 120.0, ramp_s: 2.0 };
        let json: Value = serde_json::from_str(&as_json(&Washer::listed(None))).unwrap();
        assert_eq!(
            json.as_array().map(Vec::len),
            Some(Parameter::all(&Machine::paper(), &spin).len())
        );
        assert_eq!(json[0]["name"], "gravity_m_per_s2");
    }

    #[test]
    fn a_number_that_a_user_wrote_has_the_user_as_its_source() {
        let folder = tempfile::tempdir().unwrap();
        let machine = crate::config::machine_file(&Machine::paper(), &WrittenIn::default())
            + "friction_n = 40\nfriction_linear_speed_m_per_s = \"auto\"\n";
        std::fs::write(folder.path().join("own.toml"), machine).unwrap();
        let grid = folder.path().join("grid.toml");
        let text = "spin = { profile = \"ramp\", peak_rpm = 120, ramp_s = 2 }\ntime.end_s = 2\n";
        let sources = |named: &str, sets: &[&str]| {
            std::fs::write(&grid, format!("{named}{text}")).unwrap();
            let sets: Vec<String> = sets.iter().copied().map(str::to_owned).collect();
            let plan = crate::config::load(&grid, &sets).unwrap();
            move |name: &str| {
                let rows = Washer::listed(Some(&plan));
                rows.iter().find(|row| row.parameter.name() == name).unwrap().source.clone()
            }
        };
        let own = sources("machine = \"own.toml\"\n", &["damper_1_damping_n_s_per_m=140"]);
        let file = folder.path().join("own.toml").display().to_string();
        assert_eq!(own("tub_mass_kg"), format!("given: {file}"));
        assert_eq!(own("damper_1_damping_n_s_per_m"), "given: --set");
        assert_eq!(own("damping_n_s_per_m"), format!("given: --set, {file}"));
        assert_eq!(own("spring_1_cubic_n_per_m3"), "assumed: none unless given");
        assert_eq!(own("damper_2_friction_n"), format!("given: {file}"));
        // The word "auto" in the file leaves this number to the program.
        let speed = own("damper_2_friction_linear_speed_m_per_s");
        assert_eq!(speed, "assumed: that of the linear motion");
        assert_eq!(own("spin_peak_rpm"), "the grid file's [spin]");
        let built_in = sources("", &["tub_mass_kg=23.87"]);
        assert_eq!(built_in("tub_mass_kg"), "given: --set");
        assert_eq!(built_in("shaft_mass_kg"), "paper, Table 2");
    }
}
