//! Lists of words from a set of known ones.

use serde_json::Value;

use super::{Diagnostic, Field, Located, Report, Section, unknown_word};

/// Reads a list of words of `all`, each once; an empty list is a mistake.
pub fn names(section: &Section<'_>, key: &'static str, what: &str, all: &[&str]) -> Field<Value> {
    section.texts(key).map(|list| {
        if list.value.is_empty() {
            let expected = format!("expected at least one of `{}`", all.join("`, `"));
            section.report.refuse::<()>(&list.at, format!("`{key}` is empty"), expected);
        }
        known_words(list.value, what, all, section.report).0.into()
    })
}

/// Returns the words that are in `all`, each once, and whether all words were valid.
pub fn known_words<'t>(
    found: impl IntoIterator<Item = Located<&'t str>>,
    what: &str,
    all: &[&str],
    report: &Report,
) -> (Vec<&'t str>, bool) {
    let mut chosen: Vec<Located<&str>> = Vec::new();
    let mut is_sound = true;
    for found in found {
        let is_known = all.contains(&found.value);
        let first = chosen.iter().find(|other| other.value == found.value);
        is_sound &= is_known && first.is_none();
        match first {
            _ if !is_known => report.push_with(|_| unknown_word(what, &found, all)),
            Some(first) => {
                let title = format!("the {what} \"{}\" is given twice", found.value);
                let refusal =
                    Diagnostic::new(title).at(&found.at, format!("expected each {what} once"));
                // Names of one argument share a location.
                report.push(match first.at == found.at {
                    true => refusal,
                    false => refusal.at(&first.at, "first given here"),
                });
            }
            None => chosen.push(found),
        }
    }
    (chosen.into_iter().map(|one| one.value).collect(), is_sound)
}
