//! JSON Schema (draft 2020-12) of grid files, made from the tables that read them. It covers what a
//! schema can say about one file; what needs the model or two values together is left to reading.

use serde_json::{Map, Value, json};
use sweep_parameter::{Channel as _, Parameter, Range};

use super::axes::DISTRIBUTIONS;
use super::design::{DEFAULT_SEED, MOST_SEED, MOST_SOBOL};
use super::grid::DEFAULT_RATIO_LIMIT;
use super::read::{Read, Schema};
use crate::method::{Entry, Integrator, default_method};
use crate::plan::{LONGEST_S, MOST_POINTS, RATIO_MIN};

const DRAFT: &str = "https://json-schema.org/draft/2020-12/schema";

/// The schema of a model's grid files.
pub fn grid<M: Read>() -> Value {
    let name = json!({
        "type": "string",
        "pattern": "^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$",
        "description": "name of the run and of its result file; the grid file's own name if left \
                        out",
    });
    let axes = json!({
        "type": "array",
        "items": axis(),
        "description": "swept parameters; the first varies slowest. With [design] each has a \
                        range without a count",
    });
    let Schema { top, mut required, reliability, set } = M::schema();
    let sections = [
        ("name", name),
        ("set", set),
        ("time", time()),
        ("integrator", integrator::<M::Integrator>()),
        ("axis", axes),
        ("design", design()),
        ("reliability", self::reliability::<M>(reliability)),
    ];
    required.push("time");
    let mut schema = table(sections.into_iter().chain(top), &required);
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
        let points = whole(1, most, "how many");
        let mut seed = whole(0, MOST_SEED, "another seed, another draw");
        seed["default"] = DEFAULT_SEED.into();
        table([("method", method), ("points", points), ("seed", seed)], &["method", "points"])
    };
    let list = json!({ "const": "list", "description": "points as listed" });
    let listed = "CSV or Parquet, relative to this file: one column a parameter, one row a point";
    let file = json!({ "type": "string", "description": listed });
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

/// A schema as a document.
pub fn document(title: &str, mut schema: Value) -> Value {
    schema["$schema"] = DRAFT.into();
    schema["title"] = title.into();
    schema
}

/// An object with these properties and no others.
pub fn table<'k>(
    properties: impl IntoIterator<Item = (&'k str, Value)>,
    required: &[&str],
) -> Value {
    let properties: Map<String, Value> =
        properties.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    json!({
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}

fn whole(least: u64, most: u64, description: &str) -> Value {
    json!({ "type": "integer", "minimum": least, "maximum": most, "description": description })
}

/// A number in a range.
pub fn number(range: Range) -> Value {
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

/// A parameter's number.
pub fn of(parameter: &impl Parameter) -> Value {
    let mut schema = number(parameter.range());
    schema["description"] = format!("{}, {}", parameter.description(), parameter.unit()).into();
    schema
}

/// `[set]`: parameters by name, and those of numbered elements as patterns.
pub fn set(parameters: &[impl Parameter], patterns: Map<String, Value>) -> Value {
    let properties: Map<String, Value> =
        parameters.iter().map(|parameter| (parameter.name().to_owned(), of(parameter))).collect();
    json!({
        "type": "object",
        "properties": properties,
        "patternProperties": patterns,
        "additionalProperties": false,
        "description": "constants, by the names of `sweep parameters`",
    })
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

fn integrator<I: Integrator>() -> Value {
    let one = |entry: &Entry<I>| {
        let method = json!({ "const": entry.name, "description": entry.description });
        let settings = entry.settings.iter().map(|setting| {
            (setting.key, described(number(setting.range), setting.default, setting.description))
        });
        let is_default = entry.name == default_method::<I>().name;
        let required: &[&str] = if is_default { &[] } else { &["method"] };
        table([("method", method)].into_iter().chain(settings), required)
    };
    json!({ "oneOf": I::methods().iter().map(one).collect::<Value>() })
}

fn reliability<M: Read>(further: Vec<(&'static str, Value)>) -> Value {
    let names = |channels: &[M::Channel]| -> Value {
        channels.iter().map(|channel| channel.name()).collect()
    };
    let limit = "a point is reliable where every ratio is below this";
    let channels = json!({
        "type": "array",
        "items": { "enum": names(M::Channel::every()) },
        "minItems": 1,
        "uniqueItems": true,
        "default": names(&M::default_channels()),
        "description": "motions that are compared",
    });
    let ratio_limit = described(number(Range::Positive), DEFAULT_RATIO_LIMIT, limit);
    let mut ratio_min = number(RATIO_MIN);
    ratio_min["description"] =
        "if given, a point is reliable where every ratio is above this too".into();
    let own = [("ratio_limit", ratio_limit), ("ratio_min", ratio_min), ("channels", channels)];
    table(own.into_iter().chain(further), &[])
}

fn distribution() -> Value {
    let one = |&(kind, numbers): &(&'static str, &[(&'static str, Range)])| {
        let own = numbers.iter().map(|(key, range)| (*key, number(*range)));
        let ends = ["from", "to"].map(|key| (key, number(Range::Any)));
        let mut required = vec!["kind"];
        match numbers {
            [] => required.extend(["from", "to"]),
            numbers => required.extend(numbers.iter().map(|(key, _)| *key)),
        }
        table([("kind", json!({ "const": kind }))].into_iter().chain(own).chain(ends), &required)
    };
    json!({
        "description": "of a design, cut at `from` and `to`; left out, they lie six standard \
                        deviations from the middle",
        "oneOf": DISTRIBUTIONS.iter().map(one).collect::<Value>(),
    })
}

fn axis() -> Value {
    let parameter = json!({ "type": "string", "description": "a name of `sweep parameters`" });
    let count = whole(1, MOST_POINTS, "how many, both ends included");
    let spacing = json!({ "enum": ["linear", "log"], "default": "linear" });
    let ends = ["from", "to"].map(|key| (key, number(Range::Any)));
    let further = [("count", count), ("spacing", spacing)];
    let range = table(ends.into_iter().chain(further), &["from", "to"]);
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
