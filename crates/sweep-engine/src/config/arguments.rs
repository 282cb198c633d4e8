//! Arguments NAME=VALUE of the command line.

use std::ops::RangeInclusive;

use sweep_parameter::Range;

use super::section::check_number;
use super::words::check_words;
use super::{Located, Location, Report, quote, shorten, unknown_word_mistake};

/// An argument NAME=VALUE, split into its parts.
pub struct NamedArgument<'a> {
    /// The name with its location.
    pub name: Located<&'a str>,
    /// The value with its location.
    pub value: Located<&'a str>,
    /// The report of mistakes.
    pub report: &'a Report,
}

impl<'a> NamedArgument<'a> {
    /// Splits an option's argument.
    pub fn read(option: &str, argument: &'a str, report: &'a Report) -> Option<Self> {
        let source = report.add(option, argument);
        let locate = |value: &'a str, span| Located {
            value: value.trim(),
            location: Location::new(source, span),
        };
        match argument.split_once('=') {
            Some((name, value)) => {
                let equals_index = name.len();
                let name = locate(name, 0..equals_index);
                Some(Self { name, value: locate(value, equals_index + 1..argument.len()), report })
            }
            None => {
                let title = format!("`{}` is not a constant", shorten(argument));
                let whole_argument = Location::new(source, 0..argument.len());
                report.refuse(&whole_argument, title, "expected NAME=VALUE")
            }
        }
    }

    /// Parses the number, in a range.
    pub fn number(&self, range: Range) -> Option<Located<f64>> {
        let location = self.value.location.clone();
        match self.value.value.parse() {
            Ok(number) => {
                check_number(&quote(self.name.value), number, location, range, self.report)
            }
            Err(_) => {
                let title = format!("`{}` is not a number", shorten(self.value.value));
                self.report.refuse(&location, title, format!("expected {range}"))
            }
        }
    }

    /// Parses a whole number within bounds.
    pub fn whole_number(&self, bounds: &RangeInclusive<u64>) -> Option<u64> {
        let number = self.value.value.parse().ok();
        number.filter(|number| bounds.contains(number)).or_else(|| {
            let title = format!("`{}` is not a valid number", shorten(self.value.value));
            let least = bounds.start();
            let greatest = bounds.end();
            let expectation = format!("expected a whole number from {least} to {greatest}");
            self.report.refuse(&self.value.location, title, expectation)
        })
    }

    /// Parses a word, as its index in `choices`.
    pub fn choice(&self, choices: &[&str]) -> Option<usize> {
        let index = choices.iter().position(|choice| *choice == self.value.value);
        if index.is_none() {
            self.report.push_with(|_| unknown_word_mistake(self.name.value, &self.value, choices));
        }
        index
    }

    /// Parses words separated by commas, each once and at least one.
    pub fn list(&self, noun: &str, all: &[&str]) -> Option<Vec<&'a str>> {
        let Located { value, location } = &self.value;
        let words =
            value.split(',').map(|part| Located { value: part.trim(), location: location.clone() });
        let (valid_words, are_all_valid) = check_words(words, noun, all, self.report);
        are_all_valid.then_some(valid_words)
    }
}

/// Returns the name of an argument NAME=VALUE.
pub fn argument_name(argument: &str) -> &str {
    argument.split('=').next().unwrap_or_default().trim()
}

/// Parses a finite number of the command line.
///
/// # Errors
/// The text of the message.
pub fn parse_finite(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|value| value.is_finite())
        .ok_or_else(|| format!("`{}` is not a finite number", text.trim()))
}
