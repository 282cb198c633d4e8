//! `--set` of the grid file's own scalars. They are not parameters: they are the same at every
//! point, and no axis sweeps them.

use serde_json::{Value, json};
use sweep_parameter::{Channel, Range, decimal};

use super::design::{MOST_SEED, MOST_SOBOL};
use super::{Draft, Read, Written, twice};
use crate::Design;
use crate::method::{Entry, Integrator, settings};
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
            // Settings that both methods have stay as they are.
            plan.integrator = changed(&plan.integrator, entry, None);
            report.put("integrator", written.value.at.clone());
            json!(entry.name)
        }
        "points" | "seed" => return design(written, draft),
        key => {
            let (setting, owners) =
                settings::<M::Integrator>().into_iter().find(|(setting, _)| setting.key == key)?;
            if !owners.contains(&plan.integrator.name()) {
                let title = format!("the method \"{}\" has no `{key}`", plan.integrator.name());
                let expected = format!("`{key}` belongs to \"{}\"", owners.join("\", \""));
                return report.refuse(&written.name.at, title, expected);
            }
            let number = written.number(setting.range)?.value;
            let mut entries = M::Integrator::methods().iter();
            let entry = entries.find(|entry| entry.name == plan.integrator.name())?;
            plan.integrator = changed(&plan.integrator, entry, Some((key, number)));
            report.put(format!("integrator.{key}"), written.value.at.clone());
            json!(number)
        }
    })
}

/// A method with the settings of another, and one of its own.
fn changed<I: Integrator>(was: &I, entry: &Entry<I>, own: Option<(&str, f64)>) -> I {
    let was = was.settings();
    let of = |key: &str| was.iter().copied().chain(own).rfind(|(known, _)| *known == key);
    (entry.with)(&mut |setting| of(setting.key).map_or(setting.default, |(_, number)| number))
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
