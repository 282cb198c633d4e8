//! Parsing of conditions in the arguments of several subcommands.

use crate::config::{Diagnostic, Diagnostics, Location, Report};
use crate::exit::Error;
use sweep_results::{Condition, ResultTable};

/// Parses conditions on the columns of a file.
///
/// # Errors
/// Every mistake, with its position.
pub fn parse_conditions(
    option: &str,
    texts: &[String],
    table: &ResultTable,
) -> Result<Vec<Condition>, Diagnostics> {
    let report = Report::default();
    let parse_condition = |text: &String| match Condition::parse(text, table) {
        Ok(condition) => Some(condition),
        Err(mistake) => {
            let location = Location::new(report.add(option, text.as_str()), mistake.span.clone());
            report.push(Diagnostic::from_expression(mistake, &location));
            None
        }
    };
    let conditions = texts.iter().filter_map(parse_condition).collect();
    report.finish(Some(conditions))
}

/// Parses the condition of `--where`, which selects rows.
///
/// # Errors
/// Mistakes in the condition; [`Error::Refused`] for a condition with functions over all rows.
pub fn parse_filter(
    text: Option<&String>,
    table: &ResultTable,
) -> Result<Option<Condition>, Error> {
    let condition =
        parse_conditions("--where", text.map_or(&[], std::slice::from_ref), table)?.pop();
    if let Some(Condition { text, .. }) =
        condition.as_ref().filter(|condition| condition.has_aggregates())
    {
        let expectation =
            "an expression without count(), share(), min(), max(), mean() and quantile()";
        return Err(Error::option("--where", text, expectation));
    }
    Ok(condition)
}
