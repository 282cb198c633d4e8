//! `--set` of the grid file's own scalars, which are no parameters: they are the same at every
//! point, and no axis sweeps them.

use serde_json::{Value, json};
use washer_model::{Channel, Range, decimal};
use washer_row::{Criterion, Metric};

use super::axes::MOST_POINTS;
use super::design::{MOST_SEED, MOST_SOBOL};
use super::grid::{Draft, LONGEST_S};
use super::report::{Diagnostic, Report};
use super::section::{check_number, quoted, short, unknown_word};
use super::source::{Located, Location};
use super::spin;
use crate::design::Design;
use crate::method::{METHODS, settings};

/// Those that stand outside of `[integrator]`.
const OWN: [&str; 9] = [
    "profile",
    "end_s",
    "ratio_limit",
    "criterion",
    "channels",
    "metrics",
    "method",
    "points",
    "seed",
];

/// Every name.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    OWN.into_iter().chain(settings().into_iter().map(|(setting, _)| setting.key))
}

/// Whether an argument `NAME=VALUE` is about one of them.
pub(super) fn is_one(argument: &str) -> bool {
    let name = argument.split('=').next().unwrap_or_default().trim();
    argument.contains('=') && names().any(|known| known == name)
}

/// One argument, taken apart.
struct Written<'a> {
    name: Located<&'a str>,
    value: Located<&'a str>,
}

impl Written<'_> {
    fn number(&self, range: Range, report: &mut Report) -> Option<f64> {
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

    fn whole(&self, least: u64, most: u64, report: &mut Report) -> Option<u64> {
        let number = self.value.value.parse::<u64>().ok();
        let number = number.filter(|number| (least..=most).contains(number));
        if number.is_none() {
            let title = format!("`{}` is no such number", short(self.value.value));
            let expected = format!("expected a whole number from {least} to {most}");
            report.push(Diagnostic::new(title).at(&self.value.at, expected));
        }
        number
    }

    fn choice(&self, choices: &[&str], report: &mut Report) -> Option<usize> {
        let place = choices.iter().position(|choice| *choice == self.value.value);
        if place.is_none() {
            report.push_with(|_| unknown_word(self.name.value, &self.value, choices));
        }
        place
    }
}

impl Written<'_> {
    /// Names separated by commas, each once and at least one.
    fn list<T: Copy + PartialEq>(
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
pub(super) fn apply(sets: &[String], draft: &mut Draft, report: &mut Report) {
    let mut written: Vec<Written<'_>> = Vec::new();
    for argument in sets.iter().filter(|argument| is_one(argument)) {
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
fn put(written: &Written<'_>, draft: &mut Draft, report: &mut Report) -> Option<Value> {
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
        "profile" => {
            let names = spin::RAMPED.map(|profile| profile.name);
            let profile = &spin::RAMPED[written.choice(&names, report)?];
            let Some(spun) = spin::by_profile(&plan.spin, profile) else {
                let title = "the grid's spin is a table, which has no peak and no ramp";
                let expected = "expected a grid file with `peak_rpm` and `ramp_s`";
                report.push(Diagnostic::new(title).at(&written.name.at, expected));
                return None;
            };
            plan.spin = spun;
            json!(profile.name)
        }
        "channels" => {
            let all = Channel::ALL;
            let channels = written.list("channel", &all, Channel::name, report)?;
            plan.reliability.channels = channels;
            json!(written.value.value)
        }
        "metrics" => {
            let metrics = written.list("metric", &Metric::ALL, Metric::name, report)?;
            let speeds = &mut plan.growth_speeds;
            if !metrics.contains(&Metric::Growth) {
                *speeds = None;
            } else if speeds.is_none() {
                let title = "the metric `growth` needs speeds";
                let expected = "expected a grid file with this metric and a section [stability]";
                report.push(Diagnostic::new(title).at(&written.value.at, expected));
                return None;
            }
            plan.measures.metrics = metrics;
            json!(written.value.value)
        }
        "ratio_limit" => {
            plan.reliability.ratio_limit = written.number(Range::Positive, report)?;
            json!(plan.reliability.ratio_limit)
        }
        "criterion" => {
            let names = Criterion::ALL.map(Criterion::name);
            plan.measures.criterion = Criterion::ALL[written.choice(&names, report)?];
            let at = written.value.at.clone();
            draft.origins.put("reliability.criterion".to_owned(), at);
            json!(plan.measures.criterion.name())
        }
        "method" => {
            let names: Vec<_> = METHODS.iter().map(|entry| entry.name).collect();
            let entry = &METHODS[written.choice(&names, report)?];
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
                settings().into_iter().find(|(setting, _)| setting.key == key)?;
            let was = plan.integrator.to_json();
            if !owners.contains(&plan.integrator.name()) {
                let title = format!("the method \"{}\" has no `{key}`", plan.integrator.name());
                let expected = format!("`{key}` belongs to \"{}\"", owners.join("\", \""));
                report.push(Diagnostic::new(title).at(&written.name.at, expected));
                return None;
            }
            let number = written.number(setting.range, report)?;
            let entry = METHODS.iter().find(|entry| entry.name == plan.integrator.name())?;
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
fn design(written: &Written<'_>, draft: &mut Draft, report: &mut Report) -> Option<Value> {
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
