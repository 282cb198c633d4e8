//! What may stand under a key: how it is read, how an option gives it, and its schema. Values are
//! as a plan has them, in JSON.

use std::ops::RangeInclusive;

use serde_json::{Value, json};
use sweep_parameter::{Parameter, Range};

use super::words::names;
use super::{Diagnostic, Field, Located, Section, Written};

/// A kind of value.
pub enum Form<'k> {
    /// A number.
    Number(Range),
    /// A whole number.
    Whole(RangeInclusive<u64>),
    /// A string.
    Text,
    /// One of these words.
    Word(&'k [&'static str]),
    /// Some of these words, each once, which messages call so.
    Words(&'static str, &'k [&'static str]),
    /// An array of numbers.
    Numbers(Numbers),
    /// What has a reader and a schema of its own, and no option.
    Own(&'k dyn Fn(&Section<'_>, &'static str) -> Field<Value>, Value),
}

/// An array of numbers.
#[derive(Clone)]
pub struct Numbers {
    /// Of each.
    pub range: Range,
    /// Of each when it is read, if the rest is judged later.
    pub read: Range,
    /// How many.
    pub count: RangeInclusive<usize>,
    /// What their places are kept under, if not under that of all with the number of each.
    pub places: Vec<String>,
    /// What is expected where they are more or fewer.
    pub expected: String,
    /// What to do then.
    pub help: Option<&'static str>,
}

impl Form<'_> {
    /// The value in a file. The places of several numbers are kept under `place`.
    pub fn read(&self, section: &Section<'_>, key: &'static str, place: &str) -> Field<Value> {
        match self {
            Self::Number(range) => section.number(key, *range).map(|found| found.value.into()),
            Self::Whole(bounds) => section.whole(key, bounds).map(|found| found.value.into()),
            Self::Text => section.text(key).map(|found| found.value.into()),
            Self::Word(all) => section.choice(key, all).map(|found| all[found.value].into()),
            Self::Words(what, all) => names(section, key, what, all),
            Self::Numbers(numbers) => numbers.read(section, key, place),
            Self::Own(read, _) => read(section, key),
        }
    }

    /// The value that an option gives.
    pub fn typed(&self, written: &Written<'_>) -> Option<Value> {
        Some(match self {
            Self::Number(range) => written.number(*range)?.value.into(),
            Self::Whole(bounds) => written.whole(bounds)?.into(),
            Self::Word(all) => all[written.choice(all)?].into(),
            Self::Words(what, all) => written.list(what, all)?.into(),
            Self::Text | Self::Numbers(_) | Self::Own(..) => return None,
        })
    }

    /// Its schema.
    pub fn schema(&self) -> Value {
        match self {
            Self::Number(range) => number(*range),
            Self::Whole(bounds) => {
                json!({ "type": "integer", "minimum": bounds.start(), "maximum": bounds.end() })
            }
            Self::Text => json!({ "type": "string" }),
            Self::Word(all) => json!({ "enum": all }),
            Self::Words(_, all) => json!({
                "type": "array", "items": { "enum": all }, "minItems": 1, "uniqueItems": true,
            }),
            Self::Numbers(Numbers { range, count, .. }) => json!({
                "type": "array",
                "items": number(*range),
                "minItems": count.start().max(&1),
                "maxItems": count.end(),
            }),
            Self::Own(_, schema) => schema.clone(),
        }
    }
}

impl Numbers {
    /// So many numbers in a range.
    pub fn new(range: Range, count: RangeInclusive<usize>, expected: impl Into<String>) -> Self {
        Self {
            range,
            read: range,
            count,
            places: Vec::new(),
            expected: expected.into(),
            help: None,
        }
    }

    fn read(&self, section: &Section<'_>, key: &'static str, place: &str) -> Field<Value> {
        section.numbers(key, self.read).then(|found| {
            if !self.count.contains(&found.value.len()) {
                let title = format!("`{key}` has {} numbers", found.value.len());
                let refusal = Diagnostic::new(title).at(&found.at, self.expected.as_str());
                section.report.push(self.help.into_iter().fold(refusal, Diagnostic::help));
                return None;
            }
            let put = |(k, number): (usize, Located<f64>)| {
                let own = self.places.get(k).cloned();
                section.report.put(own.unwrap_or_else(|| format!("{place}[{k}]")), number.at);
                number.value
            };
            let value = found.value.into_iter().enumerate().map(put).collect();
            Some(Located { value, at: found.at })
        })
    }
}

/// The schema of a number in a range.
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

/// What a schema says of a parameter's number.
pub fn about(parameter: &impl Parameter) -> String {
    format!("{}, {}", parameter.description(), parameter.unit())
}
