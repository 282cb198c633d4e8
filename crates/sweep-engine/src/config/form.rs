//! The forms of values: how each is read from a file and from an option, and its schema. Values are
//! JSON, as in plans.

use std::ops::RangeInclusive;

use serde_json::{Value, json};
use sweep_parameter::{Parameter, Range};

use super::words::read_words;
use super::{Diagnostic, Field, Located, NamedArgument, Section};

/// A kind of value.
pub enum Form<'k> {
    /// A number in a range.
    Number(Range),
    /// A whole number within bounds.
    Whole(RangeInclusive<u64>),
    /// A string.
    Text,
    /// A word of a list.
    Word(&'k [&'static str]),
    /// Some words of a list, each once. The first field names them in messages.
    Words(&'static str, &'k [&'static str]),
    /// An array of numbers.
    Numbers(NumberArray),
    /// A value with a reader and a schema of its own, which no option sets.
    Custom(&'k dyn Fn(&Section<'_>, &'static str) -> Field<Value>, Value),
}

/// An array of numbers.
#[derive(Clone)]
pub struct NumberArray {
    /// The range of each number in the schema.
    pub range: Range,
    /// The range of each number when it is read, if it is checked later.
    pub read_range: Range,
    /// The number of entries.
    pub count: RangeInclusive<usize>,
    /// The keys of the entries' locations, if they are not the array's key with an index.
    pub location_keys: Vec<String>,
    /// The expectation in the message about a wrong number of entries.
    pub expected: String,
    /// The help of that message.
    pub help: Option<&'static str>,
}

impl Form<'_> {
    /// Reads the value from a file. The locations of several numbers are recorded under
    /// `location_key`.
    pub fn read(
        &self,
        section: &Section<'_>,
        key: &'static str,
        location_key: &str,
    ) -> Field<Value> {
        match self {
            Self::Number(range) => section.number(key, *range).map(|found| found.value.into()),
            Self::Whole(bounds) => {
                section.whole_number(key, bounds).map(|found| found.value.into())
            }
            Self::Text => section.text(key).map(|found| found.value.into()),
            Self::Word(all) => section.choice(key, all).map(|found| all[found.value].into()),
            Self::Words(noun, all) => read_words(section, key, noun, all),
            Self::Numbers(numbers) => numbers.read(section, key, location_key),
            Self::Custom(read, _) => read(section, key),
        }
    }

    /// Reads the value from an option.
    pub fn read_option(&self, argument: &NamedArgument<'_>) -> Option<Value> {
        Some(match self {
            Self::Number(range) => argument.number(*range)?.value.into(),
            Self::Whole(bounds) => argument.whole_number(bounds)?.into(),
            Self::Word(all) => all[argument.choice(all)?].into(),
            Self::Words(noun, all) => argument.list(noun, all)?.into(),
            Self::Text | Self::Numbers(_) | Self::Custom(..) => return None,
        })
    }

    /// Returns the schema of the value.
    pub fn schema(&self) -> Value {
        match self {
            Self::Number(range) => number_schema(*range),
            Self::Whole(bounds) => {
                json!({ "type": "integer", "minimum": bounds.start(), "maximum": bounds.end() })
            }
            Self::Text => json!({ "type": "string" }),
            Self::Word(all) => json!({ "enum": all }),
            Self::Words(_, all) => json!({
                "type": "array", "items": { "enum": all }, "minItems": 1, "uniqueItems": true,
            }),
            Self::Numbers(NumberArray { range, count, .. }) => json!({
                "type": "array",
                "items": number_schema(*range),
                "minItems": count.start().max(&1),
                "maxItems": count.end(),
            }),
            Self::Custom(_, schema) => schema.clone(),
        }
    }
}

impl NumberArray {
    /// Returns an array of numbers in a range.
    pub fn new(range: Range, count: RangeInclusive<usize>, expected: impl Into<String>) -> Self {
        Self {
            range,
            read_range: range,
            count,
            location_keys: Vec::new(),
            expected: expected.into(),
            help: None,
        }
    }

    fn read(&self, section: &Section<'_>, key: &'static str, location_key: &str) -> Field<Value> {
        section.numbers(key, self.read_range).and_then(|found| {
            if !self.count.contains(&found.value.len()) {
                let title = format!("`{key}` has {} numbers", found.value.len());
                let refusal =
                    Diagnostic::new(title).at_location(&found.location, self.expected.as_str());
                section.report.push(self.help.into_iter().fold(refusal, Diagnostic::with_help));
                return None;
            }
            let record_number = |(k, number): (usize, Located<f64>)| {
                let model_file_key = self.location_keys.get(k).cloned();
                section.report.record_location(
                    model_file_key.unwrap_or_else(|| format!("{location_key}[{k}]")),
                    number.location,
                );
                number.value
            };
            let value = found.value.into_iter().enumerate().map(record_number).collect();
            Some(Located { value, location: found.location })
        })
    }
}

/// Returns the schema of a number in a range.
pub fn number_schema(range: Range) -> Value {
    let max_magnitude = Range::MAX_MAGNITUDE;
    match range {
        Range::Any => {
            json!({ "type": "number", "minimum": -max_magnitude, "maximum": max_magnitude })
        }
        Range::Positive => {
            json!({ "type": "number", "exclusiveMinimum": 0, "maximum": max_magnitude })
        }
        Range::NonNegative => json!({ "type": "number", "minimum": 0, "maximum": max_magnitude }),
        Range::Negative => {
            json!({ "type": "number", "minimum": -max_magnitude, "exclusiveMaximum": 0 })
        }
        Range::Within(least, greatest) => {
            json!({ "type": "number", "minimum": least, "maximum": greatest })
        }
    }
}

/// Returns the description of a parameter's number in schemas.
pub fn describe_parameter(parameter: &Parameter<impl Sized>) -> String {
    format!("{}, {}", parameter.description, parameter.unit)
}
