//! The grid file, section by section. What is left out has the defaults of the constants below.

use std::path::Path;

use sweep_parameter::{Channel, Range, RatioLimits, decimal};

use super::draft::Draft;
use super::source::{Located, Location, is_blank};
use super::syntax::{self, parse};
use super::words::names;
use super::{
    Diagnostic, Field, GridInput, Read, Report, Section, axes, design, parameters, scalars,
};
use crate::method::{Integrator, default_method, settings};
use crate::plan::{LONGEST_S, Plan, RATIO_MIN, Reliability, WrittenIn};

/// `ratio_limit` of `[reliability]`.
pub const DEFAULT_RATIO_LIMIT: f64 = 2.0;

/// Reads the grid file and puts the constants in place. `None` if the grid file has no text.
pub fn draft<'a, M: Read>(input: &GridInput<M>, report: &'a Report) -> Option<Draft<'a, M>> {
    let GridInput { path, text, sets, at, .. } = input;
    let shown = path.display();
    let (text, source) = match text {
        Some(text) => (text.clone(), report.add(shown.to_string(), text.as_str())),
        None => syntax::text(path, "grid", M::TO_START, report)?,
    };
    if is_blank(&text) {
        let at = Location::new(source, 0..0);
        let refusal =
            Diagnostic::new(format!("the grid file {shown} is empty")).at(&at, "expected a grid");
        report.push(M::TO_START.into_iter().fold(refusal, Diagnostic::help));
        return None;
    }
    let table = parse(&text, source, report);
    let root = Section::new("the grid file", Location::new(source, 0..0), table.get_ref(), report);

    let name = name(&root, path);
    let mut model = M::read(input, &root);
    let [end_s, from_s, to_s] = time(&root);
    let integrator = integrator(&root);
    let reliability = reliability(&root, &mut model);
    let plan = Plan {
        name,
        model,
        end_s,
        window_s: [from_s, to_s],
        integrator,
        axes: Vec::new(),
        design: None,
        reliability,
        set: Vec::new(),
        written: WrittenIn::default(),
    };
    let mut draft = Draft { plan, report, constants: Vec::new() };
    parameters::constants(&root, sets, at, &mut draft);
    match design::read(&root, path) {
        design::WrittenDesign::None => axes::axes(&root, None, &mut draft),
        design::WrittenDesign::Box(design) => axes::axes(&root, Some(design), &mut draft),
        design::WrittenDesign::List(list) => axes::listed_axes(&root, list, &mut draft),
        design::WrittenDesign::Bad => {
            // The right axes depend on a method that is unknown.
            let _ = root.tables("axis");
        }
    }
    scalars::apply(sets, &mut draft);
    root.finish();
    Some(draft)
}

/// What a name may be: it becomes a file's.
const PLAIN_NAME: &str = "letters, digits, `-`, `_` and `.`, beginning with a letter or digit, at \
                          most 100 characters";

fn is_plain(name: &str) -> bool {
    let first = name.chars().next().is_some_and(|c| c.is_ascii_alphanumeric());
    first
        && name.len() <= 100
        && name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
}

/// A run's name from the command line.
pub fn plain_name(text: &str) -> Result<String, String> {
    if is_plain(text) { Ok(text.to_owned()) } else { Err(format!("expected {PLAIN_NAME}")) }
}

/// The name that a file gives its run, or its own.
pub fn name(root: &Section<'_>, path: &Path) -> String {
    match root.text("name") {
        Field::Given(found) if is_plain(found.value) => return found.value.to_owned(),
        Field::Given(found) => {
            let title = "`name` is not a plain file name";
            let refusal = Diagnostic::new(title).at(&found.at, format!("expected {PLAIN_NAME}"));
            root.report.push(refusal);
        }
        Field::Bad => {}
        Field::Absent => {
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            if is_plain(stem) {
                return stem.to_owned();
            }
            let title = "`name` is missing, and the file's own name cannot stand in for it";
            let refusal = Diagnostic::new(title).at(root.at(), format!("expected {PLAIN_NAME}"));
            root.report.push_missing(refusal);
        }
    }
    String::new()
}

/// End and both edges of the window, in s.
fn time(root: &Section<'_>) -> [f64; 3] {
    const STAND_IN: [f64; 3] = [50.0, 0.0, 50.0];
    let report = root.report;
    let Some(section) = root.require(root.table("time", "[time]"), "time", "a section [time]")
    else {
        return STAND_IN;
    };
    let section = section.value;
    let field = section.number("end_s", Range::Any);
    let end = section.require(field, "end_s", "the end of the integration in s");
    let end = end.and_then(|end| match 0.0 < end.value && end.value <= LONGEST_S {
        true => Some(end),
        false => {
            let title = format!("`end_s` = {} is out of range", decimal(end.value));
            let expected = format!("expected a time greater than 0, at most {LONGEST_S:e} s");
            report.refuse(&end.at, title, expected)
        }
    });
    let window = section.numbers("window_s", Range::NonNegative).given();
    if let Some(Located { value, .. }) = &window
        && let [from, to] = value.as_slice()
    {
        report.put("window_from_s", from.at.clone());
        report.put("window_to_s", to.at.clone());
    }
    let window = window.and_then(|window| self::window(&window, end.as_ref(), report));
    section.finish();
    let Some(end) = end else { return STAND_IN };
    let [from_s, to_s] = window.unwrap_or([0.0, end.value]);
    report.put("time.end_s", end.at);
    [end.value, from_s, to_s]
}

fn window(
    window: &Located<Vec<Located<f64>>>,
    end: Option<&Located<f64>>,
    report: &Report,
) -> Option<[f64; 2]> {
    let [from, to] = window.value.as_slice() else {
        let title = format!("`window_s` has {} numbers", window.value.len());
        return report.refuse(&window.at, title, "expected two, [from, to], in s");
    };
    let [from_said, to_said] = [from, to].map(|edge| decimal(edge.value));
    if from.value >= to.value {
        let what = if from.value > to.value { "reversed" } else { "empty" };
        let title = format!("the window is {what}: it goes from {from_said} s to {to_said} s");
        return report.refuse(&window.at, title, "expected [from, to] with from < to");
    }
    if let Some(end) = end.filter(|end| to.value > end.value) {
        let title = format!("the window ends at {to_said} s, after the integration");
        let refusal =
            Diagnostic::new(title).at(&to.at, format!("expected at most {}", decimal(end.value)));
        report.push(refusal.at(&end.at, "the integration ends here"));
        return None;
    }
    Some([from.value, to.value])
}

fn integrator<I: Integrator>(root: &Section<'_>) -> I {
    let stand_in = || default_method::<I>().with_defaults();
    let Some(section) = root.table("integrator", "[integrator]").given() else {
        return stand_in();
    };
    let section = section.value;
    root.report.put("integrator", section.at().clone());
    let names: Vec<_> = I::methods().iter().map(|entry| entry.name).collect();
    let method = match section.choice("method", &names) {
        Field::Given(place) => &I::methods()[place.value],
        Field::Absent => default_method::<I>(),
        Field::Bad => {
            // An unknown method has no list of keys, but each key has its range.
            for (setting, _) in settings::<I>() {
                let _ = section.number(setting.key, setting.range);
            }
            section.finish();
            return stand_in();
        }
    };
    for (setting, owners) in settings::<I>() {
        if !owners.contains(&method.name) {
            let (noun, verb) =
                if owners.len() == 1 { ("method", "has") } else { ("methods", "have") };
            let (owners, method) = (owners.join("\" and \""), method.name);
            let reason = format!("only the {noun} \"{owners}\" {verb} it, not \"{method}\"");
            section.misplace(&[setting.key], &reason);
        }
    }
    let integrator = (method.with)(&mut |setting| {
        if let Some(at) = section.key_at(setting.key) {
            root.report.put(format!("integrator.{}", setting.key), at);
        }
        section.number(setting.key, setting.range).or(setting.default).unwrap_or(setting.default)
    });
    section.finish();
    integrator
}

fn reliability<M: Read>(root: &Section<'_>, model: &mut M) -> Reliability<M> {
    let stand_in =
        Reliability { limits: DEFAULT_RATIO_LIMIT.into(), channels: M::default_channels() };
    let Some(section) = root.table("reliability", "[reliability]").given() else {
        return stand_in;
    };
    let section = section.value;
    model.read_reliability(&section);
    let most = section.number("ratio_limit", Range::Positive).or(DEFAULT_RATIO_LIMIT);
    let most = most.unwrap_or(DEFAULT_RATIO_LIMIT);
    let least = section.number("ratio_min", RATIO_MIN).given().map(|least| least.value);
    let channels = names(&section, "channels", "channel", M::Channel::every(), M::Channel::name);
    section.finish();
    Reliability {
        limits: RatioLimits { most, least },
        channels: channels.unwrap_or(stand_in.channels),
    }
}
