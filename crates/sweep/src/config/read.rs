//! The washing machine in grid files.

use serde_json::{Map, Value, json};
use sweep_engine::Schema;
use sweep_engine::config::report::Report;
use sweep_engine::config::scalars::Written;
use sweep_engine::config::section::Section;
use sweep_engine::config::{Draft, Origins, Read};
use washer_row::{Criterion, Measures};

use super::{GridInput, grid, machine_json, scalars, schema, spin, validate};
use crate::model::Washer;

impl Read for Washer {
    const OWN_FILE: Option<&'static str> = Some("machine");

    const TO_START: Option<&'static str> =
        Some("`sweep init FILE` writes a grid file to start from");

    fn read(
        input: &GridInput,
        root: &mut Section<'_>,
        origins: &mut Origins,
        report: &mut Report,
    ) -> Self {
        let machine = grid::machine(input, root, origins, report);
        let spin = spin::read(root, origins, report);
        let (stops, feet) = (machine.stops.len(), machine.feet.len());
        let measures = Measures { stops, feet, ..Measures::default() };
        Self { machine, spin, measures, growth_speeds: None }
    }

    fn read_before_reliability(
        &mut self,
        root: &mut Section<'_>,
        _: &mut Origins,
        report: &mut Report,
    ) {
        self.measures.metrics = grid::metrics(root, report);
    }

    fn read_reliability(
        &mut self,
        section: &mut Section<'_>,
        origins: &mut Origins,
        report: &mut Report,
    ) {
        self.measures.criterion = grid::criterion(section, origins, report);
    }

    fn read_after_reliability(
        &mut self,
        root: &mut Section<'_>,
        _: &mut Origins,
        report: &mut Report,
    ) {
        grid::judge_metrics(&self.measures.metrics, &self.machine, root, report);
        self.growth_speeds = grid::stability(root, &self.measures.metrics, report);
    }

    fn scalars() -> &'static [&'static str] {
        scalars::NAMES
    }

    fn put(written: &Written<'_>, draft: &mut Draft<Self>, report: &mut Report) -> Option<Value> {
        scalars::put(written, draft, report)
    }

    fn judge(draft: &Draft<Self>, report: &mut Report) {
        validate::scenarios(draft, report);
        validate::stability(draft, report);
    }

    fn describe(&self, plan: &mut Map<String, Value>) {
        plan.insert("machine".to_owned(), machine_json(&self.machine));
        plan.insert("spin".to_owned(), spin::to_json(&self.spin));
        // What is left out stands for the default, so that plans which do not ask for more read as
        // ever. The machine says how many stops and feet it has.
        let Measures { criterion, metrics, stops: _, feet: _ } = &self.measures;
        if *criterion != Criterion::default() {
            plan["reliability"]["criterion"] = criterion.name().into();
        }
        if !metrics.is_empty() {
            let metrics = metrics.iter().map(|metric| metric.name()).collect();
            plan.insert("metrics".to_owned(), metrics);
        }
        if let Some(speeds) = &self.growth_speeds {
            plan.insert("stability".to_owned(), json!({ "speed_rpm": speeds.to_string() }));
        }
    }

    fn schema() -> Schema {
        schema::grid()
    }
}
