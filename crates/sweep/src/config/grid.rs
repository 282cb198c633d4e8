//! The washing machine's part of a grid file: `machine`, `[spin]`, `metrics`, the criterion of
//! `[reliability]`, `[stability]`.

use sweep_engine::config::Origins;
use sweep_engine::config::grid::names;
use sweep_engine::config::report::{Diagnostic, Report};
use sweep_engine::config::section::{Field, Section, cut};
use sweep_engine::config::source::{Location, beside, read};
use sweep_engine::config::syntax::parse;
use washer_model::Machine;
use washer_row::{Criterion, Metric};

use super::{GridInput, machine};
use crate::speeds::SpeedList;

/// `machine` when the grid names none.
pub(super) const DEFAULT_MACHINE: &str = "paper";
/// Most characters of a path in a message; no system takes much longer ones.
const LONGEST_PATH: usize = 1000;

/// Names of machines that need no file.
const MACHINES: [&str; 1] = [DEFAULT_MACHINE];

/// The machine that a grid names, or the one given in its place.
pub(crate) fn machine(
    input: &GridInput,
    root: &mut Section<'_>,
    origins: &mut Origins,
    report: &mut Report,
) -> Machine {
    if let Some(text) = &input.own_file {
        return machine_of(text, "its machine", origins, report);
    }
    let Some(named) = root.text("machine", report).given() else { return Machine::paper() };
    if named.value == DEFAULT_MACHINE {
        return Machine::paper();
    }
    let path = beside(&input.path, named.value);
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

/// Metrics by their names.
pub(crate) fn metrics(root: &mut Section<'_>, report: &mut Report) -> Vec<Metric> {
    let metrics = names(root, "metrics", "metric", &Metric::ALL, Metric::name, report);
    metrics.unwrap_or_default()
}

/// The criterion of `[reliability]`.
pub(crate) fn criterion(
    section: &mut Section<'_>,
    origins: &mut Origins,
    report: &mut Report,
) -> Criterion {
    section.misplace(&["metrics"], "it belongs at the top of the file, before the first [section]");
    let criterion =
        section.choice("criterion", &Criterion::ALL.map(Criterion::name), report).given();
    if let Some(criterion) = &criterion {
        origins.put("reliability.criterion".to_owned(), criterion.at.clone());
    }
    criterion.map(|found| Criterion::ALL[found.value]).unwrap_or_default()
}

/// The speeds that the metric `growth` is about. The section and the metric need each other.
pub(crate) fn stability(
    root: &mut Section<'_>,
    metrics: &[Metric],
    report: &mut Report,
) -> Option<SpeedList> {
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
    let found = section.require(
        field,
        "speed_rpm",
        "constant speeds in rpm, as \"250\", \"240,305\" or \"60:400:1\"",
        report,
    );
    section.finish(report);
    let found = found?;
    match found.value.parse() {
        Ok(speeds) => Some(speeds),
        Err(expected) => {
            let title = format!("`speed_rpm` = \"{}\" is no list of speeds", found.value);
            report.push(Diagnostic::new(title).at(&found.at, expected));
            None
        }
    }
}

/// Metrics of what the machine has not got.
pub(crate) fn judge_metrics(
    metrics: &[Metric],
    machine: &Machine,
    root: &Section<'_>,
    report: &mut Report,
) {
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
