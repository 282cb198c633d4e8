//! The one table of parameters: every number of machine, spin and window under one flat,
//! unit-suffixed name, with its unit, meaning, source and range. Grid axes, `[set]`, `--set`,
//! reports and the machine file's checks all read it.

mod assumed;
mod table;

use std::borrow::Cow;
use std::fmt;

pub use assumed::{Assumption, DataSheet, Spread};
pub use sweep_parameter::{Range, UnknownParameter, decimal, unit_suffix};

use crate::{BumpStop, Damper, Machine, Spin, Spring};
use table::{LISTS, TABLE};

/// A number of the machine, the spin or the window that a user can name, set and sweep.
///
/// Most write one number. Some write several at once, such as `spring_stiffness_n_per_m` that of
/// all springs; see [`Parameter::parts`].
#[derive(Clone)]
pub struct Parameter {
    name: Cow<'static, str>,
    row: &'static Row,
    /// Which numbered element, from 0; 0 where the row has only one.
    index: usize,
}

/// Farther than this (m) is no place on a machine, and no motion of one.
pub(crate) const MAX_COORDINATE_M: f64 = 10.0;

/// What a parameter writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// One number of the machine.
    Machine,
    /// A number of the cabinet, which not every machine has.
    Cabinet,
    /// A number of both bearings, by its name after `bearing_front_` and `bearing_rear_`.
    Bearings(&'static str),
    /// A number of every spring, by its name after `spring_1_`.
    Springs(&'static str),
    /// A number of every damper, by its name after `damper_1_`.
    Dampers(&'static str),
    /// A number of the spin: of its profile, or of a point of its table.
    Spin,
    /// An edge of the window (0: the beginning, 1: the end), which neither machine nor spin holds:
    /// [`Parameter::get`] finds nothing and [`Parameter::set`] writes nothing.
    Window(usize),
}

/// One line of the table.
#[derive(Debug)]
struct Row {
    /// The whole name, or what follows `spring_1_` and the like.
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    source: &'static str,
    range: Range,
    left_out: Option<f64>,
    /// The rule where a file with a data sheet's numbers leaves it out.
    assumption: Option<Assumption>,
    target: Target,
    get: Get,
    set: Set,
}

/// Reads the number, of which element.
type Get = fn(&Machine, &Spin, usize) -> Option<f64>;

/// Writes it.
type Set = fn(&mut Machine, &mut Spin, usize, f64);

/// A list of the machine's elements, in machine files an array of tables; or the points of a spin's
/// table.
#[derive(Debug)]
pub struct ElementList {
    /// Key in machine files; none of a spin's table.
    pub name: &'static str,
    /// What names of parameters begin with; the number and the row's name follow.
    pub element: &'static str,
    /// Number of the first element.
    pub first: usize,
    /// How many a machine has.
    pub count: fn(&Machine) -> usize,
    /// Gives a machine so many, each with what may be left out left out.
    pub fill: fn(&mut Machine, usize),
    rows: &'static [&'static [Row]],
}

impl ElementList {
    /// Every one of a machine, in the order of machine files.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        LISTS.iter().filter(|list| !list.name.is_empty())
    }

    fn count_in(&self, machine: &Machine, spin: &Spin) -> usize {
        if self.name.is_empty() { table_points(spin) } else { (self.count)(machine) }
    }

    fn rows(&self) -> impl Iterator<Item = &'static Row> {
        self.rows.iter().copied().flatten()
    }

    fn parameter(&self, row: &'static Row, index: usize) -> Parameter {
        let name = Cow::Owned(format!("{}_{}_{}", self.element, index + self.first, row.name));
        Parameter { name, row, index }
    }
}

impl Target {
    /// Whether these are several numbers at once.
    pub const fn is_several(self) -> bool {
        matches!(self, Self::Bearings(_) | Self::Springs(_) | Self::Dampers(_))
    }

    /// Whether machine and spin have it, for what is not one of numbered elements.
    fn is_of(self, machine: &Machine, spin: &Spin) -> Result<(), UnknownParameter> {
        match self {
            Self::Spin if matches!(spin, Spin::Table { .. }) => {
                Err(UnknownParameter::not_here("a spin given as a table has no such number"))
            }
            Self::Cabinet if machine.cabinet.is_none() => {
                Err(UnknownParameter::not_here("the machine has no [cabinet]"))
            }
            _ => Ok(()),
        }
    }
}

impl sweep_parameter::Parameter for Parameter {
    fn name(&self) -> &str {
        self.name()
    }

    fn unit(&self) -> &'static str {
        self.unit()
    }

    fn description(&self) -> &'static str {
        self.description()
    }

    fn range(&self) -> Range {
        self.range()
    }

    fn window_edge(&self) -> Option<usize> {
        match self.target() {
            Target::Window(edge) => Some(edge),
            _ => None,
        }
    }
}

impl PartialEq for Parameter {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Parameter {}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Parameter").field(&self.name).finish()
    }
}

impl Parameter {
    /// Every parameter of this machine and spin, in the table's order, numbered elements one by
    /// one.
    pub fn all(machine: &Machine, spin: &Spin) -> Vec<Self> {
        let is_there = |row: &&Row| row.target.is_of(machine, spin).is_ok();
        let single = TABLE.iter().filter(is_there).map(Self::single);
        let numbered = LISTS.iter().flat_map(|list| {
            (0..list.count_in(machine, spin))
                .flat_map(move |k| list.rows().map(move |row| list.parameter(row, k)))
        });
        single.chain(numbered).collect()
    }

    /// The parameter of this name.
    ///
    /// # Errors
    /// When the table has no such row, or this machine or spin no such number.
    pub fn find(name: &str, machine: &Machine, spin: &Spin) -> Result<Self, UnknownParameter> {
        if let Some(row) = TABLE.iter().find(|row| row.name == name) {
            return row.target.is_of(machine, spin).map(|()| Self::single(row));
        }
        for list in LISTS {
            if let Some((number, rest)) = numbered(name, list.element) {
                let row = list.rows().find(|row| row.name == rest);
                let row = row.ok_or_else(UnknownParameter::strange)?;
                let count = list.count_in(machine, spin);
                return match number.checked_sub(list.first) {
                    Some(k) if k < count => Ok(list.parameter(row, k)),
                    _ => {
                        let (owner, noun) = match list.name {
                            "" => ("the spin's table", "point"),
                            _ => ("the machine", list.element),
                        };
                        let last = list.first + count - 1;
                        let there = format!("{owner} has {last} {}", plural(noun, last));
                        Err(UnknownParameter::not_here(format!("{there}, numbered from 1")))
                    }
                };
            }
        }
        Err(UnknownParameter::strange())
    }

    /// Name in grid files, on the command line and of the result's column.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// SI unit (rpm for speeds), as in the name's suffix but readable.
    pub fn unit(&self) -> &'static str {
        self.row.unit
    }

    /// What it is, in a phrase.
    pub fn description(&self) -> &'static str {
        self.row.description
    }

    /// Where the built-in machine's value comes from: the paper and where in it, `derived` or
    /// `assumed` and how, a convention, or the grid file.
    pub fn source(&self) -> &'static str {
        self.row.source
    }

    /// Values it may take. No place on a machine is farther than 10 m: who writes millimetres is
    /// told.
    pub fn range(&self) -> Range {
        match (self.row.unit, self.row.range) {
            ("m", Range::Any) => Range::Within(-MAX_COORDINATE_M, MAX_COORDINATE_M),
            ("m", Range::NonNegative) => Range::Within(0.0, MAX_COORDINATE_M),
            (_, range) => range,
        }
    }

    /// What it is where a machine file leaves it out, if it may.
    pub fn left_out(&self) -> Option<f64> {
        self.row.left_out
    }

    /// Returns the rule for its value where a file with a data sheet's numbers leaves it out.
    pub fn assumption(&self) -> Option<&'static Assumption> {
        self.row.assumption.as_ref()
    }

    /// What it writes.
    pub fn target(&self) -> Target {
        self.row.target
    }

    /// Its value; `None` if it writes several numbers and they differ, or if the machine has no
    /// such number.
    pub fn get(&self, machine: &Machine, spin: &Spin) -> Option<f64> {
        (self.row.get)(machine, spin, self.index)
    }

    /// Writes the value, unchecked: [`Machine::violations`] judges the whole. Nothing is written if
    /// the machine has no such number, which [`Parameter::find`] rules out.
    pub fn set(&self, machine: &mut Machine, spin: &mut Spin, value: f64) {
        (self.row.set)(machine, spin, self.index, value);
    }

    /// Names of the single numbers this parameter writes: its own name, unless it writes several at
    /// once.
    pub fn parts(&self, machine: &Machine) -> Vec<Cow<'static, str>> {
        let of_every = |count: usize, element: &str, number: &str| {
            (1..=count).map(|k| format!("{element}_{k}_{number}").into()).collect()
        };
        match self.row.target {
            Target::Bearings(number) => {
                ["front", "rear"].map(|end| format!("bearing_{end}_{number}").into()).into()
            }
            Target::Springs(number) => of_every(machine.springs.len(), "spring", number),
            Target::Dampers(number) => of_every(machine.dampers.len(), "damper", number),
            Target::Machine | Target::Cabinet | Target::Spin | Target::Window(_) => {
                vec![self.name.clone()]
            }
        }
    }

    fn single(row: &'static Row) -> Self {
        Self { name: Cow::Borrowed(row.name), row, index: 0 }
    }
}

/// A noun of so many.
fn plural(noun: &str, count: usize) -> String {
    match (noun, count) {
        (_, 1) => noun.to_owned(),
        ("foot", _) => "feet".to_owned(),
        _ => format!("{noun}s"),
    }
}

/// Points of a spin given as a table.
fn table_points(spin: &Spin) -> usize {
    match spin {
        Spin::Table { time_s, speed_rpm } => time_s.len().min(speed_rpm.len()),
        Spin::Ramped { .. } => 0,
    }
}

/// `"spring_2_tub_x_m"` with `"spring"` gives 2 and `"tub_x_m"`. Only the canonical
/// spelling counts (no `spring_02_`), so that one number has one name.
fn numbered<'a>(name: &'a str, element: &str) -> Option<(usize, &'a str)> {
    let (digits, rest) = name.strip_prefix(element)?.strip_prefix('_')?.split_once('_')?;
    let canonical = digits.bytes().all(|b| b.is_ascii_digit()) && !digits.starts_with('0');
    let number: usize = if canonical { digits.parse().ok()? } else { return None };
    Some((number, rest))
}

/// The value all items share.
fn common<T>(items: &[T], value: fn(&T) -> f64) -> Option<f64> {
    let first = value(items.first()?);
    items.iter().all(|item| value(item).to_bits() == first.to_bits()).then_some(first)
}

impl Spring {
    /// Distance between the ends as given, before the machine sags, in m.
    pub fn given_length_m(&self) -> f64 {
        distance_m(self.cabinet_m, self.tub_m)
    }
}

impl Damper {
    /// Distance between the ends as given, before the machine sags, in m.
    pub fn given_length_m(&self) -> f64 {
        distance_m(self.cabinet_m, self.tub_m)
    }
}

impl BumpStop {
    /// Length of the direction as given.
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
