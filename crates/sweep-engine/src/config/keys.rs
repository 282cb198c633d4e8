//! One walk over the keys of a file. It says each key once: its kind, what it means, and where its
//! value stands. By it a file is read, `--set` is put in place, a plan is written as JSON, and the
//! schema of files is made.

use std::cell::RefCell;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::section::listed;
use super::{Field, Form, Located, Report, Section, Written, twice};

/// A key of a table.
#[derive(Clone, Copy)]
pub struct Key<'k> {
    name: &'static str,
    /// For schemas.
    description: &'k str,
    /// What is expected where a file leaves it out, if it may not.
    needed: Option<&'k str>,
    /// Whether `--set` takes it.
    is_set: bool,
}

impl<'k> Key<'k> {
    /// A key that may be left out.
    pub const fn new(name: &'static str, description: &'k str) -> Self {
        Self { name, description, needed: None, is_set: false }
    }

    /// The same, but it must be there.
    #[must_use]
    pub const fn needed(self, expected: &'k str) -> Self {
        Self { needed: Some(expected), ..self }
    }

    /// The same, but `--set` takes it too.
    #[must_use]
    pub const fn set(self) -> Self {
        Self { is_set: true, ..self }
    }
}

/// What a walk over keys does.
pub enum Walk<'a> {
    /// Takes the values of a file.
    Read(Section<'a>),
    /// Puts options in place of values.
    Set(&'a Options<'a>),
    /// Tells of values as JSON, or of keys as a schema.
    Tell(Told),
}

/// Options of the command line that take the place of a file's values.
pub struct Options<'a> {
    written: Vec<Written<'a>>,
    /// What they changed, by name.
    pub changed: RefCell<Vec<(String, Value)>>,
    report: &'a Report,
}

impl<'a> Options<'a> {
    /// Takes arguments NAME=VALUE apart.
    pub fn read(arguments: impl IntoIterator<Item = &'a String>, report: &'a Report) -> Self {
        let mut written: Vec<Written<'_>> = Vec::new();
        for argument in arguments {
            let Some(next) = Written::read("--set", argument, report) else { continue };
            match written.iter().find(|known| known.name.value == next.name.value) {
                Some(first) => report.push(twice(&next.name, &first.name)),
                None => written.push(next),
            }
        }
        Self { written, changed: RefCell::default(), report }
    }

    /// The value under a name. Another than that which stands is noted.
    fn value(&self, name: &str, kind: &Form<'_>, was: &Value) -> Field<Value> {
        let Some(written) = self.written.iter().find(|written| written.name.value == name) else {
            return Field::Absent;
        };
        let Some(value) = kind.typed(written) else { return Field::Bad };
        if value != *was {
            // Several words are as they were written.
            let said = if value.is_array() { written.value.value.into() } else { value.clone() };
            self.changed.borrow_mut().push((name.to_owned(), said));
        }
        Field::Given(Located { value, at: written.value.at.clone() })
    }
}

/// What was told of a table so far.
#[derive(Default)]
pub struct Told {
    is_schema: bool,
    entries: Map<String, Value>,
    required: Vec<&'static str>,
    variants: Vec<Value>,
    /// The keys that `--set` takes, of this table and those in it.
    pub set: Vec<&'static str>,
}

impl Told {
    /// Adds a key with its value or schema.
    pub fn add(&mut self, key: Key<'_>, mut value: Value) {
        if self.is_schema {
            if !key.description.is_empty() {
                value["description"] = key.description.into();
            }
            self.required.extend(key.needed.map(|_| key.name));
            self.set.extend(key.is_set.then_some(key.name));
        }
        self.entries.insert(key.name.to_owned(), value);
    }

    /// What another walk of this kind tells.
    fn inside<'a>(&mut self, walk: impl FnOnce(&mut Keys<'a>)) -> Value {
        let mut told = Keys::told(self.is_schema, walk);
        self.set.append(&mut told.set);
        told.finish()
    }

    /// The table that has a key, if one of these has.
    pub fn table_of<'t>(&self, key: &str, tables: &[&'t str]) -> Option<&'t str> {
        let has = |schema: &Value| schema["properties"].get(key).is_some();
        let any =
            |schema: &Value| schema["oneOf"].as_array().is_some_and(|all| all.iter().any(has));
        let entry = |table: &str| self.entries.get(table).is_some_and(|it| has(it) || any(it));
        tables.iter().copied().find(|table| entry(table))
    }

    /// The table, or its schema.
    pub fn finish(self) -> Value {
        match (self.is_schema, self.variants.is_empty()) {
            (false, _) => self.entries.into(),
            (true, false) => json!({ "oneOf": self.variants }),
            (true, true) => table(self.entries, &self.required),
        }
    }
}

/// The keys of a table, as a walk comes to them.
pub struct Keys<'a> {
    /// What the walk does.
    pub walk: Walk<'a>,
    /// What the names begin with under which the places of values are kept.
    pub places: String,
    /// Whether it is not known which keys belong here: those that are there are judged.
    is_loose: bool,
}

impl<'a> Keys<'a> {
    /// The keys at the top.
    pub fn new(walk: Walk<'a>) -> Self {
        Self { walk, places: String::new(), is_loose: false }
    }

    /// What a walk tells: of keys, or of values.
    pub fn told(is_schema: bool, walk: impl FnOnce(&mut Self)) -> Told {
        let mut keys = Self::new(Walk::Tell(Told { is_schema, ..Told::default() }));
        walk(&mut keys);
        if let Walk::Tell(told) = keys.walk { told } else { Told::default() }
    }

    /// Whether a walk tells of keys.
    pub fn is_schema(&self) -> bool {
        matches!(&self.walk, Walk::Tell(told) if told.is_schema)
    }

    /// Adds what a walk that tells knows: a value, or the schema of a key.
    pub fn tell(&mut self, key: Key<'_>, value: impl FnOnce(bool) -> Value) {
        if let Walk::Tell(told) = &mut self.walk {
            let value = value(told.is_schema);
            told.add(key, value);
        }
    }

    /// Adds a value to what is told of values: no file has it.
    pub fn write(&mut self, name: &'static str, value: Value) {
        if !self.is_schema() {
            self.tell(Key::new(name, ""), |_| value);
        }
    }

    /// The table that is read, if one is.
    pub fn section(&self) -> Option<&Section<'a>> {
        if let Walk::Read(section) = &self.walk { Some(section) } else { None }
    }

    /// Takes what is wrong, if values are read or set.
    pub fn report(&self) -> Option<&'a Report> {
        match &self.walk {
            Walk::Read(section) => Some(section.report),
            Walk::Set(options) => Some(options.report),
            Walk::Tell(_) => None,
        }
    }

    /// Refuses keys of a file that belong to another word, with a reason.
    pub fn misplace(&self, keys: &[&'static str], reason: &str) {
        self.section().into_iter().for_each(|section| section.misplace(keys, reason));
    }

    /// Refuses an option for which there is no place.
    pub fn refuse(&self, name: &str, title: &str, expected: &str) {
        let Walk::Set(options) = &self.walk else { return };
        for written in options.written.iter().filter(|written| written.name.value == name) {
            options.report.refuse::<()>(&written.name.at, title, expected);
        }
    }

    /// A key with its value: a wrong or missing one is reported, and leaves the value as it is.
    pub fn key<T: Serialize + DeserializeOwned>(
        &mut self,
        key: Key<'_>,
        kind: &Form<'_>,
        value: &mut T,
    ) -> Field<()> {
        let (place, was) = (format!("{}{}", self.places, key.name), json!(value));
        // What is not there is not written, and no default.
        let is_there = ![json!(null), json!([]), json!("")].contains(&was);
        let found = match &mut self.walk {
            Walk::Read(section) if self.is_loose && section.is_known(key.name) => Field::Absent,
            Walk::Read(section) => {
                let field = kind.read(section, key.name, &place);
                section.expect(field, key.name, key.needed.filter(|_| !self.is_loose))
            }
            Walk::Set(options) if key.is_set => options.value(key.name, kind, &was),
            Walk::Tell(told) if told.is_schema => {
                let mut schema = kind.schema();
                if is_there && key.needed.is_none() {
                    schema["default"] = was;
                }
                told.add(key, schema);
                Field::Absent
            }
            Walk::Tell(told) if is_there => {
                told.add(key, was);
                Field::Absent
            }
            Walk::Set(_) | Walk::Tell(_) => Field::Absent,
        };
        found.then(|Located { value: found, at }| {
            *value = serde_json::from_value(found).ok()?;
            self.report()?.put(place, at.clone());
            Some(Located { value: (), at })
        })
    }

    /// A key with some of these things, by their names; messages call them so.
    pub fn words<T: Copy>(
        &mut self,
        key: Key<'_>,
        what: &'static str,
        all: &[T],
        name: fn(T) -> &'static str,
        value: &mut Vec<T>,
    ) -> Field<()> {
        let names: Vec<&str> = all.iter().copied().map(name).collect();
        let mut words: Vec<String> = value.iter().map(|one| name(*one).to_owned()).collect();
        let found = self.key(key, &Form::Words(what, &names), &mut words);
        let of = |word: &String| all.iter().copied().find(|one| name(*one) == word);
        *value = words.iter().filter_map(of).collect();
        found
    }

    /// A table under a key.
    pub fn table(&mut self, key: Key<'_>, walk: impl FnOnce(&mut Keys<'a>)) -> Field<()> {
        let name = key.name;
        let keys = |inner| Keys { places: format!("{name}."), ..Keys::new(inner) };
        match &mut self.walk {
            Walk::Read(root) => root
                .expect(root.table(name, &format!("[{name}]")), name, key.needed)
                .map(|section| {
                    root.report.put(name, section.at);
                    let mut keys = keys(Walk::Read(section.value));
                    walk(&mut keys);
                    keys.finish();
                }),
            Walk::Set(options) => {
                walk(&mut keys(Walk::Set(options)));
                Field::Absent
            }
            Walk::Tell(told) => {
                let inner = told.inside(walk);
                if inner != json!({}) {
                    told.add(key, inner);
                }
                Field::Absent
            }
        }
    }

    /// An array of tables under a key: those that are read, or so many; `walk` goes over one by its
    /// position.
    pub fn tables(
        &mut self,
        key: Key<'_>,
        read: Vec<Section<'a>>,
        count: usize,
        mut walk: impl FnMut(&mut Keys<'a>, usize),
    ) {
        for (k, section) in read.into_iter().enumerate() {
            let mut keys = Keys::new(Walk::Read(section));
            walk(&mut keys, k);
            keys.finish();
        }
        let Walk::Tell(told) = &mut self.walk else { return };
        let value = if told.is_schema {
            let items = told.inside(|keys| walk(keys, 0));
            let mut schema = json!({ "type": "array", "items": items });
            if key.needed.is_some() {
                schema["minItems"] = 1.into();
            }
            schema
        } else {
            (0..count).map(|k| told.inside(|keys| walk(keys, k))).collect()
        };
        told.add(key, value);
    }

    /// Ends a walk: keys that it did not come to are refused.
    pub fn finish(self) {
        if let Walk::Read(section) = self.walk {
            section.finish();
        }
    }

    /// A key that says by a word which further keys there are: `walk` goes over those of a word, by
    /// its position. `now` is the word that stands. Gives the word that is chosen.
    pub fn variants(
        &mut self,
        key: Key<'_>,
        variants: &Variants,
        now: Option<usize>,
        mut walk: impl FnMut(&mut Self, usize),
    ) -> Option<usize> {
        if let Walk::Tell(told) = &mut self.walk
            && told.is_schema
        {
            for (k, (name, description)) in variants.all.iter().enumerate() {
                let needed = (variants.default != Some(k)).then_some("");
                let variant = told.inside(|keys| {
                    keys.tell(Key { description, needed, ..key }, |_| json!({ "const": name }));
                    walk(keys, k);
                });
                told.variants.push(variant);
            }
            return None;
        }
        let names: Vec<&str> = variants.all.iter().map(|(name, _)| *name).collect();
        let expected = listed(&names);
        let needed = key.needed.or(variants.default.is_none().then_some(&expected));
        let can_be = if let Walk::Set(_) = self.walk { variants.set } else { names.len() };
        let mut word = now.map(|now| names[now].to_owned());
        let found = self.key(Key { needed, ..key }, &Form::Word(&names[..can_be]), &mut word);
        if let (Walk::Set(options), Field::Given(found)) = (&self.walk, &found) {
            // What a word decides is the whole table.
            options.report.put(self.places.trim_end_matches('.'), found.at.clone());
        }
        let word = names.iter().position(|name| word.as_deref() == Some(name));
        let chosen = match (&self.walk, found) {
            (Walk::Read(_), Field::Absent) => variants.default,
            (Walk::Read(_), Field::Bad) => None,
            _ => word,
        };
        self.is_loose = chosen.is_none() && self.section().is_some();
        match chosen {
            Some(chosen) => walk(self, chosen),
            None if self.is_loose => (0..names.len()).for_each(|k| walk(self, k)),
            None => {}
        }
        chosen
    }
}

/// The words of a key that says which further keys there are.
pub struct Variants {
    /// Each with what it means.
    pub all: Vec<(&'static str, &'static str)>,
    /// The one that is chosen where a file names none; without, it must name one.
    pub default: Option<usize>,
    /// How many of them `--set` may choose, from the first on.
    pub set: usize,
}

/// The schema of an object with these properties and no others.
pub fn table(
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
