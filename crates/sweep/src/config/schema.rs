//! JSON Schema (draft 2020-12) of grid and machine files, made from the tables that read them. It
//! covers what a schema can say about one file; what needs the machine or two values together is
//! left to [`super::load`].

use serde_json::{Map, Value, json};
use washer_model::{Channel, Parameter, Range, Spin};
use washer_row::{Criterion, Metric};

use super::axes::MOST_POINTS;
use super::design::{DEFAULT_SEED, MOST_SEED, MOST_SOBOL};
use super::grid::{DEFAULT_CHANNELS, DEFAULT_MACHINE, DEFAULT_RATIO_LIMIT, LONGEST_S};
use super::machine::{BLOCKS, Block, CABINET, LISTS, no_spin, with_one_of_each};
use super::spin::{MOST_ROWS, RAMPED, Ramped, TABLE};
use crate::method::{Entry, METHODS};

const DRAFT: &str = "https://json-schema.org/draft/2020-12/schema";

/// The schema of grid files.
#[must_use]
pub(crate) fn grid() -> Value {
    let name = json!({
        "type": "string",
        "pattern": "^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$",
        "description": "name of the run and of its result file; the grid file's own name if left \
                        out",
    });
    let machine = json!({
        "type": "string",
        "default": DEFAULT_MACHINE,
        "description": "\"paper\", or a machine file relative to this file",
    });
    let axes = json!({
        "type": "array",
        "items": axis(),
        "description": "swept parameters; the first varies slowest. With [design] each has a \
                        range without a count",
    });
    let sections = [
        ("name", name),
        ("machine", machine),
        ("metrics", metrics()),
        ("set", set()),
        ("spin", spin()),
        ("time", time()),
        ("integrator", integrator()),
        ("axis", axes),
        ("design", design()),
        ("reliability", reliability()),
        ("stability", stability()),
    ];
    let mut schema = table(sections, &["spin", "time"]);
    // Whether a range has a count depends on whether there is a design.
    schema["if"] = json!({ "required": ["design"] });
    let counted = json!({ "properties": { "range": { "required": ["count"] } } });
    let every_axis = |items: Value| json!({ "properties": { "axis": { "items": items } } });
    schema["then"] = every_axis(json!({ "not": counted }));
    schema["else"] = every_axis(counted);
    document("Grid file of sweep", schema)
}

fn design() -> Value {
    let one = |method: &'static str, description: &str, most: u64| {
        let method = json!({ "const": method, "description": description });
        let points =
            json!({ "type": "integer", "minimum": 1, "maximum": most, "description": "how many" });
        let seed = json!({
            "type": "integer",
            "minimum": 0,
            "maximum": MOST_SEED,
            "default": DEFAULT_SEED,
            "description": "another seed, another draw",
        });
        table([("method", method), ("points", points), ("seed", seed)], &["method", "points"])
    };
    let list = json!({ "const": "list", "description": "points as listed" });
    let file = json!({ "type": "string", "description": "CSV or Parquet, relative to this file: \
                                                         one column a parameter, one row a \
                                                         point" });
    json!({
        "oneOf": [
            one("latin_hypercube", "every axis cut into as many strata as there are points, one \
                                    point in each", MOST_POINTS),
            one("monte_carlo", "every point at random, independent of all others", MOST_POINTS),
            one("sobol", "a scrambled Sobol sequence; a power of two points is the most \
                          even", MOST_SOBOL),
            table([("method", list), ("file", file)], &["method", "file"]),
        ],
    })
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

fn document(title: &str, mut schema: Value) -> Value {
    schema["$schema"] = DRAFT.into();
    schema["title"] = title.into();
    schema
}

fn table<'k>(properties: impl IntoIterator<Item = (&'k str, Value)>, required: &[&str]) -> Value {
    let properties: Map<String, Value> =
        properties.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    json!({
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn number(range: Range) -> Value {
    let largest = Range::LARGEST;
    match range {
        Range::Any => json!({ "type": "number", "minimum": -largest, "maximum": largest }),
        Range::Positive => json!({ "type": "number", "exclusiveMinimum": 0, "maximum": largest }),
        Range::NonNegative => json!({ "type": "number", "minimum": 0, "maximum": largest }),
        Range::Negative => json!({ "type": "number", "minimum": -largest, "exclusiveMaximum": 0 }),
        Range::Within(least, greatest) => {
            json!({ "type": "number", "minimum": least, "maximum": greatest })
        }
    }
}

fn described(mut schema: Value, default: f64, description: &str) -> Value {
    schema["default"] = default.into();
    schema["description"] = description.into();
    schema
}

/// A parameter's number, by name.
fn parameter(name: &str) -> Value {
    let spin = Spin::Triangular { peak_rpm: 0.0, ramp_s: 0.0 };
    Parameter::find(name, &with_one_of_each(), &spin)
        .map_or(json!({ "type": "number" }), |parameter| of(&parameter))
}

fn of(parameter: &Parameter) -> Value {
    let mut schema = number(parameter.range());
    schema["description"] = format!("{}, {}", parameter.description(), parameter.unit()).into();
    schema
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
    let (mut properties, mut patterns) = (Map::new(), Map::new());
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
            _ => {
                properties.insert(name.to_owned(), of(parameter));
            }
        }
    }
    json!({
        "type": "object",
        "properties": properties,
        "patternProperties": patterns,
        "additionalProperties": false,
        "description": "constants, by the names of `sweep parameters`",
    })
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

fn time() -> Value {
    let end_s = json!({
        "type": "number",
        "exclusiveMinimum": 0,
        "maximum": LONGEST_S,
        "description": "end of the integration, s",
    });
    let window_s = json!({
        "type": "array",
        "items": number(Range::NonNegative),
        "minItems": 2,
        "maxItems": 2,
        "description": "amplitudes are taken from the first to the second time, s; the whole run \
                        if left out",
    });
    table([("end_s", end_s), ("window_s", window_s)], &["end_s"])
}

fn integrator() -> Value {
    let one = |entry: &Entry| {
        let method = json!({ "const": entry.name, "description": entry.description });
        let settings = entry.settings.iter().map(|setting| {
            (setting.key, described(number(setting.range), setting.default, setting.description))
        });
        let is_default = entry.name == Entry::default_method().name;
        let required: &[&str] = if is_default { &[] } else { &["method"] };
        table([("method", method)].into_iter().chain(settings), required)
    };
    json!({ "oneOf": METHODS.iter().map(one).collect::<Value>() })
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

fn reliability() -> Value {
    let criterion = json!({
        "enum": Criterion::ALL.map(Criterion::name),
        "default": Criterion::default().name(),
        "description": "what the models are compared by: largest deviations, the same turn by \
                        turn of the drum, or root mean squares",
    });
    let limit = "a point is reliable where every ratio is below this";
    let channels = json!({
        "type": "array",
        "items": { "enum": Channel::ALL.map(Channel::name) },
        "minItems": 1,
        "uniqueItems": true,
        "default": DEFAULT_CHANNELS.map(Channel::name),
        "description": "motions that are compared",
    });
    let ratio_limit = described(number(Range::Positive), DEFAULT_RATIO_LIMIT, limit);
    table([("ratio_limit", ratio_limit), ("channels", channels), ("criterion", criterion)], &[])
}

fn distribution() -> Value {
    let one = |kind: &'static str, numbers: &[(&'static str, Range)], required: &[&str]| {
        let mut properties = vec![("kind", json!({ "const": kind }))];
        properties.extend(numbers.iter().map(|(key, range)| (*key, number(*range))));
        properties.extend(["from", "to"].map(|key| (key, number(Range::Any))));
        table(properties, required)
    };
    let (any, positive) = (Range::Any, Range::Positive);
    json!({
        "description": "of a design, cut at `from` and `to`; left out, they lie six standard \
                        deviations from the middle",
        "oneOf": [
            one("normal", &[("mean", any), ("sd", positive)], &["kind", "mean", "sd"]),
            one(
                "lognormal",
                &[("median", positive), ("sigma", positive)],
                &["kind", "median", "sigma"],
            ),
            one("uniform", &[], &["kind", "from", "to"]),
        ],
    })
}

fn axis() -> Value {
    let parameter = json!({ "type": "string", "description": "a name of `sweep parameters`" });
    let range = table(
        [
            ("from", number(Range::Any)),
            ("to", number(Range::Any)),
            (
                "count",
                json!({
                    "type": "integer",
                    "minimum": 1,
                    "maximum": MOST_POINTS,
                    "description": "how many, both ends included",
                }),
            ),
            ("spacing", json!({ "enum": ["linear", "log"], "default": "linear" })),
        ],
        &["from", "to"],
    );
    let values =
        json!({ "type": "array", "items": number(Range::Any), "minItems": 1, "uniqueItems": true });
    json!({
        "oneOf": [
            table([("parameter", parameter.clone()), ("values", values)], &["parameter", "values"]),
            table([("parameter", parameter.clone()), ("range", range)], &["parameter", "range"]),
            table(
                [("parameter", parameter), ("distribution", distribution())],
                &["parameter", "distribution"],
            ),
        ],
    })
}
