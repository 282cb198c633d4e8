//! Arguments NAME=VALUE of the command line.

use std::ops::RangeInclusive;

use sweep_parameter::Range;

use super::section::check_number;
use super::words::some_of;
use super::{Located, Location, Report, quoted, short, unknown_word};

/// One argument NAME=VALUE, taken apart.
pub struct Written<'a> {
    /// What is set.
    pub name: Located<&'a str>,
    /// To what.
    pub value: Located<&'a str>,
    /// Takes what is wrong.
    pub report: &'a Report,
}

impl<'a> Written<'a> {
    /// Takes an option's argument apart.
    pub fn read(option: &str, argument: &'a str, report: &'a Report) -> Option<Self> {
        let source = report.add(option, argument);
        let located =
            |value: &'a str, span| Located { value: value.trim(), at: Location::new(source, span) };
        match argument.split_once('=') {
            Some((name, value)) => {
                let equals = name.len();
                let name = located(name, 0..equals);
                Some(Self { name, value: located(value, equals + 1..argument.len()), report })
            }
            None => {
                let title = format!("`{}` is not a constant", short(argument));
                let whole = Location::new(source, 0..argument.len());
                report.refuse(&whole, title, "expected NAME=VALUE")
            }
        }
    }

    /// The number, in a range.
    pub fn number(&self, range: Range) -> Option<Located<f64>> {
        let at = self.value.at.clone();
        match self.value.value.parse() {
            Ok(number) => check_number(&quoted(self.name.value), number, at, range, self.report),
            Err(_) => {
                let title = format!("`{}` is not a number", short(self.value.value));
                self.report.refuse(&at, title, format!("expected {range}"))
            }
        }
    }

    /// A whole number within bounds.
    pub fn whole(&self, bounds: &RangeInclusive<u64>) -> Option<u64> {
        let number = self.value.value.parse().ok();
        number.filter(|number| bounds.contains(number)).or_else(|| {
            let title = format!("`{}` is no such number", short(self.value.value));
            let (least, most) = (bounds.start(), bounds.end());
            let expected = format!("expected a whole number from {least} to {most}");
            self.report.refuse(&self.value.at, title, expected)
        })
    }

    /// One of a few words, by its place.
    pub fn choice(&self, choices: &[&str]) -> Option<usize> {
        let place = choices.iter().position(|choice| *choice == self.value.value);
        if place.is_none() {
            self.report.push_with(|_| unknown_word(self.name.value, &self.value, choices));
        }
        place
    }

    /// Words separated by commas, each once and at least one.
    pub fn list(&self, what: &str, all: &[&str]) -> Option<Vec<&'a str>> {
        let Located { value, at } = &self.value;
        let parts = value.split(',').map(|part| Located { value: part.trim(), at: at.clone() });
        let (chosen, is_sound) = some_of(parts, what, all, self.report);
        is_sound.then_some(chosen)
    }
}

/// What an argument NAME=VALUE names.
pub fn name_of(argument: &str) -> &str {
    argument.split('=').next().unwrap_or_default().trim()
}

/// A finite number of the command line.
///
/// # Errors
/// What it is not.
pub fn finite(text: &str) -> Result<f64, String> {
    text.trim()
        .parse::<f64>()
        .ok()
        .filter(|value| value.is_finite())
        .ok_or_else(|| format!("`{}` is not a finite number", text.trim()))
}
