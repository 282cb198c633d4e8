//! The grid file, section by section. What is left out has the defaults of the constants below.

use std::io::ErrorKind;
use std::path::Path;

use washer_model::{Channel, Machine, Range, decimal};
use washer_row::{Criterion, Measures, Metric};

use super::origins::Origins;
use super::parameters::WrittenConstant;
use super::report::{Diagnostic, Report};
use super::section::{Field, Section, cut, unknown_word};
use super::source::{Located, Location, ReadError, read};
use super::syntax::parse;
use super::{GridInput, axes, design, machine, parameters, scalars, spin};
use crate::method::{Entry, Integrator, METHODS, settings};
use crate::plan::{Plan, Reliability};
use crate::speeds::{Speeds, turning};

/// `machine` when the grid names none.
pub(super) const DEFAULT_MACHINE: &str = "paper";
/// `ratio_limit` of `[reliability]`.
pub(super) const DEFAULT_RATIO_LIMIT: f64 = 2.0;
/// `channels` of `[reliability]`.
pub(super) const DEFAULT_CHANNELS: [Channel; 6] = [
    Channel::TubFrontY,
    Channel::TubFrontZ,
    Channel::DrumFrontY,
    Channel::DrumFrontZ,
    Channel::TubYaw,
    Channel::TubPitch,
];

/// Longest integration that is accepted: eleven days of spinning.
pub(super) const LONGEST_S: f64 = 1e6;
/// Most characters of a path in a message; no system takes much longer ones.
const LONGEST_PATH: usize = 1000;

/// Names of machines that need no file.
pub(super) const MACHINES: [&str; 1] = [DEFAULT_MACHINE];

/// A plan in the making: whole, but sound only if nothing was reported.
pub(super) struct Draft {
    pub(super) plan: Plan,
    pub(super) origins: Origins,
    pub(super) constants: Vec<WrittenConstant>,
}

/// Reads the grid file and its machine file and puts the constants in place. `None` if the grid
/// file has no text.
pub(super) fn draft(input: &GridInput, report: &mut Report) -> Option<Draft> {
    let GridInput { path, text, machine: machine_text, sets } = input;
    let shown = path.display();
    let text = match text.clone().map_or_else(|| read(path), Ok) {
        Ok(text) => text,
        Err(error) => {
            let missing =
                matches!(&error, ReadError::Io(error) if error.kind() == ErrorKind::NotFound);
            let diagnostic = Diagnostic::new(format!("cannot read the grid file {shown}: {error}"));
            report.push(if missing {
                diagnostic.help("`sweep init FILE` writes a grid file to start from")
            } else {
                diagnostic
            });
            return None;
        }
    };
    let source = report.sources.add(shown.to_string(), text.as_str());
    if is_blank(&text) {
        let at = Location::new(source, 0..0);
        let diagnostic =
            Diagnostic::new(format!("the grid file {shown} is empty")).at(&at, "expected a grid");
        report.push(diagnostic.help("`sweep init FILE` writes a grid file to start from"));
        return None;
    }
    let table = parse(&text, source, report);
    let mut root = Section::new("the grid file", Location::new(source, 0..0), table.get_ref());

    let name = name(&mut root, path, report);
    let mut origins = Origins::default();
    let machine = match machine_text {
        Some(text) => machine_of(text, "its machine", &mut origins, report),
        None => machine(&mut root, path, &mut origins, report),
    };
    let spin = spin::read(&mut root, &mut origins, report);
    let [end_s, from_s, to_s] = time(&mut root, &mut origins, report);
    let integrator = integrator(&mut root, &mut origins, report);
    let metrics = names(&mut root, "metrics", "metric", &Metric::ALL, Metric::name, report);
    let (reliability, criterion) = reliability(&mut root, &mut origins, report);
    let metrics = metrics.unwrap_or_default();
    judge_metrics(&metrics, &machine, &root, report);
    let growth_speeds = stability(&mut root, &metrics, report);
    let (stops, feet) = (machine.stops.len(), machine.feet.len());
    let plan = Plan {
        name,
        machine,
        spin,
        end_s,
        window_s: [from_s, to_s],
        integrator,
        axes: Vec::new(),
        design: None,
        reliability,
        measures: Measures { criterion, metrics, stops, feet },
        growth_speeds,
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
            // Which axes are right depends on what cannot be known.
            let _ = root.tables("axis", report);
        }
    }
    scalars::apply(sets, &mut draft, report);
    root.finish(report);
    Some(draft)
}

/// Nothing but white space and perhaps a byte order mark.
pub(super) fn is_blank(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim().is_empty()
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
pub(super) fn plain_name(text: &str) -> Result<String, String> {
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

fn machine(
    root: &mut Section<'_>,
    grid: &Path,
    origins: &mut Origins,
    report: &mut Report,
) -> Machine {
    let Some(named) = root.text("machine", report).given() else { return Machine::paper() };
    if named.value == DEFAULT_MACHINE {
        return Machine::paper();
    }
    let path = machine::beside(grid, named.value);
    let text = match read(&path) {
        Ok(text) => text,
        Err(error) => {
            let title = format!(
                "cannot read the machine file {}: {error}",
                cut(&path.display().to_string(), LONGEST_PATH)
            );
            let expected =
                format!("expected \"{DEFAULT_MACHINE}\", or a machine file relative to this file");
            report.push(
                Diagnostic::new(title).at(&named.at, expected).nearest(named.value, MACHINES),
            );
            return Machine::paper();
        }
    };
    machine_of(&text, &path.display().to_string(), origins, report)
}

/// The machine of a machine file's text.
fn machine_of(text: &str, name: &str, origins: &mut Origins, report: &mut Report) -> Machine {
    let source = report.sources.add(name.to_owned(), text);
    let table = parse(text, source, report);
    let root = Section::new("the machine file", Location::new(source, 0..0), table.get_ref());
    machine::read(text, root, origins, report)
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

fn integrator(root: &mut Section<'_>, origins: &mut Origins, report: &mut Report) -> Integrator {
    let stand_in = || Entry::default_method().with_defaults();
    let Some(section) = root.table("integrator", "[integrator]", report).given() else {
        return stand_in();
    };
    let mut section = section.value;
    origins.put("integrator".to_owned(), section.at().clone());
    let names: Vec<_> = METHODS.iter().map(|entry| entry.name).collect();
    let method = match section.choice("method", &names, report) {
        Field::Given(place) => &METHODS[place.value],
        Field::Absent => Entry::default_method(),
        Field::Bad => {
            // Nobody knows which keys belong to an unknown method, but each has its range.
            for (setting, _) in settings() {
                let _ = section.number(setting.key, setting.range, report);
            }
            section.finish(report);
            return stand_in();
        }
    };
    for (setting, owners) in settings() {
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

fn reliability(
    root: &mut Section<'_>,
    origins: &mut Origins,
    report: &mut Report,
) -> (Reliability, Criterion) {
    let stand_in =
        Reliability { ratio_limit: DEFAULT_RATIO_LIMIT, channels: DEFAULT_CHANNELS.to_vec() };
    let Some(section) = root.table("reliability", "[reliability]", report).given() else {
        return (stand_in, Criterion::default());
    };
    let mut section = section.value;
    section.misplace(&["metrics"], "it belongs at the top of the file, before the first [section]");
    let criterion =
        section.choice("criterion", &Criterion::ALL.map(Criterion::name), report).given();
    if let Some(criterion) = &criterion {
        origins.put("reliability.criterion".to_owned(), criterion.at.clone());
    }
    let ratio_limit =
        section.number("ratio_limit", Range::Positive, report).or(DEFAULT_RATIO_LIMIT);
    let channels = names(&mut section, "channels", "channel", &Channel::ALL, Channel::name, report);
    section.finish(report);
    let reliability = Reliability {
        ratio_limit: ratio_limit.unwrap_or(DEFAULT_RATIO_LIMIT),
        channels: channels.unwrap_or(stand_in.channels),
    };
    (reliability, criterion.map(|found| Criterion::ALL[found.value]).unwrap_or_default())
}

/// The speeds that the metric `growth` is about. The section and the metric need each other.
fn stability(root: &mut Section<'_>, metrics: &[Metric], report: &mut Report) -> Option<Speeds> {
    let field = root.table("stability", "[stability]", report);
    if let (Field::Given(section), false) = (&field, metrics.contains(&Metric::Growth)) {
        let title = "[stability] is for the metric `growth`, which is not asked for";
        let expected = "expected metrics = [\"growth\"] at the top of the file, or no [stability]; \
                        `sweep stability` takes its speeds as --speed";
        report.push(Diagnostic::new(title).at(&section.at, expected));
    }
    if let (Field::Absent, true) = (&field, metrics.contains(&Metric::Growth)) {
        let title = "the metric `growth` needs speeds";
        let expected = "expected a section [stability] with speed_rpm = \"FROM:TO:STEP\"";
        report.push_missing(Diagnostic::new(title).at(root.at(), expected));
    }
    let mut section = field.given()?.value;
    let field = section.text("speed_rpm", report);
    let found =
        section.require(field, "speed_rpm", "constant speeds as \"FROM:TO:STEP\" in rpm", report);
    section.finish(report);
    let found = found?;
    match turning(found.value) {
        Ok(speeds) => Some(speeds),
        Err(expected) => {
            let title = format!("`speed_rpm` = \"{}\" is no range of speeds", found.value);
            report.push(Diagnostic::new(title).at(&found.at, expected));
            None
        }
    }
}

/// Metrics of what the machine has not got.
fn judge_metrics(metrics: &[Metric], machine: &Machine, root: &Section<'_>, report: &mut Report) {
    for metric in metrics {
        let (is_there, what) = match metric {
            Metric::StopForce | Metric::StopContact => {
                (!machine.stops.is_empty(), "stops: expected [[stops]] in the machine file")
            }
            Metric::FootLoad | Metric::SlipMargin => (
                machine.cabinet.is_some(),
                "cabinet: expected [cabinet] and three or four [[feet]] in the machine file",
            ),
            Metric::CabinetForce | Metric::ClashTime | Metric::StaticSag | Metric::Growth => {
                continue;
            }
        };
        if !is_there {
            let title = format!("the metric `{}` needs a machine with more parts", metric.name());
            report.push(Diagnostic::new(title).at(root.at(), format!("the machine has no {what}")));
        }
    }
}

/// A list of some of `all`, each once, by their names; an empty one is a mistake.
fn names<T: Copy + PartialEq>(
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
