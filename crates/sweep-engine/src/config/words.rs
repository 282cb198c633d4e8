//! Lists of words, each one of those that there are.

use super::{Diagnostic, Located, Report, Section, unknown_word};

/// A list of some of `all`, each once, by their names; an empty one is a mistake.
pub fn names<T: Copy + PartialEq>(
    section: &Section<'_>,
    key: &'static str,
    what: &str,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Option<Vec<T>> {
    let list = section.texts(key).given()?;
    if list.value.is_empty() {
        let known: Vec<&str> = all.iter().copied().map(name).collect();
        let expected = format!("expected at least one of `{}`", known.join("`, `"));
        section.report.push(Diagnostic::new(format!("`{key}` is empty")).at(&list.at, expected));
    }
    Some(some_of(list.value, what, all, name, section.report).0)
}

/// Those of `all` that are named, each once, and whether that is what every name says.
pub fn some_of<'t, T: Copy + PartialEq>(
    found: impl IntoIterator<Item = Located<&'t str>>,
    what: &str,
    all: &[T],
    name: fn(T) -> &'static str,
    report: &Report,
) -> (Vec<T>, bool) {
    let known: Vec<&str> = all.iter().copied().map(name).collect();
    let (mut chosen, mut is_sound): (Vec<Located<T>>, _) = (Vec::new(), true);
    for found in found {
        let one = all.iter().find(|one| name(**one) == found.value);
        let first = chosen.iter().find(|other| Some(&other.value) == one);
        is_sound &= one.is_some() && first.is_none();
        match (one, first) {
            (None, _) => report.push_with(|_| unknown_word(what, &found, &known)),
            (Some(_), Some(first)) => {
                let title = format!("the {what} \"{}\" is given twice", found.value);
                let refusal =
                    Diagnostic::new(title).at(&found.at, format!("expected each {what} once"));
                // Names of one argument have one place.
                report.push(match first.at == found.at {
                    true => refusal,
                    false => refusal.at(&first.at, "first given here"),
                });
            }
            (Some(&value), None) => chosen.push(Located { value, at: found.at }),
        }
    }
    (chosen.into_iter().map(|one| one.value).collect(), is_sound)
}
