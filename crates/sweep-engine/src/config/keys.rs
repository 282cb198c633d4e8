//! One walk over the keys of a file. It says each key once: its kind, what it means, and where its
//! value stands. By it a file is read, `--set` is put in place, a plan is written as JSON, and the
//! schema of files is made.

use std::borrow::Cow;
use std::cell::RefCell;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

use super::section::listed;
use super::{Field, Kind, Located, Report, Section, Written, twice};

/// A key of a table.
#[derive(Clone)]
pub struct Key {
    name: &'static str,
    /// For schemas.
    description: Cow<'static, str>,
    /// What is expected where a file leaves it out, if it may not.
    needed: Option<Cow<'static, str>>,
    /// Whether `--set` takes it.
    is_set: bool,
}

impl Key {
    /// A key that may be left out.
    pub fn new(name: &'static str, description: impl Into<Cow<'static, str>>) -> Self {
        Self { name, description: description.into(), needed: None, is_set: false }
    }

    /// The key of a table.
    pub const fn table(name: &'static str) -> Self {
        Self { name, description: Cow::Borrowed(""), needed: None, is_set: false }
    }

    /// The same, but it must be there.
    #[must_use]
    pub fn needed(self, expected: impl Into<Cow<'static, str>>) -> Self {
        Self { needed: Some(expected.into()), ..self }
    }

    /// The same, but `--set` takes it too.
    #[must_use]
    pub fn set(self) -> Self {
        Self { is_set: true, ..self }
    }
}

/// What a walk over keys does.
pub enum Walk<'a> {
    /// Takes the values of a file.
    Read(Section<'a>),
    /// Puts options in place of values.
    Set(&'a Options<'a>),
    /// Writes values as JSON.
    Write(Map<String, Value>),
    /// Describes keys and kinds.
    Describe(Described),
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

    fn of(&self, name: &str) -> Option<&Written<'a>> {
        self.written.iter().find(|written| written.name.value == name)
    }

    /// The value that one gives, and whether it is another than that which stands.
    fn value(&self, written: &Written<'_>, kind: &Kind<'_>, was: &Value) -> Field<Value> {
        let Some(value) = kind.typed(written) else { return Field::Bad };
        if value != *was {
            // Several words are as they were written.
            let said = if value.is_array() { written.value.value.into() } else { value.clone() };
            self.changed.borrow_mut().push((written.name.value.to_owned(), said));
        }
        Field::Given(Located { value, at: written.value.at.clone() })
    }
}

/// A table's schema in the making.
#[derive(Default)]
pub struct Described {
    properties: Vec<(&'static str, Value)>,
    required: Vec<&'static str>,
    variants: Vec<Value>,
    /// The keys that `--set` takes, of this table and those in it.
    pub set: Vec<&'static str>,
}

impl Described {
    /// Adds a key.
    pub fn add(&mut self, key: &Key, mut schema: Value) {
        if !key.description.is_empty() {
            schema["description"] = (*key.description).into();
        }
        self.properties.push((key.name, schema));
        self.required.extend(key.needed.as_ref().map(|_| key.name));
        self.set.extend(key.is_set.then_some(key.name));
    }

    /// The table that has a key, if one of these has.
    pub fn table_of(&self, key: &str, tables: &[&str]) -> Option<&'static str> {
        let has = |schema: &Value| schema["properties"].get(key).is_some();
        let any =
            |schema: &Value| schema["oneOf"].as_array().is_some_and(|all| all.iter().any(has));
        let mut tables = self.properties.iter().filter(|(name, _)| tables.contains(name));
        tables.find(|(_, schema)| has(schema) || any(schema)).map(|(name, _)| *name)
    }

    /// The schema.
    pub fn finish(self) -> Value {
        match self.variants.is_empty() {
            true => table(self.properties, &self.required),
            false => json!({ "oneOf": self.variants }),
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

    /// What a walk writes.
    pub fn written(walk: impl FnOnce(&mut Self)) -> Map<String, Value> {
        let mut keys = Self::new(Walk::Write(Map::new()));
        walk(&mut keys);
        if let Walk::Write(plan) = keys.walk { plan } else { Map::new() }
    }

    /// What a walk describes.
    pub fn described(walk: impl FnOnce(&mut Self)) -> Described {
        let mut keys = Self::new(Walk::Describe(Described::default()));
        walk(&mut keys);
        if let Walk::Describe(described) = keys.walk { described } else { Described::default() }
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
            Walk::Write(_) | Walk::Describe(_) => None,
        }
    }

    /// Whether values are read.
    pub fn is_reading(&self) -> bool {
        self.section().is_some()
    }

    /// Refuses keys of a file that belong to another word, with a reason.
    pub fn misplace(&self, keys: &[&'static str], reason: &str) {
        self.section().into_iter().for_each(|section| section.misplace(keys, reason));
    }

    /// Refuses an option for which there is no place.
    pub fn refuse(&self, name: &str, title: &str, expected: &str) {
        if let Walk::Set(options) = &self.walk
            && let Some(written) = options.of(name)
        {
            options.report.refuse::<()>(&written.name.at, title, expected);
        }
    }

    /// Adds to a plan what no file has.
    pub fn write(&mut self, name: &str, value: impl Into<Value>) {
        if let Walk::Write(plan) = &mut self.walk {
            plan.insert(name.to_owned(), value.into());
        }
    }

    /// A key with its value: a wrong or missing one is reported, and leaves the value as it is.
    pub fn key<T: Serialize + DeserializeOwned>(
        &mut self,
        key: Key,
        kind: &Kind<'_>,
        value: &mut T,
    ) -> Field<()> {
        let (place, was) = (format!("{}{}", self.places, key.name), json!(value));
        // What is not there is not written, and no default.
        let is_there = ![json!(null), json!([]), json!("")].contains(&was);
        let found = match &mut self.walk {
            Walk::Read(section) if self.is_loose && section.is_known(key.name) => Field::Absent,
            Walk::Read(section) => {
                let needed = key.needed.filter(|_| !self.is_loose);
                section.expect(kind.read(section, key.name, &place), key.name, needed)
            }
            Walk::Set(options) => match options.of(key.name).filter(|_| key.is_set) {
                Some(written) => options.value(written, kind, &was),
                None => Field::Absent,
            },
            Walk::Write(plan) => {
                plan.extend(is_there.then(|| (key.name.to_owned(), was)));
                Field::Absent
            }
            Walk::Describe(described) => {
                let mut schema = kind.schema();
                if is_there && key.needed.is_none() {
                    schema["default"] = was;
                }
                described.add(&key, schema);
                Field::Absent
            }
        };
        found.then(|Located { value: found, at }| {
            *value = serde_json::from_value(found).ok()?;
            self.report()?.put(place, at.clone());
            Some(Located { value: (), at })
        })
    }

    /// A key with one of these things, by their names.
    pub fn word<T: Copy>(
        &mut self,
        key: Key,
        all: &[T],
        name: fn(T) -> &'static str,
        value: &mut T,
    ) -> Field<()> {
        let names: Vec<&str> = all.iter().copied().map(name).collect();
        let mut word = name(*value).to_owned();
        let found = self.key(key, &Kind::Word(&names), &mut word);
        all.iter().filter(|one| name(**one) == word).for_each(|one| *value = *one);
        found
    }

    /// A key with some of these things, by their names; messages call them so.
    pub fn words<T: Copy>(
        &mut self,
        key: Key,
        what: &'static str,
        all: &[T],
        name: fn(T) -> &'static str,
        value: &mut Vec<T>,
    ) -> Field<()> {
        let names: Vec<&str> = all.iter().copied().map(name).collect();
        let mut words: Vec<String> = value.iter().map(|one| name(*one).to_owned()).collect();
        let found = self.key(key, &Kind::Words(what, &names), &mut words);
        let of = |word: &String| all.iter().copied().find(|one| name(*one) == word);
        *value = words.iter().filter_map(of).collect();
        found
    }

    /// A table under a key.
    pub fn table(&mut self, key: Key, walk: impl FnOnce(&mut Keys<'a>)) -> Field<()> {
        let (mut at, name) = (None, key.name);
        let inner = match &self.walk {
            Walk::Read(root) => {
                let title = format!("[{name}]");
                let field = root.table(name, &title);
                let needed = key.needed.as_ref().map(|_| format!("a section {title}"));
                match root.expect(field, name, needed) {
                    Field::Absent => return Field::Absent,
                    Field::Bad => return Field::Bad,
                    Field::Given(section) => {
                        root.report.put(name, section.at.clone());
                        at = Some(section.at);
                        Walk::Read(section.value)
                    }
                }
            }
            Walk::Set(options) => Walk::Set(options),
            Walk::Write(_) => Walk::Write(Map::new()),
            Walk::Describe(_) => Walk::Describe(Described::default()),
        };
        let mut keys = Keys { walk: inner, places: format!("{name}."), is_loose: false };
        walk(&mut keys);
        match (keys.walk, &mut self.walk) {
            (Walk::Read(section), _) => section.finish(),
            (Walk::Write(inner), Walk::Write(plan)) if !inner.is_empty() => {
                plan.insert(name.to_owned(), inner.into());
            }
            (Walk::Describe(mut inner), Walk::Describe(described)) => {
                described.set.append(&mut inner.set);
                described.add(&key, inner.finish());
            }
            _ => {}
        }
        at.map_or(Field::Absent, |at| Field::Given(Located { value: (), at }))
    }

    /// An array of tables under a key: those that are read, or so many; `walk` goes over one by its
    /// position.
    pub fn tables(
        &mut self,
        key: Key,
        read: Vec<Section<'a>>,
        count: usize,
        mut walk: impl FnMut(&mut Keys<'a>, usize),
    ) {
        for (k, section) in read.into_iter().enumerate() {
            let mut keys = Keys::new(Walk::Read(section));
            walk(&mut keys, k);
            keys.finish();
        }
        match &mut self.walk {
            Walk::Write(plan) => {
                let one = |k| Value::from(Keys::written(|keys| walk(keys, k)));
                plan.insert(key.name.to_owned(), (0..count).map(one).collect());
            }
            Walk::Describe(described) => {
                let items = Keys::described(|keys| walk(keys, 0)).finish();
                let mut schema = json!({ "type": "array", "items": items });
                if key.needed.is_some() {
                    schema["minItems"] = 1.into();
                }
                described.add(&key, schema);
            }
            Walk::Read(_) | Walk::Set(_) => {}
        }
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
        key: Key,
        variants: &Variants,
        now: Option<usize>,
        mut walk: impl FnMut(&mut Self, usize),
    ) -> Option<usize> {
        if let Walk::Describe(outer) = &mut self.walk {
            for (k, (name, description)) in variants.all.iter().enumerate() {
                let mut word = Described::default();
                let key = Key { description: (*description).into(), ..key.clone() };
                let key = if variants.default == Some(k) { key } else { key.needed("") };
                word.add(&key, json!({ "const": name }));
                let mut keys = Keys::new(Walk::Describe(word));
                walk(&mut keys, k);
                let Walk::Describe(mut word) = keys.walk else { continue };
                outer.set.append(&mut word.set);
                outer.variants.push(word.finish());
            }
            return None;
        }
        let names: Vec<&str> = variants.all.iter().map(|(name, _)| *name).collect();
        let key = match (variants.default, &key.needed) {
            (None, None) => key.needed(listed(&names)),
            _ => key,
        };
        let settable = if let Walk::Set(_) = self.walk { variants.set } else { names.len() };
        let mut word = now.map(|now| names[now].to_owned());
        let found = self.key(key, &Kind::Word(&names[..settable]), &mut word);
        let word = names.iter().position(|name| word.as_deref() == Some(name));
        let chosen = match (self.is_reading(), found) {
            (true, Field::Absent) => variants.default,
            (true, Field::Bad) => None,
            _ => word,
        };
        match chosen {
            Some(chosen) => walk(self, chosen),
            None if self.is_reading() => {
                self.is_loose = true;
                (0..names.len()).for_each(|k| walk(self, k));
            }
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
