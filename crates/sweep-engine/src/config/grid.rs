//! The grid file, section by section. What is left out has the defaults of the constants below.

use std::io::ErrorKind;
use std::path::Path;

use sweep_parameter::{Channel, Range, decimal};

use super::Read;
use super::origins::Origins;
use super::parameters::WrittenConstant;
use super::report::{Diagnostic, Report};
use super::section::{Field, Section, unknown_word};
use super::source::{Located, Location, ReadError, is_blank, read};
use super::syntax::parse;
use super::{GridInput, axes, design, parameters, scalars};
use crate::method::{Integrator, default_method, settings};
use crate::plan::{Plan, Reliability};

/// `ratio_limit` of `[reliability]`.
pub const DEFAULT_RATIO_LIMIT: f64 = 2.0;
/// Longest integration that is accepted: eleven days.
pub const LONGEST_S: f64 = 1e6;

/// A plan in the making: whole, but sound only if nothing was reported.
pub struct Draft<M: Read> {
    /// The plan.
    pub plan: Plan<M>,
    /// Where its numbers were written.
    pub origins: Origins,
    /// What `[set]`, `--set` and `--at` have written.
    pub constants: Vec<WrittenConstant>,
}

/// Reads the grid file and puts the constants in place. `None` if the grid file has no text.
pub fn draft<M: Read>(input: &GridInput<M>, report: &mut Report) -> Option<Draft<M>> {
    let GridInput { path, text, sets, .. } = input;
    let to_start = |diagnostic: Diagnostic| match M::TO_START {
        Some(help) => diagnostic.help(help),
        None => diagnostic,
    };
    let shown = path.display();
    let text = match text.clone().map_or_else(|| read(path), Ok) {
        Ok(text) => text,
        Err(error) => {
            let missing =
                matches!(&error, ReadError::Io(error) if error.kind() == ErrorKind::NotFound);
            let diagnostic = Diagnostic::new(format!("cannot read the grid file {shown}: {error}"));
            report.push(if missing { to_start(diagnostic) } else { diagnostic });
            return None;
        }
    };
    let source = report.sources.add(shown.to_string(), text.as_str());
    if is_blank(&text) {
        let at = Location::new(source, 0..0);
        let diagnostic =
            Diagnostic::new(format!("the grid file {shown} is empty")).at(&at, "expected a grid");
        report.push(to_start(diagnostic));
        return None;
    }
    let table = parse(&text, source, report);
    let mut root = Section::new("the grid file", Location::new(source, 0..0), table.get_ref());

    let name = name(&mut root, path, report);
    let mut origins = Origins::default();
    let mut model = M::read(input, &mut root, &mut origins, report);
    let [end_s, from_s, to_s] = time(&mut root, &mut origins, report);
    let integrator = integrator(&mut root, &mut origins, report);
    model.read_before_reliability(&mut root, &mut origins, report);
    let reliability = reliability(&mut root, &mut model, &mut origins, report);
    model.read_after_reliability(&mut root, &mut origins, report);
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
    };
    let mut draft = Draft { plan, origins, constants: Vec::new() };
    parameters::constants(&mut root, sets, &mut draft, report);
    match design::read(&mut root, path, report) {
        design::WrittenDesign::None => axes::axes(&mut root, &mut draft, report),
        design::WrittenDesign::Box(design) => {
            axes::box_of_axes(&mut root, design, &mut draft, report)
        }
        design::WrittenDesign::List(list) => axes::listed_axes(&mut root, list, &mut draft, report),
        design::WrittenDesign::Bad => {
            // The right axes depend on a method that is unknown.
            let _ = root.tables("axis", report);
        }
    }
    scalars::apply(sets, &mut draft, report);
    root.finish(report);
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

fn name(root: &mut Section<'_>, path: &Path, report: &mut Report) -> String {
    match root.text("name", report) {
        Field::Given(found) if is_plain(found.value) => return found.value.to_owned(),
        Field::Given(found) => {
            let title = "`name` is not a plain file name";
            report.push(Diagnostic::new(title).at(&found.at, format!("expected {PLAIN_NAME}")));
        }
        Field::Bad => {}
        Field::Absent => {
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            if is_plain(stem) {
                return stem.to_owned();
            }
            let title = "`name` is missing, and the file's own name cannot stand in for it";
            report.push_missing(
                Diagnostic::new(title).at(root.at(), format!("expected {PLAIN_NAME}")),
            );
        }
    }
    String::new()
}

/// End and both edges of the window, in s.
fn time(root: &mut Section<'_>, origins: &mut Origins, report: &mut Report) -> [f64; 3] {
    const STAND_IN: [f64; 3] = [50.0, 0.0, 50.0];
    let field = root.table("time", "[time]", report);
    let Some(section) = root.require(field, "time", "a section [time]", report) else {
        return STAND_IN;
    };
    let mut section = section.value;
    let field = section.number("end_s", Range::Any, report);
    let end = section.require(field, "end_s", "the end of the integration in s", report);
    let end = end.filter(|end| {
        let sound = 0.0 < end.value && end.value <= LONGEST_S;
        if !sound {
            let title = format!("`end_s` = {} is out of range", decimal(end.value));
            let expected = format!("expected a time greater than 0, at most {LONGEST_S:e} s");
            report.push(Diagnostic::new(title).at(&end.at, expected));
        }
        sound
    });
    let window = section.numbers("window_s", Range::NonNegative, report).given();
    if let Some(Located { value, .. }) = &window
        && let [from, to] = value.as_slice()
    {
        origins.put("window_from_s".to_owned(), from.at.clone());
        origins.put("window_to_s".to_owned(), to.at.clone());
    }
    let window = window.and_then(|window| self::window(window, end.as_ref(), report));
    section.finish(report);
    let Some(end) = end else { return STAND_IN };
    let [from_s, to_s] = window.unwrap_or([0.0, end.value]);
    origins.put("time.end_s".to_owned(), end.at);
    [end.value, from_s, to_s]
}

fn window(
    window: Located<Vec<Located<f64>>>,
    end: Option<&Located<f64>>,
    report: &mut Report,
) -> Option<[f64; 2]> {
    let [from, to] = window.value.as_slice() else {
        let title = format!("`window_s` has {} numbers", window.value.len());
        report.push(Diagnostic::new(title).at(&window.at, "expected two, [from, to], in s"));
        return None;
    };
    if from.value >= to.value {
        let what = if from.value > to.value { "reversed" } else { "empty" };
        let title = format!(
            "the window is {what}: it goes from {} s to {} s",
            decimal(from.value),
            decimal(to.value)
        );
        report.push(Diagnostic::new(title).at(&window.at, "expected [from, to] with from < to"));
        return None;
    }
    if let Some(end) = end.filter(|end| to.value > end.value) {
        let title = format!("the window ends at {} s, after the integration", decimal(to.value));
        let expected = format!("expected at most {}", decimal(end.value));
        report.push(
            Diagnostic::new(title).at(&to.at, expected).at(&end.at, "the integration ends here"),
        );
        return None;
    }
    Some([from.value, to.value])
}

fn integrator<I: Integrator>(
    root: &mut Section<'_>,
    origins: &mut Origins,
    report: &mut Report,
) -> I {
    let stand_in = || default_method::<I>().with_defaults();
    let Some(section) = root.table("integrator", "[integrator]", report).given() else {
        return stand_in();
    };
    let mut section = section.value;
    origins.put("integrator".to_owned(), section.at().clone());
    let names: Vec<_> = I::methods().iter().map(|entry| entry.name).collect();
    let method = match section.choice("method", &names, report) {
        Field::Given(place) => &I::methods()[place.value],
        Field::Absent => default_method::<I>(),
        Field::Bad => {
            // An unknown method has no list of keys, but each key has its range.
            for (setting, _) in settings::<I>() {
                let _ = section.number(setting.key, setting.range, report);
            }
            section.finish(report);
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
            origins.put(format!("integrator.{}", setting.key), at);
        }
        let number = section.number(setting.key, setting.range, report);
        number.or(setting.default).unwrap_or(setting.default)
    });
    section.finish(report);
    integrator
}

fn reliability<M: Read>(
    root: &mut Section<'_>,
    model: &mut M,
    origins: &mut Origins,
    report: &mut Report,
) -> Reliability<M> {
    let stand_in =
        Reliability { ratio_limit: DEFAULT_RATIO_LIMIT, channels: M::default_channels() };
    let Some(section) = root.table("reliability", "[reliability]", report).given() else {
        return stand_in;
    };
    let mut section = section.value;
    model.read_reliability(&mut section, origins, report);
    let ratio_limit =
        section.number("ratio_limit", Range::Positive, report).or(DEFAULT_RATIO_LIMIT);
    let every = M::Channel::every();
    let channels = names(&mut section, "channels", "channel", every, M::Channel::name, report);
    section.finish(report);
    Reliability {
        ratio_limit: ratio_limit.unwrap_or(DEFAULT_RATIO_LIMIT),
        channels: channels.unwrap_or(stand_in.channels),
    }
}

/// A list of some of `all`, each once, by their names; an empty one is a mistake.
pub fn names<T: Copy + PartialEq>(
    section: &mut Section<'_>,
    key: &'static str,
    what: &str,
    all: &[T],
    name: fn(T) -> &'static str,
    report: &mut Report,
) -> Option<Vec<T>> {
    let known: Vec<&str> = all.iter().copied().map(name).collect();
    let list = section.texts(key, report).given()?;
    if list.value.is_empty() {
        let expected = format!("expected at least one of `{}`", known.join("`, `"));
        report.push(Diagnostic::new(format!("`{key}` is empty")).at(&list.at, expected));
    }
    let mut chosen: Vec<Located<T>> = Vec::new();
    for found in list.value {
        let Some(&one) = all.iter().find(|one| name(**one) == found.value) else {
            report.push_with(|_| unknown_word(what, &found, &known));
            continue;
        };
        match chosen.iter().find(|other| other.value == one) {
            Some(first) => report.push(
                Diagnostic::new(format!("the {what} \"{}\" is given twice", found.value))
                    .at(&found.at, format!("expected each {what} once"))
                    .at(&first.at, "first given here"),
            ),
            None => chosen.push(Located { value: one, at: found.at }),
        }
    }
    Some(chosen.into_iter().map(|one| one.value).collect())
}
