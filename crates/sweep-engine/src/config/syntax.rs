//! From text to a TOML table, with every mistake of syntax the parser can recover from.

use std::io::ErrorKind;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, Error};

use super::source::read;
use super::{Diagnostic, Location, Report, SourceId, quoted};

/// The text of a file that is named in words, kept under its path; none where it cannot be read,
/// which is reported, with what to do where there is no such file.
pub fn text(
    path: &Path,
    what: &str,
    to_start: Option<&str>,
    report: &Report,
) -> Option<(String, SourceId)> {
    let shown = path.display();
    let error = match read(path) {
        Ok(text) => {
            let source = report.add(shown.to_string(), text.as_str());
            return Some((text, source));
        }
        Err(error) => error,
    };
    let is_missing = error.kind() == ErrorKind::NotFound;
    let refusal = Diagnostic::new(format!("cannot read the {what} file {shown}: {error}"));
    report.push(to_start.filter(|_| is_missing).into_iter().fold(refusal, Diagnostic::help));
    None
}

/// The table a text holds; what is not TOML is reported, what can be made out of the rest is
/// returned.
pub fn parse<'a>(text: &'a str, source: SourceId, report: &Report) -> Spanned<DeTable<'a>> {
    let (table, mut errors) = DeTable::parse_recoverable(text);
    errors.sort_by_key(start);
    // An array that is never closed swallows what follows. Only its first mistake says something of
    // it.
    let unclosed = errors.iter().any(|error| error.message().starts_with("unclosed array"));
    let swallowed =
        errors.iter().position(|error| error.message().contains("array")).filter(|_| unclosed);
    if let Some(first) = swallowed {
        let at = Location::new(source, errors[first].span().unwrap_or(0..0));
        report.push_syntax(
            Diagnostic::new("an array is not closed").at(&at, "expected `,` or `]` before this"),
        );
        report.swallow(&at);
        errors.truncate(first);
    }
    for error in errors {
        report.push_syntax(describe(&error, text, source));
    }
    table
}

fn start(error: &Error) -> usize {
    error.span().map_or(0, |span| span.start)
}

fn describe(error: &Error, text: &str, source: SourceId) -> Diagnostic {
    let span = error.span().unwrap_or(0..0);
    let typed = text.get(span.clone()).unwrap_or_default();
    let at = Location::new(source, span);
    // The message says what was expected after its first comma, if anything.
    let (what, expected) = error.message().split_once(", ").unwrap_or((error.message(), ""));
    match what {
        "duplicate key" => Diagnostic::new(format!("the key {} is given twice", quoted(typed)))
            .at(&at, "expected each key once"),
        "string values must be quoted" => {
            let title = if typed.is_empty() {
                "a value is missing".to_owned()
            } else {
                format!("{} is no value", quoted(typed))
            };
            Diagnostic::new(title).at(&at, "expected a number, a string in quotes, or an array")
        }
        what => Diagnostic::new(what).at(&at, expected),
    }
}
