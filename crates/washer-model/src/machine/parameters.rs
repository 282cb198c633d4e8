//! The table of parameters: every number of machine, spin and window under a flat name with a unit
//! suffix, with unit, description, source and range. Grid axes, `[set]`, `--set`, reports and the
//! machine file's checks read it.

mod assumed;
mod table;

use std::borrow::Cow;
use std::fmt;

pub use assumed::{Assumption, DataSheet, ExpectedRange};
pub use sweep_parameter::{Range, UnknownParameter, decimal, unit_suffix};

use crate::{BumpStop, Damper, Machine, Spin, Spring};
use table::{ELEMENT_LISTS, SINGLE_ENTRIES};

/// A number of the machine, the spin or the window that a user can name, set and sweep.
///
/// Most parameters write one number. Some write several: `spring_stiffness_n_per_m` writes the
/// stiffness of all springs; see [`MachineParameter::single_names`].
#[derive(Clone)]
pub struct MachineParameter {
    name: Cow<'static, str>,
    entry: &'static ParameterEntry,
    /// The index of the element, from 0; 0 for a number that does not belong to a list.
    index: usize,
}

/// The greatest coordinate of a point on a machine, and of a motion, m. Basis: larger than any
/// washing machine, smaller than coordinates in millimetres read as metres. Doubling it accepts
/// machines twice as large.
pub(crate) const MAX_COORDINATE_M: f64 = 10.0;

/// The object that has the number, or the numbers, of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A number of the machine.
    Machine,
    /// A number of the cabinet, which machines may lack.
    Cabinet,
    /// A value that both bearings share; the text is the end of a single bearing's parameter name,
    /// after `bearing_front_` or `bearing_rear_`.
    Bearings(&'static str),
    /// A value that all springs share; the text is the end of a single spring's parameter name,
    /// after `spring_1_` or the like.
    Springs(&'static str),
    /// A value that all dampers share; the text is the end of a single damper's parameter name,
    /// after `damper_1_` or the like.
    Dampers(&'static str),
    /// A number of the spin's profile, or of a point of the spin's table.
    Spin,
    /// An edge of the window (0: the beginning, 1: the end). Neither machine nor spin has a field
    /// for it: [`MachineParameter::get`] returns `None` and [`MachineParameter::set`] does nothing.
    Window(usize),
}

/// An entry of the table: the properties of a parameter, which elements of a list share.
#[derive(Debug)]
struct ParameterEntry {
    /// The name, or the part of the name after `spring_1_` and the like.
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    source: &'static str,
    range: Range,
    /// The value if a machine file leaves the number out; `None` if the number is required.
    default_value: Option<f64>,
    /// The rule for the value if a file with a data sheet's numbers leaves the number out.
    assumption: Option<Assumption>,
    target: Target,
    get: Getter,
    set: Setter,
}

/// A function that reads a number; the last argument is the element's index.
type Getter = fn(&Machine, &Spin, usize) -> Option<f64>;

/// A function that writes a number; the third argument is the element's index.
type Setter = fn(&mut Machine, &mut Spin, usize, f64);

/// A list of the machine's elements, which is an array of tables in machine files, or the points of
/// a spin's table.
#[derive(Debug)]
pub struct ElementList {
    /// The key in machine files; empty for a spin's table.
    pub name: &'static str,
    /// The beginning of the parameters' names, before the number and the entry's name.
    pub element_name: &'static str,
    /// The number of the first element in parameters' names: 2 for unbalances, else 1.
    pub first_number: usize,
    /// The function that returns the number of elements of a machine.
    pub count: fn(&Machine) -> usize,
    /// The function that replaces a machine's elements by a number of elements with default values.
    pub resize: fn(&mut Machine, usize),
    entries: &'static [&'static [ParameterEntry]],
}

impl ElementList {
    /// Iterates over the lists of a machine, in the order of machine files.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        ELEMENT_LISTS.iter().filter(|list| !list.name.is_empty())
    }

    fn element_count(&self, machine: &Machine, spin: &Spin) -> usize {
        if self.name.is_empty() { table_point_count(spin) } else { (self.count)(machine) }
    }

    fn entries(&self) -> impl Iterator<Item = &'static ParameterEntry> {
        self.entries.iter().copied().flatten()
    }

    fn element_parameter(&self, entry: &'static ParameterEntry, index: usize) -> MachineParameter {
        let name = Cow::Owned(format!(
            "{}_{}_{}",
            self.element_name,
            index + self.first_number,
            entry.name
        ));
        MachineParameter { name, entry, index }
    }
}

impl Target {
    /// Returns whether the parameter writes several numbers.
    pub const fn has_several_numbers(self) -> bool {
        matches!(self, Self::Bearings(_) | Self::Springs(_) | Self::Dampers(_))
    }

    /// Checks that machine and spin have the number of a parameter that does not belong to a list.
    fn check_exists(self, machine: &Machine, spin: &Spin) -> Result<(), UnknownParameter> {
        match self {
            Self::Spin if matches!(spin, Spin::Table { .. }) => {
                Err(UnknownParameter::in_other_models("a spin given as a table has no such number"))
            }
            Self::Cabinet if machine.cabinet.is_none() => {
                Err(UnknownParameter::in_other_models("the machine has no [cabinet]"))
            }
            _ => Ok(()),
        }
    }
}

impl PartialEq for MachineParameter {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for MachineParameter {}

impl fmt::Debug for MachineParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("MachineParameter").field(&self.name).finish()
    }
}

impl MachineParameter {
    /// Returns every parameter of a machine and a spin in the table's order, those of lists element
    /// by element.
    pub fn all(machine: &Machine, spin: &Spin) -> Vec<Self> {
        let exists = |entry: &&ParameterEntry| entry.target.check_exists(machine, spin).is_ok();
        let single_parameters = SINGLE_ENTRIES.iter().filter(exists).map(Self::from_entry);
        let list_parameters = ELEMENT_LISTS.iter().flat_map(|list| {
            (0..list.element_count(machine, spin)).flat_map(move |k| {
                list.entries().map(move |entry| list.element_parameter(entry, k))
            })
        });
        single_parameters.chain(list_parameters).collect()
    }

    /// Returns the parameter with a name.
    ///
    /// # Errors
    /// A name that the table does not have, or a number that the machine or the spin does not have.
    pub fn find(name: &str, machine: &Machine, spin: &Spin) -> Result<Self, UnknownParameter> {
        if let Some(entry) = SINGLE_ENTRIES.iter().find(|entry| entry.name == name) {
            return entry.target.check_exists(machine, spin).map(|()| Self::from_entry(entry));
        }
        for list in ELEMENT_LISTS {
            if let Some((number, name_after_number)) = split_numbered_name(name, list.element_name)
            {
                let entry = list
                    .entries()
                    .find(|entry| entry.name == name_after_number)
                    .ok_or_else(UnknownParameter::in_no_model)?;
                let count = list.element_count(machine, spin);
                return match number.checked_sub(list.first_number) {
                    Some(k) if k < count => Ok(list.element_parameter(entry, k)),
                    _ => {
                        let (owner, noun) = match list.name {
                            "" => ("the spin's table", "point"),
                            _ => ("the machine", list.element_name),
                        };
                        let last_number = list.first_number + count - 1;
                        let element_count_text = format!(
                            "{owner} has {last_number} {}",
                            noun_for_count(noun, last_number)
                        );
                        Err(UnknownParameter::in_other_models(format!(
                            "{element_count_text}, numbered from 1"
                        )))
                    }
                };
            }
        }
        Err(UnknownParameter::in_no_model())
    }

    /// Returns the name in grid files, on the command line and of the result's column.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the SI unit (rpm for speeds of the spin).
    pub fn unit(&self) -> &'static str {
        self.entry.unit
    }

    pub fn description(&self) -> &'static str {
        self.entry.description
    }

    /// Returns the source of the built-in machine's value: a place in the paper, `derived` or
    /// `assumed` with the reason, a convention, or the grid file.
    pub fn source(&self) -> &'static str {
        self.entry.source
    }

    /// Returns the range of values. Coordinates are at most `MAX_COORDINATE_M`, so that
    /// millimetres are refused.
    pub fn range(&self) -> Range {
        match (self.entry.unit, self.entry.range) {
            ("m", Range::Any) => Range::Within(-MAX_COORDINATE_M, MAX_COORDINATE_M),
            ("m", Range::NonNegative) => Range::Within(0.0, MAX_COORDINATE_M),
            (_, range) => range,
        }
    }

    /// Returns the value if a machine file leaves the number out; `None` if the number is required.
    pub fn default_value(&self) -> Option<f64> {
        self.entry.default_value
    }

    /// Returns the rule for the value if a file with a data sheet's numbers leaves the number out.
    pub fn assumption(&self) -> Option<&'static Assumption> {
        self.entry.assumption.as_ref()
    }

    pub fn target(&self) -> Target {
        self.entry.target
    }

    /// Returns the value; `None` for several numbers that differ, and for a number that the machine
    /// does not have.
    pub fn get(&self, machine: &Machine, spin: &Spin) -> Option<f64> {
        (self.entry.get)(machine, spin, self.index)
    }

    /// Writes the value without a check: [`Machine::violations`] checks the machine as a whole. A
    /// number that the machine does not have is ignored; [`MachineParameter::find`] refuses it.
    pub fn set(&self, machine: &mut Machine, spin: &mut Spin, value: f64) {
        (self.entry.set)(machine, spin, self.index, value);
    }

    /// Returns the names of the single numbers that the parameter writes.
    pub fn single_names(&self, machine: &Machine) -> Vec<Cow<'static, str>> {
        let numbered_names = |count: usize, element: &str, number: &str| {
            (1..=count).map(|k| format!("{element}_{k}_{number}").into()).collect()
        };
        match self.entry.target {
            Target::Bearings(number) => {
                ["front", "rear"].map(|end| format!("bearing_{end}_{number}").into()).into()
            }
            Target::Springs(number) => numbered_names(machine.springs.len(), "spring", number),
            Target::Dampers(number) => numbered_names(machine.dampers.len(), "damper", number),
            Target::Machine | Target::Cabinet | Target::Spin | Target::Window(_) => {
                vec![self.name.clone()]
            }
        }
    }

    fn from_entry(entry: &'static ParameterEntry) -> Self {
        Self { name: Cow::Borrowed(entry.name), entry, index: 0 }
    }
}

/// Returns a noun in the singular or the plural, by a count.
fn noun_for_count(noun: &str, count: usize) -> String {
    match (noun, count) {
        (_, 1) => noun.to_owned(),
        ("foot", _) => "feet".to_owned(),
        _ => format!("{noun}s"),
    }
}

/// Returns the number of points of a spin's table.
fn table_point_count(spin: &Spin) -> usize {
    match spin {
        Spin::Table { time_s, speed_rpm } => time_s.len().min(speed_rpm.len()),
        Spin::Ramped { .. } => 0,
    }
}

/// Splits the name of a list's parameter: `"spring_2_tub_x_m"` with `"spring"` gives 2 and
/// `"tub_x_m"`. It refuses `spring_02_`, so that each number has one name.
fn split_numbered_name<'a>(name: &'a str, element: &str) -> Option<(usize, &'a str)> {
    let (digits, name_after_number) =
        name.strip_prefix(element)?.strip_prefix('_')?.split_once('_')?;
    let is_canonical = digits.bytes().all(|b| b.is_ascii_digit()) && !digits.starts_with('0');
    let number: usize = if is_canonical { digits.parse().ok()? } else { return None };
    Some((number, name_after_number))
}

/// Returns the value that all items share; `None` if items differ or are missing.
fn common_value<T>(items: &[T], value: fn(&T) -> f64) -> Option<f64> {
    let first_value = value(items.first()?);
    items.iter().all(|item| value(item).to_bits() == first_value.to_bits()).then_some(first_value)
}

impl Spring {
    /// Returns the distance between the given ends before the machine sags (m).
    pub fn given_length_m(&self) -> f64 {
        distance_m(self.cabinet_m, self.tub_m)
    }
}

impl Damper {
    /// Returns the distance between the given ends before the machine sags (m).
    pub fn given_length_m(&self) -> f64 {
        distance_m(self.cabinet_m, self.tub_m)
    }
}

impl BumpStop {
    /// Returns the length of the given direction vector.
    pub fn direction_length(&self) -> f64 {
        distance_m(self.direction, [0.0; 3])
    }
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests;
