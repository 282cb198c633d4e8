//! `--set` of the grid file's own scalars. They are not parameters: they are the same at every
//! point, and no axis sweeps them.

use serde_json::{Value, json};
use sweep_parameter::{Channel, Range, decimal};

use super::Read;
use super::design::{MOST_SEED, MOST_SOBOL};
use super::draft::Draft;
use super::report::Report;
use super::section::{check_number, quoted, short, twice, unknown_word};
use super::source::{Located, Location};
use super::words::some_of;
use crate::design::Design;
use crate::method::{Integrator, settings};
use crate::plan::{LONGEST_S, MOST_POINTS, RATIO_MIN};

/// Those that stand outside of `[integrator]`.
const OWN: [&str; 7] =
    ["end_s", "ratio_limit", "ratio_min", "channels", "method", "points", "seed"];

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

/// One argument NAME=VALUE, taken apart.
pub struct Written<'a> {
    /// What is set.
    pub name: Located<&'a str>,
    /// To what.
    pub value: Located<&'a str>,
    report: &'a Report,
}

impl<'a> Written<'a> {
    /// Takes an option's argument apart.
    pub fn read(option: &str, argument: &'a str, report: &'a Report) -> Option<Self> {
        let source = report.add(option, argument);
        let located =
            |value: &'a str, span| Located { value: value.trim(), at: Location::new(source, span) };
        match argument.split_once('=') {
            Some((name, value)) => {
                let equals = name.len();
                let name = located(name, 0..equals);
                Some(Self { name, value: located(value, equals + 1..argument.len()), report })
            }
            None => {
                let title = format!("`{}` is not a constant", short(argument));
                let whole = Location::new(source, 0..argument.len());
                report.refuse(&whole, title, "expected NAME=VALUE")
            }
        }
    }

    /// The number, in a range.
    pub fn number(&self, range: Range) -> Option<Located<f64>> {
        let at = self.value.at.clone();
        match self.value.value.parse() {
            Ok(number) => check_number(&quoted(self.name.value), number, at, range, self.report),
            Err(_) => {
                let title = format!("`{}` is not a number", short(self.value.value));
                self.report.refuse(&at, title, format!("expected {range}"))
            }
        }
    }

    /// A whole number within bounds.
    pub fn whole(&self, least: u64, most: u64) -> Option<u64> {
        let number = self.value.value.parse::<u64>().ok();
        number.filter(|number| (least..=most).contains(number)).or_else(|| {
            let title = format!("`{}` is no such number", short(self.value.value));
            let expected = format!("expected a whole number from {least} to {most}");
            self.report.refuse(&self.value.at, title, expected)
        })
    }

    /// One of a few words, by its place.
    pub fn choice(&self, choices: &[&str]) -> Option<usize> {
        let place = choices.iter().position(|choice| *choice == self.value.value);
        if place.is_none() {
            self.report.push_with(|_| unknown_word(self.name.value, &self.value, choices));
        }
        place
    }

    /// Names separated by commas, each once and at least one.
    pub fn list<T: Copy + PartialEq>(
        &self,
        what: &str,
        all: &[T],
        name: fn(T) -> &'static str,
    ) -> Option<Vec<T>> {
        let Located { value, at } = &self.value;
        let parts = value.split(',').map(|part| Located { value: part.trim(), at: at.clone() });
        let (chosen, is_sound) = some_of(parts, what, all, name, self.report);
        is_sound.then_some(chosen)
    }
}

/// Puts the scalars among `sets` in place, over those of the grid file. The plan has its design
/// already.
pub fn apply<M: Read>(sets: &[String], draft: &mut Draft<'_, M>) {
    let report = draft.report;
    let mut written: Vec<Written<'_>> = Vec::new();
    for argument in sets.iter().filter(|argument| is_one::<M>(argument)) {
        let Some(next) = Written::read("--set", argument, report) else { continue };
        match written.iter().find(|known| known.name.value == next.name.value) {
            Some(first) => report.push(twice(&next.name, &first.name)),
            None => written.push(next),
        }
    }
    // The method first: it decides which settings there are.
    written.sort_by_key(|written| written.name.value != "method");
    for written in &written {
        let before = draft.plan.clone();
        if let Some(value) = put(written, draft)
            && draft.plan != before
        {
            draft.plan.set.push((written.name.value.to_owned(), value));
        }
    }
}

/// Puts one in place; its value as it stands in the plan.
fn put<M: Read>(written: &Written<'_>, draft: &mut Draft<'_, M>) -> Option<Value> {
    if M::scalars().contains(&written.name.value) {
        return M::put(written, draft);
    }
    let report = draft.report;
    let plan = &mut draft.plan;
    Some(match written.name.value {
        "end_s" => {
            let end_s = written.number(Range::Positive)?.value;
            if end_s > LONGEST_S {
                let title = format!("`end_s` = {} is out of range", decimal(end_s));
                let expected = format!("expected at most {LONGEST_S:e} s");
                return report.refuse(&written.value.at, title, expected);
            }
            // A window that was not written ends with the run.
            if report.place("window_to_s").is_none() {
                plan.window_s[1] = end_s;
            }
            plan.end_s = end_s;
            report.put("time.end_s", written.value.at.clone());
            json!(end_s)
        }
        "channels" => {
            let every = M::Channel::every();
            let channels = written.list("channel", every, M::Channel::name)?;
            plan.reliability.channels = channels;
            json!(written.value.value)
        }
        "ratio_limit" => {
            plan.reliability.limits.most = written.number(Range::Positive)?.value;
            json!(plan.reliability.limits.most)
        }
        "ratio_min" => {
            let least = written.number(RATIO_MIN)?.value;
            plan.reliability.limits.least = Some(least);
            json!(least)
        }
        "method" => {
            let names: Vec<_> = M::Integrator::methods().iter().map(|entry| entry.name).collect();
            let entry = &M::Integrator::methods()[written.choice(&names)?];
            let was = plan.integrator.to_json();
            // Settings that both methods have stay as they are.
            plan.integrator =
                (entry.with)(&mut |setting| was[setting.key].as_f64().unwrap_or(setting.default));
            report.put("integrator", written.value.at.clone());
            json!(entry.name)
        }
        "points" | "seed" => return design(written, draft),
        key => {
            let (setting, owners) =
                settings::<M::Integrator>().into_iter().find(|(setting, _)| setting.key == key)?;
            let was = plan.integrator.to_json();
            if !owners.contains(&plan.integrator.name()) {
                let title = format!("the method \"{}\" has no `{key}`", plan.integrator.name());
                let expected = format!("`{key}` belongs to \"{}\"", owners.join("\", \""));
                return report.refuse(&written.name.at, title, expected);
            }
            let number = written.number(setting.range)?.value;
            let entry = M::Integrator::methods()
                .iter()
                .find(|entry| entry.name == plan.integrator.name())?;
            plan.integrator = (entry.with)(&mut |setting| {
                let own = (setting.key == key).then_some(number);
                own.or(was[setting.key].as_f64()).unwrap_or(setting.default)
            });
            report.put(format!("integrator.{key}"), written.value.at.clone());
            json!(number)
        }
    })
}

/// The number of points, or the seed, of a design that has one.
fn design<M: Read>(written: &Written<'_>, draft: &mut Draft<'_, M>) -> Option<Value> {
    let name = written.name.value;
    let most = match &draft.plan.design {
        Some(Design::Sobol { .. }) if name == "points" => MOST_SOBOL,
        _ if name == "points" => MOST_POINTS,
        _ => MOST_SEED,
    };
    let number = written.whole(u64::from(name == "points"), most)?;
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
            return draft.report.refuse(&written.name.at, title, expected);
        }
    }
    Some(json!(number))
}
