//! The keys of the washing machine in grid files.

use std::path::Path;

use sweep_engine::config::{Draft, Form, Key, KeyWalk, Keys};
use washer_row::{Criterion, Measures, Metric};

use super::{WasherGridInput, grid, plausible, spin, validate};
use crate::model::Washer;

pub(crate) use super::machine::MACHINE_KEYS;
pub(crate) use super::schema::schema_of_set;

/// Walks over the keys at the top of a grid file and the machine's own tables.
pub(crate) fn walk_top(washer: &mut Washer, keys: &mut Keys<'_>, input: Option<&WasherGridInput>) {
    let Washer { machine, spin, measures, held_speeds } = washer;
    grid::walk_machine(machine, keys, input);
    let path = input.map_or(Path::new(""), |input| &input.path);
    spin::walk(spin, path, keys);
    let key = Key::new("metrics", "further columns of the result").settable();
    let metrics_field =
        keys.walk_words(key, "metric", &Metric::ALL, Metric::name, &mut measures.metrics);
    measures.stops = machine.stops.len();
    measures.feet = machine.feet.len();
    measures.dampers = machine.dampers.len();
    if let Some(root) = keys.section() {
        grid::check_metrics(&measures.metrics, machine, root);
    }
    grid::walk_stability(&measures.metrics, metrics_field, held_speeds, keys);
}

/// Walks over the criterion in `[reliability]`.
pub(crate) fn walk_reliability(measures: &mut Measures, keys: &mut Keys<'_>) {
    let reason = "it belongs at the top of the file, before the first [section]";
    keys.mark_misplaced(&["metrics"], reason);
    let description = "amplitudes by which the models are compared: largest deviations, the same \
                 turn by turn of the drum, or root mean squares";
    let criterion = &mut measures.criterion;
    // The description of a plan omits the default criterion, so that plans of files without the
    // key and of files that name the default have the same hash.
    if !matches!(keys.walk, KeyWalk::Describe(_))
        || keys.is_schema()
        || *criterion != Criterion::default()
    {
        let key = Key::new("criterion", description).settable();
        let mut criterion_name = criterion.name().to_owned();
        keys.walk_key(key, &Form::Word(&Criterion::ALL.map(Criterion::name)), &mut criterion_name);
        *criterion = Criterion::named(&criterion_name).unwrap_or_default();
    }
}

/// Checks a plan as a whole.
pub(crate) fn check(draft: &Draft<'_, Washer>) {
    validate::check_corners(draft);
    validate::check_stability(draft);
    plausible::note_unusual_numbers(draft);
}
