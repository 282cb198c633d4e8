//! The washing machine's part of a grid file: `machine`, `[spin]`, `metrics`, the criterion of
//! `[reliability]`, `[stability]`.

use serde_json::json;
use sweep_engine::config::grid::refuse_other_kind;
use sweep_engine::config::section::truncate;
use sweep_engine::config::source::{read_text_file, resolve_beside};
use sweep_engine::config::syntax::parse_toml;
use sweep_engine::config::{
    Diagnostic, Field, Form, Key, KeyWalk, Keys, Location, Report, Section,
};
use washer_model::Machine;
use washer_row::{Metric, PartKind};

use super::{WasherGridInput, machine, machine_json};
use crate::model::Washer;
use crate::speeds::SpeedList;

/// The machine of a grid that names none.
pub(super) const DEFAULT_MACHINE: &str = "paper";

/// Maximum number of characters of a path in a message. Basis: longer than paths in use. Doubling
/// it doubles the longest message.
const MAX_PATH_CHARS: usize = 1000;

/// Names of machines that need no file.
const BUILT_IN_MACHINES: [&str; 1] = [DEFAULT_MACHINE];

/// Reads or describes the key `machine`. The machine may also be given with the input instead of in
/// a file.
pub(super) fn walk_machine(
    machine: &mut Machine,
    keys: &mut Keys<'_>,
    input: Option<&WasherGridInput>,
) {
    let key = Key::new("machine", "\"paper\", or a machine file relative to this file");
    if let (Some(root), Some(input)) = (keys.section(), input) {
        *machine = read_grid_machine(input, root);
    }
    keys.describe(key, |is_schema| match is_schema {
        true => json!({ "type": "string", "default": DEFAULT_MACHINE }),
        false => machine_json(machine),
    });
}

/// Returns the machine that a grid names, or the one that was given with the input.
fn read_grid_machine(input: &WasherGridInput, root: &Section<'_>) -> Machine {
    let report = root.report;
    if let Some(text) = &input.model_file {
        return parse_machine(text, "its machine", report);
    }
    let Some(name) = root.text("machine").into_located() else { return Machine::paper() };
    if name.value == DEFAULT_MACHINE {
        return Machine::paper();
    }
    let path = resolve_beside(&input.path, name.value);
    match read_text_file(&path) {
        Ok(text) => parse_machine(&text, &path.display().to_string(), report),
        Err(error) => {
            let short_path = truncate(&path.display().to_string(), MAX_PATH_CHARS);
            let title = format!("cannot read the machine file {short_path}: {error}");
            let expected =
                format!("expected \"{DEFAULT_MACHINE}\", or a machine file relative to this file");
            let refusal = Diagnostic::new(title).at_location(&name.location, expected);
            report.push(refusal.with_nearest_name(name.value, BUILT_IN_MACHINES));
            Machine::paper()
        }
    }
}

/// Parses the text of a machine file.
fn parse_machine(text: &str, name: &str, report: &Report) -> Machine {
    let source = report.add(name, text);
    let table = parse_toml(text, source, report);
    if refuse_other_kind::<Washer>("machine", table.get_ref(), source, report) {
        return Machine::paper();
    }
    let location = Location::new(source, 0..0);
    machine::read(text, Section::new("the machine file", location, table.get_ref(), report))
}

/// Reads or describes the section `[stability]`, which has the held speeds of metrics. A metric at
/// held speeds needs the section, and the section needs such a metric. `metrics_field` has the
/// location of the metrics.
pub(super) fn walk_stability(
    metrics: &[Metric],
    metrics_field: Field<()>,
    speeds: &mut Option<SpeedList>,
    keys: &mut Keys<'_>,
) {
    let metric_at_held_speeds = metrics.iter().find(|metric| metric.is_at_held_speeds());
    let missing_speeds_title =
        |metric: &Metric| format!("the metric `{}` needs speeds", metric.name());
    if let (KeyWalk::Set(_), Field::Present(location)) = (&keys.walk, metrics_field) {
        if let (Some(metric), None, Some(report)) = (metric_at_held_speeds, &speeds, keys.report())
        {
            let expected = "expected a grid file with this metric and a section [stability]";
            report.refuse::<()>(&location.location, missing_speeds_title(metric), expected);
        }
        speeds.take_if(|_| metric_at_held_speeds.is_none());
    }
    let description = "constant spin speeds in rpm, above 0, as 250, \"240,305\" or \"60:400:1\": \
                       those of the metrics `growth` and `dwell`";
    let expected = "constant speeds in rpm, as 250, \"240,305\" or \"60:400:1\"";
    let mut speeds_text = speeds.as_ref().map(ToString::to_string);
    let section_field = keys.walk_table(Key::new("stability", ""), |keys| {
        let read_speeds = |section: &Section<'_>, key| {
            section.text_or_number(key).map(|speeds_value| speeds_value.value.into())
        };
        let value_form = Form::Custom(&read_speeds, json!({ "type": ["string", "number"] }));
        let key_field = keys.walk_key(
            Key::new("speed_rpm", description).required(expected),
            &value_form,
            &mut speeds_text,
        );
        let (Field::Present(key_location), Some(text), Some(report)) =
            (key_field, speeds_text, keys.report())
        else {
            return;
        };
        match text.parse() {
            Ok(speed_list) => *speeds = Some(speed_list),
            Err(expected) => {
                let title = format!("`speed_rpm` = \"{text}\" is no list of speeds");
                report.refuse::<()>(&key_location.location, title, expected);
            }
        }
    });
    let Some(root) = keys.section() else { return };
    match (section_field, metric_at_held_speeds) {
        (Field::Present(section), None) => {
            let title =
                "[stability] is for the metrics `growth` and `dwell`, and neither is asked for";
            let expected = "expected metrics = [\"growth\"] or [\"dwell\"] at the top of the \
                            file, or no [stability]; `sweep stability` takes its speeds as --speed";
            root.report.refuse::<()>(&section.location, title, expected);
        }
        (Field::Absent, Some(metric)) => {
            let expected =
                "expected a section [stability] with speed_rpm = 250 or \"FROM:TO:STEP\"";
            let refusal = Diagnostic::new(missing_speeds_title(metric))
                .at_location(root.location(), expected);
            root.report.push_missing(refusal);
        }
        _ => {}
    }
}

/// Returns the part that a metric needs and the machine lacks, with the expected sections.
pub(crate) fn find_missing_part(metric: Metric, machine: &Machine) -> Option<&'static str> {
    let (has_part, part_name) = match metric.properties().part? {
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
    (!has_part).then_some(part_name)
}

/// Refuses metrics of parts that the machine lacks.
pub(crate) fn check_metrics(metrics: &[Metric], machine: &Machine, root: &Section<'_>) {
    for metric in metrics {
        if let Some(missing_part) = find_missing_part(*metric, machine) {
            let title = format!("the metric `{}` needs a machine with more parts", metric.name());
            let refusal = Diagnostic::new(title)
                .at_location(root.location(), format!("the machine has no {missing_part}"));
            root.report.push(refusal);
        }
    }
}
