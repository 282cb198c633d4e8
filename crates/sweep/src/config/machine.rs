//! Machine files: every section and key is a group of parameters, so one small table of their names
//! reads a file, writes one, and describes it.

use std::slice;
use std::sync::LazyLock;

use serde_json::{Value, json};
use sweep_parameter::Range;
use washer_model::{Cabinet, DataSheet, ElementList, Machine, Parameter, Spin, Target};

use sweep_engine::config::form::{Numbers, describe_parameter};
use sweep_engine::config::keys;
use sweep_engine::config::schema::{document, parameter_schema};
use sweep_engine::config::source::is_blank;
use sweep_engine::config::{Diagnostic, Field, Form, KeyWalk, Keys, Report, Section};
use sweep_engine::plan::WrittenIn;

/// A section of the machine file. It holds the parameters whose names begin with its prefix. Three
/// that differ in a component are an array: `inertia_kg_m2` holds `inertia_11_kg_m2` and two more.
struct Part {
    /// Key of the section; empty for the numbers at the top of the file.
    section: &'static str,
    /// What its parameters' names begin with; completed by the element's number where there may be
    /// any number of them.
    prefix: String,
    /// How often it may stand in a file.
    times: Times,
    /// How many a machine has.
    count: fn(&Machine) -> usize,
    /// Gives a machine so many, each with what may be left out left out.
    fill: fn(&mut Machine, usize),
}

/// How often a section may stand in a file.
#[derive(Clone, Copy)]
enum Times {
    Once,
    AtMostOnce,
    /// As an array of tables, with the number of the first element.
    Many(usize),
}

/// A key of a section: a number, or three in an array.
struct Key {
    name: String,
    /// Its parameters, behind the section's prefix.
    parameters: Vec<String>,
    left_out: LeftOut,
}

/// What it means that a key is not there.
#[derive(Clone, Copy, PartialEq)]
enum LeftOut {
    Refused,
    /// It is this.
    Is(f64),
    /// It is no number of the file.
    Nothing,
    /// The same, and [`AUTO`] says so too.
    Auto,
}

/// What stands for a number that the program finds.
const AUTO: &str = "auto";

/// The keys of each part, by the table of parameters.
static KEYS: LazyLock<Vec<Vec<Key>>> = LazyLock::new(|| {
    let mut machine = Machine::paper();
    PARTS.iter().for_each(|part| (part.fill)(&mut machine, 1));
    let all = Parameter::all(&machine, &no_spin());
    let is_single = |one: &&Parameter| matches!(one.target(), Target::Machine | Target::Cabinet);
    let mut names = vec![Vec::new(); PARTS.len()];
    for one in all.iter().filter(is_single) {
        let name = one.name();
        let rest = |part: &Part| name.strip_prefix(&part.prefix(0));
        let places = (0..PARTS.len()).filter_map(|k| Some((rest(&PARTS[k])?, k)));
        // The longest prefix is its own.
        let own = places.min_by_key(|(rest, _)| rest.len());
        own.into_iter().for_each(|(rest, k)| names[k].push((rest.to_owned(), one.left_out())));
    }
    PARTS.iter().zip(names).map(|(part, names)| part.keys(&names)).collect()
});

/// The name of a parameter without its component.
fn stem(name: &str) -> String {
    let is_component = |word: &&str| ["x", "y", "z", "11", "22", "33"].contains(word);
    name.split('_').filter(|word| !is_component(word)).collect::<Vec<_>>().join("_")
}

impl Part {
    /// The keys of these parameters, in the order in which they are written: numbers, arrays, and
    /// what may be left out.
    fn keys(&self, names: &[(String, Option<f64>)]) -> Vec<Key> {
        let key = |names: &[(String, Option<f64>)]| {
            let (first, value) = &names[0];
            let stem = stem(first);
            let name = match names.len() {
                1 => first.clone(),
                // The place of a foot is that of nothing else.
                _ if first.starts_with("x_") => format!("{}{stem}", self.prefix),
                _ => stem,
            };
            let optional = OPTIONAL.iter().find(|(known, _)| *known == name);
            let by_table = value.map_or(LeftOut::Refused, LeftOut::Is);
            let left_out = optional.map_or(by_table, |(_, left_out)| *left_out);
            Key { name, parameters: names.iter().map(|(name, _)| name.clone()).collect(), left_out }
        };
        let mut keys: Vec<Key> =
            names.chunk_by(|(a, _), (b, _)| stem(a) == stem(b)).map(key).collect();
        keys.sort_by_key(|key| (key.left_out != LeftOut::Refused, key.is_vector()));
        keys
    }

    /// Walks over the keys of element `k`.
    fn walk(
        &self,
        own: &'static [Key],
        k: usize,
        machine: &mut Machine,
        sheet: &mut Sheet,
        keys: &mut Keys<'_>,
    ) {
        keys.places = format!("{}.", self.section);
        sheet.walk(self, k, keys);
        own.iter().for_each(|key| key.walk(self, k, machine, sheet, keys));
    }

    /// What the parameters of an element begin with.
    fn prefix(&self, k: usize) -> String {
        match self.times {
            Times::Many(first) => format!("{}{}_", self.prefix, k + first),
            Times::Once | Times::AtMostOnce => self.prefix.clone(),
        }
    }

    /// As it stands in a file.
    fn header(&self) -> String {
        match self.times {
            Times::Many(..) => format!("[[{}]]", self.section),
            Times::Once | Times::AtMostOnce => format!("[{}]", self.section),
        }
    }
}

impl Key {
    /// Whether it holds three numbers.
    fn is_vector(&self) -> bool {
        self.parameters.len() > 1
    }

    /// Names of its parameters.
    fn names(&self, prefix: &str) -> Vec<String> {
        self.parameters.iter().map(|name| format!("{prefix}{name}")).collect()
    }

    /// Whether each of its numbers has a rule for files with a data sheet's numbers.
    fn is_assumed(&self, part: &Part, machine: &Machine) -> bool {
        let has_rule = |name: &String| find(name, machine)?.assumption();
        self.names(&part.prefix(0)).iter().all(|name| has_rule(name).is_some())
    }

    /// Its numbers in a machine, if they say more than leaving it out.
    fn given(&self, part: &Part, k: usize, machine: &Machine) -> Option<Vec<f64>> {
        let names = self.names(&part.prefix(k)).into_iter();
        let values: Vec<f64> = names.map(|name| value(&name, machine)).collect::<Option<_>>()?;
        let is_given = match self.left_out {
            LeftOut::Refused => true,
            LeftOut::Is(default) => values.iter().any(|value| *value != default),
            // A spring has a free length by its ends, too.
            LeftOut::Nothing | LeftOut::Auto => {
                self.name != FREE_LENGTH || machine.springs[k].free_length_m.is_some()
            }
        };
        is_given.then_some(values)
    }
}

/// A section that every file has once.
fn once(section: &'static str) -> Part {
    let prefix = match section {
        "" => String::new(),
        _ => format!("{}_", section.trim_end_matches('s')),
    };
    Part { section, prefix, times: Times::Once, count: |_| 1, fill: |_, _| () }
}

/// A spring's free length follows its ends where it is left out.
const FREE_LENGTH: &str = "free_length_m";

/// What may be left out, and then is no number of the file; more, by the table of parameters.
const OPTIONAL: [(&str, LeftOut); 2] =
    [(FREE_LENGTH, LeftOut::Nothing), ("friction_linear_speed_m_per_s", LeftOut::Auto)];

/// Every section of a machine file.
static PARTS: LazyLock<Vec<Part>> = LazyLock::new(|| {
    let cabinet = Part {
        section: "cabinet",
        prefix: "cabinet_".to_owned(),
        times: Times::AtMostOnce,
        count: |machine| usize::from(machine.cabinet.is_some()),
        fill: |machine, count| machine.cabinet = (count > 0).then(Cabinet::default),
    };
    let of_list = |&ElementList { name: section, element, first, count, fill, .. }: &_| {
        let times = Times::Many(first);
        Part { section, prefix: format!("{element}_"), times, count, fill }
    };
    let once = ["", "tub", "shaft", "drum", "unbalance", "flexure", "bearings"].map(once);
    once.into_iter().chain([cabinet]).chain(ElementList::all().map(of_list)).collect()
});

/// Most elements of one list: enough for any machine, and what depends on all of them stays quick.
const MOST_ELEMENTS: usize = 1000;

/// The paper's machine with one of each element that it lacks: every kind of parameter has a name
/// there.
pub(crate) fn with_one_of_each() -> Machine {
    let mut machine = Machine::paper();
    for part in PARTS.iter().filter(|part| (part.count)(&Machine::paper()) == 0) {
        (part.fill)(&mut machine, 1);
    }
    machine
}

/// Parameters of no machine file take a spin; this one has no number of its own.
pub(super) fn no_spin() -> Spin {
    Spin::Table { time_s: Vec::new(), speed_rpm: Vec::new() }
}

/// The numbers of a data sheet in a machine file, from which numbers follow that it leaves out.
#[derive(Default)]
struct Sheet {
    /// Whether the file gives the drum's radius and depth, so that it may leave numbers out.
    is_given: bool,
    moving_mass_kg: Option<f64>,
    drum_radius_m: Option<f64>,
    drum_depth_m: Option<f64>,
    /// The parameters that the file leaves out.
    left_out: Vec<Parameter>,
    /// The positions along the axis that the file gives by the name of a plane.
    planes: Vec<(Parameter, Plane)>,
}

/// A plane of the drum in which an unbalance lies.
#[derive(Clone, Copy, PartialEq)]
enum Plane {
    /// The drum's front, where its motion is observed.
    Front,
    /// The drum's back, where it is fixed to the shaft.
    Rear,
}

impl Plane {
    const ALL: [(Self, &'static str); 2] = [(Self::Front, "front"), (Self::Rear, "rear")];

    /// Returns its place along the axis.
    fn x_m(self, machine: &Machine) -> f64 {
        match self {
            Self::Front => machine.drum.front_x_m,
            Self::Rear => machine.drum.hinge_x_m,
        }
    }
}

/// Sections of unbalances, and the key of their place along the axis.
const UNBALANCES: [&str; 2] = ["unbalance", "further_unbalances"];
const ALONG_AXIS: &str = "x_m";
/// The key that gives that place by a name.
const PLANE: &str = "plane";

/// The drum's numbers on a data sheet.
const RADIUS: &str = "radius_m";
const DEPTH: &str = "depth_m";

impl Sheet {
    /// Returns the data sheet of a file whose keys are not read yet.
    fn new(keys: &Keys<'_>) -> Self {
        let has_both = |root: &Section<'_>| {
            let at = |key| root.key_inside("drum", key);
            at(RADIUS) && at(DEPTH)
        };
        Self { is_given: keys.section().is_some_and(has_both), ..Self::default() }
    }

    /// Walks over the data sheet's keys of element `k` of a section.
    fn walk(&mut self, part: &Part, k: usize, keys: &mut Keys<'_>) {
        const LENGTH: Form<'_> = Form::Number(Range::Within(1e-3, 10.0));
        match part.section {
            "" => {
                let about =
                    "mass of tub, shaft and drum without laundry, in place of the tub's, kg";
                let key = keys::Key::new(MOVING_MASS, about);
                keys.key(key, &Form::Number(Range::Positive), &mut self.moving_mass_kg);
            }
            "drum" => {
                let key = keys::Key::new(RADIUS, "inner radius; other numbers follow from it, m");
                keys.key(key, &LENGTH, &mut self.drum_radius_m);
                let key = keys::Key::new(DEPTH, "inner depth; other numbers follow from it, m");
                keys.key(key, &LENGTH, &mut self.drum_depth_m);
            }
            section if UNBALANCES.contains(&section) => self.walk_plane(part, k, keys),
            _ => {}
        }
    }

    /// Walks over the name of an unbalance's plane, which stands for its place along the axis.
    fn walk_plane(&mut self, part: &Part, k: usize, keys: &mut Keys<'_>) {
        let about = "the drum's front, or its rear where it is fixed: in place of x_m";
        let mut word: Option<String> = None;
        let names = Plane::ALL.map(|(_, name)| name);
        let found = keys.key(keys::Key::new(PLANE, about), &Form::Word(&names), &mut word);
        let plane = Plane::ALL.into_iter().find(|(_, name)| word.as_deref() == Some(name));
        let (Field::Given(found), Some((plane, _))) = (found, plane) else { return };
        let Some(section) = keys.section() else { return };
        if section.key_at(ALONG_AXIS).is_some() {
            let title = format!("`{PLANE}` beside `{ALONG_AXIS}`");
            let expected = "expected only one of them: both say where the unbalance is";
            section.report.refuse::<()>(&found.at, title, expected);
        }
        let name = format!("{}{ALONG_AXIS}", part.prefix(k));
        section.report.put(name.as_str(), found.at);
        // The paper's machine has none of the elements that a file may have more of.
        let machine = with_unbalances(k + 1);
        self.planes.extend(find(&name, &machine).map(|parameter| (parameter, plane)));
    }

    /// Whether the place of element `k` along the axis is that of a plane.
    fn has_plane(&self, part: &Part, k: usize, key: &str) -> bool {
        let name = format!("{}{ALONG_AXIS}", part.prefix(k));
        key == ALONG_AXIS && self.planes.iter().any(|(parameter, _)| parameter.name() == name)
    }

    /// Puts assumed values in place of what the file leaves out, each with its rule as its source.
    fn fill(self, machine: &mut Machine, root: &Section<'_>) {
        let report = root.report;
        let is_left_out = |name: &str| self.left_out.iter().any(|one| one.name() == name);
        let needs_mass = ["tub_mass_kg", "shaft_mass_kg", "drum_mass_kg"].map(is_left_out);
        let sheet = DataSheet {
            moving_mass_kg: self.moving_mass_kg,
            drum_radius_m: self.drum_radius_m.unwrap_or_default(),
            drum_depth_m: self.drum_depth_m.unwrap_or_default(),
        };
        let is_whole = self.drum_radius_m.is_some() && self.drum_depth_m.is_some();
        if sheet.moving_mass_kg.is_some() && !needs_mass[0] {
            let title = format!("`{MOVING_MASS}` beside the tub's mass");
            let expected =
                "expected no `mass_kg` in [tub]: it is the moving mass less shaft and drum";
            let at = root.key_at(MOVING_MASS).unwrap_or_else(|| root.at().clone());
            report.refuse::<()>(&at, title, expected);
        } else if needs_mass.contains(&true) && sheet.moving_mass_kg.is_none() {
            let expected = "the mass of tub, shaft and drum without laundry, or `mass_kg` of each";
            root.missing(MOVING_MASS, expected);
        } else if is_whole {
            sheet.fill(&self.left_out, machine);
        }
        for parameter in &self.left_out {
            let Some(value) = parameter.get(machine, &no_spin()) else { continue };
            if is_whole && !parameter.range().contains(value) {
                let (name, range) = (parameter.name(), parameter.range());
                let title = format!("the rule for the left-out `{name}` gives {value:.4}");
                report.refuse::<()>(root.at(), title, format!("expected {range}: give the number"));
            }
            if let Some(assumption) = parameter.assumption() {
                report.assume(parameter.name(), assumption.rule);
            }
        }
    }
}

/// Returns the paper's machine with so many further unbalances.
fn with_unbalances(count: usize) -> Machine {
    let mut machine = Machine::paper();
    machine.further_unbalances = vec![Default::default(); count];
    machine
}

/// The data sheet's mass, at the top of a machine file.
const MOVING_MASS: &str = "moving_mass_kg";

/// Reads a machine file's text. Wrong and missing numbers keep the paper's, and their names are
/// marked doubtful.
pub(super) fn read(text: &str, root: Section<'_>) -> Machine {
    let (mut machine, report) = (Machine::paper(), root.report);
    if is_blank(text) {
        report
            .push(Diagnostic::new("the machine file is empty").at(root.at(), "expected a machine"));
        return machine;
    }
    let mut keys = Keys::new(KeyWalk::Read(root));
    walk(&mut machine, &mut keys);
    keys.finish();
    machine
}

/// The schema of machine files.
pub(crate) fn schema() -> Value {
    let description = Keys::described(true, |keys| walk(&mut with_one_of_each(), keys));
    document("Machine file of sweep", description.finish())
}

/// The machine as a machine file's tables hold it, and as a result file carries it; every number as
/// its shortest decimal that reads back the same.
pub(crate) fn to_json(machine: &Machine) -> Value {
    Keys::described(false, |keys| walk(&mut machine.clone(), keys)).finish()
}

/// Whether a machine file has this key at the top.
pub(super) fn is_key(key: &str) -> bool {
    let mut parts = PARTS.iter().zip(&*KEYS);
    parts.any(|(part, own)| match part.section {
        "" => key == MOVING_MASS || own.iter().any(|own| own.name == key),
        section => section == key,
    })
}

/// Walks over every section.
fn walk(machine: &mut Machine, keys: &mut Keys<'_>) {
    let mut sheet = Sheet::new(keys);
    for (part, own) in PARTS.iter().zip(&*KEYS) {
        let table = keys::Key::new(part.section, "");
        match part.times {
            _ if part.section.is_empty() => part.walk(own, 0, machine, &mut sheet, keys),
            Times::Once => {
                let expected = format!("a section {}", part.header());
                let is_assumed = own.iter().all(|key| key.is_assumed(part, machine));
                let is_needed = !(is_assumed && (sheet.is_given || keys.is_schema()));
                let table = if is_needed { table.needed(&expected) } else { table };
                let field = keys.table(table, |keys| part.walk(own, 0, machine, &mut sheet, keys));
                if !is_needed && matches!(field, Field::Absent) && keys.section().is_some() {
                    let names = own.iter().flat_map(|key| key.names(&part.prefix));
                    sheet.left_out.extend(names.filter_map(|name| find(&name, machine)));
                    continue;
                }
                if let (None, Some(report)) = (field.given(), keys.section().map(|it| it.report)) {
                    own.iter().for_each(|key| doubt(key.names(&part.prefix), report));
                }
            }
            Times::AtMostOnce => drop(keys.table(table, |keys| {
                if keys.section().is_some() {
                    (part.fill)(machine, 1);
                }
                for k in 0..(part.count)(machine) {
                    part.walk(own, k, machine, &mut sheet, keys);
                }
            })),
            Times::Many(_) => {
                let mut sections = Vec::new();
                if let Some(root) = keys.section() {
                    sections = elements(part, root);
                    (part.fill)(machine, sections.len());
                }
                // The two that machines have always had are written even where there are none.
                let count = (part.count)(machine);
                if count > 0 || ["springs", "dampers"].contains(&part.section) {
                    keys.tables(table, sections, count, |keys, k| {
                        part.walk(own, k, machine, &mut sheet, keys);
                    });
                }
            }
        }
    }
    let Some(root) = keys.section() else { return };
    if machine.springs.is_empty() && machine.bushings.is_empty() {
        let expected = "at least one [[springs]] or [[bushings]]: nothing else carries the machine";
        root.missing("springs", expected);
        // The built-in machine's springs keep later checks from reporting the same mistake again.
        machine.springs = Machine::paper().springs;
    }
    let planes = std::mem::take(&mut sheet.planes);
    if sheet.is_given {
        sheet.fill(machine, root);
    }
    for (parameter, plane) in planes {
        let x_m = plane.x_m(machine);
        parameter.set(machine, &mut no_spin(), x_m);
    }
}

/// The tables of a list, no more of them than are accepted.
fn elements<'a>(part: &Part, root: &Section<'a>) -> Vec<Section<'a>> {
    let mut sections = root.tables(part.section);
    if let Some(first_beyond) = sections.get(MOST_ELEMENTS) {
        let title = format!("the machine has {} {}", sections.len(), part.section);
        let expected = format!("expected at most {MOST_ELEMENTS}");
        root.report.push(Diagnostic::new(title).at(first_beyond.at(), expected));
        sections.truncate(MOST_ELEMENTS);
    }
    sections
}

impl Key {
    /// Walks over the key of element `k`.
    fn walk(
        &'static self,
        part: &Part,
        k: usize,
        machine: &mut Machine,
        sheet: &mut Sheet,
        keys: &mut Keys<'_>,
    ) {
        let names = self.names(&part.prefix(k));
        let parameters: Vec<_> = names.iter().filter_map(|name| find(name, machine)).collect();
        let Some(first) = parameters.first() else { return };
        let number = Form::Number(first.range());
        let or_auto = |section: &Section<'_>, key| match section.is_text(key) {
            true => section.choice(key, &[AUTO]).map(|_| AUTO.into()),
            false => number.read(section, key, ""),
        };
        let (kind, about, expected) = match self.left_out {
            _ if self.is_vector() => {
                let three = Numbers::new(first.range(), 3..=3, "expected three numbers");
                (
                    Form::Numbers(Numbers { places: names.clone(), ..three }),
                    String::new(),
                    "an array of three numbers".to_owned(),
                )
            }
            LeftOut::Auto => {
                let schema = json!({ "anyOf": [parameter_schema(first), { "const": AUTO }] });
                (Form::Own(&or_auto, schema), String::new(), String::new())
            }
            _ => {
                let expected = format!("{}: {}", first.description(), first.range());
                (Form::Number(first.range()), describe_parameter(first), expected)
            }
        };
        let is_assumed = keys.is_schema() || sheet.is_given;
        let is_assumed = is_assumed && self.is_assumed(part, machine);
        let may_have_plane = keys.is_schema() && UNBALANCES.contains(&part.section);
        let has_plane =
            sheet.has_plane(part, k, &self.name) || may_have_plane && self.name == ALONG_AXIS;
        let is_needed = self.left_out == LeftOut::Refused && !is_assumed && !has_plane;
        let key = keys::Key::new(&self.name, &about);
        let key = if is_needed { key.needed(&expected) } else { key };
        let mut value = match self.left_out {
            _ if !keys.is_schema() => self.json(part, k, machine),
            LeftOut::Auto => AUTO.into(),
            LeftOut::Is(default) if !self.is_vector() => default.into(),
            _ => Value::Null,
        };
        let found = keys.key(key, &kind, &mut value);
        let Some(report) = keys.section().map(|section| section.report) else { return };
        let numbers = value.as_array().map_or(slice::from_ref(&value), Vec::as_slice);
        match found {
            Field::Given(found) => {
                let numbers = numbers.iter().filter_map(Value::as_f64);
                for (parameter, number) in parameters.iter().zip(numbers) {
                    parameter.set(machine, &mut no_spin(), number);
                    if !self.is_vector() {
                        report.put(parameter.name(), found.at.clone());
                    }
                }
            }
            Field::Absent if has_plane => {}
            Field::Absent if is_assumed => sheet.left_out.extend(parameters),
            Field::Absent if !is_needed => {}
            Field::Absent | Field::Bad => doubt(names, report),
        }
    }

    /// What a machine's file has under the key; nothing where it is left out.
    fn json(&self, part: &Part, k: usize, machine: &Machine) -> Value {
        match self.given(part, k, machine) {
            Some(values) if self.is_vector() => values.into(),
            Some(values) => values[0].into(),
            None if self.left_out == LeftOut::Auto && machine.dampers[k].friction_n != 0.0 => {
                AUTO.into()
            }
            None => Value::Null,
        }
    }
}

fn doubt(names: Vec<String>, report: &Report) {
    names.into_iter().for_each(|name| report.doubt(name));
}

fn find(name: &str, machine: &Machine) -> Option<Parameter> {
    Parameter::find(name, machine, &no_spin()).ok()
}

/// A parameter's value.
fn value(name: &str, machine: &Machine) -> Option<f64> {
    find(name, machine)?.get(machine, &no_spin())
}

/// The machine as the text of a machine file, each number with its meaning and source, the built-in
/// machine's if it was not written: loading it gives the same machine, bit for bit.
pub(crate) fn to_toml(machine: &Machine, written: &WrittenIn) -> String {
    let mut text = "# A machine in full, in SI units. Lengths in m from O, midway between the \
                    bearings before loading: x along the\n\
         # drum axis towards the door, y up, z sideways. Inertia about each body's own mass \
         centre, in body axes.\n"
        .to_owned();
    let parts = PARTS.iter().zip(&*KEYS);
    for (part, own, k) in
        parts.flat_map(|(part, own)| (0..(part.count)(machine)).map(move |k| (part, own, k)))
    {
        if !part.section.is_empty() {
            text.push_str(&format!("\n{}\n", part.header()));
        }
        for key in own {
            let Some(values) = key.given(part, k, machine) else { continue };
            let line = match key.is_vector() {
                true => format!("{} = {values:?}", key.name),
                false => format!("{} = {:?}", key.name, values[0]),
            };
            let names = key.names(&part.prefix(k));
            let given = written.source(&names);
            let is_said = given.is_some() || key.left_out == LeftOut::Refused;
            match find(&names[0], machine).filter(|_| is_said) {
                Some(first) => {
                    let source = given.unwrap_or_else(|| first.source().to_owned());
                    let said = first.description();
                    let said = if key.is_vector() { String::new() } else { format!("{said} ") };
                    text.push_str(&format!("{line:<40} # {said}[{source}]\n"));
                }
                None => text.push_str(&format!("{line}\n")),
            }
        }
    }
    text
}
