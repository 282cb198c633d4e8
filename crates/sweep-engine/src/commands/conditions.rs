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

/// The condition of `--where`, which chooses rows.
///
/// # Errors
/// Mistakes in it; [`Error::Option`] for one of the file as a whole.
pub fn of_rows(text: Option<&String>, table: &ResultTable) -> Result<Option<Condition>, Error> {
    let condition = parse("--where", text.map_or(&[], std::slice::from_ref), table)?.pop();
    if let Some(Condition { text, .. }) = condition.as_ref().filter(|one| one.has_folds()) {
        let expected = "an expression without count(), share(), min(), max() and mean()";
        return Err(Error::option("--where", text, expected));
    }
    Ok(condition)
}
