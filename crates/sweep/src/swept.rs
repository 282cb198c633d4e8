//! What computes the washing machine's rows, for the engine's commands.

use sweep_engine::{Engine, Error, Estimate, Swept};
use washer_model::{Machine, Parameter, Point, Profile, Spin, Target, stops_at_rest_n};
use washer_row::{Criterion, Demand, Metric};

use crate::config::grid::lacking;
use crate::engine::ModelEngine;
use crate::model::Washer;
use crate::plan::{Plan, ready, timing};

/// A stop that carries more than this share of the machine's weight at rest is told.
const RESTS_FROM: f64 = 0.01;

/// Returns the place of rest of the first point's machine in words: why it has none, or the stop on
/// which it rests most, if it rests on one.
fn rest(plan: &Plan) -> Option<(&'static str, String)> {
    let Washer { machine, spin, .. } = plan.scenario(0).model;
    match ready(machine, spin, &timing(plan)) {
        Ok(point) => resting_on(&point).map(|stop| ("stops", stop)),
        Err(why) => Some(("rest", format!("{why} (first point)"))),
    }
}

fn resting_on(point: &Point) -> Option<String> {
    let pushes_n = stops_at_rest_n(point).into_iter().map(f64::abs).zip(1..);
    let (push_n, stop) = pushes_n.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (push_n > RESTS_FROM * point.weight_n()).then(|| {
        let [push_n, weight_n] = [push_n, point.weight_n()].map(f64::round);
        format!(
            "stop {stop} carries {push_n} of {weight_n} N at rest: both models have it closed, and \
             `clearance_m` counts from where the springs carry nothing"
        )
    })
}

impl Swept for Washer {
    fn engine<'a>(plan: &'a Plan, only: Option<&str>) -> Result<Box<dyn Engine + 'a>, Error> {
        // It makes sure of a ratio's side, and knows nothing of the limits of other columns.
        let is_of = |kind| only.is_some_and(|only| only.starts_with(kind));
        let mut engine = ModelEngine::new(plan)?;
        engine.demand = if is_of("ratio_") {
            Demand::Side
        } else if is_of("growth_") || is_of("dwell_") {
            Demand::Growth
        } else {
            Demand::Row
        };
        Ok(Box::new(engine))
    }

    fn estimate(plan: &Plan, threads: usize) -> Result<Estimate, Error> {
        crate::estimate::of(plan, threads)
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
            let how = "from the first instant, with the suspension at rest: it begins by a jump";
            words.push(("spin", format!("{first} rpm {how}")));
        }
        words.extend(rest(plan));
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
        let with = |metric| {
            let mut plan = plan.clone();
            plan.model.measures.metrics = vec![metric];
            plan
        };
        metrics(plan).map(with).collect()
    }

    fn complete(plan: &Plan) -> Plan {
        let mut complete = plan.clone();
        complete.model.measures.metrics = metrics(plan).collect();
        complete
    }

    fn listed(plan: Option<&Plan>) -> Vec<Listed> {
        // The spin's parameters exist without a grid, but have no value.
        let (paper, spin) = (
            Machine::paper(),
            Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 },
        );
        let (machine, spin) =
            plan.map_or((&paper, &spin), |plan| (&plan.model.machine, &plan.model.spin));
        let row = |parameter: Parameter| {
            let of_grid = matches!(parameter.target(), Target::Spin | Target::Window(_));
            let value = match parameter.target() {
                Target::Window(edge) => plan.map(|plan| plan.window_s[edge]),
                _ => parameter.get(machine, spin).filter(|_| plan.is_some() || !of_grid),
            };
            // A parameter of several numbers: each may have been written elsewhere.
            let given = |plan: &Plan| plan.written.source(&parameter.parts(machine));
            let given = plan.filter(|_| !of_grid).and_then(given);
            let source = given.unwrap_or_else(|| parameter.source().to_owned());
            Listed { parameter, value, source }
        };
        Parameter::all(machine, spin).into_iter().map(row).collect()
    }
}

/// Iterates over the metrics that rows of a plan can have.
fn metrics(plan: &Plan) -> impl Iterator<Item = Metric> {
    let can_have = |metric: &Metric| match metric {
        metric if metric.is_at_held_speeds() => plan.model.held_speeds.is_some(),
        metric => lacking(*metric, &plan.model.machine).is_none(),
    };
    Metric::ALL.into_iter().filter(can_have)
}

/// A line of the listing.
pub(crate) type Listed = sweep_engine::Listed<Washer>;

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use sweep_engine::commands::parameters::as_json;
    use sweep_engine::plan::WrittenIn;

    #[test]
    fn json_holds_every_parameter() {
        let spin = Spin::Ramped { profile: Profile::Ramp, peak_rpm: 120.0, ramp_s: 2.0 };
        let json: Value = serde_json::from_str(&as_json(&Washer::listed(None))).unwrap();
        assert_eq!(
            json.as_array().map(Vec::len),
            Some(Parameter::all(&Machine::paper(), &spin).len())
        );
        assert_eq!(json[0]["name"], "gravity_m_per_s2");
    }

    #[test]
    fn what_a_user_wrote_is_not_ascribed_to_the_paper_whatever_its_value() {
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
        // It is left to the program.
        let speed = own("damper_2_friction_linear_speed_m_per_s");
        assert_eq!(speed, "assumed: that of the linear motion");
        assert_eq!(own("spin_peak_rpm"), "the grid file's [spin]");
        let built_in = sources("", &["tub_mass_kg=23.87"]);
        assert_eq!(built_in("tub_mass_kg"), "given: --set");
        assert_eq!(built_in("shaft_mass_kg"), "paper, Table 2");
    }
}
