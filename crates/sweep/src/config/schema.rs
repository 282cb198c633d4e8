//! JSON Schemas of machine files, and of `[set]` in grid files.

use serde_json::{Map, Value, json};
use sweep_engine::config::keys::table;
use sweep_engine::config::kind::number;
use sweep_engine::config::schema::{document, of, set as set_schema};
use washer_model::{Parameter, Range, Spin};

use super::machine::{AUTO, Key, LeftOut, PARTS, Part, Times, no_spin, with_one_of_each};

/// The schema of machine files.
pub(crate) fn machine() -> Value {
    let (mut properties, mut required) = (Vec::new(), Vec::new());
    for part in &PARTS {
        let (own, needed) = keys(part);
        if part.section.is_empty() {
            properties.extend(own);
            required.extend(needed);
            continue;
        }
        let mut schema = table(own, &needed);
        if let Times::Many(_, needed) = part.times {
            schema = json!({ "type": "array", "items": schema });
            if needed.is_some() {
                schema["minItems"] = 1.into();
            }
        }
        if matches!(part.times, Times::Once | Times::Many(_, Some(_))) {
            required.push(part.section);
        }
        properties.push((part.section, schema));
    }
    document("Machine file of sweep", table(properties, &required))
}

/// The keys of a section, and those that must be there.
fn keys(part: &Part) -> (Vec<(&'static str, Value)>, Vec<&'static str>) {
    let one = |key: &Key| {
        let first = &key.names(&part.prefix(0))[0];
        let mut schema = if key.is_vector() { vector(first) } else { parameter(first) };
        match key.left_out {
            LeftOut::Is(default) if !key.is_vector() => schema["default"] = default.into(),
            LeftOut::Auto => {
                schema = json!({ "anyOf": [schema, { "const": AUTO }], "default": AUTO })
            }
            _ => {}
        }
        (key.name, schema)
    };
    let needed = part.keys.iter().filter(|key| key.left_out == LeftOut::Refused);
    (part.keys.iter().map(one).collect(), needed.map(|key| key.name).collect())
}

/// A parameter's number, by name.
fn parameter(name: &str) -> Value {
    let spin = Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 };
    Parameter::find(name, &with_one_of_each(), &spin)
        .map_or(json!({ "type": "number" }), |parameter| of(&parameter))
}

/// Three numbers, of which `first` is a parameter's name.
fn vector(first: &str) -> Value {
    let range = Parameter::find(first, &with_one_of_each(), &no_spin())
        .map_or(Range::Any, |found| found.range());
    json!({ "type": "array", "items": number(range), "minItems": 3, "maxItems": 3 })
}

/// `[set]`: names of the table as properties; those of numbered elements as patterns.
pub(super) fn set() -> Value {
    let spin = Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 };
    let machine = with_one_of_each();
    let mut all = Parameter::all(&machine, &spin);
    let table = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    all.extend(Parameter::all(&machine, &table));
    let (mut single, mut patterns) = (Vec::new(), Map::new());
    for parameter in &all {
        let name = parameter.name();
        let lists = PARTS.iter().filter_map(|part| match part.times {
            Times::Many(first, _) => Some((part.prefix, first)),
            Times::Once | Times::AtMostOnce => None,
        });
        let mut lists = lists.chain([("spin_table_", 1)]);
        match lists.find_map(|(prefix, first)| Some((prefix, first, name.strip_prefix(prefix)?))) {
            Some((prefix, first, rest)) if rest.starts_with(|c: char| c.is_ascii_digit()) => {
                let suffix = rest.trim_start_matches(|c: char| c.is_ascii_digit());
                let number = if first == 1 { "[1-9][0-9]*" } else { "([2-9]|[1-9][0-9]+)" };
                patterns.insert(format!("^{prefix}{number}{suffix}$"), of(parameter));
            }
            _ => single.push(parameter.clone()),
        }
    }
    set_schema(&single, patterns)
}
