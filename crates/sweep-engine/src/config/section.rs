//! A walk over a TOML table key by key. Values are read by name and kind. A wrong value is reported
//! and the walk goes on, so that one pass finds every mistake. Keys that were not read are reported
//! at the end.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use sweep_parameter::{Range, decimal};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Diagnostic, Located, Location, Report};

/// The value of a key: absent, rejected, or present with its location.
pub enum Field<T> {
    /// The key is not in the table.
    Absent,
    /// The value was rejected and reported.
    Rejected,
    /// The value with its location.
    Present(Located<T>),
}

impl<T> Field<T> {
    /// Returns the value, or the default if it is absent; `None` if it was rejected.
    pub fn or_default(self, default: T) -> Option<T> {
        match self {
            Self::Absent => Some(default),
            Self::Rejected => None,
            Self::Present(found) => Some(found.value),
        }
    }

    /// Returns the value with its location, if it is in the table.
    pub fn into_located(self) -> Option<Located<T>> {
        match self {
            Self::Present(found) => Some(found),
            Self::Absent | Self::Rejected => None,
        }
    }

    /// Maps the value at the same location.
    pub fn map<U>(self, map_value: impl FnOnce(Located<T>) -> U) -> Field<U> {
        self.and_then(|found| {
            let location = found.location.clone();
            Some(Located { value: map_value(found), location })
        })
    }

    /// Maps the value at the same location, or rejects it after the function has reported it.
    pub fn and_then<U>(self, map_value: impl FnOnce(Located<T>) -> Option<Located<U>>) -> Field<U> {
        match self {
            Self::Absent => Field::Absent,
            Self::Rejected => Field::Rejected,
            Self::Present(found) => map_value(found).map_or(Field::Rejected, Field::Present),
        }
    }
}

type Value<'a> = Spanned<DeValue<'a>>;

/// A table of a file.
pub struct Section<'a> {
    /// The name in messages: `[spin]`, `the grid file`.
    title: String,
    location: Location,
    table: &'a DeTable<'a>,
    /// The report of mistakes.
    pub report: &'a Report,
    /// The keys that were read.
    read_keys: RefCell<Vec<&'static str>>,
    /// The keys that are valid in another place or variant, with the reason why they are rejected.
    misplacement_reasons: RefCell<BTreeMap<&'static str, String>>,
}

impl<'a> Section<'a> {
    /// Returns the walk over a table.
    pub fn new(
        title: impl Into<String>,
        location: Location,
        table: &'a DeTable<'a>,
        report: &'a Report,
    ) -> Self {
        let read_keys = RefCell::default();
        let misplaced = RefCell::default();
        Self {
            title: title.into(),
            location,
            table,
            report,
            read_keys,
            misplacement_reasons: misplaced,
        }
    }

    /// Returns the location of the table.
    pub fn location(&self) -> &Location {
        &self.location
    }

    /// Returns the location of a byte range in the text of this table.
    fn locate(&self, span: std::ops::Range<usize>) -> Location {
        Location::new(self.location.source, span)
    }

    /// Returns the value of a key, which counts as read.
    fn read_value(&self, key: &'static str) -> Option<&'a Value<'a>> {
        // A key that may be a number or a word is read twice.
        if !self.has_read(key) {
            self.read_keys.borrow_mut().push(key);
        }
        self.table.get(key)
    }

    /// Returns whether a key was read.
    pub fn has_read(&self, key: &str) -> bool {
        self.read_keys.borrow().contains(&key)
    }

    /// Returns the location of a key, if it is written.
    pub fn key_location(&self, key: &str) -> Option<Location> {
        self.table.get_key_value(key).map(|(key, _)| self.locate(key.span()))
    }

    /// Returns whether the table under a key has an inner key.
    pub fn has_inner_key(&self, table: &str, key: &str) -> bool {
        let table = self.table.get(table).map(Spanned::get_ref);
        matches!(table, Some(DeValue::Table(table)) if table.contains_key(key))
    }

    /// Rejects these keys with this reason instead of "unknown key".
    pub fn mark_misplaced(&self, keys: &[&'static str], reason: &str) {
        // The first reason of a key is kept, because it is the more specific one.
        let mut reasons = self.misplacement_reasons.borrow_mut();
        for key in keys {
            reasons.entry(key).or_insert_with(|| reason.to_owned());
        }
    }

    /// Returns a required value; a missing one is reported.
    pub fn require<T>(&self, field: Field<T>, key: &str, expectation: &str) -> Option<Located<T>> {
        self.report_if_missing(field, key, Some(expectation)).into_located()
    }

    /// Returns the field; a missing one is reported if a value is expected.
    pub fn report_if_missing<T>(
        &self,
        field: Field<T>,
        key: &str,
        expectation: Option<&str>,
    ) -> Field<T> {
        if let (Field::Absent, Some(expectation)) = (&field, expectation) {
            self.report_missing(key, expectation);
        }
        field
    }

    /// Reports a required key that is missing.
    pub fn report_missing(&self, key: &str, expectation: &str) {
        let title = format!("`{key}` is missing in {}", self.title);
        self.report.push_missing(
            Diagnostic::new(title).at_location(&self.location, format!("expected {expectation}")),
        );
    }

    /// Reads the value under a key by a function, which reports a value that it rejects.
    fn read<T>(
        &self,
        key: &'static str,
        read: impl FnOnce(&'a Value<'a>, &Location) -> Option<T>,
    ) -> Field<T> {
        let Some(value) = self.read_value(key) else { return Field::Absent };
        let location = self.locate(value.span());
        let value_read = read(value, &location);
        value_read.map_or(Field::Rejected, |value| Field::Present(Located { value, location }))
    }

    /// Reports a value of the wrong type.
    fn report_wrong_type<T>(
        &self,
        description: &str,
        value: &Value<'_>,
        expectation: &str,
    ) -> Option<T> {
        let type_name = match value.get_ref() {
            DeValue::String(_) => "a string",
            DeValue::Integer(_) => "a whole number",
            DeValue::Float(_) => "a decimal number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(_) => "an array",
            DeValue::Table(_) => "a table",
        };
        let number_text = value.get_ref().as_str().filter(|_| expectation.contains("number"));
        let is_number = number_text.is_some_and(|number_text| number_text.parse::<f64>().is_ok());
        let quotes_advice = is_number.then_some("write the number without quotes");
        let refusal = Diagnostic::new(format!("{description} has the wrong type")).at_location(
            &self.locate(value.span()),
            format!("expected {expectation}, found {type_name}"),
        );
        self.report.push(quotes_advice.into_iter().fold(refusal, Diagnostic::with_help));
        None
    }

    /// Reads a finite number in a range.
    pub fn number(&self, key: &'static str, range: Range) -> Field<f64> {
        self.read(key, |value, _| Some(self.parse_number(&quote(key), value, range)?.value))
    }

    /// Reads a whole number within bounds.
    pub fn whole_number(&self, key: &'static str, bounds: &RangeInclusive<u64>) -> Field<u64> {
        self.read(key, |value, location| {
            let DeValue::Integer(integer) = value.get_ref() else {
                return self.report_wrong_type(&quote(key), value, "a whole number");
            };
            let count = u64::from_str_radix(integer.as_str(), integer.radix()).ok();
            count.filter(|count| bounds.contains(count)).or_else(|| {
                let title = format!("`{key}` = {integer} is out of range");
                let min = bounds.start();
                let max = bounds.end();
                let expectation = format!("expected a whole number from {min} to {max}");
                self.report.refuse(location, title, expectation)
            })
        })
    }

    /// Reads a string.
    pub fn text(&self, key: &'static str) -> Field<&'a str> {
        self.read(key, |value, _| Some(self.parse_text(&quote(key), value)?.value))
    }

    /// Reads a string, or the text of a number.
    pub fn text_or_number(&self, key: &'static str) -> Field<&'a str> {
        self.read(key, |value, _| match value.get_ref() {
            DeValue::Integer(integer) if integer.radix() == 10 => Some(integer.as_str()),
            DeValue::Float(float) => Some(float.as_str()),
            _ => Some(self.parse_text(&quote(key), value)?.value),
        })
    }

    /// Returns whether the value is a string.
    pub fn is_text(&self, key: &'static str) -> bool {
        self.read_value(key).is_some_and(|value| value.get_ref().is_str())
    }

    /// Reads a word, as its index in `choices`.
    pub fn choice(&self, key: &'static str, choices: &[&str]) -> Field<usize> {
        self.text(key).and_then(|found| {
            let position = choices.iter().position(|&choice| choice == found.value);
            if position.is_none() {
                self.report.push_with(|_| unknown_word_mistake(key, &found, choices));
            }
            position.map(|value| Located { value, location: found.location })
        })
    }

    /// Reads an array of finite numbers in a range; one wrong number rejects all.
    pub fn numbers(&self, key: &'static str, range: Range) -> Field<Vec<Located<f64>>> {
        self.valid_numbers(key, range).and_then(|found| {
            let (numbers, are_all_valid) = found.value;
            are_all_valid.then_some(Located { value: numbers, location: found.location })
        })
    }

    /// Reads the valid numbers of an array, and whether all are valid.
    pub fn valid_numbers(
        &self,
        key: &'static str,
        range: Range,
    ) -> Field<(Vec<Located<f64>>, bool)> {
        self.read_items(key, "an array of numbers").map(|items| {
            let parse_item = |item| self.parse_number(&describe_array_entry(key), item, range);
            let numbers: Vec<_> = items.value.iter().filter_map(parse_item).collect();
            let are_all_valid = numbers.len() == items.value.len();
            (numbers, are_all_valid)
        })
    }

    /// Reads the valid strings of an array; others are reported.
    pub fn texts(&self, key: &'static str) -> Field<Vec<Located<&'a str>>> {
        self.read_items(key, "an array of strings").map(|items| {
            items
                .value
                .iter()
                .filter_map(|item| self.parse_text(&describe_array_entry(key), item))
                .collect()
        })
    }

    fn read_items(&self, key: &'static str, kind: &str) -> Field<&'a [Value<'a>]> {
        self.read(key, |value, _| match value.get_ref() {
            DeValue::Array(items) => Some(&items[..]),
            _ => self.report_wrong_type(&quote(key), value, kind),
        })
    }

    /// Reads the table under a key.
    pub fn table(&self, key: &'static str, title: &str) -> Field<Section<'a>> {
        self.read(key, |value, location| match value.get_ref() {
            DeValue::Table(table) => {
                Some(Section::new(title, location.clone(), table, self.report))
            }
            _ => self.report_wrong_type(&quote(key), value, &format!("a table, {title}")),
        })
    }

    /// Reads an array of tables, `[[key]]`; it is empty if the key is absent.
    pub fn tables(&self, key: &'static str) -> Vec<Section<'a>> {
        let expected_tables = format!("tables, each under [[{key}]]");
        let items = self
            .read_items(key, &expected_tables)
            .into_located()
            .map_or(&[][..], |items| items.value);
        let section_of_item = |(k, item): (usize, &'a Value<'a>)| {
            let DeValue::Table(table) = item.get_ref() else {
                return self.report_wrong_type(&describe_array_entry(key), item, &expected_tables);
            };
            let title = format!("[[{key}]] number {}", k + 1);
            Some(Section::new(title, self.locate(item.span()), table, self.report))
        };
        items.iter().enumerate().filter_map(section_of_item).collect()
    }

    /// Returns every key as written, for tables whose keys are names of parameters.
    pub fn names(&self) -> Vec<Located<&'a str>> {
        let keys = self.table.keys();
        keys.map(|key| Located { value: &**key.get_ref(), location: self.locate(key.span()) })
            .collect()
    }

    /// Reads the number under a name from [`Section::names`].
    pub fn number_named(&self, key_name: &str, range: Range) -> Option<Located<f64>> {
        self.parse_number(&quote(key_name), self.table.get(key_name)?, range)
    }

    /// Reads the string under a name from [`Section::names`].
    pub fn text_named(&self, name: &str) -> Option<Located<&'a str>> {
        self.parse_text(&quote(name), self.table.get(name)?)
    }

    fn parse_text(&self, description: &str, value: &'a Value<'a>) -> Option<Located<&'a str>> {
        match value.get_ref() {
            DeValue::String(text) => {
                Some(Located { value: text, location: self.locate(value.span()) })
            }
            _ => self.report_wrong_type(description, value, "a string"),
        }
    }

    fn parse_number(
        &self,
        description: &str,
        value: &Value<'_>,
        range: Range,
    ) -> Option<Located<f64>> {
        let number = match value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok(),
            DeValue::Integer(integer) => u64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|value| value as f64),
            _ => return self.report_wrong_type(description, value, "a number"),
        };
        let number = number.unwrap_or(f64::INFINITY);
        check_number(description, number, self.locate(value.span()), range, self.report)
    }

    /// Reports every key that was not read.
    pub fn finish(self) {
        let read_keys = self.read_keys.into_inner();
        let misplacement_reasons = self.misplacement_reasons.into_inner();
        for key in self.table.keys() {
            let name: &str = key.get_ref();
            if read_keys.contains(&name) {
                continue;
            }
            self.report.push_with(|_| {
                let location = Location::new(self.location.source, key.span());
                match misplacement_reasons.get(name) {
                    Some(reason) => {
                        Diagnostic::new(format!("`{name}` does not belong in {}", self.title))
                            .at_location(&location, reason.as_str())
                    }
                    None => Diagnostic::new(format!(
                        "unknown key `{}` in {}",
                        shorten(name),
                        self.title
                    ))
                    .at_location(&location, format!("expected {}", format_choices(&read_keys)))
                    .with_nearest_name(name, read_keys.iter().copied()),
                }
            });
        }
    }
}

/// Returns the mistake of a number that is written twice.
pub fn written_twice_mistake(
    second: &Located<impl AsRef<str>>,
    first: &Located<impl AsRef<str>>,
) -> Diagnostic {
    let title = match (second.value.as_ref(), first.value.as_ref()) {
        (name, other) if name == other => format!("`{name}` is given twice"),
        (name, other) => format!("`{other}` and `{name}` write the same number"),
    };
    Diagnostic::new(title)
        .at_location(&second.location, "expected each number once")
        .at_location(&first.location, "first written here")
}

/// A word of earlier versions that was removed.
struct RemovedWord {
    /// The key of the word.
    key: &'static str,
    word: &'static str,
    /// The word that replaces the removed one, in models that have it.
    successor_word: &'static str,
    reason: &'static str,
}

/// The words that earlier versions of the program accepted as values of keys.
const REMOVED_WORDS: [RemovedWord; 1] = [RemovedWord {
    key: "method",
    word: "rodas5p",
    successor_word: "additive",
    reason: "it has the same keys and takes stiff bearings in steps as long",
}];

/// Returns the mistake of a word that is not among the choices.
pub fn unknown_word_mistake(
    description: &str,
    found: &Located<&str>,
    choices: &[&str],
) -> Diagnostic {
    let removed_word = REMOVED_WORDS.iter().find(|removed_word| {
        removed_word.key == description
            && removed_word.word == found.value
            && choices.contains(&removed_word.successor_word)
    });
    let refusal = Diagnostic::new(format!("unknown {description} \"{}\"", shorten(found.value)))
        .at_location(&found.location, format!("expected {}", format_choices(choices)));
    match removed_word {
        Some(RemovedWord { key, word, successor_word: successor, reason }) => refusal.with_help(
            format!("\"{word}\" was removed: write {key} = \"{successor}\" in its place; {reason}"),
        ),
        None => refusal.with_nearest_name(found.value, choices.iter().copied()),
    }
}

/// Lists choices: `a`, `a or b`, `one of a, b, c`.
pub fn format_choices(choices: &[&str]) -> String {
    match choices {
        [] => "nothing".to_owned(),
        [only] => format!("`{only}`"),
        [first, second] => format!("`{first}` or `{second}`"),
        many => format!("one of `{}`", many.join("`, `")),
    }
}

/// Returns a count with its noun, whose plural ends in s.
pub fn format_count(count: usize, description: &str) -> String {
    if count == 1 { format!("1 {description}") } else { format!("{count} {description}s") }
}

/// Returns a key as messages show it.
pub fn quote(key: &str) -> String {
    format!("`{}`", shorten(key))
}

/// Returns the words by which messages refer to an entry of an array.
fn describe_array_entry(key: &str) -> String {
    format!("an entry of `{key}`")
}

/// Shortens a user's text to fit a title.
pub fn shorten(typed_text: &str) -> String {
    truncate(typed_text, 60)
}

/// Returns at most `max` characters of a text, with an ellipsis if it is shortened.
pub fn truncate(text: &str, max: usize) -> String {
    match text.char_indices().nth(max) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Returns the number if it is finite and in range. Other numbers are reported.
pub fn check_number(
    description: &str,
    value: f64,
    location: Location,
    range: Range,
    report: &Report,
) -> Option<Located<f64>> {
    if range.contains(value) {
        return Some(Located { value, location });
    }
    report.push(number_mistake(description, value, &location, range));
    None
}

/// Returns the mistake of a number that is not finite or not in range.
pub fn number_mistake(
    description: &str,
    value: f64,
    location: &Location,
    range: Range,
) -> Diagnostic {
    let title = if value.is_nan() {
        format!("{description} is not a number")
    } else if value.is_infinite() {
        format!("{description} is not finite")
    } else {
        format!("{description} = {} is out of range", decimal(value))
    };
    Diagnostic::new(title).at_location(location, format!("expected {}", range.describe_for(value)))
}
