//! Parsing of TOML with every mistake of syntax from which the parser can recover.

use std::io::ErrorKind;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, Error};

use super::source::read_text_file;
use super::{Diagnostic, Location, Report, SourceId, quote};

/// Reads the text of a file and adds it to the report. A file that cannot be read is reported:
/// `kind` is its kind in words, and `start_advice` the advice if it does not exist.
pub fn read_text(
    path: &Path,
    kind: &str,
    start_advice: Option<&str>,
    report: &Report,
) -> Option<(String, SourceId)> {
    let path_text = path.display();
    let error = match read_text_file(path) {
        Ok(text) => {
            let source = report.add(path_text.to_string(), text.as_str());
            return Some((text, source));
        }
        Err(error) => error,
    };
    let is_missing = error.kind() == ErrorKind::NotFound;
    let refusal = Diagnostic::new(format!("cannot read the {kind} file {path_text}: {error}"));
    report
        .push(start_advice.filter(|_| is_missing).into_iter().fold(refusal, Diagnostic::with_help));
    None
}

/// Parses a text as TOML. Mistakes of syntax are reported, and the rest of the table is returned.
pub fn parse_toml<'a>(text: &'a str, source: SourceId, report: &Report) -> Spanned<DeTable<'a>> {
    let (table, mut errors) = DeTable::parse_recoverable(text);
    errors.sort_by_key(error_start);
    // The text after an array that is never closed gives many mistakes, of which only the first is
    // meaningful.
    let has_unclosed_array =
        errors.iter().any(|error| error.message().starts_with("unclosed array"));
    let unclosed_index = errors
        .iter()
        .position(|error| error.message().contains("array"))
        .filter(|_| has_unclosed_array);
    if let Some(first) = unclosed_index {
        let location = Location::new(source, errors[first].span().unwrap_or(0..0));
        report.push_syntax(
            Diagnostic::new("an array is not closed")
                .at_location(&location, "expected `,` or `]` before this"),
        );
        report.mark_unclosed_array(&location);
        errors.truncate(first);
    }
    for error in errors {
        report.push_syntax(describe_error(&error, text, source));
    }
    table
}

fn error_start(error: &Error) -> usize {
    error.span().map_or(0, |span| span.start)
}

fn describe_error(error: &Error, text: &str, source: SourceId) -> Diagnostic {
    let span = error.span().unwrap_or(0..0);
    let wrong_text = text.get(span.clone()).unwrap_or_default();
    let location = Location::new(source, span);
    // If the parser states an expectation, it follows the first comma of the message.
    let (message, expected) = error.message().split_once(", ").unwrap_or((error.message(), ""));
    match message {
        "duplicate key" => Diagnostic::new(format!("the key {} is given twice", quote(wrong_text)))
            .at_location(&location, "expected each key once"),
        "string values must be quoted" => {
            let title = if wrong_text.is_empty() {
                "a value is missing".to_owned()
            } else {
                format!("{} is no value", quote(wrong_text))
            };
            Diagnostic::new(title)
                .at_location(&location, "expected a number, a string in quotes, or an array")
        }
        message => Diagnostic::new(message).at_location(&location, expected),
    }
}
