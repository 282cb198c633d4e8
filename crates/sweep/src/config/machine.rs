//! Machine files: every section and key is a group of parameters, so one small table of their names
//! reads a file, writes one, and describes it.

use std::path::Path;

use serde_json::{Map, Value};
use washer_model::{Damper, Machine, Parameter, Spin, Spring};

use super::grid::is_blank;
use super::origins::Origins;
use super::report::{Diagnostic, Report};
use super::section::Section;
use super::source::Location;

/// A section of the machine file. Parameters are named `<prefix>_<number>` and, for vectors, with
/// the component before the unit: `inertia_kg_m2` holds `inertia_11_kg_m2` and two more.
pub(super) struct Block {
    /// Key of the section; empty for the numbers at the top of the file.
    pub(super) section: &'static str,
    /// What its parameters' names begin with.
    pub(super) prefix: &'static str,
    pub(super) numbers: &'static [&'static str],
    pub(super) vectors: &'static [(&'static str, [&'static str; 3])],
}

const INERTIA: (&str, [&str; 3]) =
    ("inertia_kg_m2", ["inertia_11_kg_m2", "inertia_22_kg_m2", "inertia_33_kg_m2"]);
const ENDS: &[(&str, [&str; 3])] = &[
    ("cabinet_m", ["cabinet_x_m", "cabinet_y_m", "cabinet_z_m"]),
    ("tub_m", ["tub_x_m", "tub_y_m", "tub_z_m"]),
];

/// The sections that a machine file has once.
#[rustfmt::skip]
pub(super) const BLOCKS: [Block; 7] = [
    Block {
        section: "", prefix: "", vectors: &[],
        numbers: &["gravity_m_per_s2", "radial_clearance_m"],
    },
    Block {
        section: "tub", prefix: "tub_", vectors: &[INERTIA],
        numbers: &["mass_kg", "centre_x_m", "front_x_m"],
    },
    Block {
        section: "shaft", prefix: "shaft_", vectors: &[INERTIA],
        numbers: &["mass_kg", "centre_x_m"],
    },
    Block {
        section: "drum", prefix: "drum_", vectors: &[INERTIA],
        numbers: &["mass_kg", "centre_x_m", "hinge_x_m", "front_x_m"],
    },
    Block {
        section: "unbalance", prefix: "unbalance_", vectors: &[],
        numbers: &["mass_kg", "x_m", "radius_m"],
    },
    Block {
        section: "flexure", prefix: "flexure_", vectors: &[],
        numbers: &["stiffness_n_m_per_rad"],
    },
    Block {
        section: "bearings", prefix: "bearing_", vectors: &[],
        numbers: &[
            "front_x_m", "rear_x_m", "front_stiffness_n_per_m", "rear_stiffness_n_per_m",
        ],
    },
];
/// One `[[springs]]`; its prefix is completed by the number.
pub(super) const SPRINGS: Block =
    Block { section: "springs", prefix: "spring_", numbers: &["stiffness_n_per_m"], vectors: ENDS };
/// One `[[dampers]]`; its prefix is completed by the number.
pub(super) const DAMPERS: Block =
    Block { section: "dampers", prefix: "damper_", numbers: &["damping_n_s_per_m"], vectors: ENDS };
/// Most springs, and most dampers, of a machine: enough for any, and what depends on all of them
/// stays quick.
const MOST_ELEMENTS: usize = 1000;
/// The one key that may be left out of a spring.
pub(super) const FREE_LENGTH: &str = "free_length_m";

/// Parameters of no machine file take a spin; this one has no number of its own.
pub(super) fn no_spin() -> Spin {
    Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() }
}

/// Reads a machine file's text. Wrong and missing numbers keep the paper's, and their names are
/// marked doubtful.
pub(super) fn read(
    text: &str,
    root: Section<'_>,
    origins: &mut Origins,
    report: &mut Report,
) -> Machine {
    let mut machine = Machine::paper();
    let mut root = root;
    if is_blank(text) {
        report
            .push(Diagnostic::new("the machine file is empty").at(root.at(), "expected a machine"));
        return machine;
    }
    let mut reader = MachineReader { machine: &mut machine, origins, report };
    for block in &BLOCKS {
        if block.section.is_empty() {
            reader.block(block, "", &mut root);
            continue;
        }
        let title = format!("[{}]", block.section);
        let field = root.table(block.section, &title, reader.report);
        match root.require(field, block.section, &format!("a section {title}"), reader.report) {
            Some(mut section) => {
                reader.block(block, block.prefix, &mut section.value);
                section.value.finish(reader.report);
            }
            None => reader.doubt(block, block.prefix),
        }
    }

    let springs = reader.elements(&SPRINGS, &mut root);
    let dampers = reader.elements(&DAMPERS, &mut root);
    let like = Machine::paper();
    reader.machine.springs = vec![Spring { free_length_m: None, ..like.springs[0] }; springs.len()];
    reader.machine.dampers = vec![Damper { ..like.dampers[0] }; dampers.len()];
    if springs.is_empty() {
        root.missing(
            SPRINGS.section,
            "at least one [[springs]]: nothing else carries the machine",
            reader.report,
        );
        reader.machine.springs.clone_from(&like.springs);
    }
    for (k, mut section) in springs.into_iter().enumerate() {
        let prefix = format!("{}{}_", SPRINGS.prefix, k + 1);
        reader.block(&SPRINGS, &prefix, &mut section);
        reader.number(&prefix, FREE_LENGTH, false, &mut section);
        section.finish(reader.report);
    }
    for (k, mut section) in dampers.into_iter().enumerate() {
        reader.block(&DAMPERS, &format!("{}{}_", DAMPERS.prefix, k + 1), &mut section);
        section.finish(reader.report);
    }
    root.finish(report);
    machine
}

struct MachineReader<'r> {
    machine: &'r mut Machine,
    origins: &'r mut Origins,
    report: &'r mut Report,
}

impl MachineReader<'_> {
    /// The tables of springs or dampers, no more of them than are accepted.
    fn elements<'a>(&mut self, block: &Block, root: &mut Section<'a>) -> Vec<Section<'a>> {
        let mut sections = root.tables(block.section, self.report);
        if let Some(first_beyond) = sections.get(MOST_ELEMENTS) {
            let title = format!("the machine has {} {}", sections.len(), block.section);
            let expected = format!("expected at most {MOST_ELEMENTS}");
            self.report.push(Diagnostic::new(title).at(first_beyond.at(), expected));
            sections.truncate(MOST_ELEMENTS);
        }
        sections
    }

    fn block(&mut self, block: &Block, prefix: &str, section: &mut Section<'_>) {
        for &key in block.numbers {
            self.number(prefix, key, true, section);
        }
        for (key, components) in block.vectors {
            self.vector(prefix, key, components, section);
        }
    }

    fn number(
        &mut self,
        prefix: &str,
        key: &'static str,
        required: bool,
        section: &mut Section<'_>,
    ) {
        let name = format!("{prefix}{key}");
        let Some(parameter) = self.find(&name) else { return };
        let field = section.number(key, parameter.range(), self.report);
        let found = if required {
            let expected = format!("{}: {}", parameter.description(), parameter.range());
            section.require(field, key, &expected, self.report)
        } else {
            field.given()
        };
        match found {
            Some(number) => self.write(&parameter, number.value, number.at),
            None => self.origins.doubt(name),
        }
    }

    fn vector(
        &mut self,
        prefix: &str,
        key: &'static str,
        components: &[&str; 3],
        section: &mut Section<'_>,
    ) {
        let names = components.map(|component| format!("{prefix}{component}"));
        let parameters: Vec<_> = names.iter().filter_map(|name| self.find(name)).collect();
        let Some(first) = parameters.first() else { return };
        let field = section.numbers(key, first.range(), self.report);
        let found = section.require(field, key, "an array of three numbers", self.report);
        match found {
            Some(numbers) if numbers.value.len() == parameters.len() => {
                for (parameter, number) in parameters.iter().zip(numbers.value) {
                    self.write(parameter, number.value, number.at);
                }
            }
            Some(numbers) => {
                let title = format!("`{key}` has {} numbers", numbers.value.len());
                self.report.push(Diagnostic::new(title).at(&numbers.at, "expected three numbers"));
                names.into_iter().for_each(|name| self.origins.doubt(name));
            }
            None => names.into_iter().for_each(|name| self.origins.doubt(name)),
        }
    }

    fn find(&self, name: &str) -> Option<Parameter> {
        Parameter::find(name, self.machine, &no_spin()).ok()
    }

    fn write(&mut self, parameter: &Parameter, value: f64, at: Location) {
        parameter.set(self.machine, &mut no_spin(), value);
        self.origins.put(parameter.name().to_owned(), at);
    }

    fn doubt(&mut self, block: &Block, prefix: &str) {
        let vectors = block.vectors.iter().flat_map(|(_, components)| components);
        for name in block.numbers.iter().chain(vectors) {
            self.origins.doubt(format!("{prefix}{name}"));
        }
    }
}

/// Path of a machine file as the grid file means it.
pub(super) fn beside(grid: &Path, machine: &str) -> std::path::PathBuf {
    grid.parent().unwrap_or(Path::new("")).join(machine)
}

/// The machine as a machine file's tables hold it; every number as its shortest decimal that reads
/// back the same.
pub(crate) fn to_json(machine: &Machine) -> Value {
    let mut root = Map::new();
    for block in &BLOCKS {
        let numbers = block_to_json(block, block.prefix, machine);
        if block.section.is_empty() {
            root.extend(numbers);
        } else {
            root.insert(block.section.to_owned(), Value::Object(numbers));
        }
    }
    let spring = |(k, spring): (usize, &Spring)| {
        let mut numbers =
            block_to_json(&SPRINGS, &format!("{}{}_", SPRINGS.prefix, k + 1), machine);
        if let Some(free_length_m) = spring.free_length_m {
            numbers.insert(FREE_LENGTH.to_owned(), free_length_m.into());
        }
        Value::Object(numbers)
    };
    let springs = machine.springs.iter().enumerate().map(spring).collect();
    root.insert(SPRINGS.section.to_owned(), springs);
    let damper =
        |k: usize| block_to_json(&DAMPERS, &format!("{}{}_", DAMPERS.prefix, k + 1), machine);
    let dampers = (0..machine.dampers.len()).map(|k| Value::Object(damper(k))).collect();
    root.insert(DAMPERS.section.to_owned(), dampers);
    Value::Object(root)
}

fn block_to_json(block: &Block, prefix: &str, machine: &Machine) -> Map<String, Value> {
    let number = |name: &str| {
        let parameter = Parameter::find(&format!("{prefix}{name}"), machine, &no_spin()).ok();
        parameter
            .and_then(|parameter| parameter.get(machine, &no_spin()))
            .map_or(Value::Null, Value::from)
    };
    let numbers = block.numbers.iter().map(|&key| (key.to_owned(), number(key)));
    let vector = |components: &[&str; 3]| components.iter().map(|name| number(name)).collect();
    let vectors =
        block.vectors.iter().map(|(key, components)| ((*key).to_owned(), vector(components)));
    numbers.chain(vectors).collect()
}

/// The machine as the text of a machine file, each number with its meaning and source.
pub(crate) fn to_toml(machine: &Machine) -> String {
    let mut text = "# A machine in full, in SI units. Lengths in m from O, midway between the \
                    bearings before loading: x along the\n\
         # drum axis towards the door, y up, z sideways. Inertia about each body's own mass \
         centre, in body axes.\n"
        .to_owned();
    for block in &BLOCKS {
        let header =
            if block.section.is_empty() { String::new() } else { format!("[{}]", block.section) };
        text.push_str(&block_to_toml(block, block.prefix, &header, machine));
    }
    for (k, spring) in machine.springs.iter().enumerate() {
        let prefix = format!("{}{}_", SPRINGS.prefix, k + 1);
        text.push_str(&block_to_toml(&SPRINGS, &prefix, "[[springs]]", machine));
        if let Some(free_length_m) = spring.free_length_m {
            text.push_str(&format!("{FREE_LENGTH} = {free_length_m:?}\n"));
        }
    }
    for k in 0..machine.dampers.len() {
        text.push_str(&block_to_toml(
            &DAMPERS,
            &format!("{}{}_", DAMPERS.prefix, k + 1),
            "[[dampers]]",
            machine,
        ));
    }
    text
}

fn block_to_toml(block: &Block, prefix: &str, header: &str, machine: &Machine) -> String {
    let find = |name: &str| Parameter::find(&format!("{prefix}{name}"), machine, &no_spin()).ok();
    let value = |parameter: &Parameter| parameter.get(machine, &no_spin()).unwrap_or(f64::NAN);
    let mut text = if header.is_empty() { String::new() } else { format!("\n{header}\n") };
    for key in block.numbers {
        if let Some(parameter) = find(key) {
            let written = format!("{key} = {:?}", value(&parameter));
            text.push_str(&format!(
                "{written:<40} # {} [{}]\n",
                parameter.description(),
                parameter.source()
            ));
        }
    }
    for (key, components) in block.vectors {
        let parameters: Vec<_> = components.iter().filter_map(|name| find(name)).collect();
        let values: Vec<_> =
            parameters.iter().map(|parameter| format!("{:?}", value(parameter))).collect();
        let source =
            parameters.first().map_or_else(String::new, |parameter| parameter.source().to_string());
        let written = format!("{key} = [{}]", values.join(", "));
        text.push_str(&format!("{written:<40} # [{source}]\n"));
    }
    text
}
