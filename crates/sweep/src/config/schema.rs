//! JSON Schemas of machine files, and of the machine's part of grid files.

use serde_json::{Map, Value, json};
use sweep_engine::Schema;
use sweep_engine::config::schema::{document, number, of, set as set_schema, table};
use washer_model::{Parameter, Range, Spin};
use washer_row::{Criterion, Metric};

use super::grid::DEFAULT_MACHINE;
use super::machine::{BLOCKS, Block, CABINET, LISTS, no_spin, with_one_of_each};
use super::spin::{MOST_ROWS, RAMPED, Ramped, TABLE};

/// What grid files have beside what the engine reads.
#[must_use]
pub(crate) fn grid() -> Schema {
    let machine = json!({
        "type": "string",
        "default": DEFAULT_MACHINE,
        "description": "\"paper\", or a machine file relative to this file",
    });
    let criterion = json!({
        "enum": Criterion::ALL.map(Criterion::name),
        "default": Criterion::default().name(),
        "description": "what the models are compared by: largest deviations, the same turn by \
                        turn of the drum, or root mean squares",
    });
    Schema {
        top: vec![
            ("machine", machine),
            ("metrics", metrics()),
            ("spin", spin()),
            ("stability", stability()),
        ],
        required: vec!["spin"],
        reliability: vec![("criterion", criterion)],
        set: set(),
    }
}

/// The schema of machine files.
#[must_use]
pub(crate) fn machine() -> Value {
    let mut properties: Vec<(&str, Value)> = Vec::new();
    let mut required = Vec::new();
    for block in &BLOCKS {
        if block.section.is_empty() {
            properties.extend(block_properties(block, block.prefix));
            required.extend(block.numbers);
        } else {
            properties.push((block.section, block_schema(block, block.prefix, &[])));
            required.push(block.section);
        }
    }
    properties.push((CABINET.section, block_schema(&CABINET, CABINET.prefix, &[])));
    for list in &LISTS {
        let prefix = format!("{}{}_", list.block.prefix, list.first);
        let numbers = list.optional.iter().map(|&(key, default)| {
            let mut schema = parameter(&format!("{prefix}{key}"));
            if let Some(default) = default {
                schema["default"] = default.into();
            }
            (key, schema)
        });
        let vectors = list
            .optional_vectors
            .iter()
            .map(|(key, components)| (*key, vector(&format!("{prefix}{}", components[0]))));
        let optional: Vec<_> = numbers.chain(vectors).collect();
        let items = block_schema(&list.block, &prefix, &optional);
        let mut schema = json!({ "type": "array", "items": items });
        if list.needed.is_some() {
            schema["minItems"] = 1.into();
            required.push(list.block.section);
        }
        properties.push((list.block.section, schema));
    }
    document("Machine file of sweep", table(properties, &required))
}

/// A parameter's number, by name.
fn parameter(name: &str) -> Value {
    let spin = Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 };
    Parameter::find(name, &with_one_of_each(), &spin)
        .map_or(json!({ "type": "number" }), |parameter| of(&parameter))
}

fn block_properties(block: &Block, prefix: &str) -> Vec<(&'static str, Value)> {
    let numbers = block.numbers.iter().map(|&key| (key, parameter(&format!("{prefix}{key}"))));
    let vectors = block
        .vectors
        .iter()
        .map(|(key, components)| (*key, vector(&format!("{prefix}{}", components[0]))));
    numbers.chain(vectors).collect()
}

/// Three numbers, of which `first` is a parameter's name.
fn vector(first: &str) -> Value {
    let range = Parameter::find(first, &with_one_of_each(), &no_spin())
        .map_or(Range::Any, |found| found.range());
    json!({ "type": "array", "items": number(range), "minItems": 3, "maxItems": 3 })
}

fn block_schema(block: &Block, prefix: &str, optional: &[(&'static str, Value)]) -> Value {
    let properties = block_properties(block, prefix);
    let required: Vec<&str> = properties.iter().map(|(key, _)| *key).collect();
    table(properties.into_iter().chain(optional.iter().cloned()), &required)
}

/// Names of the table as properties; those of numbered elements as patterns.
fn set() -> Value {
    let spin = Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 };
    let machine = with_one_of_each();
    let mut all = Parameter::all(&machine, &spin);
    let table = Spin::Table { time_s: vec![0.0], speed_rpm: vec![0.0] };
    all.extend(Parameter::all(&machine, &table));
    let (mut single, mut patterns) = (Vec::new(), Map::new());
    for parameter in &all {
        let name = parameter.name();
        let lists = LISTS.iter().map(|list| (list.block.prefix, list.first));
        match lists
            .chain([("spin_table_", 1)])
            .find_map(|(prefix, first)| Some((prefix, first, name.strip_prefix(prefix)?)))
        {
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

fn spin() -> Value {
    let ramped = |profile: &Ramped| {
        let profile = json!({ "const": profile.name, "description": profile.description });
        let keys = [
            ("profile", profile),
            ("peak_rpm", parameter("spin_peak_rpm")),
            ("ramp_s", parameter("spin_ramp_s")),
        ];
        table(keys, &["profile", "peak_rpm", "ramp_s"])
    };
    let column = |range: Range, description: &str| {
        let (items, most) = (number(range), MOST_ROWS);
        json!({
            "type": "array",
            "items": items,
            "minItems": 1,
            "maxItems": most,
            "description": description,
        })
    };
    let tabled = table(
        [
            (
                "profile",
                json!({ "const": TABLE, "description": "linear between given points, constant \
                                                        after the last" }),
            ),
            ("time_s", column(Range::NonNegative, "increasing times from 0, s")),
            ("speed_rpm", column(Range::Within(-1e5, 1e5), "speeds at these times, rpm")),
        ],
        &["profile", "time_s", "speed_rpm"],
    );
    json!({ "oneOf": RAMPED.iter().map(ramped).chain([tabled]).collect::<Value>() })
}

fn metrics() -> Value {
    json!({
        "type": "array",
        "items": { "enum": Metric::ALL.map(Metric::name) },
        "minItems": 1,
        "uniqueItems": true,
        "description": "further columns of the result",
    })
}

fn stability() -> Value {
    let speeds = json!({
        "type": "string",
        "description": "constant spin speeds FROM:TO:STEP in rpm, above 0, as in \"60:400:1\": \
                        what `growth` among the metrics is about",
    });
    table([("speed_rpm", speeds)], &["speed_rpm"])
}
