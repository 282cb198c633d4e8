//! Lists of words, each one of those that there are.

use serde_json::Value;

use super::{Diagnostic, Field, Located, Report, Section, unknown_word};

/// A list of some of these words, each once; an empty one is a mistake.
pub fn names(section: &Section<'_>, key: &'static str, what: &str, all: &[&str]) -> Field<Value> {
    section.texts(key).map(|list| {
        if list.value.is_empty() {
            let expected = format!("expected at least one of `{}`", all.join("`, `"));
            section.report.refuse::<()>(&list.at, format!("`{key}` is empty"), expected);
        }
        some_of(list.value, what, all, section.report).0.into()
    })
}

/// Those of `all` that are named, each once, and whether that is what every name says.
pub fn some_of<'t>(
    found: impl IntoIterator<Item = Located<&'t str>>,
    what: &str,
    all: &[&str],
    report: &Report,
) -> (Vec<&'t str>, bool) {
    let (mut chosen, mut is_sound): (Vec<Located<&str>>, _) = (Vec::new(), true);
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
                // Names of one argument have one place.
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
