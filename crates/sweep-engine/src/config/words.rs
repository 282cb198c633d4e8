//! Lists of words from a set of known ones.

use serde_json::Value;

use super::{Diagnostic, Field, Located, Report, Section, unknown_word_mistake};

/// Reads a list of words of `known_words`, each once; an empty list is a mistake.
pub fn read_words(
    section: &Section<'_>,
    key: &'static str,
    noun: &str,
    known_words: &[&str],
) -> Field<Value> {
    section.texts(key).map(|list| {
        if list.value.is_empty() {
            let expectation = format!("expected at least one of `{}`", known_words.join("`, `"));
            section.report.refuse::<()>(&list.location, format!("`{key}` is empty"), expectation);
        }
        check_words(list.value, noun, known_words, section.report).0.into()
    })
}

/// Returns the words that are in `known_words`, each once, and whether all words were valid.
pub fn check_words<'t>(
    found: impl IntoIterator<Item = Located<&'t str>>,
    noun: &str,
    known_words: &[&str],
    report: &Report,
) -> (Vec<&'t str>, bool) {
    let mut valid_words: Vec<Located<&str>> = Vec::new();
    let mut are_all_valid = true;
    for found in found {
        let is_known = known_words.contains(&found.value);
        let first_occurrence = valid_words.iter().find(|other| other.value == found.value);
        are_all_valid &= is_known && first_occurrence.is_none();
        match first_occurrence {
            _ if !is_known => report.push_with(|_| unknown_word_mistake(noun, &found, known_words)),
            Some(first_occurrence) => {
                let title = format!("the {noun} \"{}\" is given twice", found.value);
                let refusal = Diagnostic::new(title)
                    .at_location(&found.location, format!("expected each {noun} once"));
                // Names of one argument share a location.
                report.push(match first_occurrence.location == found.location {
                    true => refusal,
                    false => refusal.at_location(&first_occurrence.location, "first given here"),
                });
            }
            None => valid_words.push(found),
        }
    }
    (valid_words.into_iter().map(|word| word.value).collect(), are_all_valid)
}
