//! Machine files. Every section and key is a group of parameters, so that one table of sections
//! reads a file, writes one, and describes it.

mod sheet;

use crate::model::engine_parameter;
use std::slice;
use std::sync::LazyLock;

use serde_json::{Value, json};
use washer_model::{Cabinet, ElementList, Machine, MachineParameter, Spin, Target};

use sweep_engine::config::form::{NumberArray, describe_parameter};
use sweep_engine::config::keys;
use sweep_engine::config::schema::{document, parameter_schema};
use sweep_engine::config::source::is_blank;
use sweep_engine::config::{Diagnostic, Field, Form, KeyWalk, Keys, Report, Section};
use sweep_engine::plan::NumberSources;

use sheet::{MOVING_MASS_KEY, SheetKeys, UNBALANCE_POSITION_KEY, UNBALANCE_SECTIONS};

/// A section of machine files. It has the parameters whose names begin with the section's prefix.
/// Three parameters that differ only in a component are an array: `inertia_kg_m2` is
/// `inertia_11_kg_m2` and two others.
struct MachineSection {
    /// The key of the section; empty for the numbers at the top of the file.
    name: &'static str,
    /// The prefix of the names of the section's parameters. In a list of elements the element's
    /// number follows it.
    parameter_prefix: String,
    occurrence: Occurrence,
    /// A function that returns the number of the machine's elements in the section.
    element_count: fn(&Machine) -> usize,
    /// A function that gives a machine a number of elements, whose optional numbers are omitted.
    set_element_count: fn(&mut Machine, usize),
}

/// The number of times that a section may occur in a file.
#[derive(Clone, Copy)]
enum Occurrence {
    Once,
    AtMostOnce,
    /// An array of tables, with the number of the first element.
    Many(usize),
}

/// A key of a section: a number, or an array of three.
struct MachineKey {
    name: String,
    /// The names of the key's parameters, without the section's prefix.
    parameters: Vec<String>,
    meaning_if_omitted: OmittedKeyMeaning,
}

/// The meaning of a key that is omitted.
#[derive(Clone, Copy, PartialEq)]
enum OmittedKeyMeaning {
    Refused,
    /// The number has this default.
    Default(f64),
    /// The parameter remains without a value.
    Unset,
    /// The program determines the number; [`AUTO`] is the explicit form.
    Auto,
}

/// The word in place of a number that the program determines.
const AUTO_WORD: &str = "auto";

/// The keys of each section, made from the table of parameters.
static KEYS_BY_SECTION: LazyLock<Vec<Vec<MachineKey>>> = LazyLock::new(|| {
    let mut machine = Machine::paper();
    SECTIONS.iter().for_each(|section| (section.set_element_count)(&mut machine, 1));
    let parameters = MachineParameter::all(&machine, &spin_without_parameters());
    let is_single = |parameter: &&MachineParameter| {
        matches!(parameter.target(), Target::Machine | Target::Cabinet)
    };
    let mut suffixes_by_section = vec![Vec::new(); SECTIONS.len()];
    for parameter in parameters.iter().filter(is_single) {
        let name = parameter.name();
        let suffix_in_section =
            |section: &MachineSection| name.strip_prefix(&section.element_prefix(0));
        let candidate_sections =
            (0..SECTIONS.len()).filter_map(|k| Some((suffix_in_section(&SECTIONS[k])?, k)));
        // A parameter belongs to the section with the longest prefix of its name.
        let longest_prefix_section = candidate_sections.min_by_key(|(suffix, _)| suffix.len());
        longest_prefix_section.into_iter().for_each(|(rest, k)| {
            suffixes_by_section[k].push((rest.to_owned(), parameter.default_value()))
        });
    }
    SECTIONS
        .iter()
        .zip(suffixes_by_section)
        .map(|(section, names)| section.build_keys(&names))
        .collect()
});

/// Returns the name of a parameter without its component.
fn without_component(name: &str) -> String {
    let is_component = |word: &&str| ["x", "y", "z", "11", "22", "33"].contains(word);
    name.split('_').filter(|word| !is_component(word)).collect::<Vec<_>>().join("_")
}

impl MachineSection {
    /// Returns the keys of the section's parameters in the order in which they are written:
    /// numbers, arrays, and optional ones. `names` has the names without the prefix, with their
    /// defaults.
    fn build_keys(&self, names: &[(String, Option<f64>)]) -> Vec<MachineKey> {
        let key_of_parameters = |names: &[(String, Option<f64>)]| {
            let (first_name, default_value) = &names[0];
            let name_without_component = without_component(first_name);
            let name = match names.len() {
                1 => first_name.clone(),
                // The position of a foot has the element's name, unlike that of other elements.
                _ if first_name.starts_with("x_") => {
                    format!("{}{name_without_component}", self.parameter_prefix)
                }
                _ => name_without_component,
            };
            let optional_key = OPTIONAL_KEYS.iter().find(|(known, _)| *known == name);
            let meaning_by_table =
                default_value.map_or(OmittedKeyMeaning::Refused, OmittedKeyMeaning::Default);
            let if_omitted = optional_key.map_or(meaning_by_table, |(_, if_omitted)| *if_omitted);
            let parameters = names.iter().map(|(name, _)| name.clone()).collect();
            MachineKey { name, parameters, meaning_if_omitted: if_omitted }
        };
        let mut keys: Vec<MachineKey> = names
            .chunk_by(|(a, _), (b, _)| without_component(a) == without_component(b))
            .map(key_of_parameters)
            .collect();
        keys.sort_by_key(|key| {
            (key.meaning_if_omitted != OmittedKeyMeaning::Refused, key.is_vector())
        });
        keys
    }

    /// Walks over the keys of element `k`.
    fn walk(
        &self,
        section_keys: &'static [MachineKey],
        k: usize,
        machine: &mut Machine,
        sheet: &mut SheetKeys,
        keys: &mut Keys<'_>,
    ) {
        keys.location_prefix = format!("{}.", self.name);
        sheet.walk(self, k, keys);
        section_keys.iter().for_each(|key| key.walk(self, k, machine, sheet, keys));
    }

    /// Returns the prefix of the parameters' names of element `k`.
    fn element_prefix(&self, k: usize) -> String {
        match self.occurrence {
            Occurrence::Many(first) => format!("{}{}_", self.parameter_prefix, k + first),
            Occurrence::Once | Occurrence::AtMostOnce => self.parameter_prefix.clone(),
        }
    }

    /// Returns the header of the section in a file.
    fn header(&self) -> String {
        match self.occurrence {
            Occurrence::Many(..) => format!("[[{}]]", self.name),
            Occurrence::Once | Occurrence::AtMostOnce => format!("[{}]", self.name),
        }
    }
}

impl MachineKey {
    /// Returns whether the key has three numbers.
    fn is_vector(&self) -> bool {
        self.parameters.len() > 1
    }

    /// Returns the full names of the parameters.
    fn parameter_names(&self, prefix: &str) -> Vec<String> {
        self.parameters.iter().map(|name| format!("{prefix}{name}")).collect()
    }

    /// Returns whether each number has a rule by which it follows from a data sheet.
    fn has_assumption(&self, section: &MachineSection, machine: &Machine) -> bool {
        let has_rule = |name: &String| find_parameter(name, machine)?.assumption();
        self.parameter_names(&section.element_prefix(0)).iter().all(|name| has_rule(name).is_some())
    }

    /// Returns the numbers of element `k` that a file contains; `None` if the file may omit them.
    fn values_to_write(
        &self,
        section: &MachineSection,
        k: usize,
        machine: &Machine,
    ) -> Option<Vec<f64>> {
        let names = self.parameter_names(&section.element_prefix(k)).into_iter();
        let values: Vec<f64> =
            names.map(|name| parameter_value(&name, machine)).collect::<Option<_>>()?;
        let needs_writing = match self.meaning_if_omitted {
            OmittedKeyMeaning::Refused => true,
            OmittedKeyMeaning::Default(default) => values.iter().any(|value| *value != default),
            // If a spring has no free length, it follows from the spring's ends.
            OmittedKeyMeaning::Unset | OmittedKeyMeaning::Auto => {
                self.name != FREE_LENGTH_KEY || machine.springs[k].free_length_m.is_some()
            }
        };
        needs_writing.then_some(values)
    }
}

/// Returns a section that every file has once.
fn single_section(name: &'static str) -> MachineSection {
    let prefix = match name {
        "" => String::new(),
        _ => format!("{}_", name.trim_end_matches('s')),
    };
    MachineSection {
        name,
        parameter_prefix: prefix,
        occurrence: Occurrence::Once,
        element_count: |_| 1,
        set_element_count: |_, _| (),
    }
}

/// The key of a spring's free length, which follows from its ends if it is omitted.
const FREE_LENGTH_KEY: &str = "free_length_m";

/// Keys that may be omitted, in addition to those with a default in the table of parameters.
const OPTIONAL_KEYS: [(&str, OmittedKeyMeaning); 2] = [
    (FREE_LENGTH_KEY, OmittedKeyMeaning::Unset),
    ("friction_linear_speed_m_per_s", OmittedKeyMeaning::Auto),
];

/// Every section of a machine file.
static SECTIONS: LazyLock<Vec<MachineSection>> = LazyLock::new(|| {
    let cabinet = MachineSection {
        name: "cabinet",
        parameter_prefix: "cabinet_".to_owned(),
        occurrence: Occurrence::AtMostOnce,
        element_count: |machine| usize::from(machine.cabinet.is_some()),
        set_element_count: |machine, count| machine.cabinet = (count > 0).then(Cabinet::default),
    };
    let to_section = |&ElementList { name, element_name, first_number, count, resize, .. }: &_| {
        let occurrence = Occurrence::Many(first_number);
        MachineSection {
            name,
            parameter_prefix: format!("{element_name}_"),
            occurrence,
            element_count: count,
            set_element_count: resize,
        }
    };
    let single_sections =
        ["", "tub", "shaft", "drum", "unbalance", "flexure", "bearings"].map(single_section);
    single_sections.into_iter().chain([cabinet]).chain(ElementList::all().map(to_section)).collect()
});

/// Maximum number of elements in a list. Basis: far above real machines, and a run stays fast with
/// this number. Doubling it doubles the time of a step with this number.
const MAX_LIST_ELEMENTS: usize = 1000;

/// Returns the paper's machine with one element of each kind that it lacks, so that it has
/// parameters of every kind.
pub(crate) fn machine_with_every_element() -> Machine {
    let mut machine = Machine::paper();
    for section in SECTIONS.iter().filter(|section| (section.element_count)(&Machine::paper()) == 0)
    {
        (section.set_element_count)(&mut machine, 1);
    }
    machine
}

/// Returns a spin without parameters, for functions that need a spin where only machine files are
/// read.
pub(super) fn spin_without_parameters() -> Spin {
    Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() }
}

/// Reads the text of a machine file. A wrong or missing number has the paper's value, and its name
/// is marked as doubtful.
pub(super) fn read(text: &str, root: Section<'_>) -> Machine {
    let mut machine = Machine::paper();
    let report = root.report;
    if is_blank(text) {
        report.push(
            Diagnostic::new("the machine file is empty")
                .at_location(root.location(), "expected a machine"),
        );
        return machine;
    }
    let mut keys = Keys::new(KeyWalk::Read(root));
    walk(&mut machine, &mut keys);
    keys.finish();
    machine
}

/// Returns the JSON schema of machine files.
pub(crate) fn schema() -> Value {
    let description = Keys::described(true, |keys| walk(&mut machine_with_every_element(), keys));
    document("Machine file of sweep", description.finish())
}

/// Returns a machine as JSON with the tables of a machine file, which result files contain. Every
/// number is the shortest decimal that reads back to the same bits.
pub(crate) fn to_json(machine: &Machine) -> Value {
    Keys::described(false, |keys| walk(&mut machine.clone(), keys)).finish()
}

/// The keys at the top of machine files.
pub(crate) const MACHINE_KEYS: [&str; 16] = [
    "gravity_m_per_s2",
    "radial_clearance_m",
    MOVING_MASS_KEY,
    "tub",
    "shaft",
    "drum",
    "unbalance",
    "flexure",
    "bearings",
    "cabinet",
    "springs",
    "dampers",
    "stops",
    "bushings",
    "further_unbalances",
    "feet",
];

/// Walks over every section.
fn walk(machine: &mut Machine, keys: &mut Keys<'_>) {
    let mut sheet = SheetKeys::new(keys);
    for (section, section_keys) in SECTIONS.iter().zip(&*KEYS_BY_SECTION) {
        let table_key = keys::Key::new(section.name, "");
        match section.occurrence {
            _ if section.name.is_empty() => {
                section.walk(section_keys, 0, machine, &mut sheet, keys)
            }
            Occurrence::Once => {
                let expected = format!("a section {}", section.header());
                let is_assumed =
                    section_keys.iter().all(|key| key.has_assumption(section, machine));
                let is_needed = !(is_assumed && (sheet.has_sheet_key || keys.is_schema()));
                let table_key = if is_needed { table_key.required(&expected) } else { table_key };
                let field = keys.walk_table(table_key, |keys| {
                    section.walk(section_keys, 0, machine, &mut sheet, keys)
                });
                if !is_needed && matches!(field, Field::Absent) && keys.section().is_some() {
                    let names = section_keys
                        .iter()
                        .flat_map(|key| key.parameter_names(&section.parameter_prefix));
                    sheet
                        .omitted_parameters
                        .extend(names.filter_map(|name| find_parameter(&name, machine)));
                    continue;
                }
                if let (None, Some(report)) =
                    (field.into_located(), keys.section().map(|section| section.report))
                {
                    section_keys.iter().for_each(|key| {
                        mark_doubtful(key.parameter_names(&section.parameter_prefix), report)
                    });
                }
            }
            Occurrence::AtMostOnce => drop(keys.walk_table(table_key, |keys| {
                if keys.section().is_some() {
                    (section.set_element_count)(machine, 1);
                }
                for k in 0..(section.element_count)(machine) {
                    section.walk(section_keys, k, machine, &mut sheet, keys);
                }
            })),
            Occurrence::Many(_) => {
                let mut sections = Vec::new();
                if let Some(root) = keys.section() {
                    sections = element_tables(section, root);
                    (section.set_element_count)(machine, sections.len());
                }
                // A plan lists springs and dampers even if there are none, so that its hash stays
                // the same.
                let count = (section.element_count)(machine);
                if count > 0 || ["springs", "dampers"].contains(&section.name) {
                    keys.walk_tables(table_key, sections, count, |keys, k| {
                        section.walk(section_keys, k, machine, &mut sheet, keys);
                    });
                }
            }
        }
    }
    let Some(root) = keys.section() else { return };
    if machine.springs.is_empty() && machine.bushings.is_empty() {
        let expected = "at least one [[springs]] or [[bushings]]: nothing else carries the machine";
        root.report_missing("springs", expected);
        // With the built-in machine's springs later checks do not report this mistake again.
        machine.springs = Machine::paper().springs;
    }
    let plane_positions = std::mem::take(&mut sheet.plane_positions);
    if sheet.has_sheet_key {
        sheet.fill_omitted(machine, root);
    }
    for (parameter, plane) in plane_positions {
        let x_m = plane.x_m(machine);
        parameter.set(machine, &mut spin_without_parameters(), x_m);
    }
}

/// Returns the tables of a list, up to the maximum number of elements.
fn element_tables<'a>(section: &MachineSection, root: &Section<'a>) -> Vec<Section<'a>> {
    let mut sections = root.tables(section.name);
    if let Some(first_excess_element) = sections.get(MAX_LIST_ELEMENTS) {
        let title = format!("the machine has {} {}", sections.len(), section.name);
        let expected = format!("expected at most {MAX_LIST_ELEMENTS}");
        root.report
            .push(Diagnostic::new(title).at_location(first_excess_element.location(), expected));
        sections.truncate(MAX_LIST_ELEMENTS);
    }
    sections
}

impl MachineKey {
    /// Walks over the key of element `k`.
    fn walk(
        &'static self,
        section: &MachineSection,
        k: usize,
        machine: &mut Machine,
        sheet: &mut SheetKeys,
        keys: &mut Keys<'_>,
    ) {
        let names = self.parameter_names(&section.element_prefix(k));
        let parameters: Vec<_> =
            names.iter().filter_map(|name| find_parameter(name, machine)).collect();
        let Some(first_parameter) = parameters.first() else { return };
        let number_form = Form::Number(first_parameter.range());
        let read_number_or_auto = |section: &Section<'_>, key| match section.is_text(key) {
            true => section.choice(key, &[AUTO_WORD]).map(|_| AUTO_WORD.into()),
            false => number_form.read(section, key, ""),
        };
        let (value_form, description, expected) = match self.meaning_if_omitted {
            _ if self.is_vector() => {
                let three_numbers =
                    NumberArray::new(first_parameter.range(), 3..=3, "expected three numbers");
                (
                    Form::Numbers(NumberArray { location_keys: names.clone(), ..three_numbers }),
                    String::new(),
                    "an array of three numbers".to_owned(),
                )
            }
            OmittedKeyMeaning::Auto => {
                let schema = parameter_schema(&engine_parameter(
                    first_parameter.clone(),
                    machine,
                    &spin_without_parameters(),
                ));
                let schema = json!({ "anyOf": [schema, { "const": AUTO_WORD }] });
                (Form::Custom(&read_number_or_auto, schema), String::new(), String::new())
            }
            _ => {
                let expected =
                    format!("{}: {}", first_parameter.description(), first_parameter.range());
                (
                    Form::Number(first_parameter.range()),
                    describe_parameter(&engine_parameter(
                        first_parameter.clone(),
                        machine,
                        &spin_without_parameters(),
                    )),
                    expected,
                )
            }
        };
        let may_be_assumed = keys.is_schema() || sheet.has_sheet_key;
        let is_assumed = may_be_assumed && self.has_assumption(section, machine);
        let may_have_plane = keys.is_schema() && UNBALANCE_SECTIONS.contains(&section.name);
        let has_plane = sheet.has_plane(section, k, &self.name)
            || may_have_plane && self.name == UNBALANCE_POSITION_KEY;
        let is_needed =
            self.meaning_if_omitted == OmittedKeyMeaning::Refused && !is_assumed && !has_plane;
        let key = keys::Key::new(&self.name, &description);
        let key = if is_needed { key.required(&expected) } else { key };
        let mut value = match self.meaning_if_omitted {
            _ if !keys.is_schema() => self.written_value(section, k, machine),
            OmittedKeyMeaning::Auto => AUTO_WORD.into(),
            OmittedKeyMeaning::Default(default) if !self.is_vector() => default.into(),
            _ => Value::Null,
        };
        let field = keys.walk_key(key, &value_form, &mut value);
        let Some(report) = keys.section().map(|section| section.report) else { return };
        let numbers = value.as_array().map_or(slice::from_ref(&value), Vec::as_slice);
        match field {
            Field::Present(location) => {
                let numbers = numbers.iter().filter_map(Value::as_f64);
                for (parameter, number) in parameters.iter().zip(numbers) {
                    parameter.set(machine, &mut spin_without_parameters(), number);
                    if !self.is_vector() {
                        report.record_location(parameter.name(), location.location.clone());
                    }
                }
            }
            Field::Absent if has_plane => {}
            Field::Absent if is_assumed => sheet.omitted_parameters.extend(parameters),
            Field::Absent if !is_needed => {}
            Field::Absent | Field::Rejected => mark_doubtful(names, report),
        }
    }

    /// Returns the value of the key in a file of the machine; null if the file omits it.
    fn written_value(&self, section: &MachineSection, k: usize, machine: &Machine) -> Value {
        match self.values_to_write(section, k, machine) {
            Some(values) if self.is_vector() => values.into(),
            Some(values) => values[0].into(),
            None if self.meaning_if_omitted == OmittedKeyMeaning::Auto
                && machine.dampers[k].friction_n != 0.0 =>
            {
                AUTO_WORD.into()
            }
            None => Value::Null,
        }
    }
}

/// Marks parameters as doubtful, so that later checks skip them.
fn mark_doubtful(names: Vec<String>, report: &Report) {
    names.into_iter().for_each(|name| report.mark_invalid(name));
}

/// Returns the parameter of a name, if the machine has it.
fn find_parameter(name: &str, machine: &Machine) -> Option<MachineParameter> {
    MachineParameter::find(name, machine, &spin_without_parameters()).ok()
}

/// Returns the value of the parameter of a name, if the machine has it.
fn parameter_value(name: &str, machine: &Machine) -> Option<f64> {
    find_parameter(name, machine)?.get(machine, &spin_without_parameters())
}

/// Returns the text of a machine file, in which each number has its description and source. A
/// number that no file gave has the source of the built-in machine's number. The text reads back to
/// the same machine, bit for bit.
pub(crate) fn to_toml(machine: &Machine, sources: &NumberSources) -> String {
    let mut text = "# A machine in full, in SI units. Lengths in m from O, midway between the \
                    bearings before loading: x along the\n\
         # drum axis towards the door, y up, z sideways. Inertia about each body's own mass \
         centre, in body axes.\n"
        .to_owned();
    let sections_with_keys = SECTIONS.iter().zip(&*KEYS_BY_SECTION);
    for (section, section_keys, k) in sections_with_keys.flat_map(|(section, section_keys)| {
        (0..(section.element_count)(machine)).map(move |k| (section, section_keys, k))
    }) {
        if !section.name.is_empty() {
            text.push_str(&format!("\n{}\n", section.header()));
        }
        for key in section_keys {
            let Some(values) = key.values_to_write(section, k, machine) else { continue };
            let line = match key.is_vector() {
                true => format!("{} = {values:?}", key.name),
                false => format!("{} = {:?}", key.name, values[0]),
            };
            let names = key.parameter_names(&section.element_prefix(k));
            let user_source = sources.source(&names);
            let has_comment =
                user_source.is_some() || key.meaning_if_omitted == OmittedKeyMeaning::Refused;
            match find_parameter(&names[0], machine).filter(|_| has_comment) {
                Some(first_parameter) => {
                    let source_text =
                        user_source.unwrap_or_else(|| first_parameter.source().to_owned());
                    let description = first_parameter.description();
                    let description =
                        if key.is_vector() { String::new() } else { format!("{description} ") };
                    text.push_str(&format!("{line:<40} # {description}[{source_text}]\n"));
                }
                None => text.push_str(&format!("{line}\n")),
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_listed_keys_are_those_that_are_read() {
        let top_keys =
            |(section, section_keys): (&MachineSection, &Vec<MachineKey>)| match section.name {
                "" => section_keys.iter().map(|key| key.name.clone()).collect(),
                name => vec![name.to_owned()],
            };
        let mut read_keys: BTreeSet<String> =
            SECTIONS.iter().zip(&*KEYS_BY_SECTION).flat_map(top_keys).collect();
        read_keys.insert(MOVING_MASS_KEY.to_owned());
        assert_eq!(read_keys, MACHINE_KEYS.map(str::to_owned).into());
    }
}
