//! The report of mistakes, which are collected so that one pass shows them all.

use std::cell::{Ref, RefCell};
use std::collections::{BTreeMap, BTreeSet};

use super::source::{Location, SourceId, Sources};
use crate::plan::ASSUMED_PREFIX;
use sweep_results::nearest_name;

/// Maximum number of mistakes that are kept; later ones are only counted. Basis: a wrong file must
/// not fill a terminal or the memory. Doubling it shows twice as many.
const MAX_MISTAKES: usize = 100;

/// A mistake.
#[derive(Debug)]
pub struct Diagnostic {
    /// The mistake in one line.
    pub title: String,
    /// The locations, each with the text that is expected at it. The first is the location of the
    /// mistake; the others explain the mistake.
    pub locations: Vec<(Location, String)>,
    /// The advice.
    pub help_texts: Vec<String>,
}

impl Diagnostic {
    /// Returns a mistake without locations.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), locations: Vec::new(), help_texts: Vec::new() }
    }

    /// Returns the mistake of an expression at this location.
    pub fn from_expression(mistake: sweep_results::ExpressionError, location: &Location) -> Self {
        let (typed, names) = mistake.candidates.unwrap_or_default();
        let names = names.iter().map(String::as_str);
        Self::new(mistake.title)
            .at_location(location, mistake.expected)
            .with_nearest_name(&typed, names)
    }

    /// Adds a location, with the text that is expected at it.
    pub fn at_location(mut self, location: &Location, expected: impl Into<String>) -> Self {
        self.locations.push((location.clone(), expected.into()));
        self
    }

    /// Adds advice.
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help_texts.push(help.into());
        self
    }

    /// Adds the nearest valid name, if one is near.
    pub fn with_nearest_name<'a>(
        self,
        typed: &str,
        valid: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        match nearest_name(typed, valid) {
            Some(name) => self.with_help(format!("did you mean `{name}`?")),
            None => self,
        }
    }
}

/// The texts that are read, the locations of their numbers, and the mistakes so far.
#[derive(Debug, Default)]
pub struct Report {
    sources: RefCell<Sources>,
    mistakes: RefCell<Mistakes>,
    /// The locations of numbers, for checks that are made later.
    locations: RefCell<BTreeMap<String, Location>>,
    /// The numbers that were rejected or missing, and are replaced by placeholders.
    invalid_keys: RefCell<BTreeSet<String>>,
    /// The rules of the numbers that a file leaves out, by parameter.
    default_rules: RefCell<BTreeMap<String, String>>,
    /// The notes for the user on how input was read.
    notes: RefCell<Vec<String>>,
}

#[derive(Debug, Default)]
struct Mistakes {
    /// The mistakes that are shown.
    kept_diagnostics: Vec<Diagnostic>,
    /// The number of further mistakes.
    omitted_count: usize,
    /// The lines that are not TOML. Other mistakes on them may come from the parser's recovery, so
    /// they are dropped.
    malformed_lines: BTreeMap<SourceId, BTreeSet<usize>>,
    /// The start of an array that is never closed, for each text.
    unclosed_arrays: BTreeMap<SourceId, usize>,
}

impl Mistakes {
    fn add_mistake(&mut self, diagnostic: Diagnostic) {
        if self.kept_diagnostics.len() >= MAX_MISTAKES {
            self.omitted_count += 1;
        } else {
            self.kept_diagnostics.push(diagnostic);
        }
    }
}

impl Report {
    /// Adds a text under the name that messages show.
    pub fn add(&self, name: impl Into<String>, text: impl Into<String>) -> SourceId {
        self.sources.borrow_mut().add(name, text)
    }

    /// Adds column names as a line of text under the name that messages show. Returns their
    /// locations.
    pub fn add_header(&self, name: &str, columns: &[&str]) -> (SourceId, Vec<Location>) {
        let source = self.add(name, columns.join(","));
        let mut next_start = 0;
        let column_location = |column: &&str| {
            let start = next_start;
            next_start += column.len() + 1;
            Location::new(source, start..start + column.len())
        };
        (source, columns.iter().map(column_location).collect())
    }

    /// Sets the text of a source that was added without one.
    pub fn set_text(&self, id: SourceId, text: String) {
        self.sources.borrow_mut().set_text(id, text);
    }

    /// Returns the texts that are read.
    pub(super) fn sources(&self) -> Ref<'_, Sources> {
        self.sources.borrow()
    }

    /// Records the location of a number by its key: a parameter's name, `time.end_s` and the like
    /// for other keys of the grid file, `spin.time_s[3]` for an entry of an array, `axis[0]` for an
    /// axis.
    pub fn record_location(&self, key: impl Into<String>, location: Location) {
        self.locations.borrow_mut().insert(key.into(), location);
    }

    /// Marks a number as rejected or missing, so that checks that depend on it are skipped.
    pub fn mark_invalid(&self, key: impl Into<String>) {
        self.invalid_keys.borrow_mut().insert(key.into());
    }

    /// Records the rule that gives a parameter its value if a file leaves it out.
    pub fn record_default_rule(&self, name: &str, rule: &str) {
        self.default_rules.borrow_mut().insert(name.to_owned(), format!("{ASSUMED_PREFIX}{rule}"));
    }

    /// Adds a note for the user.
    pub fn add_note(&self, note: impl Into<String>) {
        self.notes.borrow_mut().push(note.into());
    }

    /// Takes the notes.
    pub fn take_notes(&self) -> Vec<String> {
        self.notes.take()
    }

    /// Returns the location of a number, if it was written.
    pub fn location(&self, key: &str) -> Option<Location> {
        self.locations.borrow().get(key).cloned()
    }

    /// Returns the source of each parameter: the text that wrote it last, or the rule that gives it
    /// if no text writes it.
    pub fn parameter_sources(&self) -> BTreeMap<String, String> {
        let locations = self.locations.borrow();
        let sources = self.sources.borrow();
        let parameters = locations.iter().filter(|(key, _)| !key.contains(['.', '[']));
        let written_sources = parameters
            .map(|(key, location)| (key.clone(), sources.name(location.source).to_owned()));
        self.default_rules.borrow().clone().into_iter().chain(written_sources).collect()
    }

    /// Returns whether a number was rejected or missing.
    pub fn is_invalid(&self, key: &str) -> bool {
        self.invalid_keys.borrow().contains(key)
    }

    /// Adds a mistake, unless its line has a mistake of syntax.
    pub fn push(&self, diagnostic: Diagnostic) {
        self.push_with(|_| diagnostic);
    }

    /// Adds help to the last mistake that is shown, if there is one.
    pub fn add_help(&self, help: &str) {
        if let Some(last) = self.mistakes.borrow_mut().kept_diagnostics.last_mut() {
            last.help_texts.push(help.to_owned());
        }
    }

    /// Adds a mistake at one location, and returns `None` in place of the value.
    pub fn refuse<T>(
        &self,
        location: &Location,
        title: impl Into<String>,
        expected: impl Into<String>,
    ) -> Option<T> {
        self.push(Diagnostic::new(title).at_location(location, expected));
        None
    }

    /// Adds a mistake, which is created only if it will be shown: finding the line or the nearest
    /// name of a million mistakes would take minutes.
    pub fn push_with(&self, diagnose: impl FnOnce(&Sources) -> Diagnostic) {
        if self.is_full() {
            self.mistakes.borrow_mut().omitted_count += 1;
            return;
        }
        let sources = self.sources.borrow();
        let diagnostic = diagnose(&sources);
        let mut mistakes = self.mistakes.borrow_mut();
        let is_on_malformed_line = diagnostic.locations.first().is_some_and(|(location, _)| {
            let is_in_unclosed_array = mistakes
                .unclosed_arrays
                .get(&location.source)
                .is_some_and(|&start| location.span.start >= start);
            let lines = mistakes.malformed_lines.get(&location.source);
            is_in_unclosed_array
                || lines.is_some_and(|lines| lines.contains(&sources.line(location).number))
        });
        if !is_on_malformed_line {
            mistakes.add_mistake(diagnostic);
        }
    }

    /// Adds a mistake of syntax, the first of each line.
    pub fn push_syntax(&self, diagnostic: Diagnostic) {
        let mut mistakes = self.mistakes.borrow_mut();
        let is_first_of_line = mistakes.kept_diagnostics.len() >= MAX_MISTAKES
            || diagnostic.locations.first().is_none_or(|(location, _)| {
                let number = self.sources.borrow().line(location).number;
                mistakes.malformed_lines.entry(location.source).or_default().insert(number)
            });
        if is_first_of_line {
            mistakes.add_mistake(diagnostic);
        }
    }

    /// Marks the text from a location on as the inside of an array that is never closed.
    pub fn mark_unclosed_array(&self, from: &Location) {
        self.mistakes.borrow_mut().unclosed_arrays.insert(from.source, from.span.start);
    }

    /// Adds the mistake of a missing key, unless wrong syntax may hide it.
    pub fn push_missing(&self, diagnostic: Diagnostic) {
        let mut mistakes = self.mistakes.borrow_mut();
        if !diagnostic
            .locations
            .iter()
            .any(|(location, _)| mistakes.malformed_lines.contains_key(&location.source))
        {
            mistakes.add_mistake(diagnostic);
        }
    }

    /// Returns whether further mistakes are only counted.
    pub fn is_full(&self) -> bool {
        self.mistakes.borrow().kept_diagnostics.len() >= MAX_MISTAKES
    }

    /// Returns whether there are no mistakes so far.
    pub fn is_clean(&self) -> bool {
        self.mistakes.borrow().kept_diagnostics.is_empty()
    }

    /// Returns the value if there is one and there are no mistakes.
    pub fn finish<T>(self, value: Option<T>) -> Result<T, Diagnostics> {
        value.filter(|_| self.is_clean()).ok_or_else(|| self.into_diagnostics())
    }

    /// Returns all mistakes.
    pub fn into_diagnostics(self) -> Diagnostics {
        let Mistakes { kept_diagnostics: mut shown, omitted_count, .. } =
            self.mistakes.into_inner();
        shown.sort_by_key(|diagnostic| {
            diagnostic.locations.first().map(|(location, _)| (location.source, location.span.start))
        });
        Diagnostics { sources: self.sources.into_inner(), shown, omitted_count }
    }
}

/// All mistakes of a grid file, its model's file and the command line's constants.
///
/// `Display` shows each mistake with file, line and column, the text, the expectation and the
/// nearest valid name, without colour; [`Diagnostics::styled`] adds colour.
#[derive(Debug)]
pub struct Diagnostics {
    pub(super) sources: Sources,
    /// The mistakes that are shown.
    pub(super) shown: Vec<Diagnostic>,
    /// The number of further mistakes.
    pub(super) omitted_count: usize,
}

impl Diagnostics {
    /// Returns the number of mistakes, at least 1.
    pub fn count(&self) -> usize {
        self.shown.len() + self.omitted_count
    }

    /// Returns the mistakes that are kept, in the order of the text.
    pub fn mistakes(&self) -> Vec<Mistake> {
        let to_mistake = |Diagnostic { title, locations, help_texts: help }: &Diagnostic| {
            let main_location = locations.first();
            let line = main_location.map(|(location, _)| self.sources.line(location));
            Mistake {
                file: main_location
                    .map(|(location, _)| self.sources.name(location.source).to_owned()),
                line: line.as_ref().map(|line| line.number),
                column: line.map(|line| line.text[..line.span.start].chars().count() + 1),
                message: title.clone(),
                expected: main_location.map(|(_, expected)| expected.clone()),
                hints: help.clone(),
            }
        };
        self.shown.iter().map(to_mistake).collect()
    }
}

/// A mistake as data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The file, or the name of the option or text.
    pub file: Option<String>,
    /// The line, from 1.
    pub line: Option<usize>,
    /// The column in characters, from 1.
    pub column: Option<usize>,
    /// The mistake in one line.
    pub message: String,
    /// The expectation at the location.
    pub expected: Option<String>,
    /// The advice, a line each.
    pub hints: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_beyond_the_maximum_are_counted() {
        let report = Report::default();
        for _ in 0..1000 {
            report.push(Diagnostic::new("wrong"));
        }
        let diagnostics = report.into_diagnostics();
        assert_eq!((diagnostics.count(), diagnostics.shown.len()), (1000, MAX_MISTAKES));
        assert!(diagnostics.to_string().contains("1000 mistakes"));
    }
}
