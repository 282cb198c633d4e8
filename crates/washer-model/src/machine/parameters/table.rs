//! The entries of the table of parameters.

use super::Range::{Any, Negative, NonNegative, Positive, Within};
use super::assumed::ExpectedRange::{Depth, Factor};
use super::assumed::{Assumption, DataSheet, cylinder_inertia_kg_m2};
use super::{ElementList, Getter, ParameterEntry, Range, Setter, Target, common_value};
use crate::{BumpStop, Bushing, Damper, Foot, Machine, Spin, Spring, Unbalance};

/// The target of an entry, and the functions that read and write it.
type ParameterAccess = (Target, Getter, Setter);

/// Declares an entry: name, unit, range, source, description, access. Before the access, `else`
/// gives the value if a machine file leaves the number out, or `assume` gives a function of a data
/// sheet, the rule in words, and the range in which real machines are expected.
macro_rules! entry {
    ($name:expr, $unit:literal, $range:expr, $source:expr, $description:expr,
        assume $value:expr, $rule:literal, $expected_range:expr; $($access:tt)+) => {
        ParameterEntry {
            assumption: Some(Assumption {
                compute_value: $value,
                rule: $rule,
                expected_range: $expected_range,
            }),
            ..entry!($name, $unit, $range, $source, $description, $($access)+)
        }
    };
    ($name:expr, $unit:literal, $range:expr, $source:expr, $description:expr,
        else $default_value:expr, $($access:tt)+) => {
        ParameterEntry {
            default_value: Some($default_value),
            ..entry!($name, $unit, $range, $source, $description, $($access)+)
        }
    };
    ($name:expr, $unit:literal, $range:expr, $source:expr, $description:expr, $($access:tt)+) => {{
        let (target, get, set): ParameterAccess = access!($($access)+);
        ParameterEntry {
            name: $name,
            unit: $unit,
            range: $range,
            source: $source,
            description: $description,
            default_value: None,
            assumption: None,
            target,
            get,
            set,
        }
    }};
}

/// Expands to the target of a parameter and to the functions that read and write its value.
macro_rules! access {
    (machine $($field:tt)+) => {
        (Target::Machine, |m, _, _| Some(m.$($field)+), |m, _, _, v| m.$($field)+ = v)
    };
    (cabinet $($field:tt)+) => {
        (
            Target::Cabinet,
            |m, _, _| m.cabinet.as_ref().map(|cabinet| cabinet.$($field)+),
            |m, _, _, v| if let Some(cabinet) = &mut m.cabinet { cabinet.$($field)+ = v },
        )
    };
    (of $list:ident $($field:tt)+) => {
        (
            Target::Machine,
            |m, _, k| m.$list.get(k).map(|item| item.$($field)+),
            |m, _, k, v| if let Some(item) = m.$list.get_mut(k) { item.$($field)+ = v },
        )
    };
    (every $list:ident $Target:ident $field:ident) => {
        (
            Target::$Target(stringify!($field)),
            |m, _, _| common_value(&m.$list, |item| item.$field),
            |m, _, _, v| m.$list.iter_mut().for_each(|item| item.$field = v),
        )
    };
    (spin $field:ident) => {
        (
            Target::Spin,
            |_, spin, _| {
                if let Spin::Ramped { $field, .. } = spin { Some(*$field) } else { None }
            },
            |_, spin, _, v| {
                if let Spin::Ramped { $field, .. } = spin {
                    *$field = v;
                }
            },
        )
    };
    (window $edge:literal) => {
        (Target::Window($edge), |_, _, _| None, |_, _, _, _| ())
    };
    (table $field:ident) => {
        (
            Target::Spin,
            |_, spin, k| {
                if let Spin::Table { $field, .. } = spin { $field.get(k).copied() } else { None }
            },
            |_, spin, k, v| {
                if let Spin::Table { $field, .. } = spin
                    && let Some(spin_value) = $field.get_mut(k)
                {
                    *spin_value = v;
                }
            },
        )
    };
    ($target:expr, get $get:expr, set $set:expr) => {
        ($target, $get, $set)
    };
}

/// Declares the entries of a vector's three components: the parts of the names before and after the
/// axis, then the arguments of [`entry!`]. Descriptions end with the direction of the axis.
macro_rules! axes {
    ($before:literal $after:literal, $unit:literal, $range:expr, $source:expr, $prefix:literal,
        $($vector:tt)+) => {
        &[
            entry!(concat!($before, "x", $after), $unit, $range, $source,
                concat!($prefix, "towards the door"), $($vector)+[0]),
            entry!(concat!($before, "y", $after), $unit, $range, $source,
                concat!($prefix, "upwards"), $($vector)+[1]),
            entry!(concat!($before, "z", $after), $unit, $range, $source,
                concat!($prefix, "sideways"), $($vector)+[2]),
        ]
    };
}

/// The source of masses and mass centres.
const TABLE_2: &str = "paper, Table 2";
/// The source of moments of inertia.
const TABLE_3: &str = "paper, Table 3";
/// The source of the ends of springs and dampers.
const TABLE_4: &str = "paper, Table 4";
/// The source of stiffnesses and dampings.
const SECTION_3_1: &str = "paper, section 3.1";
/// The source of numbers that the paper's machine does not have.
const ABSENT_SOURCE: &str = "assumed: none unless given";
/// The source of the friction speed v_s.
const SPEED_SOURCE: &str = "assumed: a usual value";
/// The source of the speed amplitude V of friction in the linear model.
const LINEAR_SPEED_SOURCE: &str = "assumed: that of the linear motion";
/// The range of the speeds v_s and V (m/s) of friction. Friction is divided by them.
const FRICTION_SPEED_RANGE: Range = Within(1e-6, 1e3);
/// The source of the unbalances' angles.
const ANGLE_SOURCE: &str = "assumed: along d2, up at the start";
/// The range of the unbalances' angles (deg).
const ANGLE_RANGE: Range = Within(-360.0, 360.0);
/// The source of the spin's numbers.
const SPIN_SOURCE: &str = "the grid file's [spin]";
/// The source of the window.
const TIME_SOURCE: &str = "the grid file's [time]";
/// The source of the bare drum and of its unbalance.
const DRUM_SOURCE: &str = "derived: the drum of Tables 2 and 3 less its 0.4 kg unbalance";

/// Returns the moments of inertia of an assumed tub, about its axis and across it.
fn tub_inertia_kg_m2(sheet: &DataSheet, machine: &Machine) -> [f64; 2] {
    let radius_m = sheet.drum_radius_m + machine.radial_clearance_m;
    cylinder_inertia_kg_m2(machine.tub.mass_kg, radius_m, 2.0 * sheet.drum_depth_m)
}

/// Returns the moments of inertia of an assumed shaft and rotor, about their axis and across it.
fn shaft_inertia_kg_m2(sheet: &DataSheet, machine: &Machine) -> [f64; 2] {
    let radius_m = sheet.drum_radius_m / 2.0;
    cylinder_inertia_kg_m2(machine.shaft.mass_kg, radius_m, sheet.drum_depth_m / 3.0)
}

/// Returns the moments of inertia of an assumed drum, about its axis and across it.
fn drum_inertia_kg_m2(sheet: &DataSheet, machine: &Machine) -> [f64; 2] {
    cylinder_inertia_kg_m2(machine.drum.mass_kg, sheet.drum_radius_m, sheet.drum_depth_m)
}

/// Returns the stiffness at which the empty drum, turned about its hinge, has the built-in
/// machine's natural frequency.
fn hinge_stiffness_n_m_per_rad(machine: &Machine) -> f64 {
    let hinge_inertia_kg_m2 = |machine: &Machine| {
        let arm_m = machine.drum.centre_x_m - machine.drum.hinge_x_m;
        machine.drum.inertia_kg_m2[1] + machine.drum.mass_kg * arm_m * arm_m
    };
    let built_in_machine = Machine::paper();
    let inertia_ratio = hinge_inertia_kg_m2(machine) / hinge_inertia_kg_m2(&built_in_machine);
    built_in_machine.flexure.stiffness_n_m_per_rad * inertia_ratio
}

/// The entries of parameters that do not belong to a list.
#[rustfmt::skip]
pub(super) static SINGLE_ENTRIES: &[ParameterEntry] = &[
    entry!("gravity_m_per_s2", "m/s^2", NonNegative, "convention",
        "acceleration of gravity, downwards",
        assume |_, _| 9.81,
        "9.81, as on most of the earth",
        Factor(0.998, 1.003); machine gravity_m_per_s2),
    entry!("radial_clearance_m", "m", NonNegative, "assumed: a usual gap",
        "radial gap between drum and tub at rest",
        assume |_, _| 0.010,
        "0.010 m, as the built-in machine",
        Factor(0.5, 2.0); machine radial_clearance_m),
    entry!("tub_mass_kg", "kg", Positive, TABLE_2,
        "mass of the tub",
        assume |sheet, m| sheet.moving_mass_kg.unwrap_or(0.0) - m.shaft.mass_kg - m.drum.mass_kg,
        "the moving mass less shaft and drum",
        Factor(0.85, 1.1); machine tub.mass_kg),
    entry!("tub_centre_x_m", "m", Any, TABLE_2,
        "mass centre of the tub on its axis (L_T)",
        assume |sheet, m| m.drum.hinge_x_m + 0.3 * sheet.drum_depth_m,
        "0.3 of the drum's depth before the hinge, as the built-in machine",
        Depth(-0.3, 0.3); machine tub.centre_x_m),
    entry!("tub_inertia_11_kg_m2", "kg m^2", Positive, TABLE_3,
        "tub's moment of inertia about its axis",
        assume |sheet, m| tub_inertia_kg_m2(sheet, m)[0],
        "a thin-walled cylinder around the drum, twice its depth long",
        Factor(0.8, 1.5); machine tub.inertia_kg_m2[0]),
    entry!("tub_inertia_22_kg_m2", "kg m^2", Positive, TABLE_3,
        "tub's moment of inertia about the vertical",
        assume |sheet, m| tub_inertia_kg_m2(sheet, m)[1],
        "a thin-walled cylinder around the drum, twice its depth long",
        Factor(0.7, 1.4); machine tub.inertia_kg_m2[1]),
    entry!("tub_inertia_33_kg_m2", "kg m^2", Positive, TABLE_3,
        "tub's moment of inertia about the horizontal cross axis",
        assume |sheet, m| tub_inertia_kg_m2(sheet, m)[1],
        "a thin-walled cylinder around the drum, twice its depth long",
        Factor(0.7, 1.4); machine tub.inertia_kg_m2[2]),
    entry!("tub_front_x_m", "m", Any, "assumed: level with the drum's front",
        "front centre of the tub on its axis (P_TE)",
        assume |_, m| m.drum.front_x_m,
        "level with the drum's front",
        Depth(-0.1, 0.2); machine tub.front_x_m),
    entry!("shaft_mass_kg", "kg", Positive, TABLE_2,
        "mass of shaft and rotor",
        assume |sheet, _| 0.14 * sheet.moving_mass_kg.unwrap_or(0.0),
        "0.14 of the moving mass, as the built-in machine",
        Factor(0.3, 1.5); machine shaft.mass_kg),
    entry!("shaft_centre_x_m", "m", Any, TABLE_2,
        "mass centre of shaft and rotor on their axis (-L_S)",
        assume |sheet, _| -0.06 * sheet.drum_depth_m,
        "0.06 of the drum's depth behind O, as the built-in machine",
        Depth(-0.3, 0.1); machine shaft.centre_x_m),
    entry!("shaft_inertia_11_kg_m2", "kg m^2", Positive, TABLE_3,
        "shaft's moment of inertia about its axis",
        assume |sheet, m| shaft_inertia_kg_m2(sheet, m)[0],
        "a ring of half the drum's radius, a third of its depth long",
        Factor(0.1, 2.0); machine shaft.inertia_kg_m2[0]),
    entry!("shaft_inertia_22_kg_m2", "kg m^2", Positive, TABLE_3,
        "shaft's moment of inertia across its axis, along s2",
        assume |sheet, m| shaft_inertia_kg_m2(sheet, m)[1],
        "a ring of half the drum's radius, a third of its depth long",
        Factor(0.5, 3.0); machine shaft.inertia_kg_m2[1]),
    entry!("shaft_inertia_33_kg_m2", "kg m^2", Positive, TABLE_3,
        "shaft's moment of inertia across its axis, along s3",
        assume |sheet, m| shaft_inertia_kg_m2(sheet, m)[1],
        "a ring of half the drum's radius, a third of its depth long",
        Factor(0.5, 3.0); machine shaft.inertia_kg_m2[2]),
    entry!("drum_mass_kg", "kg", Positive, DRUM_SOURCE,
        "mass of the drum without unbalance (m_0)",
        assume |sheet, _| 0.11 * sheet.moving_mass_kg.unwrap_or(0.0),
        "0.11 of the moving mass, as the built-in machine",
        Factor(0.7, 2.0); machine drum.mass_kg),
    entry!("drum_centre_x_m", "m", Any, DRUM_SOURCE,
        "mass centre of the drum without unbalance, on its axis (x_0)",
        assume |sheet, m| m.drum.hinge_x_m + sheet.drum_depth_m / 6.0,
        "a sixth of the drum's depth before the hinge, as the built-in machine",
        Depth(-0.1, 0.3); machine drum.centre_x_m),
    entry!("drum_inertia_11_kg_m2", "kg m^2", Positive, DRUM_SOURCE,
        "bare drum's moment of inertia about its axis",
        assume |sheet, m| drum_inertia_kg_m2(sheet, m)[0],
        "a thin-walled cylinder of the drum's radius and depth",
        Factor(0.8, 1.5); machine drum.inertia_kg_m2[0]),
    entry!("drum_inertia_22_kg_m2", "kg m^2", Positive, DRUM_SOURCE,
        "bare drum's moment of inertia along d2, towards the unbalance",
        assume |sheet, m| drum_inertia_kg_m2(sheet, m)[1],
        "a thin-walled cylinder of the drum's radius and depth",
        Factor(0.7, 2.0); machine drum.inertia_kg_m2[1]),
    entry!("drum_inertia_33_kg_m2", "kg m^2", Positive, DRUM_SOURCE,
        "bare drum's moment of inertia along d3",
        assume |sheet, m| drum_inertia_kg_m2(sheet, m)[1],
        "a thin-walled cylinder of the drum's radius and depth",
        Factor(0.7, 2.0); machine drum.inertia_kg_m2[2]),
    entry!("drum_hinge_x_m", "m", Any, "assumed: between front bearing and drum",
        "where drum and shaft meet (P_D, L_D)",
        assume |sheet, _| 0.5 * sheet.drum_depth_m,
        "half the drum's depth before O, as the built-in machine",
        Depth(-0.2, 0.2); machine drum.hinge_x_m),
    entry!("drum_front_x_m", "m", Any, "assumed: the drum's middle is at the unbalance",
        "front centre of the drum on its axis (P_DE, L_D + L_DE)",
        assume |sheet, m| m.drum.hinge_x_m + sheet.drum_depth_m,
        "the drum's depth before the hinge",
        Depth(-0.1, 0.1); machine drum.front_x_m),
    entry!("unbalance_mass_kg", "kg", NonNegative, TABLE_2,
        "point mass stuck to the drum's wall (m_u)", machine unbalance.mass_kg),
    entry!("unbalance_x_m", "m", Any, DRUM_SOURCE,
        "position of the unbalance along the axis (x_u)",
        assume |sheet, m| m.drum.hinge_x_m + 0.5 * sheet.drum_depth_m,
        "the middle of the drum's depth",
        Depth(-0.5, 0.5); machine unbalance.x_m),
    entry!("unbalance_radius_m", "m", NonNegative, "paper, its text",
        "distance of the unbalance from the axis (r_u)",
        assume |sheet, _| sheet.drum_radius_m,
        "the drum's radius",
        Factor(0.8, 1.0); machine unbalance.radius_m),
    entry!("unbalance_angle_deg", "deg", ANGLE_RANGE, ANGLE_SOURCE,
        "angle of the unbalance about the axis, from d2 in the direction in which the drum turns",
        else 0.0, machine unbalance.angle_deg),
    entry!("flexure_stiffness_n_m_per_rad", "N m/rad", Positive, SECTION_3_1,
        "bending stiffness between shaft and drum (K_D)",
        assume |_, m| hinge_stiffness_n_m_per_rad(m),
        "the empty drum swings on the hinge at 67 Hz, as the built-in machine",
        Factor(0.25, 16.0); machine flexure.stiffness_n_m_per_rad),
    entry!("bearing_stiffness_n_per_m", "N/m", Positive, SECTION_3_1,
        "radial stiffness of both bearings (K_fb, K_rb)", Target::Bearings("stiffness_n_per_m"),
        get |Machine { bearings: b, .. }, _, _| {
            common_value(&[b.front_stiffness_n_per_m, b.rear_stiffness_n_per_m], |k| *k)
        },
        set |Machine { bearings: b, .. }, _, _, v| {
            [b.front_stiffness_n_per_m, b.rear_stiffness_n_per_m] = [v; 2];
        }),
    entry!("bearing_front_x_m", "m", Positive, "assumed: a usual length",
        "front bearing centre (L_fb)",
        assume |sheet, _| sheet.drum_depth_m / 6.0,
        "a sixth of the drum's depth before O, as the built-in machine",
        Factor(0.5, 2.0); machine bearings.front_x_m),
    entry!("bearing_rear_x_m", "m", Negative, "assumed: O is midway between the bearings",
        "rear bearing centre (-L_rb)",
        assume |_, m| -m.bearings.front_x_m,
        "O is midway between the bearings",
        Factor(1.0, 1.0); machine bearings.rear_x_m),
    entry!("bearing_front_stiffness_n_per_m", "N/m", Positive, SECTION_3_1,
        "radial stiffness of the front bearing (K_fb)",
        assume |_, _| 2e8,
        "2e8 N/m, as the built-in machine",
        Factor(0.25, 4.0); machine bearings.front_stiffness_n_per_m),
    entry!("bearing_rear_stiffness_n_per_m", "N/m", Positive, SECTION_3_1,
        "radial stiffness of the rear bearing (K_rb)",
        assume |_, _| 2e8,
        "2e8 N/m, as the built-in machine",
        Factor(0.25, 4.0); machine bearings.rear_stiffness_n_per_m),
    entry!("spring_stiffness_n_per_m", "N/m", NonNegative, SECTION_3_1,
        "stiffness of all springs (K_k)",
        every springs Springs stiffness_n_per_m),
    entry!("damping_n_s_per_m", "N s/m", NonNegative, SECTION_3_1,
        "damping of all dampers (C)",
        every dampers Dampers damping_n_s_per_m),
    entry!("friction_n", "N", NonNegative, ABSENT_SOURCE,
        "friction of all dampers (F_f)",
        every dampers Dampers friction_n),
    entry!("friction_speed_m_per_s", "m/s", FRICTION_SPEED_RANGE, SPEED_SOURCE,
        "speed below which the friction of all dampers fades (v_s)",
        every dampers Dampers friction_speed_m_per_s),
    entry!("friction_linear_speed_m_per_s", "m/s", FRICTION_SPEED_RANGE, LINEAR_SPEED_SOURCE,
        "speed amplitude at which the linear model takes the friction of all dampers (V)",
        Target::Dampers("friction_linear_speed_m_per_s"),
        get |m, _, _| {
            let first_m_per_s = m.dampers.first()?.friction_linear_speed_m_per_s?;
            let is_common = |d: &Damper| d.friction_linear_speed_m_per_s == Some(first_m_per_s);
            m.dampers.iter().all(is_common).then_some(first_m_per_s)
        },
        set |m, _, _, v| {
            m.dampers.iter_mut().for_each(|d| d.friction_linear_speed_m_per_s = Some(v));
        }),
    entry!("free_stroke_m", "m", NonNegative, ABSENT_SOURCE,
        "free stroke of all dampers to each side of their place at rest, without friction (s)",
        else 0.0, every dampers Dampers free_stroke_m),
    entry!("outer_damping_n_s_per_m", "N s/m", NonNegative, ABSENT_SOURCE,
        "damping of all dampers beyond their free stroke, added to that which always acts",
        else 0.0, every dampers Dampers outer_damping_n_s_per_m),
    entry!("spin_peak_rpm", "rpm", Range::Within(-1e5, 1e5), SPIN_SOURCE,
        "greatest spin speed; negative turns backwards", spin peak_rpm),
    entry!("spin_ramp_s", "s", Positive, SPIN_SOURCE,
        "duration of the run-up, and of a triangle's run-down (Figs. 10 to 12: 50 s, assumed)",
        spin ramp_s),
    entry!("cabinet_mass_kg", "kg", NonNegative, ABSENT_SOURCE,
        "mass of the cabinet with all that is fixed to it", cabinet mass_kg),
    entry!("cabinet_centre_x_m", "m", Any, ABSENT_SOURCE,
        "mass centre of the cabinet, towards the door", cabinet centre_m[0]),
    entry!("cabinet_centre_y_m", "m", Any, ABSENT_SOURCE,
        "mass centre of the cabinet, upwards", cabinet centre_m[1]),
    entry!("cabinet_centre_z_m", "m", Any, ABSENT_SOURCE,
        "mass centre of the cabinet, sideways", cabinet centre_m[2]),
    entry!("cabinet_friction", "", Within(0.0, 10.0), ABSENT_SOURCE,
        "coefficient of friction between feet and floor", cabinet friction_coefficient),
    entry!("window_from_s", "s", NonNegative, TIME_SOURCE,
        "when amplitudes begin to be taken", window 0),
    entry!("window_to_s", "s", NonNegative, TIME_SOURCE,
        "when amplitudes cease to be taken", window 1),
];

/// The entries of each spring, after `spring_1_`.
#[rustfmt::skip]
static SPRING_ENTRIES: &[&[ParameterEntry]] = &[
    &[
        entry!("stiffness_n_per_m", "N/m", NonNegative, SECTION_3_1,
            "stiffness of this spring", of springs stiffness_n_per_m),
        entry!("free_length_m", "m", NonNegative, "assumed: the distance between the ends as given",
            "length of this spring without force", Target::Machine,
            get |m, _, k| {
                m.springs.get(k).map(|s| s.free_length_m.unwrap_or_else(|| s.given_length_m()))
            },
            set |m, _, k, v| if let Some(s) = m.springs.get_mut(k) { s.free_length_m = Some(v) }),
        entry!("cubic_n_per_m3", "N/m^3", NonNegative, ABSENT_SOURCE,
            "tension of this spring per cube of its elongation", else 0.0,
            of springs cubic_n_per_m3),
    ],
    axes!("cabinet_" "_m", "m", Any, TABLE_4, "cabinet end of this spring, ", of springs cabinet_m),
    axes!("tub_" "_m", "m", Any, TABLE_4, "tub end of this spring, ", of springs tub_m),
];

/// The entries of each damper, after `damper_1_`.
#[rustfmt::skip]
static DAMPER_ENTRIES: &[&[ParameterEntry]] = &[
    &[
        entry!("damping_n_s_per_m", "N s/m", NonNegative, SECTION_3_1,
            "damping of this damper", of dampers damping_n_s_per_m),
        entry!("friction_n", "N", NonNegative, ABSENT_SOURCE,
            "friction of this damper (F_f)", else 0.0, of dampers friction_n),
        entry!("friction_speed_m_per_s", "m/s", FRICTION_SPEED_RANGE, SPEED_SOURCE,
            "speed below which the friction of this damper fades (v_s)",
            else Damper::FRICTION_SPEED_M_PER_S, of dampers friction_speed_m_per_s),
        entry!("friction_linear_speed_m_per_s", "m/s", FRICTION_SPEED_RANGE, LINEAR_SPEED_SOURCE,
            "speed amplitude at which the linear model takes the friction of this damper (V)",
            Target::Machine,
            get |m, _, k| m.dampers.get(k)?.friction_linear_speed_m_per_s,
            set |m, _, k, v| if let Some(d) = m.dampers.get_mut(k) {
                d.friction_linear_speed_m_per_s = Some(v)
            }),
        entry!("free_stroke_m", "m", NonNegative, ABSENT_SOURCE,
            "free stroke of this damper to each side of its place at rest, without friction (s)",
            else 0.0, of dampers free_stroke_m),
        entry!("free_stroke_softness_m", "m", Within(1e-9, 1.0), "assumed: a tenth of a millimetre",
            "length over which forces beyond the free stroke set in",
            else Damper::FREE_STROKE_SOFTNESS_M, of dampers free_stroke_softness_m),
        entry!("outer_damping_n_s_per_m", "N s/m", NonNegative, ABSENT_SOURCE,
            "damping of this damper beyond its free stroke, added to that which always acts",
            else 0.0, of dampers outer_damping_n_s_per_m),
    ],
    axes!("cabinet_" "_m", "m", Any, TABLE_4, "cabinet end of this damper, ", of dampers cabinet_m),
    axes!("tub_" "_m", "m", Any, TABLE_4, "tub end of this damper, ", of dampers tub_m),
];

/// The entries of each stop, after `stop_1_`.
#[rustfmt::skip]
static STOP_ENTRIES: &[&[ParameterEntry]] = &[
    &[
        entry!("clearance_m", "m", Any, ABSENT_SOURCE,
            "how far the tub may move before it meets this stop", of stops clearance_m),
        entry!("stiffness_n_per_m", "N/m", NonNegative, ABSENT_SOURCE,
            "stiffness of this stop in contact", of stops stiffness_n_per_m),
        entry!("damping_n_s_per_m", "N s/m", NonNegative, ABSENT_SOURCE,
            "damping of this stop in contact", else 0.0, of stops damping_n_s_per_m),
        entry!("softness_m", "m", Within(1e-9, 1.0), "assumed: a tenth of a millimetre",
            "depth over which contact with this stop sets in", else BumpStop::SOFTNESS_M,
            of stops softness_m),
    ],
    axes!("tub_" "_m", "m", Any, ABSENT_SOURCE, "tub point of this stop, ", of stops tub_m),
    axes!("direction_" "", "", Any, ABSENT_SOURCE, "way from the tub to this stop, ",
        of stops direction),
];

/// The entries of each bushing, after `bushing_1_`.
#[rustfmt::skip]
static BUSHING_ENTRIES: &[&[ParameterEntry]] = &[
    axes!("tub_" "_m", "m", Any, ABSENT_SOURCE, "tub point of this bushing, ", of bushings tub_m),
    axes!("stiffness_" "_n_per_m", "N/m", NonNegative, ABSENT_SOURCE, "stiffness of this bushing ",
        of bushings stiffness_n_per_m),
    &[
        entry!("cubic_x_n_per_m3", "N/m^3", NonNegative, ABSENT_SOURCE,
            "force of this bushing per cube of its displacement towards the door",
            else 0.0, of bushings cubic_n_per_m3[0]),
        entry!("cubic_y_n_per_m3", "N/m^3", NonNegative, ABSENT_SOURCE,
            "the same upwards", else 0.0, of bushings cubic_n_per_m3[1]),
        entry!("cubic_z_n_per_m3", "N/m^3", NonNegative, ABSENT_SOURCE,
            "the same sideways", else 0.0, of bushings cubic_n_per_m3[2]),
    ],
    axes!("damping_" "_n_s_per_m", "N s/m", NonNegative, ABSENT_SOURCE, "damping of this bushing ",
        else 0.0, of bushings damping_n_s_per_m),
];

/// The entries of each further unbalance, after `unbalance_2_`.
#[rustfmt::skip]
static UNBALANCE_ENTRIES: &[&[ParameterEntry]] = &[&[
    entry!("mass_kg", "kg", NonNegative, ABSENT_SOURCE,
        "mass of this further unbalance", of further_unbalances mass_kg),
    entry!("x_m", "m", Any, ABSENT_SOURCE,
        "position of this further unbalance along the axis", of further_unbalances x_m),
    entry!("radius_m", "m", Any, ABSENT_SOURCE,
        "distance of this further unbalance from the axis; negative on the opposite side",
        of further_unbalances radius_m),
    entry!("angle_deg", "deg", ANGLE_RANGE, ANGLE_SOURCE,
        "angle of this further unbalance about the axis, from d2 in the direction of the turn",
        else 0.0, of further_unbalances angle_deg),
]];

/// The entries of each foot, after `foot_1_`.
#[rustfmt::skip]
static FOOT_ENTRIES: &[&[ParameterEntry]] =
    &[axes!("" "_m", "m", Any, ABSENT_SOURCE, "place of this foot, ", of feet foot_m)];

/// The entries of each point of a spin's table, after `spin_table_1_`.
#[rustfmt::skip]
static SPIN_POINT_ENTRIES: &[&[ParameterEntry]] = &[&[
    entry!("time_s", "s", NonNegative, SPIN_SOURCE,
        "time of this point of the spin's table; the first is 0", table time_s),
    entry!("speed_rpm", "rpm", Range::Within(-1e5, 1e5), SPIN_SOURCE,
        "speed at this point of the spin's table", table speed_rpm),
]];

/// Declares a list of the machine: the field with a default element, the element's name, the number
/// of the first element, and the entries.
macro_rules! list {
    ($name:ident = $default:expr, $element:literal $first_number:literal $entries:ident) => {
        ElementList {
            name: stringify!($name),
            element_name: $element,
            first_number: $first_number,
            count: |machine| machine.$name.len(),
            resize: |machine, count| machine.$name = vec![$default; count],
            entries: $entries,
        }
    };
}

/// The lists of the machine, and the points of a spin's table.
pub(super) static ELEMENT_LISTS: &[ElementList] = &[
    list!(springs = Spring { free_length_m: None, ..Machine::paper().springs[0] },
        "spring" 1 SPRING_ENTRIES),
    list!(dampers = Machine::paper().dampers[0], "damper" 1 DAMPER_ENTRIES),
    list!(stops = BumpStop::default(), "stop" 1 STOP_ENTRIES),
    list!(bushings = Bushing::default(), "bushing" 1 BUSHING_ENTRIES),
    // Unbalance 1 is the one that every machine has.
    list!(further_unbalances = Unbalance::default(), "unbalance" 2 UNBALANCE_ENTRIES),
    list!(feet = Foot::default(), "foot" 1 FOOT_ENTRIES),
    ElementList {
        name: "",
        element_name: "spin_table",
        entries: SPIN_POINT_ENTRIES,
        first_number: 1,
        count: |_| 0,
        resize: |_, _| (),
    },
];
