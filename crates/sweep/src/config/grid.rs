//! The washing machine's part of a grid file: `machine`, `[spin]`, `metrics`, the criterion of
//! `[reliability]`, `[stability]`.

use serde_json::json;
use sweep_engine::config::grid::is_another;
use sweep_engine::config::section::cut;
use sweep_engine::config::source::{beside, read};
use sweep_engine::config::syntax::parse;
use sweep_engine::config::{
    Diagnostic, Field, Form, Key, KeyWalk, Keys, Location, Report, Section,
};
use washer_model::Machine;
use washer_row::{Metric, PartKind};

use super::{GridInput, machine, machine_json};
use crate::model::Washer;
use crate::speeds::SpeedList;

/// `machine` when the grid names none.
pub(super) const DEFAULT_MACHINE: &str = "paper";
/// Most characters of a path in a message; no system takes much longer ones.
const LONGEST_PATH: usize = 1000;

/// Names of machines that need no file.
const MACHINES: [&str; 1] = [DEFAULT_MACHINE];

/// The machine that a grid names, or the one given in its place.
pub(super) fn machine(machine: &mut Machine, keys: &mut Keys<'_>, input: Option<&GridInput>) {
    let key = Key::new("machine", "\"paper\", or a machine file relative to this file");
    if let (Some(root), Some(input)) = (keys.section(), input) {
        *machine = named(input, root);
    }
    keys.describe(key, |is_schema| match is_schema {
        true => json!({ "type": "string", "default": DEFAULT_MACHINE }),
        false => machine_json(machine),
    });
}

fn named(input: &GridInput, root: &Section<'_>) -> Machine {
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
    if is_another::<Washer>("machine", table.get_ref(), source, report) {
        return Machine::paper();
    }
    let at = Location::new(source, 0..0);
    machine::read(text, Section::new("the machine file", at, table.get_ref(), report))
}

/// The speeds of the metrics that are of constant ones. The section and these need each other.
/// `found` is where the metrics were, if they were written.
pub(super) fn stability(
    metrics: &[Metric],
    found: Field<()>,
    speeds: &mut Option<SpeedList>,
    keys: &mut Keys<'_>,
) {
    let of_speeds = metrics.iter().find(|metric| metric.is_at_held_speeds());
    let lacking = |metric: &Metric| format!("the metric `{}` needs speeds", metric.name());
    if let (KeyWalk::Set(_), Field::Given(found)) = (&keys.walk, found) {
        if let (Some(metric), None, Some(report)) = (of_speeds, &speeds, keys.report()) {
            let expected = "expected a grid file with this metric and a section [stability]";
            report.refuse::<()>(&found.at, lacking(metric), expected);
        }
        speeds.take_if(|_| of_speeds.is_none());
    }
    let about = "constant spin speeds in rpm, above 0, as 250, \"240,305\" or \"60:400:1\": those \
                 of the metrics `growth` and `dwell`";
    let expected = "constant speeds in rpm, as 250, \"240,305\" or \"60:400:1\"";
    let mut text = speeds.as_ref().map(ToString::to_string);
    let field = keys.table(Key::new("stability", ""), |keys| {
        let read = |section: &Section<'_>, key| {
            section.text_or_number(key).map(|found| found.value.into())
        };
        let kind = Form::Own(&read, json!({ "type": ["string", "number"] }));
        let field = keys.key(Key::new("speed_rpm", about).needed(expected), &kind, &mut text);
        let (Field::Given(found), Some(text), Some(report)) = (field, text, keys.report()) else {
            return;
        };
        match text.parse() {
            Ok(read) => *speeds = Some(read),
            Err(expected) => {
                let title = format!("`speed_rpm` = \"{text}\" is no list of speeds");
                report.refuse::<()>(&found.at, title, expected);
            }
        }
    });
    let Some(root) = keys.section() else { return };
    match (field, of_speeds) {
        (Field::Given(section), None) => {
            let title =
                "[stability] is for the metrics `growth` and `dwell`, and neither is asked for";
            let expected = "expected metrics = [\"growth\"] or [\"dwell\"] at the top of the \
                            file, or no [stability]; `sweep stability` takes its speeds as --speed";
            root.report.refuse::<()>(&section.at, title, expected);
        }
        (Field::Absent, Some(metric)) => {
            let expected =
                "expected a section [stability] with speed_rpm = 250 or \"FROM:TO:STEP\"";
            let refusal = Diagnostic::new(lacking(metric)).at(root.at(), expected);
            root.report.push_missing(refusal);
        }
        _ => {}
    }
}

/// What a machine has not got and this metric is of.
pub(crate) fn lacking(metric: Metric, machine: &Machine) -> Option<&'static str> {
    let (is_there, what) = match metric.facts().part? {
        PartKind::Stop => {
            (!machine.stops.is_empty(), "stops: expected [[stops]] in the machine file")
        }
        PartKind::Foot => (
            machine.cabinet.is_some(),
            "cabinet: expected [cabinet] and three or four [[feet]] in the machine file",
        ),
        PartKind::Damper => {
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
