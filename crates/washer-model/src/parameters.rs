//! The one table of parameters: every number of machine, spin and window under one flat, unit-suffixed name, with its
//! unit, meaning, source and range. Grid axes, `[set]`, `--set`, reports and the machine file's checks all read it.

use std::borrow::Cow;
use std::fmt;

use crate::{Damper, Machine, Spin, Spring};

/// A number of the machine, the spin or the window that a user can name, set and sweep.
///
/// Most write one number. Some write several at once, such as `spring_stiffness_n_per_m` that of all springs; see
/// [`Parameter::parts`].
#[derive(Clone)]
pub struct Parameter {
    name: Cow<'static, str>,
    row: &'static Row,
    /// Which spring or damper, from 0; 0 where the row has only one.
    index: usize,
}

/// Where a parameter's default comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Printed by the paper, at this place.
    Paper(&'static str),
    /// Follows from what the paper prints, in this way.
    Derived(&'static str),
    /// The paper is silent: this project's assumption, for this reason.
    Assumed(&'static str),
    /// A constant everybody uses.
    Convention,
    /// Has no default: the grid file's `[spin]` gives it.
    Grid,
    /// Has no default of its own: the grid file's `[time]` gives it.
    Time,
}

/// What a parameter writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// One number of the machine.
    Machine,
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

/// Values a parameter may take. Beyond [`Range::LARGEST`] in magnitude nothing is accepted anywhere, so that
/// products of a few parameters stay finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Greater than 0.
    Positive,
    /// 0 or greater.
    NonNegative,
    /// Less than 0.
    Negative,
    /// Within these bounds, both included.
    Within(f64, f64),
}

/// Why a name is not a parameter of this machine and spin.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnknownParameter {
    /// No row of the table has this name.
    #[error("no parameter has this name")]
    Name,
    /// The name is one of a numbered spring or damper that the machine does not have.
    #[error("the machine has {count} {element}s, numbered from 1")]
    Number {
        /// `"spring"` or `"damper"`.
        element: &'static str,
        /// How many there are.
        count: usize,
    },
    /// The name is one of a numbered point of the spin's table that is not there.
    #[error("the spin's table has {count} points, numbered from 1")]
    TablePoint {
        /// How many there are; 0 if the spin is not given as a table.
        count: usize,
    },
    /// A spin given as a table has no peak and no ramp.
    #[error("a spin given as a table has no such number")]
    TableSpin,
}

/// One line of the table.
struct Row {
    /// The whole name, or what follows `spring_1_` and `damper_1_`.
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    source: Source,
    range: Range,
    target: Target,
    get: fn(&Machine, &Spin, usize) -> Option<f64>,
    set: fn(&mut Machine, &mut Spin, usize, f64),
}

impl Target {
    /// Whether these are several numbers at once.
    #[must_use]
    pub const fn is_several(self) -> bool {
        matches!(self, Self::Bearings(_) | Self::Springs(_) | Self::Dampers(_))
    }
}

impl Range {
    /// Greatest magnitude accepted of any number.
    pub const LARGEST: f64 = 1e12;

    /// Whether `value` is allowed; never for NaN or infinity.
    #[must_use]
    pub fn contains(self, value: f64) -> bool {
        value.abs() <= Self::LARGEST
            && match self {
                Self::Any => true,
                Self::Positive => value > 0.0,
                Self::NonNegative => value >= 0.0,
                Self::Negative => value < 0.0,
                Self::Within(least, greatest) => (least..=greatest).contains(&value),
            }
    }
}

impl Range {
    /// What would be accepted in place of a refused value.
    #[must_use]
    pub fn instead_of(self, value: f64) -> String {
        if value.is_finite() && value.abs() > Self::LARGEST && !matches!(self, Self::Within(..)) {
            format!("{self}, at most {:e} in magnitude", Self::LARGEST)
        } else {
            self.to_string()
        }
    }
}

/// A number as a message shows it: the shortest decimal that reads back the same, in powers of ten where it would be
/// long.
#[must_use]
pub fn decimal(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any => f.write_str("a finite number"),
            Self::Positive => f.write_str("a number greater than 0"),
            Self::NonNegative => f.write_str("a number, 0 or greater"),
            Self::Negative => f.write_str("a number less than 0"),
            Self::Within(least, greatest) => {
                write!(f, "a number from {} to {}", decimal(*least), decimal(*greatest))
            }
        }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Paper(place) => write!(f, "paper, {place}"),
            Self::Derived(how) => write!(f, "derived: {how}"),
            Self::Assumed(why) => write!(f, "assumed: {why}"),
            Self::Convention => f.write_str("convention"),
            Self::Grid => f.write_str("the grid file's [spin]"),
            Self::Time => f.write_str("the grid file's [time]"),
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

/// How a name ends whose number is in this unit; `None` where names say nothing of it.
#[must_use]
pub fn unit_suffix(unit: &str) -> Option<&'static str> {
    Some(match unit {
        "m" => "_m",
        "kg" => "_kg",
        "s" => "_s",
        "rpm" => "_rpm",
        "N/m" => "_n_per_m",
        "N s/m" => "_n_s_per_m",
        "N m/rad" => "_n_m_per_rad",
        "kg m^2" => "_kg_m2",
        "m/s^2" => "_m_per_s2",
        _ => return None,
    })
}

impl Parameter {
    /// Every parameter of this machine and spin, in the table's order, springs and dampers one by one.
    #[must_use]
    pub fn all(machine: &Machine, spin: &Spin) -> Vec<Self> {
        let tabled = matches!(spin, Spin::Table { .. });
        let single = TABLE.iter().filter(|row| !(tabled && row.target == Target::Spin)).map(Self::single);
        let springs =
            (0..machine.springs.len()).flat_map(|k| SPRING.iter().map(move |row| Self::spring(row, k)));
        let dampers =
            (0..machine.dampers.len()).flat_map(|k| DAMPER.iter().map(move |row| Self::damper(row, k)));
        let points =
            (0..table_points(spin)).flat_map(|k| SPIN_POINT.iter().map(move |row| Self::spin_point(row, k)));
        single.chain(springs).chain(dampers).chain(points).collect()
    }

    /// The parameter of this name.
    ///
    /// # Errors
    /// When the table has no such row, or this machine or spin no such number.
    pub fn find(name: &str, machine: &Machine, spin: &Spin) -> Result<Self, UnknownParameter> {
        if let Some(row) = TABLE.iter().find(|row| row.name == name) {
            return if row.target == Target::Spin && matches!(spin, Spin::Table { .. }) {
                Err(UnknownParameter::TableSpin)
            } else {
                Ok(Self::single(row))
            };
        }
        if let Some((k, rest)) = numbered(name, "spin_table_") {
            let row = SPIN_POINT.iter().find(|row| row.name == rest).ok_or(UnknownParameter::Name)?;
            let count = table_points(spin);
            return if k < count {
                Ok(Self::spin_point(row, k))
            } else {
                Err(UnknownParameter::TablePoint { count })
            };
        }
        if let Some((k, rest)) = numbered(name, "spring_") {
            let row = SPRING.iter().find(|row| row.name == rest).ok_or(UnknownParameter::Name)?;
            let count = machine.springs.len();
            return if k < count {
                Ok(Self::spring(row, k))
            } else {
                Err(UnknownParameter::Number { element: "spring", count })
            };
        }
        let (k, rest) = numbered(name, "damper_").ok_or(UnknownParameter::Name)?;
        let row = DAMPER.iter().find(|row| row.name == rest).ok_or(UnknownParameter::Name)?;
        let count = machine.dampers.len();
        if k < count {
            Ok(Self::damper(row, k))
        } else {
            Err(UnknownParameter::Number { element: "damper", count })
        }
    }

    /// Name in grid files, on the command line and of the result's column.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// SI unit (rpm for speeds), as in the name's suffix but readable.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.row.unit
    }

    /// What it is, in a phrase.
    #[must_use]
    pub fn description(&self) -> &'static str {
        self.row.description
    }

    /// Where the built-in machine's value comes from.
    #[must_use]
    pub fn source(&self) -> Source {
        self.row.source
    }

    /// Values it may take.
    #[must_use]
    pub fn range(&self) -> Range {
        self.row.range
    }

    /// What it writes.
    #[must_use]
    pub fn target(&self) -> Target {
        self.row.target
    }

    /// Its value; `None` if it stands for several numbers that differ, or the machine has no such number.
    #[must_use]
    pub fn get(&self, machine: &Machine, spin: &Spin) -> Option<f64> {
        (self.row.get)(machine, spin, self.index)
    }

    /// Writes the value, unchecked: [`Machine::violations`] judges the whole. Nothing is written if the machine has
    /// no such number, which [`Parameter::find`] rules out.
    pub fn set(&self, machine: &mut Machine, spin: &mut Spin, value: f64) {
        (self.row.set)(machine, spin, self.index, value);
    }

    /// Names of the single numbers this parameter writes: its own name, unless it writes several at once.
    #[must_use]
    pub fn parts(&self, machine: &Machine) -> Vec<Cow<'static, str>> {
        let each = |count: usize, element: &str, number: &str| {
            (1..=count).map(|k| format!("{element}_{k}_{number}").into()).collect()
        };
        match self.row.target {
            Target::Bearings(number) => {
                ["front", "rear"].map(|end| format!("bearing_{end}_{number}").into()).into()
            }
            Target::Springs(number) => each(machine.springs.len(), "spring", number),
            Target::Dampers(number) => each(machine.dampers.len(), "damper", number),
            Target::Machine | Target::Spin | Target::Window(_) => vec![self.name.clone()],
        }
    }

    fn single(row: &'static Row) -> Self {
        Self { name: Cow::Borrowed(row.name), row, index: 0 }
    }

    fn spring(row: &'static Row, index: usize) -> Self {
        Self { name: Cow::Owned(format!("spring_{}_{}", index + 1, row.name)), row, index }
    }

    fn damper(row: &'static Row, index: usize) -> Self {
        Self { name: Cow::Owned(format!("damper_{}_{}", index + 1, row.name)), row, index }
    }

    fn spin_point(row: &'static Row, index: usize) -> Self {
        Self { name: Cow::Owned(format!("spin_table_{}_{}", index + 1, row.name)), row, index }
    }
}

/// Points of a spin given as a table.
fn table_points(spin: &Spin) -> usize {
    match spin {
        Spin::Table { time_s, speed_rpm } => time_s.len().min(speed_rpm.len()),
        Spin::Cycloidal { .. } | Spin::Triangular { .. } | Spin::Ramp { .. } => 0,
    }
}

/// `"spring_2_tub_x_m"` with `"spring_"` gives 1 (from 0) and `"tub_x_m"`. Only the canonical spelling counts (no
/// `spring_02_`), so that one number has one name.
fn numbered<'a>(name: &'a str, prefix: &str) -> Option<(usize, &'a str)> {
    let (digits, rest) = name.strip_prefix(prefix)?.split_once('_')?;
    let canonical = digits.bytes().all(|b| b.is_ascii_digit()) && !digits.starts_with('0');
    let number: usize = if canonical { digits.parse().ok()? } else { return None };
    Some((number - 1, rest))
}

/// The value all items share.
fn common<T>(items: &[T], value: fn(&T) -> f64) -> Option<f64> {
    let first = value(items.first()?);
    items.iter().all(|item| value(item).to_bits() == first.to_bits()).then_some(first)
}

impl Spring {
    /// Distance between the ends as given, before the machine sags, in m.
    #[must_use]
    pub fn given_length_m(&self) -> f64 {
        distance_m(self.cabinet_m, self.tub_m)
    }
}

impl Damper {
    /// Distance between the ends as given, before the machine sags, in m.
    #[must_use]
    pub fn given_length_m(&self) -> f64 {
        distance_m(self.cabinet_m, self.tub_m)
    }
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (x * x + y * y + z * z).sqrt()
}

/// A row of the table. The last part says what it reads and writes.
macro_rules! row {
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, machine $($field:tt)+) => {
        row!(@ $name, $unit, $range, $source, $description, Target::Machine,
            |m, _, _| Some(m.$($field)+), |m, _, _, v| m.$($field)+ = v)
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, spring $($field:tt)+) => {
        row!(@ $name, $unit, $range, $source, $description, Target::Machine,
            |m, _, k| m.springs.get(k).map(|s| s.$($field)+),
            |m, _, k, v| if let Some(s) = m.springs.get_mut(k) { s.$($field)+ = v })
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, damper $($field:tt)+) => {
        row!(@ $name, $unit, $range, $source, $description, Target::Machine,
            |m, _, k| m.dampers.get(k).map(|d| d.$($field)+),
            |m, _, k, v| if let Some(d) = m.dampers.get_mut(k) { d.$($field)+ = v })
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, spin $field:ident) => {
        row!(@ $name, $unit, $range, $source, $description, Target::Spin,
            |_, spin, _| match spin {
                Spin::Cycloidal { $field, .. } | Spin::Triangular { $field, .. } | Spin::Ramp { $field, .. } => Some(*$field),
                Spin::Table { .. } => None,
            },
            |_, spin, _, v| match spin {
                Spin::Cycloidal { $field, .. } | Spin::Triangular { $field, .. } | Spin::Ramp { $field, .. } => *$field = v,
                Spin::Table { .. } => {}
            })
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, window $edge:literal) => {
        row!(@ $name, $unit, $range, $source, $description, Target::Window($edge), |_, _, _| None, |_, _, _, _| ())
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, $target:expr, by $get:expr, $set:expr) => {
        row!(@ $name, $unit, $range, $source, $description, $target, $get, $set)
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, table $field:ident) => {
        row!(@ $name, $unit, $range, $source, $description, Target::Spin,
            |_, spin, k| if let Spin::Table { $field, .. } = spin { $field.get(k).copied() } else { None },
            |_, spin, k, v| if let Spin::Table { $field, .. } = spin && let Some(entry) = $field.get_mut(k) { *entry = v })
    };
    (@ $name:literal, $unit:literal, $range:expr, $source:expr, $description:literal, $target:expr, $get:expr, $set:expr) => {
        Row {
            name: $name, unit: $unit, range: $range, source: $source, description: $description, target: $target,
            get: $get, set: $set,
        }
    };
}

use Range::{Any, Negative, NonNegative, Positive};
use Source::{Assumed, Convention, Derived, Grid, Paper, Time};

const TABLE_2: Source = Paper("Table 2");
const TABLE_3: Source = Paper("Table 3");
const TABLE_4: Source = Paper("Table 4");
const SECTION_3_1: Source = Paper("section 3.1");
const SPLIT: Source = Derived("the drum of Tables 2 and 3 less its 0.4 kg unbalance");

/// Rows with a single number each, and the three that write several.
#[rustfmt::skip]
static TABLE: &[Row] = &[
    row!("gravity_m_per_s2", "m/s^2", NonNegative, Convention, "acceleration of gravity, downwards", machine gravity_m_per_s2),
    row!("radial_clearance_m", "m", NonNegative, Assumed("a usual gap"), "radial gap between drum and tub at rest", machine radial_clearance_m),
    row!("tub_mass_kg", "kg", Positive, TABLE_2, "mass of the tub", machine tub.mass_kg),
    row!("tub_centre_x_m", "m", Any, TABLE_2, "mass centre of the tub on its axis (L_T)", machine tub.centre_x_m),
    row!("tub_inertia_11_kg_m2", "kg m^2", Positive, TABLE_3, "tub's moment of inertia about its axis", machine tub.inertia_kg_m2[0]),
    row!("tub_inertia_22_kg_m2", "kg m^2", Positive, TABLE_3, "tub's moment of inertia about the vertical", machine tub.inertia_kg_m2[1]),
    row!("tub_inertia_33_kg_m2", "kg m^2", Positive, TABLE_3, "tub's moment of inertia about the horizontal cross axis", machine tub.inertia_kg_m2[2]),
    row!("tub_front_x_m", "m", Any, Assumed("level with the drum's front"), "front centre of the tub on its axis (P_TE)", machine tub.front_x_m),
    row!("shaft_mass_kg", "kg", Positive, TABLE_2, "mass of shaft and rotor", machine shaft.mass_kg),
    row!("shaft_centre_x_m", "m", Any, TABLE_2, "mass centre of shaft and rotor on their axis (-L_S)", machine shaft.centre_x_m),
    row!("shaft_inertia_11_kg_m2", "kg m^2", Positive, TABLE_3, "shaft's moment of inertia about its axis", machine shaft.inertia_kg_m2[0]),
    row!("shaft_inertia_22_kg_m2", "kg m^2", Positive, TABLE_3, "shaft's moment of inertia across its axis, along s2", machine shaft.inertia_kg_m2[1]),
    row!("shaft_inertia_33_kg_m2", "kg m^2", Positive, TABLE_3, "shaft's moment of inertia across its axis, along s3", machine shaft.inertia_kg_m2[2]),
    row!("drum_mass_kg", "kg", Positive, SPLIT, "mass of the drum without unbalance (m_0)", machine drum.mass_kg),
    row!("drum_centre_x_m", "m", Any, SPLIT, "mass centre of the drum without unbalance, on its axis (x_0)", machine drum.centre_x_m),
    row!("drum_inertia_11_kg_m2", "kg m^2", Positive, SPLIT, "bare drum's moment of inertia about its axis", machine drum.inertia_kg_m2[0]),
    row!("drum_inertia_22_kg_m2", "kg m^2", Positive, SPLIT, "bare drum's moment of inertia along d2, towards the unbalance", machine drum.inertia_kg_m2[1]),
    row!("drum_inertia_33_kg_m2", "kg m^2", Positive, SPLIT, "bare drum's moment of inertia along d3", machine drum.inertia_kg_m2[2]),
    row!("drum_hinge_x_m", "m", Any, Assumed("between front bearing and drum"), "where drum and shaft meet (P_D, L_D)", machine drum.hinge_x_m),
    row!("drum_front_x_m", "m", Any, Assumed("the drum's middle is at the unbalance"), "front centre of the drum on its axis (P_DE, L_D + L_DE)", machine drum.front_x_m),
    row!("unbalance_mass_kg", "kg", NonNegative, TABLE_2, "point mass stuck to the drum's wall (m_u)", machine unbalance.mass_kg),
    row!("unbalance_x_m", "m", Any, SPLIT, "position of the unbalance along the axis (x_u)", machine unbalance.x_m),
    row!("unbalance_radius_m", "m", NonNegative, Paper("its text"), "distance of the unbalance from the axis (r_u)", machine unbalance.radius_m),
    row!("flexure_stiffness_n_m_per_rad", "N m/rad", Positive, SECTION_3_1, "bending stiffness between shaft and drum (K_D)", machine flexure.stiffness_n_m_per_rad),
    row!("bearing_stiffness_n_per_m", "N/m", Positive, SECTION_3_1, "radial stiffness of both bearings (K_fb, K_rb)",
        Target::Bearings("stiffness_n_per_m"), by |m, _, _| common(&[m.bearings.front_stiffness_n_per_m, m.bearings.rear_stiffness_n_per_m], |k| *k),
        |m, _, _, v| [m.bearings.front_stiffness_n_per_m, m.bearings.rear_stiffness_n_per_m] = [v; 2]),
    row!("bearing_front_x_m", "m", Positive, Assumed("a usual length"), "front bearing centre (L_fb)", machine bearings.front_x_m),
    row!("bearing_rear_x_m", "m", Negative, Assumed("O is midway between the bearings"), "rear bearing centre (-L_rb)", machine bearings.rear_x_m),
    row!("bearing_front_stiffness_n_per_m", "N/m", Positive, SECTION_3_1, "radial stiffness of the front bearing (K_fb)", machine bearings.front_stiffness_n_per_m),
    row!("bearing_rear_stiffness_n_per_m", "N/m", Positive, SECTION_3_1, "radial stiffness of the rear bearing (K_rb)", machine bearings.rear_stiffness_n_per_m),
    row!("spring_stiffness_n_per_m", "N/m", NonNegative, SECTION_3_1, "stiffness of all springs (K_k)",
        Target::Springs("stiffness_n_per_m"), by |m, _, _| common(&m.springs, |s| s.stiffness_n_per_m),
        |m, _, _, v| m.springs.iter_mut().for_each(|s| s.stiffness_n_per_m = v)),
    row!("damping_n_s_per_m", "N s/m", NonNegative, SECTION_3_1, "damping of all dampers (C)",
        Target::Dampers("damping_n_s_per_m"), by |m, _, _| common(&m.dampers, |d| d.damping_n_s_per_m),
        |m, _, _, v| m.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = v)),
    row!("spin_peak_rpm", "rpm", Range::Within(-1e5, 1e5), Grid, "greatest spin speed; negative turns backwards", spin peak_rpm),
    row!("spin_ramp_s", "s", Positive, Grid, "duration of the run-up, and of a triangle's run-down (Figs. 10 to 12: 50 s, assumed)", spin ramp_s),
    row!("window_from_s", "s", NonNegative, Time, "when amplitudes begin to be taken", window 0),
    row!("window_to_s", "s", NonNegative, Time, "when amplitudes cease to be taken", window 1),
];

/// Rows of each spring, after `spring_1_`.
#[rustfmt::skip]
static SPRING: &[Row] = &[
    row!("stiffness_n_per_m", "N/m", NonNegative, SECTION_3_1, "stiffness of this spring", spring stiffness_n_per_m),
    row!("free_length_m", "m", NonNegative, Assumed("the distance between the ends as given"), "length of this spring without force",
        Target::Machine, by |m, _, k| m.springs.get(k).map(|s| s.free_length_m.unwrap_or_else(|| s.given_length_m())),
        |m, _, k, v| if let Some(s) = m.springs.get_mut(k) { s.free_length_m = Some(v) }),
    row!("cabinet_x_m", "m", Any, TABLE_4, "cabinet end of this spring, towards the door", spring cabinet_m[0]),
    row!("cabinet_y_m", "m", Any, TABLE_4, "cabinet end of this spring, upwards", spring cabinet_m[1]),
    row!("cabinet_z_m", "m", Any, TABLE_4, "cabinet end of this spring, sideways", spring cabinet_m[2]),
    row!("tub_x_m", "m", Any, TABLE_4, "tub end of this spring, towards the door", spring tub_m[0]),
    row!("tub_y_m", "m", Any, TABLE_4, "tub end of this spring, upwards", spring tub_m[1]),
    row!("tub_z_m", "m", Any, TABLE_4, "tub end of this spring, sideways", spring tub_m[2]),
];

/// Rows of each damper, after `damper_1_`.
#[rustfmt::skip]
static DAMPER: &[Row] = &[
    row!("damping_n_s_per_m", "N s/m", NonNegative, SECTION_3_1, "damping of this damper", damper damping_n_s_per_m),
    row!("cabinet_x_m", "m", Any, TABLE_4, "cabinet end of this damper, towards the door", damper cabinet_m[0]),
    row!("cabinet_y_m", "m", Any, TABLE_4, "cabinet end of this damper, upwards", damper cabinet_m[1]),
    row!("cabinet_z_m", "m", Any, TABLE_4, "cabinet end of this damper, sideways", damper cabinet_m[2]),
    row!("tub_x_m", "m", Any, TABLE_4, "tub end of this damper, towards the door", damper tub_m[0]),
    row!("tub_y_m", "m", Any, TABLE_4, "tub end of this damper, upwards", damper tub_m[1]),
    row!("tub_z_m", "m", Any, TABLE_4, "tub end of this damper, sideways", damper tub_m[2]),
];

/// Rows of each point of a spin's table, after `spin_table_1_`.
#[rustfmt::skip]
static SPIN_POINT: &[Row] = &[
    row!("time_s", "s", NonNegative, Grid, "time of this point of the spin's table; the first is 0", table time_s),
    row!("speed_rpm", "rpm", Range::Within(-1e5, 1e5), Grid, "speed at this point of the spin's table", table speed_rpm),
];

#[cfg(test)]
mod tests;
