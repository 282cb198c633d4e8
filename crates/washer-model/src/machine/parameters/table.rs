//! The rows of the table of parameters.

use super::Range::{Any, Negative, NonNegative, Positive, Within};
use super::Source::{Assumed, Convention, Derived, Grid, Paper, Time};
use super::{Block, Range, Row, Source, Target, UnknownParameter, common, table_points};
use crate::{Damper, Machine, Spin};

/// A row: name, unit, range, source, description, and at last what it reads and writes.
macro_rules! row {
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        $target:expr, get $get:expr, set $set:expr) => {
        Row {
            name: $name,
            unit: $unit,
            range: $range,
            source: $source,
            description: $description,
            target: $target,
            get: $get,
            set: $set,
        }
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        machine $($field:tt)+) => {
        row!($name, $unit, $range, $source, $description, Target::Machine,
            get |m, _, _| Some(m.$($field)+), set |m, _, _, v| m.$($field)+ = v)
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        cabinet $($field:tt)+) => {
        row!($name, $unit, $range, $source, $description, Target::Cabinet,
            get |m, _, _| m.cabinet.as_ref().map(|cabinet| cabinet.$($field)+),
            set |m, _, _, v| if let Some(cabinet) = &mut m.cabinet { cabinet.$($field)+ = v })
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        of $list:ident $($field:tt)+) => {
        row!($name, $unit, $range, $source, $description, Target::Machine,
            get |m, _, k| m.$list.get(k).map(|item| item.$($field)+),
            set |m, _, k, v| if let Some(item) = m.$list.get_mut(k) { item.$($field)+ = v })
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        spin $field:ident) => {
        row!($name, $unit, $range, $source, $description, Target::Spin,
            get |_, spin, _| match spin {
                Spin::Cycloidal { $field, .. }
                | Spin::Triangular { $field, .. }
                | Spin::Ramp { $field, .. } => Some(*$field),
                Spin::Table { .. } => None,
            },
            set |_, spin, _, v| match spin {
                Spin::Cycloidal { $field, .. }
                | Spin::Triangular { $field, .. }
                | Spin::Ramp { $field, .. } => *$field = v,
                Spin::Table { .. } => {}
            })
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        window $edge:literal) => {
        row!($name, $unit, $range, $source, $description, Target::Window($edge),
            get |_, _, _| None, set |_, _, _, _| ())
    };
    ($name:literal, $unit:literal, $range:expr, $source:expr, $description:literal,
        table $field:ident) => {
        row!($name, $unit, $range, $source, $description, Target::Spin,
            get |_, spin, k| {
                if let Spin::Table { $field, .. } = spin { $field.get(k).copied() } else { None }
            },
            set |_, spin, k, v| {
                if let Spin::Table { $field, .. } = spin
                    && let Some(entry) = $field.get_mut(k)
                {
                    *entry = v;
                }
            })
    };
}

const TABLE_2: Source = Paper("Table 2");
const TABLE_3: Source = Paper("Table 3");
const TABLE_4: Source = Paper("Table 4");
const SECTION_3_1: Source = Paper("section 3.1");
const NONE: Source = Assumed("none unless given");
const USUAL_SPEED: Source = Assumed("a usual value");
const OWN_SPEED: Source = Assumed("that of the linear motion");
/// Speeds at which friction is taken: what divides by them stays finite.
const SPEED: Range = Within(1e-6, 1e3);
const SPLIT: Source = Derived("the drum of Tables 2 and 3 less its 0.4 kg unbalance");

/// Rows with a single number each, and those that write several.
#[rustfmt::skip]
pub(super) static TABLE: &[Row] = &[
    row!("gravity_m_per_s2", "m/s^2", NonNegative, Convention,
        "acceleration of gravity, downwards", machine gravity_m_per_s2),
    row!("radial_clearance_m", "m", NonNegative, Assumed("a usual gap"),
        "radial gap between drum and tub at rest", machine radial_clearance_m),
    row!("tub_mass_kg", "kg", Positive, TABLE_2,
        "mass of the tub", machine tub.mass_kg),
    row!("tub_centre_x_m", "m", Any, TABLE_2,
        "mass centre of the tub on its axis (L_T)", machine tub.centre_x_m),
    row!("tub_inertia_11_kg_m2", "kg m^2", Positive, TABLE_3,
        "tub's moment of inertia about its axis", machine tub.inertia_kg_m2[0]),
    row!("tub_inertia_22_kg_m2", "kg m^2", Positive, TABLE_3,
        "tub's moment of inertia about the vertical", machine tub.inertia_kg_m2[1]),
    row!("tub_inertia_33_kg_m2", "kg m^2", Positive, TABLE_3,
        "tub's moment of inertia about the horizontal cross axis", machine tub.inertia_kg_m2[2]),
    row!("tub_front_x_m", "m", Any, Assumed("level with the drum's front"),
        "front centre of the tub on its axis (P_TE)", machine tub.front_x_m),
    row!("shaft_mass_kg", "kg", Positive, TABLE_2,
        "mass of shaft and rotor", machine shaft.mass_kg),
    row!("shaft_centre_x_m", "m", Any, TABLE_2,
        "mass centre of shaft and rotor on their axis (-L_S)", machine shaft.centre_x_m),
    row!("shaft_inertia_11_kg_m2", "kg m^2", Positive, TABLE_3,
        "shaft's moment of inertia about its axis", machine shaft.inertia_kg_m2[0]),
    row!("shaft_inertia_22_kg_m2", "kg m^2", Positive, TABLE_3,
        "shaft's moment of inertia across its axis, along s2", machine shaft.inertia_kg_m2[1]),
    row!("shaft_inertia_33_kg_m2", "kg m^2", Positive, TABLE_3,
        "shaft's moment of inertia across its axis, along s3", machine shaft.inertia_kg_m2[2]),
    row!("drum_mass_kg", "kg", Positive, SPLIT,
        "mass of the drum without unbalance (m_0)", machine drum.mass_kg),
    row!("drum_centre_x_m", "m", Any, SPLIT,
        "mass centre of the drum without unbalance, on its axis (x_0)", machine drum.centre_x_m),
    row!("drum_inertia_11_kg_m2", "kg m^2", Positive, SPLIT,
        "bare drum's moment of inertia about its axis", machine drum.inertia_kg_m2[0]),
    row!("drum_inertia_22_kg_m2", "kg m^2", Positive, SPLIT,
        "bare drum's moment of inertia along d2, towards the unbalance",
        machine drum.inertia_kg_m2[1]),
    row!("drum_inertia_33_kg_m2", "kg m^2", Positive, SPLIT,
        "bare drum's moment of inertia along d3", machine drum.inertia_kg_m2[2]),
    row!("drum_hinge_x_m", "m", Any, Assumed("between front bearing and drum"),
        "where drum and shaft meet (P_D, L_D)", machine drum.hinge_x_m),
    row!("drum_front_x_m", "m", Any, Assumed("the drum's middle is at the unbalance"),
        "front centre of the drum on its axis (P_DE, L_D + L_DE)", machine drum.front_x_m),
    row!("unbalance_mass_kg", "kg", NonNegative, TABLE_2,
        "point mass stuck to the drum's wall (m_u)", machine unbalance.mass_kg),
    row!("unbalance_x_m", "m", Any, SPLIT,
        "position of the unbalance along the axis (x_u)", machine unbalance.x_m),
    row!("unbalance_radius_m", "m", NonNegative, Paper("its text"),
        "distance of the unbalance from the axis (r_u)", machine unbalance.radius_m),
    row!("flexure_stiffness_n_m_per_rad", "N m/rad", Positive, SECTION_3_1,
        "bending stiffness between shaft and drum (K_D)", machine flexure.stiffness_n_m_per_rad),
    row!("bearing_stiffness_n_per_m", "N/m", Positive, SECTION_3_1,
        "radial stiffness of both bearings (K_fb, K_rb)", Target::Bearings("stiffness_n_per_m"),
        get |Machine { bearings: b, .. }, _, _| {
            common(&[b.front_stiffness_n_per_m, b.rear_stiffness_n_per_m], |k| *k)
        },
        set |Machine { bearings: b, .. }, _, _, v| {
            [b.front_stiffness_n_per_m, b.rear_stiffness_n_per_m] = [v; 2];
        }),
    row!("bearing_front_x_m", "m", Positive, Assumed("a usual length"),
        "front bearing centre (L_fb)", machine bearings.front_x_m),
    row!("bearing_rear_x_m", "m", Negative, Assumed("O is midway between the bearings"),
        "rear bearing centre (-L_rb)", machine bearings.rear_x_m),
    row!("bearing_front_stiffness_n_per_m", "N/m", Positive, SECTION_3_1,
        "radial stiffness of the front bearing (K_fb)", machine bearings.front_stiffness_n_per_m),
    row!("bearing_rear_stiffness_n_per_m", "N/m", Positive, SECTION_3_1,
        "radial stiffness of the rear bearing (K_rb)", machine bearings.rear_stiffness_n_per_m),
    row!("spring_stiffness_n_per_m", "N/m", NonNegative, SECTION_3_1,
        "stiffness of all springs (K_k)", Target::Springs("stiffness_n_per_m"),
        get |m, _, _| common(&m.springs, |s| s.stiffness_n_per_m),
        set |m, _, _, v| m.springs.iter_mut().for_each(|s| s.stiffness_n_per_m = v)),
    row!("damping_n_s_per_m", "N s/m", NonNegative, SECTION_3_1,
        "damping of all dampers (C)", Target::Dampers("damping_n_s_per_m"),
        get |m, _, _| common(&m.dampers, |d| d.damping_n_s_per_m),
        set |m, _, _, v| m.dampers.iter_mut().for_each(|d| d.damping_n_s_per_m = v)),
    row!("friction_n", "N", NonNegative, NONE,
        "friction of all dampers (F_f)", Target::Dampers("friction_n"),
        get |m, _, _| common(&m.dampers, |d| d.friction_n),
        set |m, _, _, v| m.dampers.iter_mut().for_each(|d| d.friction_n = v)),
    row!("friction_speed_m_per_s", "m/s", SPEED, USUAL_SPEED,
        "speed below which the friction of all dampers fades (v_s)",
        Target::Dampers("friction_speed_m_per_s"),
        get |m, _, _| common(&m.dampers, |d| d.friction_speed_m_per_s),
        set |m, _, _, v| m.dampers.iter_mut().for_each(|d| d.friction_speed_m_per_s = v)),
    row!("friction_linear_speed_m_per_s", "m/s", SPEED, OWN_SPEED,
        "speed amplitude at which the linear model takes the friction of all dampers (V)",
        Target::Dampers("friction_linear_speed_m_per_s"),
        get |m, _, _| {
            let first = m.dampers.first()?.friction_linear_speed_m_per_s?;
            let is_common = |d: &Damper| d.friction_linear_speed_m_per_s == Some(first);
            m.dampers.iter().all(is_common).then_some(first)
        },
        set |m, _, _, v| {
            m.dampers.iter_mut().for_each(|d| d.friction_linear_speed_m_per_s = Some(v));
        }),
    row!("spin_peak_rpm", "rpm", Range::Within(-1e5, 1e5), Grid,
        "greatest spin speed; negative turns backwards", spin peak_rpm),
    row!("spin_ramp_s", "s", Positive, Grid,
        "duration of the run-up, and of a triangle's run-down (Figs. 10 to 12: 50 s, assumed)",
        spin ramp_s),
    row!("cabinet_mass_kg", "kg", NonNegative, NONE,
        "mass of the cabinet with all that is fixed to it", cabinet mass_kg),
    row!("cabinet_centre_x_m", "m", Any, NONE,
        "mass centre of the cabinet, towards the door", cabinet centre_m[0]),
    row!("cabinet_centre_y_m", "m", Any, NONE,
        "mass centre of the cabinet, upwards", cabinet centre_m[1]),
    row!("cabinet_centre_z_m", "m", Any, NONE,
        "mass centre of the cabinet, sideways", cabinet centre_m[2]),
    row!("cabinet_friction", "", Within(0.0, 10.0), NONE,
        "coefficient of friction between feet and floor", cabinet friction),
    row!("window_from_s", "s", NonNegative, Time,
        "when amplitudes begin to be taken", window 0),
    row!("window_to_s", "s", NonNegative, Time,
        "when amplitudes cease to be taken", window 1),
];

/// Rows of each spring, after `spring_1_`.
#[rustfmt::skip]
static SPRING: &[Row] = &[
    row!("stiffness_n_per_m", "N/m", NonNegative, SECTION_3_1,
        "stiffness of this spring", of springs stiffness_n_per_m),
    row!("free_length_m", "m", NonNegative, Assumed("the distance between the ends as given"),
        "length of this spring without force", Target::Machine,
        get |m, _, k| {
            m.springs.get(k).map(|s| s.free_length_m.unwrap_or_else(|| s.given_length_m()))
        },
        set |m, _, k, v| if let Some(s) = m.springs.get_mut(k) { s.free_length_m = Some(v) }),
    row!("cubic_n_per_m3", "N/m^3", NonNegative, NONE,
        "tension of this spring per cube of its elongation", of springs cubic_n_per_m3),
    row!("cabinet_x_m", "m", Any, TABLE_4,
        "cabinet end of this spring, towards the door", of springs cabinet_m[0]),
    row!("cabinet_y_m", "m", Any, TABLE_4,
        "cabinet end of this spring, upwards", of springs cabinet_m[1]),
    row!("cabinet_z_m", "m", Any, TABLE_4,
        "cabinet end of this spring, sideways", of springs cabinet_m[2]),
    row!("tub_x_m", "m", Any, TABLE_4,
        "tub end of this spring, towards the door", of springs tub_m[0]),
    row!("tub_y_m", "m", Any, TABLE_4,
        "tub end of this spring, upwards", of springs tub_m[1]),
    row!("tub_z_m", "m", Any, TABLE_4,
        "tub end of this spring, sideways", of springs tub_m[2]),
];

/// Rows of each damper, after `damper_1_`.
#[rustfmt::skip]
static DAMPER: &[Row] = &[
    row!("damping_n_s_per_m", "N s/m", NonNegative, SECTION_3_1,
        "damping of this damper", of dampers damping_n_s_per_m),
    row!("friction_n", "N", NonNegative, NONE,
        "friction of this damper (F_f)", of dampers friction_n),
    row!("friction_speed_m_per_s", "m/s", SPEED, USUAL_SPEED,
        "speed below which the friction of this damper fades (v_s)",
        of dampers friction_speed_m_per_s),
    row!("friction_linear_speed_m_per_s", "m/s", SPEED, OWN_SPEED,
        "speed amplitude at which the linear model takes the friction of this damper (V)",
        Target::Machine,
        get |m, _, k| m.dampers.get(k)?.friction_linear_speed_m_per_s,
        set |m, _, k, v| if let Some(d) = m.dampers.get_mut(k) {
            d.friction_linear_speed_m_per_s = Some(v)
        }),
    row!("cabinet_x_m", "m", Any, TABLE_4,
        "cabinet end of this damper, towards the door", of dampers cabinet_m[0]),
    row!("cabinet_y_m", "m", Any, TABLE_4,
        "cabinet end of this damper, upwards", of dampers cabinet_m[1]),
    row!("cabinet_z_m", "m", Any, TABLE_4,
        "cabinet end of this damper, sideways", of dampers cabinet_m[2]),
    row!("tub_x_m", "m", Any, TABLE_4,
        "tub end of this damper, towards the door", of dampers tub_m[0]),
    row!("tub_y_m", "m", Any, TABLE_4,
        "tub end of this damper, upwards", of dampers tub_m[1]),
    row!("tub_z_m", "m", Any, TABLE_4,
        "tub end of this damper, sideways", of dampers tub_m[2]),
];

/// Rows of each stop, after `stop_1_`.
#[rustfmt::skip]
static STOP: &[Row] = &[
    row!("clearance_m", "m", Any, NONE,
        "how far the tub may move before it meets this stop", of stops clearance_m),
    row!("stiffness_n_per_m", "N/m", NonNegative, NONE,
        "stiffness of this stop in contact", of stops stiffness_n_per_m),
    row!("damping_n_s_per_m", "N s/m", NonNegative, NONE,
        "damping of this stop in contact", of stops damping_n_s_per_m),
    row!("softness_m", "m", Within(1e-9, 1.0), Assumed("a tenth of a millimetre"),
        "depth over which contact with this stop sets in", of stops softness_m),
    row!("tub_x_m", "m", Any, NONE,
        "tub point of this stop, towards the door", of stops tub_m[0]),
    row!("tub_y_m", "m", Any, NONE,
        "tub point of this stop, upwards", of stops tub_m[1]),
    row!("tub_z_m", "m", Any, NONE,
        "tub point of this stop, sideways", of stops tub_m[2]),
    row!("direction_x", "", Any, NONE,
        "way from the tub to this stop, towards the door", of stops direction[0]),
    row!("direction_y", "", Any, NONE,
        "way from the tub to this stop, upwards", of stops direction[1]),
    row!("direction_z", "", Any, NONE,
        "way from the tub to this stop, sideways", of stops direction[2]),
];

/// Rows of each bushing, after `bushing_1_`.
#[rustfmt::skip]
static BUSHING: &[Row] = &[
    row!("tub_x_m", "m", Any, NONE,
        "tub point of this bushing, towards the door", of bushings tub_m[0]),
    row!("tub_y_m", "m", Any, NONE,
        "tub point of this bushing, upwards", of bushings tub_m[1]),
    row!("tub_z_m", "m", Any, NONE,
        "tub point of this bushing, sideways", of bushings tub_m[2]),
    row!("stiffness_x_n_per_m", "N/m", NonNegative, NONE,
        "stiffness of this bushing towards the door", of bushings stiffness_n_per_m[0]),
    row!("stiffness_y_n_per_m", "N/m", NonNegative, NONE,
        "stiffness of this bushing upwards", of bushings stiffness_n_per_m[1]),
    row!("stiffness_z_n_per_m", "N/m", NonNegative, NONE,
        "stiffness of this bushing sideways", of bushings stiffness_n_per_m[2]),
    row!("cubic_x_n_per_m3", "N/m^3", NonNegative, NONE,
        "force of this bushing per cube of its displacement towards the door",
        of bushings cubic_n_per_m3[0]),
    row!("cubic_y_n_per_m3", "N/m^3", NonNegative, NONE,
        "the same upwards", of bushings cubic_n_per_m3[1]),
    row!("cubic_z_n_per_m3", "N/m^3", NonNegative, NONE,
        "the same sideways", of bushings cubic_n_per_m3[2]),
    row!("damping_x_n_s_per_m", "N s/m", NonNegative, NONE,
        "damping of this bushing towards the door", of bushings damping_n_s_per_m[0]),
    row!("damping_y_n_s_per_m", "N s/m", NonNegative, NONE,
        "damping of this bushing upwards", of bushings damping_n_s_per_m[1]),
    row!("damping_z_n_s_per_m", "N s/m", NonNegative, NONE,
        "damping of this bushing sideways", of bushings damping_n_s_per_m[2]),
];

/// Rows of each further unbalance, after `unbalance_2_`.
#[rustfmt::skip]
static FURTHER_UNBALANCE: &[Row] = &[
    row!("mass_kg", "kg", NonNegative, NONE,
        "mass of this further unbalance", of further_unbalances mass_kg),
    row!("x_m", "m", Any, NONE,
        "position of this further unbalance along the axis", of further_unbalances x_m),
    row!("radius_m", "m", Any, NONE,
        "distance of this further unbalance from the axis; negative opposite the first",
        of further_unbalances radius_m),
];

/// Rows of each foot, after `foot_1_`.
#[rustfmt::skip]
static FOOT: &[Row] = &[
    row!("x_m", "m", Any, NONE, "place of this foot, towards the door", of feet foot_m[0]),
    row!("y_m", "m", Any, NONE, "place of this foot, upwards", of feet foot_m[1]),
    row!("z_m", "m", Any, NONE, "place of this foot, sideways", of feet foot_m[2]),
];

/// Rows of each point of a spin's table, after `spin_table_1_`.
#[rustfmt::skip]
static SPIN_POINT: &[Row] = &[
    row!("time_s", "s", NonNegative, Grid,
        "time of this point of the spin's table; the first is 0", table time_s),
    row!("speed_rpm", "rpm", Range::Within(-1e5, 1e5), Grid,
        "speed at this point of the spin's table", table speed_rpm),
];

/// Rows of numbered elements.
pub(super) static BLOCKS: &[Block] = &[
    Block {
        prefix: "spring_",
        rows: SPRING,
        first: 1,
        count: |machine, _| machine.springs.len(),
        missing: |count| UnknownParameter::Number { element: "spring", count },
    },
    Block {
        prefix: "damper_",
        rows: DAMPER,
        first: 1,
        count: |machine, _| machine.dampers.len(),
        missing: |count| UnknownParameter::Number { element: "damper", count },
    },
    Block {
        prefix: "stop_",
        rows: STOP,
        first: 1,
        count: |machine, _| machine.stops.len(),
        missing: |count| UnknownParameter::Number { element: "stop", count },
    },
    Block {
        prefix: "bushing_",
        rows: BUSHING,
        first: 1,
        count: |machine, _| machine.bushings.len(),
        missing: |count| UnknownParameter::Number { element: "bushing", count },
    },
    Block {
        prefix: "unbalance_",
        rows: FURTHER_UNBALANCE,
        // The first is that of every machine.
        first: 2,
        count: |machine, _| machine.further_unbalances.len(),
        missing: |count| UnknownParameter::Number { element: "unbalance", count: count + 1 },
    },
    Block {
        prefix: "foot_",
        rows: FOOT,
        first: 1,
        count: |machine, _| machine.feet.len(),
        missing: |count| UnknownParameter::Number { element: "foot", count },
    },
    Block {
        prefix: "spin_table_",
        rows: SPIN_POINT,
        first: 1,
        count: |_, spin| table_points(spin),
        missing: |count| UnknownParameter::TablePoint { count },
    },
];
