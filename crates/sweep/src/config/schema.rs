//! JSON Schema of `[set]` in grid files.

use crate::model::engine_parameter;
use serde_json::{Map, Value};
use sweep_engine::config::schema::{parameter_schema, set_schema};
use washer_model::{ElementList, MachineParameter, Profile, Spin};

use super::machine::machine_with_every_element;

/// Returns the schema of `[set]`. Parameters are properties; those of numbered elements are
/// patterns.
pub(crate) fn schema_of_set() -> Value {
    let spin = Spin::Ramped { profile: Profile::Triangular, peak_rpm: 0.0, ramp_s: 0.0 };
    let machine = machine_with_every_element();
    let table_spin = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    let parameters_by_spin = [spin, table_spin].map(|spin| {
        let parameters = MachineParameter::all(&machine, &spin).into_iter();
        parameters.map(|parameter| engine_parameter(parameter, &machine, &spin)).collect::<Vec<_>>()
    });
    let mut single_parameters = Vec::new();
    let mut schemas_by_pattern = Map::new();
    for parameter in parameters_by_spin.iter().flatten() {
        let name = &parameter.name;
        let element_lists = ElementList::all().map(|list| (list.element_name, list.first_number));
        let mut numbered_names = element_lists.chain([("spin_table", 1)]);
        let suffix_after_element = |element| name.strip_prefix(element)?.strip_prefix('_');
        match numbered_names
            .find_map(|(element, first)| Some((element, first, suffix_after_element(element)?)))
        {
            Some((element, first, rest)) if rest.starts_with(|c: char| c.is_ascii_digit()) => {
                let suffix = rest.trim_start_matches(|c: char| c.is_ascii_digit());
                let number_pattern = if first == 1 { "[1-9][0-9]*" } else { "([2-9]|[1-9][0-9]+)" };
                schemas_by_pattern.insert(
                    format!("^{element}_{number_pattern}{suffix}$"),
                    parameter_schema(parameter),
                );
            }
            _ => single_parameters.push(parameter.clone()),
        }
    }
    set_schema(&single_parameters, schemas_by_pattern)
}
