//! Mistakes as they are found: collected, not thrown, so that one pass shows them all.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use super::source::{Location, SourceId, Sources};
use crate::plan::ASSUMED;
use sweep_results::nearest;

/// More mistakes than this are counted but not kept: a wrong file should not fill a terminal or the
/// memory.
const KEPT: usize = 100;

/// One mistake.
#[derive(Debug)]
pub struct Diagnostic {
    /// What is wrong, in one line.
    pub title: String,
    /// Where, and what was expected there; the first is the place itself, the rest explain.
    pub places: Vec<(Location, String)>,
    /// What to do.
    pub help: Vec<String>,
}

impl Diagnostic {
    /// Nothing but what is wrong.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), places: Vec::new(), help: Vec::new() }
    }

    /// A mistake in an expression, at this place.
    pub fn of_expression(mistake: sweep_results::ExpressionError, at: &Location) -> Self {
        let (typed, names) = mistake.candidates.unwrap_or_default();
        let names = names.iter().map(String::as_str);
        Self::new(mistake.title).at(at, mistake.expected).nearest(&typed, names)
    }

    /// Adds a place, with what was expected there.
    pub fn at(mut self, at: &Location, expected: impl Into<String>) -> Self {
        self.places.push((at.clone(), expected.into()));
        self
    }

    /// Adds what to do.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help.push(help.into());
        self
    }

    /// Adds the nearest valid name, if any is near.
    pub fn nearest<'a>(self, typed: &str, valid: impl IntoIterator<Item = &'a str>) -> Self {
        match nearest(typed, valid) {
            Some(name) => self.help(format!("did you mean `{name}`?")),
            None => self,
        }
    }
}

/// Texts read, where their numbers stand, and mistakes found so far. All who read share it.
#[derive(Debug, Default)]
pub struct Report {
    sources: RefCell<Sources>,
    found: RefCell<Found>,
    /// Places of resolved numbers, so that a check made later can still point at them.
    places: RefCell<BTreeMap<String, Location>>,
    /// Numbers that were refused or missing: a stand-in holds their place.
    doubtful: RefCell<BTreeSet<String>>,
    /// The rules of numbers that a file leaves out, by their parameters' names.
    assumed: RefCell<BTreeMap<String, String>>,
    /// What is no mistake, but was read otherwise than it stands.
    notes: RefCell<Vec<String>>,
}

#[derive(Debug, Default)]
struct Found {
    found: Vec<Diagnostic>,
    beyond: usize,
    /// Lines that are not TOML: what recovery makes of them is not the user's mistake.
    broken: BTreeMap<SourceId, BTreeSet<usize>>,
    /// Where an array that is never closed begins to swallow the rest of its text.
    swallowed: BTreeMap<SourceId, usize>,
}

impl Found {
    fn keep(&mut self, diagnostic: Diagnostic) {
        if self.found.len() >= KEPT {
            self.beyond += 1;
        } else {
            self.found.push(diagnostic);
        }
    }
}

impl Report {
    /// Keeps a text under the name that messages show.
    pub fn add(&self, name: impl Into<String>, text: impl Into<String>) -> SourceId {
        self.sources.borrow_mut().add(name, text)
    }

    /// Keeps names of columns as a line under the name that messages show; the place of each.
    pub fn header(&self, name: &str, columns: &[&str]) -> (SourceId, Vec<Location>) {
        let (source, mut next) = (self.add(name, columns.join(",")), 0);
        let place = |column: &&str| {
            let start = next;
            next += column.len() + 1;
            Location::new(source, start..start + column.len())
        };
        (source, columns.iter().map(place).collect())
    }

    /// Puts in the text of a source that was kept under its name alone.
    pub fn fill(&self, id: SourceId, text: String) {
        self.sources.borrow_mut().fill(id, text);
    }

    /// Keeps the place of a number by its key: a parameter's name, `time.end_s` and the like for
    /// the rest of the grid file, `spin.time_s[3]` for an entry of an array, `axis[0]` for an axis.
    pub fn put(&self, key: impl Into<String>, at: Location) {
        self.places.borrow_mut().insert(key.into(), at);
    }

    /// Marks a number that was refused or missing: what depends on it is not judged.
    pub fn doubt(&self, key: impl Into<String>) {
        self.doubtful.borrow_mut().insert(key.into());
    }

    /// Keeps the rule by which a number has its value that a file leaves out.
    pub fn assume(&self, name: &str, rule: &str) {
        self.assumed.borrow_mut().insert(name.to_owned(), format!("{ASSUMED}{rule}"));
    }

    /// Keeps what a user should know of what was read, a line.
    pub fn note(&self, note: impl Into<String>) {
        self.notes.borrow_mut().push(note.into());
    }

    /// Takes the notes that were kept.
    pub fn take_notes(&self) -> Vec<String> {
        self.notes.take()
    }

    /// The place of a number, if it was written.
    pub fn place(&self, key: &str) -> Option<Location> {
        self.places.borrow().get(key).cloned()
    }

    /// Returns the text in which each parameter that was written stands last, and the rule of each
    /// that was left out.
    pub fn written(&self) -> BTreeMap<String, String> {
        let (places, sources) = (self.places.borrow(), self.sources.borrow());
        let parameters = places.iter().filter(|(key, _)| !key.contains(['.', '[']));
        let written = parameters.map(|(key, at)| (key.clone(), sources.name(at.source).to_owned()));
        self.assumed.borrow().clone().into_iter().chain(written).collect()
    }

    /// Whether it was refused or missing.
    pub fn is_doubtful(&self, key: &str) -> bool {
        self.doubtful.borrow().contains(key)
    }

    /// Keeps a mistake, unless it is on a line whose syntax is already refused.
    pub fn push(&self, diagnostic: Diagnostic) {
        self.push_with(|_| diagnostic);
    }

    /// Adds help to the mistake that was kept last, if there is one.
    pub fn add_help(&self, help: &str) {
        if let Some(last) = self.found.borrow_mut().found.last_mut() {
            last.help.push(help.to_owned());
        }
    }

    /// Keeps a mistake at one place: what is wrong, and what was expected there. There is no value.
    pub fn refuse<T>(
        &self,
        at: &Location,
        title: impl Into<String>,
        expected: impl Into<String>,
    ) -> Option<T> {
        self.push(Diagnostic::new(title).at(at, expected));
        None
    }

    /// As [`Report::push`], but a mistake beyond those kept is only counted: finding its line, or
    /// the nearest name, a million times over would take minutes.
    pub fn push_with(&self, diagnose: impl FnOnce(&Sources) -> Diagnostic) {
        if self.is_full() {
            self.found.borrow_mut().beyond += 1;
            return;
        }
        let sources = self.sources.borrow();
        let diagnostic = diagnose(&sources);
        let mut found = self.found.borrow_mut();
        let broken = diagnostic.places.first().is_some_and(|(at, _)| {
            let swallowed = found.swallowed.get(&at.source).is_some_and(|&f| at.span.start >= f);
            let broken = found.broken.get(&at.source);
            swallowed || broken.is_some_and(|lines| lines.contains(&sources.line(at).number))
        });
        if !broken {
            found.keep(diagnostic);
        }
    }

    /// Keeps a mistake of syntax, the first of each line.
    pub fn push_syntax(&self, diagnostic: Diagnostic) {
        let mut found = self.found.borrow_mut();
        let first = found.found.len() >= KEPT
            || diagnostic.places.first().is_none_or(|(at, _)| {
                let number = self.sources.borrow().line(at).number;
                found.broken.entry(at.source).or_default().insert(number)
            });
        if first {
            found.keep(diagnostic);
        }
    }

    /// Takes what follows a place for the inside of an array that is never closed.
    pub fn swallow(&self, from: &Location) {
        self.found.borrow_mut().swallowed.insert(from.source, from.span.start);
    }

    /// Keeps the report of a missing key, unless broken syntax may have swallowed it.
    pub fn push_missing(&self, diagnostic: Diagnostic) {
        let mut found = self.found.borrow_mut();
        if !diagnostic.places.iter().any(|(at, _)| found.broken.contains_key(&at.source)) {
            found.keep(diagnostic);
        }
    }

    /// Whether further mistakes would only be counted.
    pub fn is_full(&self) -> bool {
        self.found.borrow().found.len() >= KEPT
    }

    /// Whether nothing is wrong so far.
    pub fn is_clean(&self) -> bool {
        self.found.borrow().found.is_empty()
    }

    /// The value if there is one and nothing is wrong.
    pub fn finish<T>(self, value: Option<T>) -> Result<T, Diagnostics> {
        value.filter(|_| self.is_clean()).ok_or_else(|| self.into_diagnostics())
    }

    /// Everything that was found.
    pub fn into_diagnostics(self) -> Diagnostics {
        let Found { mut found, beyond, .. } = self.found.into_inner();
        found.sort_by_key(|d| d.places.first().map(|(at, _)| (at.source, at.span.start)));
        Diagnostics { sources: self.sources.into_inner(), found, beyond }
    }
}

/// Everything wrong with a grid file, its machine file and the command line's constants.
///
/// `Display` shows each mistake with file, line and column, the text pointed at, what was expected
/// and the nearest valid name, without colour; [`Diagnostics::styled`] the same with colour.
#[derive(Debug)]
pub struct Diagnostics {
    pub(super) sources: Sources,
    pub(super) found: Vec<Diagnostic>,
    pub(super) beyond: usize,
}

impl Diagnostics {
    /// How many mistakes, at least 1.
    pub fn count(&self) -> usize {
        self.found.len() + self.beyond
    }

    /// Each mistake that is kept, in the order of the text.
    pub fn mistakes(&self) -> Vec<Mistake> {
        let mistake = |Diagnostic { title, places, help }: &Diagnostic| {
            let place = places.first();
            let line = place.map(|(at, _)| self.sources.line(at));
            Mistake {
                file: place.map(|(at, _)| self.sources.name(at.source).to_owned()),
                line: line.as_ref().map(|line| line.number),
                column: line.map(|line| line.text[..line.span.start].chars().count() + 1),
                message: title.clone(),
                expected: place.map(|(_, expected)| expected.clone()),
                hints: help.clone(),
            }
        };
        self.found.iter().map(mistake).collect()
    }
}

/// One mistake as data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The file that it is in, or the name of the option or text.
    pub file: Option<String>,
    /// From 1.
    pub line: Option<usize>,
    /// From 1, in characters.
    pub column: Option<usize>,
    /// What is wrong, in one line.
    pub message: String,
    /// What was expected at that place.
    pub expected: Option<String>,
    /// What to do, a line each.
    pub hints: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_beyond_what_is_kept_are_counted() {
        let report = Report::default();
        for _ in 0..1000 {
            report.push(Diagnostic::new("wrong"));
        }
        let diagnostics = report.into_diagnostics();
        assert_eq!((diagnostics.count(), diagnostics.found.len()), (1000, KEPT));
        assert!(diagnostics.to_string().contains("1000 mistakes"));
    }
}
