//! The washing machine's part of a grid file: `machine`, `[spin]`, `metrics`, the criterion of
//! `[reliability]`, `[stability]`.

use sweep_engine::config::report::{Diagnostic, Report};
use sweep_engine::config::section::{Field, Section, cut};
use sweep_engine::config::source::{Location, beside, read};
use sweep_engine::config::syntax::parse;
use washer_model::Machine;
use washer_row::{Criterion, Metric, Part};

use super::{GridInput, machine};
use crate::speeds::SpeedList;

/// `machine` when the grid names none.
pub(super) const DEFAULT_MACHINE: &str = "paper";
/// Most characters of a path in a message; no system takes much longer ones.
const LONGEST_PATH: usize = 1000;

/// Names of machines that need no file.
const MACHINES: [&str; 1] = [DEFAULT_MACHINE];

/// The machine that a grid names, or the one given in its place.
pub(crate) fn machine(input: &GridInput, root: &Section<'_>) -> Machine {
    let report = root.report;
    if let Some(text) = &input.own_file {
        return machine_of(text, "its machine", report);
    }
    let Some(named) = root.text("machine").given() else { return Machine::paper() };
    if named.value == DEFAULT_MACHINE {
        return Machine::paper();
    }
    let path = beside(&input.path, named.value);
    match read(&path) {
        Ok(text) => machine_of(&text, &path.display().to_string(), report),
        Err(error) => {
            let shown = cut(&path.display().to_string(), LONGEST_PATH);
            let title = format!("cannot read the machine file {shown}: {error}");
            let expected =
                format!("expected \"{DEFAULT_MACHINE}\", or a machine file relative to this file");
            let refusal = Diagnostic::new(title).at(&named.at, expected);
            report.push(refusal.nearest(named.value, MACHINES));
            Machine::paper()
        }
    }
}

/// The machine of a machine file's text.
fn machine_of(text: &str, name: &str, report: &Report) -> Machine {
    let source = report.add(name, text);
    let table = parse(text, source, report);
    let at = Location::new(source, 0..0);
    machine::read(text, Section::new("the machine file", at, table.get_ref(), report))
}

/// The criterion of `[reliability]`.
pub(crate) fn criterion(section: &Section<'_>) -> Criterion {
    section.misplace(&["metrics"], "it belongs at the top of the file, before the first [section]");
    let criterion = section.choice("criterion", &Criterion::ALL.map(Criterion::name)).given();
    criterion.map_or_else(Criterion::default, |found| {
        section.report.put("reliability.criterion", found.at);
        Criterion::ALL[found.value]
    })
}

/// The speeds of the metrics that are of constant ones. The section and these need each other.
pub(crate) fn stability(root: &Section<'_>, metrics: &[Metric]) -> Option<SpeedList> {
    let (field, report) = (root.table("stability", "[stability]"), root.report);
    let of_speeds = metrics.iter().find(|metric| metric.is_of_speeds());
    if let (Field::Given(section), None) = (&field, of_speeds) {
        let title = "[stability] is for the metrics `growth` and `dwell`, and neither is asked for";
        let expected = "expected metrics = [\"growth\"] or [\"dwell\"] at the top of the file, or \
                        no [stability]; `sweep stability` takes its speeds as --speed";
        report.push(Diagnostic::new(title).at(&section.at, expected));
    }
    if let (Field::Absent, Some(metric)) = (&field, of_speeds) {
        let title = format!("the metric `{}` needs speeds", metric.name());
        let expected = "expected a section [stability] with speed_rpm = 250 or \"FROM:TO:STEP\"";
        report.push_missing(Diagnostic::new(title).at(root.at(), expected));
    }
    let section = field.given()?.value;
    let expected = "constant speeds in rpm, as 250, \"240,305\" or \"60:400:1\"";
    let found = section.require(section.text_or_number("speed_rpm"), "speed_rpm", expected);
    section.finish();
    let found = found?;
    found.value.parse().map_or_else(
        |expected| {
            let title = format!("`speed_rpm` = \"{}\" is no list of speeds", found.value);
            report.refuse(&found.at, title, expected)
        },
        Some,
    )
}

/// What a machine has not got and this metric is of.
pub(crate) fn lacking(metric: Metric, machine: &Machine) -> Option<&'static str> {
    let (is_there, what) = match metric.part()? {
        Part::Stop => (!machine.stops.is_empty(), "stops: expected [[stops]] in the machine file"),
        Part::Foot => (
            machine.cabinet.is_some(),
            "cabinet: expected [cabinet] and three or four [[feet]] in the machine file",
        ),
        Part::Damper => {
            (!machine.dampers.is_empty(), "dampers: expected [[dampers]] in the machine file")
        }
    };
    (!is_there).then_some(what)
}

/// Metrics of what the machine has not got.
pub(crate) fn judge_metrics(metrics: &[Metric], machine: &Machine, root: &Section<'_>) {
    for metric in metrics {
        if let Some(what) = lacking(*metric, machine) {
            let title = format!("the metric `{}` needs a machine with more parts", metric.name());
            let refusal =
                Diagnostic::new(title).at(root.at(), format!("the machine has no {what}"));
            root.report.push(refusal);
        }
    }
}
