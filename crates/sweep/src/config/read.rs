//! The washing machine in grid files.

use serde_json::{Map, Value, json};
use sweep_engine::Schema;
use sweep_engine::config::section::Section;
use sweep_engine::config::words::names;
use sweep_engine::config::written::Written;
use sweep_engine::config::{Draft, Read};
use washer_row::{Criterion, Measures, Metric};

use super::{GridInput, grid, machine_json, scalars, schema, spin, validate};
use crate::model::Washer;

impl Read for Washer {
    const OWN_FILE: Option<&'static str> = Some("machine");

    const TO_START: Option<&'static str> =
        Some("`sweep init FILE` writes a grid file to start from");

    fn read(input: &GridInput, root: &Section<'_>) -> Self {
        let machine = grid::machine(input, root);
        let spin = spin::read(root);
        let metrics = names(root, "metrics", "metric", &Metric::ALL, Metric::name);
        let metrics = metrics.unwrap_or_default();
        grid::judge_metrics(&metrics, &machine, root);
        let held_speeds = grid::stability(root, &metrics);
        let (stops, feet) = (machine.stops.len(), machine.feet.len());
        let dampers = machine.dampers.len();
        let measures = Measures { metrics, stops, feet, dampers, ..Measures::default() };
        Self { machine, spin, measures, held_speeds }
    }

    fn read_reliability(&mut self, section: &Section<'_>) {
        self.measures.criterion = grid::criterion(section);
    }

    fn scalars() -> &'static [&'static str] {
        scalars::NAMES
    }

    fn put(written: &Written<'_>, draft: &mut Draft<'_, Self>) -> Option<Value> {
        scalars::put(written, draft)
    }

    fn judge(draft: &Draft<'_, Self>) {
        validate::scenarios(draft);
        validate::stability(draft);
    }

    fn describe(&self, plan: &mut Map<String, Value>) {
        plan.insert("machine".to_owned(), machine_json(&self.machine));
        plan.insert("spin".to_owned(), spin::to_json(&self.spin));
        // What is left out stands for the default, so that plans which do not ask for more read as
        // ever. The machine says how many stops, feet and dampers it has.
        let Measures { criterion, metrics, stops: _, feet: _, dampers: _ } = &self.measures;
        if *criterion != Criterion::default() {
            plan["reliability"]["criterion"] = criterion.name().into();
        }
        if !metrics.is_empty() {
            let metrics = metrics.iter().map(|metric| metric.name()).collect();
            plan.insert("metrics".to_owned(), metrics);
        }
        if let Some(speeds) = &self.held_speeds {
            plan.insert("stability".to_owned(), json!({ "speed_rpm": speeds.to_string() }));
        }
    }

    fn schema() -> Schema {
        schema::grid()
    }
}
