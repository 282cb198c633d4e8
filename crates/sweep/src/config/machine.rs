//! Machine files: every section and key is a group of parameters, so one small table of their names
//! reads a file, writes one, and describes it.

use serde_json::{Map, Value};
use washer_model::{
    BumpStop, Bushing, Cabinet, Damper, Foot, Machine, Parameter, Spin, Spring, Unbalance,
};

use sweep_engine::config::origins::Origins;
use sweep_engine::config::report::{Diagnostic, Report};
use sweep_engine::config::section::{Field, Section};
use sweep_engine::config::source::Location;
use sweep_engine::config::source::is_blank;

/// A section of the machine file. Parameters are named `<prefix>_<number>` and, for vectors, with
/// the component before the unit: `inertia_kg_m2` holds `inertia_11_kg_m2` and two more.
pub(super) struct Block {
    /// Key of the section; empty for the numbers at the top of the file.
    pub(super) section: &'static str,
    /// What its parameters' names begin with.
    pub(super) prefix: &'static str,
    pub(super) numbers: &'static [&'static str],
    pub(super) vectors: &'static [Vector],
}

/// A key that holds three parameters.
type Vector = (&'static str, [&'static str; 3]);

/// A section that a machine file may have any number of times. Its prefix is completed by the
/// element's number.
pub(super) struct List {
    pub(super) block: Block,
    /// Number of the first element.
    pub(super) first: usize,
    /// Numbers that may be left out, and what they are then; none where that is no number of the
    /// file.
    pub(super) optional: &'static [(&'static str, Option<f64>)],
    /// Vectors that may be left out. They are zero then.
    pub(super) optional_vectors: &'static [Vector],
    /// How many a machine has.
    count: fn(&Machine) -> usize,
    /// Gives a machine so many, each with what may be left out left out.
    fill: fn(&mut Machine, usize),
    /// What a machine needs one for, if it does.
    pub(super) needed: Option<&'static str>,
}

impl List {
    fn prefix(&self, k: usize) -> String {
        format!("{}{}_", self.block.prefix, k + self.first)
    }
}

const INERTIA: (&str, [&str; 3]) =
    ("inertia_kg_m2", ["inertia_11_kg_m2", "inertia_22_kg_m2", "inertia_33_kg_m2"]);
const TUB_END: Vector = ("tub_m", ["tub_x_m", "tub_y_m", "tub_z_m"]);
const ENDS: &[Vector] = &[("cabinet_m", ["cabinet_x_m", "cabinet_y_m", "cabinet_z_m"]), TUB_END];

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
/// The section that a machine file has once or not at all.
pub(super) const CABINET: Block = Block {
    section: "cabinet",
    prefix: "cabinet_",
    numbers: &["mass_kg", "friction"],
    vectors: &[("centre_m", ["centre_x_m", "centre_y_m", "centre_z_m"])],
};
/// Springs by their place in [`LISTS`].
const SPRINGS: usize = 0;
/// The sections that a machine file has any number of times.
pub(super) const LISTS: [List; 6] = [
    List {
        block: Block {
            section: "springs",
            prefix: "spring_",
            numbers: &["stiffness_n_per_m"],
            vectors: ENDS,
        },
        first: 1,
        optional: &[(FREE_LENGTH, None), ("cubic_n_per_m3", Some(0.0))],
        optional_vectors: &[],
        count: |machine| machine.springs.len(),
        fill: |machine, count| {
            let like = Machine::paper().springs[0];
            machine.springs = vec![Spring { free_length_m: None, ..like }; count];
        },
        needed: Some("at least one [[springs]]: nothing else carries the machine"),
    },
    List {
        block: Block {
            section: "dampers",
            prefix: "damper_",
            numbers: &["damping_n_s_per_m"],
            vectors: ENDS,
        },
        first: 1,
        optional: &[
            ("friction_n", Some(0.0)),
            ("friction_speed_m_per_s", Some(Damper::FRICTION_SPEED_M_PER_S)),
            ("friction_linear_speed_m_per_s", None),
        ],
        optional_vectors: &[],
        count: |machine| machine.dampers.len(),
        fill: |machine, count| machine.dampers = vec![Machine::paper().dampers[0]; count],
        needed: None,
    },
    List {
        block: Block {
            section: "stops",
            prefix: "stop_",
            numbers: &["clearance_m", "stiffness_n_per_m"],
            vectors: &[TUB_END, ("direction", ["direction_x", "direction_y", "direction_z"])],
        },
        first: 1,
        optional: &[("damping_n_s_per_m", Some(0.0)), ("softness_m", Some(BumpStop::SOFTNESS_M))],
        optional_vectors: &[],
        count: |machine| machine.stops.len(),
        fill: |machine, count| machine.stops = vec![BumpStop::default(); count],
        needed: None,
    },
    List {
        block: Block {
            section: "bushings",
            prefix: "bushing_",
            numbers: &[],
            vectors: &[
                TUB_END,
                (
                    "stiffness_n_per_m",
                    ["stiffness_x_n_per_m", "stiffness_y_n_per_m", "stiffness_z_n_per_m"],
                ),
            ],
        },
        first: 1,
        optional: &[],
        optional_vectors: &[
            ("cubic_n_per_m3", ["cubic_x_n_per_m3", "cubic_y_n_per_m3", "cubic_z_n_per_m3"]),
            (
                "damping_n_s_per_m",
                ["damping_x_n_s_per_m", "damping_y_n_s_per_m", "damping_z_n_s_per_m"],
            ),
        ],
        count: |machine| machine.bushings.len(),
        fill: |machine, count| machine.bushings = vec![Bushing::default(); count],
        needed: None,
    },
    List {
        block: Block {
            section: "further_unbalances",
            prefix: "unbalance_",
            numbers: &["mass_kg", "x_m", "radius_m"],
            vectors: &[],
        },
        // The first is `[unbalance]`.
        first: 2,
        optional: &[],
        optional_vectors: &[],
        count: |machine| machine.further_unbalances.len(),
        fill: |machine, count| {
            machine.further_unbalances = vec![Unbalance::default(); count];
        },
        needed: None,
    },
    List {
        block: Block {
            section: "feet",
            prefix: "foot_",
            numbers: &[],
            vectors: &[("foot_m", ["x_m", "y_m", "z_m"])],
        },
        first: 1,
        optional: &[],
        optional_vectors: &[],
        count: |machine| machine.feet.len(),
        fill: |machine, count| machine.feet = vec![Foot::default(); count],
        needed: None,
    },
];
/// Most elements of one list: enough for any machine, and what depends on all of them stays quick.
const MOST_ELEMENTS: usize = 1000;
/// A spring's free length follows its ends where it is left out.
const FREE_LENGTH: &str = "free_length_m";

/// The paper's machine with one of each element that it lacks: every kind of parameter has a name
/// there.
pub(crate) fn with_one_of_each() -> Machine {
    let mut machine = Machine { cabinet: Some(Cabinet::default()), ..Machine::paper() };
    for list in LISTS.iter().filter(|list| (list.count)(&Machine::paper()) == 0) {
        (list.fill)(&mut machine, 1);
    }
    machine
}

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

    if let Some(mut section) = root.table(CABINET.section, "[cabinet]", reader.report).given() {
        reader.machine.cabinet = Some(Cabinet::default());
        reader.block(&CABINET, CABINET.prefix, &mut section.value);
        section.value.finish(reader.report);
    }

    for (place, list) in LISTS.iter().enumerate() {
        let sections = reader.elements(&list.block, &mut root);
        (list.fill)(reader.machine, sections.len());
        if let Some(expected) = list.needed.filter(|_| sections.is_empty()) {
            root.missing(list.block.section, expected, reader.report);
            if place == SPRINGS {
                reader.machine.springs = Machine::paper().springs;
            }
        }
        for (k, mut section) in sections.into_iter().enumerate() {
            let prefix = list.prefix(k);
            reader.block(&list.block, &prefix, &mut section);
            for &(key, _) in list.optional {
                reader.number(&prefix, key, false, &mut section);
            }
            for (key, components) in list.optional_vectors {
                reader.vector(&prefix, key, components, false, &mut section);
            }
            section.finish(reader.report);
        }
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
    /// The tables of a list, no more of them than are accepted.
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
            self.vector(prefix, key, components, true, section);
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
        if !required && matches!(field, Field::Absent) {
            return;
        }
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
        required: bool,
        section: &mut Section<'_>,
    ) {
        let names = components.map(|component| format!("{prefix}{component}"));
        let parameters: Vec<_> = names.iter().filter_map(|name| self.find(name)).collect();
        let Some(first) = parameters.first() else { return };
        let field = section.numbers(key, first.range(), self.report);
        if !required && matches!(field, Field::Absent) {
            return;
        }
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
    if machine.cabinet.is_some() {
        let numbers = block_to_json(&CABINET, CABINET.prefix, machine);
        root.insert(CABINET.section.to_owned(), Value::Object(numbers));
    }
    for list in &LISTS {
        let count = (list.count)(machine);
        // The two that machines have always had are written even where there are none.
        let is_old = list.block.section == "springs" || list.block.section == "dampers";
        if count == 0 && !is_old {
            continue;
        }
        let element = |k: usize| {
            let prefix = list.prefix(k);
            let mut numbers = block_to_json(&list.block, &prefix, machine);
            for (key, value) in given_numbers(list, k, machine) {
                numbers.insert(key.to_owned(), value.into());
            }
            for (key, values) in given_vectors(list, k, machine) {
                numbers.insert(key.to_owned(), values.to_vec().into());
            }
            Value::Object(numbers)
        };
        root.insert(list.block.section.to_owned(), (0..count).map(element).collect());
    }
    Value::Object(root)
}

/// A parameter's value.
fn value(name: &str, machine: &Machine) -> Option<f64> {
    Parameter::find(name, machine, &no_spin()).ok()?.get(machine, &no_spin())
}

/// The numbers of an element that may be left out and that it has.
fn given_numbers(list: &List, k: usize, machine: &Machine) -> Vec<(&'static str, f64)> {
    let given = |&(key, default): &(&'static str, Option<f64>)| {
        let is_of_ends = key == FREE_LENGTH && machine.springs[k].free_length_m.is_none();
        let value = value(&format!("{}{key}", list.prefix(k)), machine).filter(|_| !is_of_ends)?;
        (default != Some(value)).then_some((key, value))
    };
    list.optional.iter().filter_map(given).collect()
}

/// The same of vectors.
fn given_vectors(list: &List, k: usize, machine: &Machine) -> Vec<(&'static str, [f64; 3])> {
    let given = |(key, components): &Vector| {
        let values = components.map(|component| {
            value(&format!("{}{component}", list.prefix(k)), machine).unwrap_or(0.0)
        });
        (values != [0.0; 3]).then_some((*key, values))
    };
    list.optional_vectors.iter().filter_map(given).collect()
}

fn block_to_json(block: &Block, prefix: &str, machine: &Machine) -> Map<String, Value> {
    let number =
        |name: &str| value(&format!("{prefix}{name}"), machine).map_or(Value::Null, Value::from);
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
    if machine.cabinet.is_some() {
        text.push_str(&block_to_toml(&CABINET, CABINET.prefix, "[cabinet]", machine));
    }
    for list in &LISTS {
        let header = format!("[[{}]]", list.block.section);
        for k in 0..(list.count)(machine) {
            text.push_str(&block_to_toml(&list.block, &list.prefix(k), &header, machine));
            for (key, value) in given_numbers(list, k, machine) {
                text.push_str(&format!("{key} = {value:?}\n"));
            }
            for (key, values) in given_vectors(list, k, machine) {
                text.push_str(&format!("{key} = {values:?}\n"));
            }
        }
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
