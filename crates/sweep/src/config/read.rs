//! The washing machine in grid files.

use std::path::Path;

use serde_json::Value;
use sweep_engine::config::{Draft, Form, Key, KeyWalk, Keys, Read};
use washer_model::Machine;
use washer_row::{Criterion, Measures, Metric};

use super::{WasherGridInput, grid, machine, plausible, schema, spin, validate};
use crate::model::Washer;

impl Read for Washer {
    const OWN_FILE: Option<&'static str> = Some("machine");

    const TO_START: Option<&'static str> =
        Some("`sweep init FILE` writes a grid file to start from");

    fn is_own_key(key: &str) -> bool {
        machine::is_key(key)
    }

    fn blank() -> Self {
        Self {
            machine: Machine::paper(),
            spin: spin::BLANK,
            measures: Measures::default(),
            held_speeds: None,
        }
    }

    fn walk(&mut self, keys: &mut Keys<'_>, input: Option<&WasherGridInput>) {
        let Self { machine, spin, measures, held_speeds } = self;
        grid::walk_machine(machine, keys, input);
        let path = input.map_or(Path::new(""), |input| &input.path);
        spin::walk(spin, path, keys);
        let key = Key::new("metrics", "further columns of the result").set();
        let found = keys.words(key, "metric", &Metric::ALL, Metric::name, &mut measures.metrics);
        measures.stops = machine.stops.len();
        measures.feet = machine.feet.len();
        measures.dampers = machine.dampers.len();
        if let Some(root) = keys.section() {
            grid::check_metrics(&measures.metrics, machine, root);
        }
        grid::walk_stability(&measures.metrics, found, held_speeds, keys);
    }

    fn walk_reliability(&mut self, keys: &mut Keys<'_>) {
        let misplaced = "it belongs at the top of the file, before the first [section]";
        keys.misplace(&["metrics"], misplaced);
        let about = "amplitudes by which the models are compared: largest deviations, the same \
                     turn by turn of the drum, or root mean squares";
        let criterion = &mut self.measures.criterion;
        // A plan with the default criterion omits it, so that its hash stays the same.
        if !matches!(keys.walk, KeyWalk::Describe(_))
            || keys.is_schema()
            || *criterion != Criterion::default()
        {
            let key = Key::new("criterion", about).set();
            let mut word = criterion.name().to_owned();
            keys.key(key, &Form::Word(&Criterion::ALL.map(Criterion::name)), &mut word);
            *criterion = Criterion::named(&word).unwrap_or_default();
        }
    }

    fn check(draft: &Draft<'_, Self>) {
        validate::check_scenarios(draft);
        validate::check_stability(draft);
        plausible::note_unusual_numbers(draft);
    }

    fn schema_of_set() -> Value {
        schema::schema_of_set()
    }
}
