//! A walk over the keys of a file, which states each key once with its kind, description and value.
//! A walk reads a file, applies `--set`, writes a plan as JSON, or makes the schema of files.

use std::cell::RefCell;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::section::format_choices;
use super::{Field, Form, Located, NamedArgument, Report, Section, written_twice_mistake};

/// A key of a table.
#[derive(Clone, Copy)]
pub struct Key<'k> {
    name: &'static str,
    /// The description in schemas.
    description: &'k str,
    /// The expected value, if the key is required.
    expected_value: Option<&'k str>,
    /// Whether `--set` can change the key.
    can_be_set: bool,
}

impl<'k> Key<'k> {
    /// Returns an optional key.
    pub const fn new(name: &'static str, description: &'k str) -> Self {
        Self { name, description, expected_value: None, can_be_set: false }
    }

    /// Returns the key as a required one.
    #[must_use]
    pub const fn required(self, expected: &'k str) -> Self {
        Self { expected_value: Some(expected), ..self }
    }

    /// Returns the key as one that `--set` can change.
    #[must_use]
    pub const fn settable(self) -> Self {
        Self { can_be_set: true, ..self }
    }
}

/// The purpose of a walk over keys.
pub enum KeyWalk<'a> {
    /// Reads the values of a file.
    Read(Section<'a>),
    /// Replaces values by options.
    Set(&'a Options<'a>),
    /// Describes values as JSON, or keys as a schema.
    Describe(Description),
}

/// Options of the command line that replace values of a file.
pub struct Options<'a> {
    arguments: Vec<NamedArgument<'a>>,
    /// The changes by name.
    pub changes: RefCell<Vec<(String, Value)>>,
    report: &'a Report,
}

impl<'a> Options<'a> {
    /// Parses arguments NAME=VALUE.
    pub fn read(arguments: impl IntoIterator<Item = &'a String>, report: &'a Report) -> Self {
        let mut named_arguments: Vec<NamedArgument<'_>> = Vec::new();
        for argument in arguments {
            let Some(next) = NamedArgument::read("--set", argument, report) else { continue };
            match named_arguments.iter().find(|earlier| earlier.name.value == next.name.value) {
                Some(first) => report.push(written_twice_mistake(&next.name, &first.name)),
                None => named_arguments.push(next),
            }
        }
        Self { arguments: named_arguments, changes: RefCell::default(), report }
    }

    /// Returns the value of an option, and records the change if the value differs from
    /// `old_value`.
    fn value(&self, name: &str, kind: &Form<'_>, old_value: &Value) -> Field<Value> {
        let Some(written_argument) =
            self.arguments.iter().find(|written_argument| written_argument.name.value == name)
        else {
            return Field::Absent;
        };
        let Some(value) = kind.read_option(written_argument) else { return Field::Rejected };
        if value != *old_value {
            // The change to a list of words has the text of the argument.
            let change =
                if value.is_array() { written_argument.value.value.into() } else { value.clone() };
            self.changes.borrow_mut().push((name.to_owned(), change));
        }
        Field::Present(Located { value, location: written_argument.value.location.clone() })
    }
}

/// The description of a table so far.
#[derive(Default)]
pub struct Description {
    is_schema: bool,
    entries: Map<String, Value>,
    required_keys: Vec<&'static str>,
    variant_schemas: Vec<Value>,
    /// The keys of this table and its inner tables that `--set` can change.
    pub settable_keys: Vec<&'static str>,
}

impl Description {
    /// Adds a key with its value or schema.
    pub fn add_key(&mut self, key: Key<'_>, mut value: Value) {
        if self.is_schema {
            if !key.description.is_empty() {
                value["description"] = key.description.into();
            }
            self.required_keys.extend(key.expected_value.map(|_| key.name));
            self.settable_keys.extend(key.can_be_set.then_some(key.name));
        }
        self.entries.insert(key.name.to_owned(), value);
    }

    /// Returns the description of an inner table.
    fn describe_inner<'a>(&mut self, walk: impl FnOnce(&mut Keys<'a>)) -> Value {
        let mut description = Keys::described(self.is_schema, walk);
        self.settable_keys.append(&mut description.settable_keys);
        description.finish()
    }

    /// Returns the first of these tables that has a key.
    pub fn table_of<'t>(&self, key: &str, tables: &[&'t str]) -> Option<&'t str> {
        let has_property = |schema: &Value| schema["properties"].get(key).is_some();
        let variant_has_property = |schema: &Value| {
            schema["oneOf"].as_array().is_some_and(|all| all.iter().any(has_property))
        };
        let has_key = |table: &str| {
            self.entries
                .get(table)
                .is_some_and(|schema| has_property(schema) || variant_has_property(schema))
        };
        tables.iter().copied().find(|table| has_key(table))
    }

    /// Returns the table, or its schema.
    pub fn finish(self) -> Value {
        match (self.is_schema, self.variant_schemas.is_empty()) {
            (false, _) => self.entries.into(),
            (true, false) => json!({ "oneOf": self.variant_schemas }),
            (true, true) => object_schema(self.entries, &self.required_keys),
        }
    }
}

/// The keys of a table during a walk.
pub struct Keys<'a> {
    /// The purpose of the walk.
    pub walk: KeyWalk<'a>,
    /// The prefix of the keys under which locations are recorded.
    pub location_prefix: String,
    /// Whether the table's variant is unknown. Then only the keys that are present are checked.
    is_lenient: bool,
}

impl<'a> Keys<'a> {
    /// Returns the keys of the top table.
    pub fn new(walk: KeyWalk<'a>) -> Self {
        Self { walk, location_prefix: String::new(), is_lenient: false }
    }

    /// Returns the description of a walk: a schema, or values.
    pub fn described(is_schema: bool, walk: impl FnOnce(&mut Self)) -> Description {
        let mut keys =
            Self::new(KeyWalk::Describe(Description { is_schema, ..Description::default() }));
        walk(&mut keys);
        if let KeyWalk::Describe(description) = keys.walk {
            description
        } else {
            Description::default()
        }
    }

    /// Returns whether the walk makes a schema.
    pub fn is_schema(&self) -> bool {
        matches!(&self.walk, KeyWalk::Describe(description) if description.is_schema)
    }

    /// Adds a key's value or schema, if the walk describes.
    pub fn describe(&mut self, key: Key<'_>, value: impl FnOnce(bool) -> Value) {
        if let KeyWalk::Describe(description) = &mut self.walk {
            let value = value(description.is_schema);
            description.add_key(key, value);
        }
    }

    /// Adds a value that is not in files, if the walk describes values.
    pub fn write_value(&mut self, name: &'static str, value: Value) {
        if !self.is_schema() {
            self.describe(Key::new(name, ""), |_| value);
        }
    }

    /// Returns the table that is read, if the walk reads.
    pub fn section(&self) -> Option<&Section<'a>> {
        if let KeyWalk::Read(section) = &self.walk { Some(section) } else { None }
    }

    /// Returns the report of mistakes, if the walk reads or sets values.
    pub fn report(&self) -> Option<&'a Report> {
        match &self.walk {
            KeyWalk::Read(section) => Some(section.report),
            KeyWalk::Set(options) => Some(options.report),
            KeyWalk::Describe(_) => None,
        }
    }

    /// Rejects keys that belong to another variant, with a reason.
    pub fn mark_misplaced(&self, keys: &[&'static str], reason: &str) {
        self.section().into_iter().for_each(|section| section.mark_misplaced(keys, reason));
    }

    /// Rejects an option that has no place in the plan.
    pub fn refuse_option(&self, name: &str, title: &str, expected: &str) {
        let KeyWalk::Set(options) = &self.walk else { return };
        for written in options.arguments.iter().filter(|written| written.name.value == name) {
            options.report.refuse::<()>(&written.name.location, title, expected);
        }
    }

    /// Walks over a key with its value. A wrong or missing value is reported, and the old value
    /// stays.
    pub fn walk_key<T: Serialize + DeserializeOwned>(
        &mut self,
        key: Key<'_>,
        kind: &Form<'_>,
        value: &mut T,
    ) -> Field<()> {
        let location_key = format!("{}{}", self.location_prefix, key.name);
        let old_value = json!(value);
        // An empty value is neither described nor a default.
        let is_present = ![json!(null), json!([]), json!("")].contains(&old_value);
        let field = match &mut self.walk {
            KeyWalk::Read(section) if self.is_lenient && section.has_read(key.name) => {
                Field::Absent
            }
            KeyWalk::Read(section) => {
                let read_field = kind.read(section, key.name, &location_key);
                section.report_if_missing(
                    read_field,
                    key.name,
                    key.expected_value.filter(|_| !self.is_lenient),
                )
            }
            KeyWalk::Set(options) if key.can_be_set => options.value(key.name, kind, &old_value),
            KeyWalk::Describe(description) if description.is_schema => {
                let mut schema = kind.schema();
                if is_present && key.expected_value.is_none() {
                    schema["default"] = old_value;
                }
                description.add_key(key, schema);
                Field::Absent
            }
            KeyWalk::Describe(description) if is_present => {
                description.add_key(key, old_value);
                Field::Absent
            }
            KeyWalk::Set(_) | KeyWalk::Describe(_) => Field::Absent,
        };
        field.and_then(|Located { value: json, location }| {
            *value = serde_json::from_value(json).ok()?;
            self.report()?.record_location(location_key, location.clone());
            Some(Located { value: (), location })
        })
    }

    /// Walks over a key with some of `all`, by their names; `noun` names them in messages.
    pub fn walk_words<T: Copy>(
        &mut self,
        key: Key<'_>,
        noun: &'static str,
        choices: &[T],
        name: fn(T) -> &'static str,
        value: &mut Vec<T>,
    ) -> Field<()> {
        let names: Vec<&str> = choices.iter().copied().map(name).collect();
        let mut words: Vec<String> = value.iter().map(|item| name(*item).to_owned()).collect();
        let field = self.walk_key(key, &Form::Words(noun, &names), &mut words);
        let find_by_name = |word: &String| choices.iter().copied().find(|item| name(*item) == word);
        *value = words.iter().filter_map(find_by_name).collect();
        field
    }

    /// Walks over a table under a key.
    pub fn walk_table(&mut self, key: Key<'_>, walk: impl FnOnce(&mut Keys<'a>)) -> Field<()> {
        let name = key.name;
        let keys_of_table = |inner_description| Keys {
            location_prefix: format!("{name}."),
            ..Keys::new(inner_description)
        };
        match &mut self.walk {
            KeyWalk::Read(root) => root
                .report_if_missing(root.table(name, &format!("[{name}]")), name, key.expected_value)
                .map(|section| {
                    root.report.record_location(name, section.location);
                    let mut keys_of_table = keys_of_table(KeyWalk::Read(section.value));
                    walk(&mut keys_of_table);
                    keys_of_table.finish();
                }),
            KeyWalk::Set(options) => {
                walk(&mut keys_of_table(KeyWalk::Set(options)));
                Field::Absent
            }
            KeyWalk::Describe(description) => {
                let inner_description = description.describe_inner(walk);
                if inner_description != json!({}) {
                    description.add_key(key, inner_description);
                }
                Field::Absent
            }
        }
    }

    /// Walks over an array of tables under a key: the tables in `read`, or `count` described ones.
    /// `walk` takes the index of a table.
    pub fn walk_tables(
        &mut self,
        key: Key<'_>,
        sections: Vec<Section<'a>>,
        count: usize,
        mut walk: impl FnMut(&mut Keys<'a>, usize),
    ) {
        for (k, section) in sections.into_iter().enumerate() {
            let mut keys = Keys::new(KeyWalk::Read(section));
            walk(&mut keys, k);
            keys.finish();
        }
        let KeyWalk::Describe(description) = &mut self.walk else { return };
        let value = if description.is_schema {
            let item_schema = description.describe_inner(|keys| walk(keys, 0));
            let mut schema = json!({ "type": "array", "items": item_schema });
            if key.expected_value.is_some() {
                schema["minItems"] = 1.into();
            }
            schema
        } else {
            (0..count).map(|k| description.describe_inner(|keys| walk(keys, k))).collect()
        };
        description.add_key(key, value);
    }

    /// Ends the walk, and rejects the keys of the file that the walk did not name.
    pub fn finish(self) {
        if let KeyWalk::Read(section) = self.walk {
            section.finish();
        }
    }

    /// Walks over a key whose word decides which other keys the table has. `walk` takes the index
    /// of a word and walks over its keys; `current` is the current word. Returns the index of the
    /// selected word.
    pub fn walk_variants(
        &mut self,
        key: Key<'_>,
        variants: &KeyVariants,
        current_index: Option<usize>,
        mut walk: impl FnMut(&mut Self, usize),
    ) -> Option<usize> {
        if let KeyWalk::Describe(table) = &mut self.walk
            && table.is_schema
        {
            for (k, (name, description)) in variants.words.iter().enumerate() {
                let expected = (variants.default_index != Some(k)).then_some("");
                let variant_schema = table.describe_inner(|keys| {
                    keys.describe(
                        Key { description, expected_value: expected, ..key },
                        |_| json!({ "const": name }),
                    );
                    walk(keys, k);
                });
                table.variant_schemas.push(variant_schema);
            }
            return None;
        }
        let names: Vec<&str> = variants.words.iter().map(|(name, _)| *name).collect();
        let choices_text = format_choices(&names);
        let expected =
            key.expected_value.or(variants.default_index.is_none().then_some(&choices_text));
        let allowed_count =
            if let KeyWalk::Set(_) = self.walk { variants.settable_count } else { names.len() };
        let mut word = current_index.map(|current_index| names[current_index].to_owned());
        let field = self.walk_key(
            Key { expected_value: expected, ..key },
            &Form::Word(&names[..allowed_count]),
            &mut word,
        );
        if let (KeyWalk::Set(options), Field::Present(field)) = (&self.walk, &field) {
            // The word decides on the whole table, so that its location is that of the table.
            options.report.record_location(
                self.location_prefix.trim_end_matches('.'),
                field.location.clone(),
            );
        }
        let word = names.iter().position(|name| word.as_deref() == Some(name));
        let selected_index = match (&self.walk, field) {
            (KeyWalk::Read(_), Field::Absent) => variants.default_index,
            (KeyWalk::Read(_), Field::Rejected) => None,
            _ => word,
        };
        self.is_lenient = selected_index.is_none() && self.section().is_some();
        match selected_index {
            Some(selected_index) => walk(self, selected_index),
            None if self.is_lenient => (0..names.len()).for_each(|k| walk(self, k)),
            None => {}
        }
        selected_index
    }
}

/// The words of a key that decides which other keys a table has.
pub struct KeyVariants {
    /// The words with their descriptions.
    pub words: Vec<(&'static str, &'static str)>,
    /// The index of the word that applies if a file names none; `None` if it must name one.
    pub default_index: Option<usize>,
    /// The number of words that `--set` may choose, from the first on.
    pub settable_count: usize,
}

/// Returns the schema of an object with these properties and no others.
pub fn object_schema(
    properties: impl IntoIterator<Item = (impl Into<String>, Value)>,
    required: &[&str],
) -> Value {
    let properties: Map<String, Value> =
        properties.into_iter().map(|(key, value)| (key.into(), value)).collect();
    json!({
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    })
}
