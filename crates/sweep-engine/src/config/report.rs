//! Mistakes as they are found: collected, not thrown, so that one pass shows them all.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::render;
use super::source::{Location, SourceId, Sources};
use crate::nearest::nearest;

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

/// Texts read and mistakes found so far.
#[derive(Debug, Default)]
pub struct Report {
    /// Texts read so far.
    pub sources: Sources,
    found: Vec<Diagnostic>,
    beyond: usize,
    /// Lines that are not TOML: what recovery makes of them is not the user's mistake.
    broken: BTreeMap<SourceId, BTreeSet<usize>>,
    /// Where an array that is never closed begins to swallow the rest of its text.
    swallowed: BTreeMap<SourceId, usize>,
}

impl Report {
    /// Keeps a mistake, unless it is on a line whose syntax is already refused.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.push_with(|_| diagnostic);
    }

    /// As [`Report::push`], but a mistake beyond those kept is only counted: finding its line, or
    /// the nearest name, a million times over would take minutes.
    pub fn push_with(&mut self, diagnose: impl FnOnce(&Sources) -> Diagnostic) {
        if self.is_full() {
            self.beyond += 1;
            return;
        }
        let diagnostic = diagnose(&self.sources);
        let broken = diagnostic.places.first().is_some_and(|(at, _)| {
            let swallowed =
                self.swallowed.get(&at.source).is_some_and(|&from| at.span.start >= from);
            let broken = self.broken.get(&at.source);
            swallowed || broken.is_some_and(|lines| lines.contains(&self.sources.line(at).number))
        });
        if broken {
            return;
        }
        self.keep(diagnostic);
    }

    /// Keeps a mistake of syntax, the first of each line.
    pub fn push_syntax(&mut self, diagnostic: Diagnostic) {
        if self.is_full() {
            self.beyond += 1;
            return;
        }
        let first = diagnostic.places.first().is_none_or(|(at, _)| {
            let number = self.sources.line(at).number;
            self.broken.entry(at.source).or_default().insert(number)
        });
        if first {
            self.keep(diagnostic);
        }
    }

    /// Takes what follows a place for the inside of an array that is never closed.
    pub fn swallow(&mut self, from: &Location) {
        self.swallowed.insert(from.source, from.span.start);
    }

    /// Keeps the report of a missing key, unless broken syntax may have swallowed it.
    pub fn push_missing(&mut self, diagnostic: Diagnostic) {
        if !diagnostic.places.iter().any(|(at, _)| self.broken.contains_key(&at.source)) {
            self.keep(diagnostic);
        }
    }

    fn keep(&mut self, diagnostic: Diagnostic) {
        if self.is_full() {
            self.beyond += 1;
        } else {
            self.found.push(diagnostic);
        }
    }

    /// Whether further mistakes would only be counted.
    pub fn is_full(&self) -> bool {
        self.found.len() >= KEPT
    }

    /// Whether nothing is wrong so far.
    pub fn is_clean(&self) -> bool {
        self.found.is_empty()
    }

    /// The value if nothing is wrong.
    pub fn finish<T>(self, value: T) -> Result<T, Diagnostics> {
        if self.is_clean() { Ok(value) } else { Err(self.into_diagnostics()) }
    }

    /// Everything that was found.
    pub fn into_diagnostics(mut self) -> Diagnostics {
        self.found.sort_by_key(|d| d.places.first().map(|(at, _)| (at.source, at.span.start)));
        Diagnostics { sources: self.sources, found: self.found, beyond: self.beyond }
    }
}

/// Everything wrong with a grid file, its machine file and the command line's constants.
///
/// `Display` shows each mistake with file, line and column, the text pointed at, what was expected
/// and the nearest valid name, without colour; [`Diagnostics::styled`] the same with colour.
#[derive(Debug)]
pub struct Diagnostics {
    sources: Sources,
    found: Vec<Diagnostic>,
    beyond: usize,
}

impl Diagnostics {
    /// How many mistakes, at least 1.
    #[must_use]
    pub fn count(&self) -> usize {
        self.found.len() + self.beyond
    }

    /// Each mistake that is kept, in the order of the text.
    #[must_use]
    pub fn mistakes(&self) -> Vec<Mistake> {
        self.found.iter().map(|diagnostic| Mistake::of(diagnostic, &self.sources)).collect()
    }

    /// The whole text with terminal colours.
    #[must_use]
    pub fn styled(&self) -> String {
        self.text(true)
    }

    fn text(&self, colour: bool) -> String {
        let mut text = String::new();
        for diagnostic in &self.found {
            text.push_str(&render::diagnostic(diagnostic, &self.sources, colour));
            text.push_str("\n\n");
        }
        text.push_str(&render::summary(self.count(), self.beyond, colour));
        text
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

impl Mistake {
    fn of(diagnostic: &Diagnostic, sources: &Sources) -> Self {
        let place = diagnostic.places.first();
        let line = place.map(|(at, _)| sources.line(at));
        Self {
            file: place.map(|(at, _)| sources.name(at.source).to_owned()),
            line: line.as_ref().map(|line| line.number),
            column: line.map(|line| line.text[..line.span.start].chars().count() + 1),
            message: diagnostic.title.clone(),
            expected: place.map(|(_, expected)| expected.clone()),
            hints: diagnostic.help.clone(),
        }
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(false))
    }
}

impl std::error::Error for Diagnostics {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_beyond_what_is_kept_are_counted() {
        let mut report = Report::default();
        for _ in 0..1000 {
            report.push(Diagnostic::new("wrong"));
        }
        let diagnostics = report.into_diagnostics();
        assert_eq!((diagnostics.count(), diagnostics.found.len()), (1000, KEPT));
        assert!(diagnostics.to_string().contains("1000 mistakes"));
    }
}
