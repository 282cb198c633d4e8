//! JSON Schema (draft 2020-12) of grid files, made by the walks that read them. It covers a single
//! file; checks that need the model or several values are made on reading.

use serde_json::{Map, Value, json};
use sweep_parameter::{Parameter, Range};

use super::axes::DISTRIBUTIONS;
use super::form::{describe_parameter, number_schema};
use super::keys::object_schema;
use super::sections::describe_keys;
use super::{Form, Key};
use crate::Model;
use crate::plan::MAX_POINTS;

/// The identifier of the draft.
const SCHEMA_DRAFT: &str = "https://json-schema.org/draft/2020-12/schema";

/// Returns the schema of a model's grid files.
pub fn grid_schema<M: Model>() -> Value {
    let mut description = describe_keys::<M>();
    let key = Key::new("set", "constants, by the names of `sweep parameters`");
    description.add_key(key, M::schema_of_set());
    let axis_description = "headers of lists and measurements with the names of what they hold";
    let names = json!({ "type": "object", "additionalProperties": { "type": "string" } });
    description.add_key(Key::new("columns", axis_description), names);
    let axes = json!({ "type": "array", "items": axis_schema() });
    let axis_description = "swept parameters; the first varies slowest. With [design] each has a \
                            range without a count";
    description.add_key(Key::new("axis", axis_description), axes);
    let mut schema = description.finish();
    // Only a design has distributions, and its ranges have no count.
    schema["if"] = json!({ "required": ["design"] });
    let range_with_count = json!({ "range": { "required": ["count"] } });
    let schema_of_every_axis =
        |items: Value| json!({ "properties": { "axis": { "items": items } } });
    let without_count = json!({ "required": ["range"], "properties": range_with_count });
    schema["then"] = schema_of_every_axis(json!({ "not": without_count }));
    let without_distribution = json!({ "required": ["distribution"] });
    schema["else"] = schema_of_every_axis(
        json!({ "properties": range_with_count, "not": without_distribution }),
    );
    document("Grid file of sweep", schema)
}

/// Returns a schema as a document.
pub fn document(title: &str, mut schema: Value) -> Value {
    schema["$schema"] = SCHEMA_DRAFT.into();
    schema["title"] = title.into();
    schema
}

/// Returns the schema of a parameter's number.
pub fn parameter_schema(parameter: &Parameter<impl Sized>) -> Value {
    let mut schema = number_schema(parameter.range);
    schema["description"] = describe_parameter(parameter).into();
    schema
}

/// Returns the schema of `[set]`: parameters by name, and numbered elements as patterns.
pub fn set_schema(parameters: &[Parameter<impl Sized>], patterns: Map<String, Value>) -> Value {
    let properties: Map<String, Value> = parameters
        .iter()
        .map(|parameter| (parameter.name.to_string(), parameter_schema(parameter)))
        .collect();
    json!({
        "type": "object",
        "properties": properties,
        "patternProperties": patterns,
        "additionalProperties": false,
    })
}

fn distribution_schema() -> Value {
    let distribution_schema = |&(kind, numbers): &(&'static str, &[(&'static str, Range)])| {
        let shape_numbers = numbers.iter().map(|(key, range)| (*key, number_schema(*range)));
        let truncation_ends = ["from", "to"].map(|key| (key, number_schema(Range::Any)));
        let mut required = vec!["kind"];
        match numbers {
            [] => required.extend(["from", "to"]),
            numbers => required.extend(numbers.iter().map(|(key, _)| *key)),
        }
        let kind = || ("kind", json!({ "const": kind }));
        let schema_with_numbers = object_schema(
            [kind()].into_iter().chain(shape_numbers).chain(truncation_ends),
            &required,
        );
        let schema_with_tolerance =
            object_schema([kind(), ("tolerance", tolerance_schema())], &["kind", "tolerance"]);
        [schema_with_numbers, schema_with_tolerance]
    };
    json!({
        "description": "of a design, cut at `from` and `to`; left out, they lie six standard \
                        deviations from the middle. A tolerance is three",
        "oneOf": DISTRIBUTIONS.iter().flat_map(distribution_schema).collect::<Value>(),
    })
}

fn tolerance_schema() -> Value {
    json!({
        "description": "about the machine's own number: a number in its unit, or as \"5 %\"",
        "anyOf": [
            { "type": "number", "exclusiveMinimum": 0 },
            { "type": "string", "pattern": "^[0-9.eE+-]+ *%?$" },
        ],
    })
}

fn axis_schema() -> Value {
    let parameter = json!({ "type": "string", "description": "a name of `sweep parameters`" });
    let mut count = Form::Whole(1..=MAX_POINTS).schema();
    count["description"] = "the number of values, both ends included".into();
    let spacing = json!({ "enum": ["linear", "log"], "default": "linear" });
    let range_ends = ["from", "to"].map(|key| (key, number_schema(Range::Any)));
    let count_and_spacing = [("count", count.clone()), ("spacing", spacing)];
    let range = object_schema(range_ends.into_iter().chain(count_and_spacing), &["from", "to"]);
    let tolerance_schema = json!({
        "type": "object",
        "properties": { "parameter": parameter, "tolerance": tolerance_schema(), "count": count },
        "required": ["parameter", "tolerance"],
        "additionalProperties": false,
    });
    let values = json!({
        "type": "array", "items": number_schema(Range::Any), "minItems": 1, "uniqueItems": true,
    });
    let schema_with_parameter = |(key, value)| {
        object_schema([("parameter", parameter.clone()), (key, value)], &["parameter", key])
    };
    let axis_forms =
        [("values", values), ("range", range), ("distribution", distribution_schema())];
    let axis_forms: Vec<Value> =
        axis_forms.map(schema_with_parameter).into_iter().chain([tolerance_schema]).collect();
    json!({ "oneOf": axis_forms })
}
