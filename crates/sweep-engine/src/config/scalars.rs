//! `--set` of the grid file's own scalars. They are not parameters: they are the same at every
//! point, and no axis sweeps them.

use serde_json::{Value, json};
use sweep_parameter::{Channel, Range, decimal};

use super::Read;
use super::axes::MOST_POINTS;
use super::design::{MOST_SEED, MOST_SOBOL};
use super::grid::{Draft, LONGEST_S};
use super::report::{Diagnostic, Report};
use super::section::{check_number, quoted, short, unknown_word};
use super::source::{Located, Location};
use crate::design::Design;
use crate::method::{Integrator, settings};

/// Those that stand outside of `[integrator]`.
const OWN: [&str; 6] = ["end_s", "ratio_limit", "channels", "method", "points", "seed"];

/// Every name.
pub fn names<M: Read>() -> impl Iterator<Item = &'static str> {
    let settings = settings::<M::Integrator>().into_iter().map(|(setting, _)| setting.key);
    OWN.into_iter().chain(M::scalars().iter().copied()).chain(settings)
}

/// Whether an argument `NAME=VALUE` is about one of them.
pub fn is_one<M: Read>(argument: &str) -> bool {
    let name = argument.split('=').next().unwrap_or_default().trim();
    argument.contains('=') && names::<M>().any(|known| known == name)
}

/// One argument, taken apart.
pub struct Written<'a> {
    /// What is set.
    pub name: Located<&'a str>,
    /// To what.
    pub value: Located<&'a str>,
}

impl Written<'_> {
    /// The number, in a range.
    pub fn number(&self, range: Range, report: &mut Report) -> Option<f64> {
        let at = self.value.at.clone();
        match self.value.value.parse() {
            Ok(number) => check_number(&quoted(self.name.value), number, at, range, report)
                .map(|number| number.value),
            Err(_) => {
                let title = format!("`{}` is not a number", short(self.value.value));
                report.push(Diagnostic::new(title).at(&at, format!("expected {range}")));
                None
            }
        }
    }

    /// A whole number within bounds.
    pub fn whole(&self, least: u64, most: u64, report: &mut Report) -> Option<u64> {
        let number = self.value.value.parse::<u64>().ok();
        let number = number.filter(|number| (least..=most).contains(number));
        if number.is_none() {
            let title = format!("`{}` is no such number", short(self.value.value));
            let expected = format!("expected a whole number from {least} to {most}");
            report.push(Diagnostic::new(title).at(&self.value.at, expected));
        }
        number
    }

    /// One of a few words, by its place.
    pub fn choice(&self, choices: &[&str], report: &mut Report) -> Option<usize> {
        let place = choices.iter().position(|choice| *choice == self.value.value);
        if place.is_none() {
            report.push_with(|_| unknown_word(self.name.value, &self.value, choices));
        }
        place
    }
}

impl Written<'_> {
    /// Names separated by commas, each once and at least one.
    pub fn list<T: Copy + PartialEq>(
        &self,
        what: &str,
        all: &[T],
        name: fn(T) -> &'static str,
        report: &mut Report,
    ) -> Option<Vec<T>> {
        let known: Vec<&str> = all.iter().copied().map(name).collect();
        let Located { value: text, at } = &self.value;
        let mut chosen: Vec<T> = Vec::new();
        let mut is_sound = true;
        for part in text.split(',').map(str::trim) {
            let found = Located { value: part, at: at.clone() };
            let Some(&one) = all.iter().find(|one| name(**one) == part) else {
                report.push_with(|_| unknown_word(what, &found, &known));
                is_sound = false;
                continue;
            };
            if chosen.contains(&one) {
                let title = format!("the {what} \"{part}\" is given twice");
                let expected = format!("expected each {what} once");
                report.push(Diagnostic::new(title).at(at, expected));
                is_sound = false;
            }
            chosen.push(one);
        }
        is_sound.then_some(chosen)
    }
}

/// Puts the scalars among `sets` in place, over those of the grid file. The plan has its design
/// already.
pub fn apply<M: Read>(sets: &[String], draft: &mut Draft<M>, report: &mut Report) {
    let mut written: Vec<Written<'_>> = Vec::new();
    for argument in sets.iter().filter(|argument| is_one::<M>(argument)) {
        let Some((name, value)) = argument.split_once('=') else { continue };
        let source = report.sources.add("--set", argument.as_str());
        let at = Location::new(source, 0..name.len());
        let name = Located { value: name.trim(), at };
        let at = Location::new(source, argument.len() - value.len()..argument.len());
        let value = Located { value: value.trim(), at };
        if let Some(first) = written.iter().find(|known| known.name.value == name.value) {
            let title = format!("`{}` is given twice", name.value);
            let diagnostic = Diagnostic::new(title).at(&name.at, "expected each number once");
            report.push(diagnostic.at(&first.name.at, "first written here"));
            continue;
        }
        written.push(Written { name, value });
    }
    // The method first: it decides which settings there are.
    written.sort_by_key(|written| written.name.value != "method");
    for written in &written {
        let before = draft.plan.clone();
        if let Some(value) = put(written, draft, report)
            && draft.plan != before
        {
            draft.plan.set.push((written.name.value.to_owned(), value));
        }
    }
}

/// Puts one in place; its value as it stands in the plan.
fn put<M: Read>(written: &Written<'_>, draft: &mut Draft<M>, report: &mut Report) -> Option<Value> {
    if M::scalars().contains(&written.name.value) {
        return M::put(written, draft, report);
    }
    let plan = &mut draft.plan;
    Some(match written.name.value {
        "end_s" => {
            let end_s = written.number(Range::Positive, report)?;
            if end_s > LONGEST_S {
                let title = format!("`end_s` = {} is out of range", decimal(end_s));
                let expected = format!("expected at most {LONGEST_S:e} s");
                report.push(Diagnostic::new(title).at(&written.value.at, expected));
                return None;
            }
            // A window that was not written ends with the run.
            if draft.origins.get("window_to_s").is_none() {
                plan.window_s[1] = end_s;
            }
            plan.end_s = end_s;
            draft.origins.put("time.end_s".to_owned(), written.value.at.clone());
            json!(end_s)
        }
        "channels" => {
            let every = M::Channel::every();
            let channels = written.list("channel", every, M::Channel::name, report)?;
            plan.reliability.channels = channels;
            json!(written.value.value)
        }
        "ratio_limit" => {
            plan.reliability.ratio_limit = written.number(Range::Positive, report)?;
            json!(plan.reliability.ratio_limit)
        }
        "method" => {
            let names: Vec<_> = M::Integrator::methods().iter().map(|entry| entry.name).collect();
            let entry = &M::Integrator::methods()[written.choice(&names, report)?];
            let was = plan.integrator.to_json();
            // Settings that both methods have stay as they are.
            plan.integrator =
                (entry.with)(&mut |setting| was[setting.key].as_f64().unwrap_or(setting.default));
            draft.origins.put("integrator".to_owned(), written.value.at.clone());
            json!(entry.name)
        }
        "points" | "seed" => return design(written, draft, report),
        key => {
            let (setting, owners) =
                settings::<M::Integrator>().into_iter().find(|(setting, _)| setting.key == key)?;
            let was = plan.integrator.to_json();
            if !owners.contains(&plan.integrator.name()) {
                let title = format!("the method \"{}\" has no `{key}`", plan.integrator.name());
                let expected = format!("`{key}` belongs to \"{}\"", owners.join("\", \""));
                report.push(Diagnostic::new(title).at(&written.name.at, expected));
                return None;
            }
            let number = written.number(setting.range, report)?;
            let entry = M::Integrator::methods()
                .iter()
                .find(|entry| entry.name == plan.integrator.name())?;
            plan.integrator = (entry.with)(&mut |setting| {
                let own = (setting.key == key).then_some(number);
                own.or(was[setting.key].as_f64()).unwrap_or(setting.default)
            });
            draft.origins.put(format!("integrator.{key}"), written.value.at.clone());
            json!(number)
        }
    })
}

/// The number of points, or the seed, of a design that has one.
fn design<M: Read>(
    written: &Written<'_>,
    draft: &mut Draft<M>,
    report: &mut Report,
) -> Option<Value> {
    let name = written.name.value;
    let most = match &draft.plan.design {
        Some(Design::Sobol { .. }) if name == "points" => MOST_SOBOL,
        _ if name == "points" => MOST_POINTS,
        _ => MOST_SEED,
    };
    let number = written.whole(u64::from(name == "points"), most, report)?;
    match &mut draft.plan.design {
        Some(
            Design::LatinHypercube { points, seed }
            | Design::Sobol { points, seed }
            | Design::MonteCarlo { points, seed },
        ) => *(if name == "points" { points } else { seed }) = number,
        _ => {
            let title =
                format!("`{name}` belongs to a design, and this grid has none that takes it");
            let expected = "expected a grid file with [design]";
            report.push(Diagnostic::new(title).at(&written.name.at, expected));
            return None;
        }
    }
    Some(json!(number))
}
