//! Conditions as several subcommands take them.

use crate::config::{self, Diagnostics};
use crate::exit::Error;
use sweep_results::{Condition, ResultTable};

/// Reads conditions over the columns of a file.
///
/// # Errors
/// Every mistake in them, pointed at.
pub fn parse(
    option: &str,
    texts: &[String],
    table: &ResultTable,
) -> Result<Vec<Condition>, Diagnostics> {
    let parsed: Vec<_> = texts.iter().map(|text| Condition::parse(text, table)).collect();
    if parsed.iter().all(Result::is_ok) {
        return Ok(parsed.into_iter().flatten().collect());
    }
    let wrong = texts.iter().zip(parsed);
    let mistakes = wrong.filter_map(|(text, parsed)| Some((text.as_str(), parsed.err()?)));
    Err(config::mistakes_in_expressions(option, mistakes))
}

/// Refuses conditions of the file as a whole where rows are chosen.
///
/// # Errors
/// [`Error::Option`].
pub fn rows_only(
    option: &'static str,
    conditions: Vec<Condition>,
) -> Result<Vec<Condition>, Error> {
    match conditions.iter().find(|condition| condition.has_folds()) {
        None => Ok(conditions),
        Some(condition) => {
            let expected = "an expression without count(), share(), min(), max() and mean()";
            Err(Error::option(option, &condition.text, expected))
        }
    }
}
