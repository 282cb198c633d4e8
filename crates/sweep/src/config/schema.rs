//! JSON Schemas of machine files, and of the machine's part of grid files.

use serde_json::{Map, Value, json};
use sweep_engine::Schema;
use sweep_engine::config::schema::{document, number, of, set as set_schema, table};
use washer_model::{Parameter, Range, Spin};
use washer_row::{Criterion, Metric};

use super::grid::DEFAULT_MACHINE;
use super::machine::{AUTO, Key, LeftOut, PARTS, Part, Times, no_spin, with_one_of_each};
use super::spin::{MOST_ROWS, RAMPED, Ramped, TABLE};

/// What grid files have beside what the engine reads.
pub(crate) fn grid() -> Schema {
    let machine = json!({
        "type": "string", "default": DEFAULT_MACHINE,
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
    let column = |range: Range, said: &str| {
        let items = number(range);
        json!({
            "type": "array", "items": items, "minItems": 1, "maxItems": MOST_ROWS,
            "description": said,
        })
    };
    let said = "linear between given points, constant after the last";
    let keys = [
        ("profile", json!({ "const": TABLE, "description": said })),
        ("time_s", column(Range::NonNegative, "increasing times from 0, s")),
        ("speed_rpm", column(Range::Within(-1e5, 1e5), "speeds at these times, rpm")),
    ];
    let tabled = table(keys, &["profile", "time_s", "speed_rpm"]);
    json!({ "oneOf": RAMPED.iter().map(ramped).chain([tabled]).collect::<Value>() })
}

fn metrics() -> Value {
    json!({
        "type": "array", "items": { "enum": Metric::ALL.map(Metric::name) }, "minItems": 1,
        "uniqueItems": true, "description": "further columns of the result",
    })
}

fn stability() -> Value {
    let speeds = json!({
        "type": ["string", "number"],
        "description": "constant spin speeds in rpm, above 0, as 250, \"240,305\" or \
                        \"60:400:1\": those of the metrics `growth` and `dwell`",
    });
    table([("speed_rpm", speeds)], &["speed_rpm"])
}
