//! The section `[spin]`: the profiles by name, and the keys of each.

mod cycle;

use crate::model::engine_parameter;
use std::path::Path;

use sweep_engine::config::form::{NumberArray, describe_parameter};
use sweep_engine::config::keys::KeyVariants;
use sweep_engine::config::source::resolve_beside;
use sweep_engine::config::{Field, Form, Key, Keys};
use washer_model::{Machine, MachineParameter, Profile, Range, Spin};

use cycle::JointKind;

/// Maximum number of rows of a table. Basis: each row is a segment of every trajectory, kept in
/// memory for all points that are prepared together. Doubling it doubles that memory.
pub(super) const MAX_TABLE_ROWS: usize = 20_000;

/// The spin that replaces an invalid one, so that axes of its parameters are still checked.
pub(crate) const PLACEHOLDER_SPIN: Spin =
    Spin::Ramped { profile: Profile::Triangular, peak_rpm: 350.0, ramp_s: 50.0 };

/// Returns the description of a profile that has a peak and a ramp.
const fn profile_description(profile: Profile) -> &'static str {
    match profile {
        Profile::Cycloidal => "smooth run-up, then constant",
        Profile::Triangular => "linear up, and as long down",
        Profile::Ramp => "linear up, then constant",
    }
}

/// The profile that is given as a table.
const TABLE_PROFILE: &str = "table";

/// The profile that is read from a file.
const FILE_PROFILE: &str = "file";

/// The reason why keys of a file are refused with another profile.
const NEEDS_FILE_PROFILE: &str = "only the profile \"file\" has it, which needs no `profile`";

/// Walks over the section of the grid file at `path`.
pub(super) fn walk(spin: &mut Spin, path: &Path, keys: &mut Keys<'_>) {
    keys.walk_table(Key::new("spin", "").required("a section [spin]"), |keys| {
        keys.location_prefix = "spin_".to_owned();
        let table_variant = (
            TABLE_PROFILE,
            "linear between given points, constant after the last; a first speed other than 0 is \
             there at once",
        );
        let file_variant = (
            FILE_PROFILE,
            "a cycle from a file with columns of time and speed; constant after its last row",
        );
        let profile_variants =
            Profile::ALL.map(|profile| (profile.name(), profile_description(profile)));
        let table_index = profile_variants.len();
        // The key `file` implies its profile.
        let has_file =
            keys.section().is_some_and(|section| section.key_location(FILE_PROFILE).is_some());
        let is_default = has_file || keys.is_schema();
        let variants = KeyVariants {
            words: profile_variants.into_iter().chain([table_variant, file_variant]).collect(),
            default_index: is_default.then_some(table_index + 1),
            settable_count: table_index,
        };
        let current_variant = match spin {
            Spin::Ramped { profile, .. } => *profile as usize,
            Spin::Table { .. } => table_index,
        };
        let key = Key::new("profile", "").settable();
        let chosen_variant =
            keys.walk_variants(key, &variants, Some(current_variant), |keys, k| match Profile::ALL
                .get(k)
            {
                Some(&profile) => walk_ramp(profile, spin, keys),
                None if k == table_index => walk_table(spin, keys),
                None => walk_file(spin, path, keys),
            });
        if chosen_variant.is_none() && keys.section().is_some() {
            *spin = PLACEHOLDER_SPIN;
        }
    });
}

/// Walks over the keys of a cycle in a file. The plan has its rows, like those of a table.
fn walk_file(spin: &mut Spin, path: &Path, keys: &mut Keys<'_>) {
    let reason = "the file gives times and speeds";
    keys.mark_misplaced(&["time_s", "speed_rpm", "peak_rpm", "ramp_s"], reason);
    let description = "CSV or Parquet file with columns of time and speed and their units, \
                       relative to this file";
    let mut file_name = String::new();
    let key =
        Key::new(FILE_PROFILE, description).required("a CSV or Parquet file of times and speeds");
    let file_field = keys.walk_key(key, &Form::Text, &mut file_name);
    let description = "straight lines between the rows, or monotone cubics";
    let joint_names = JointKind::ALL.map(|(_, name)| name);
    let mut joint_name = joint_names[0].to_owned();
    keys.walk_key(Key::new("joints", description), &Form::Word(&joint_names), &mut joint_name);
    let (Field::Present(location), Some(report)) = (file_field, keys.report()) else {
        if keys.section().is_some() {
            *spin = PLACEHOLDER_SPIN;
        }
        return;
    };
    let joints = JointKind::ALL.into_iter().find(|(_, name)| *name == joint_name);
    let joints = joints.map_or(JointKind::Straight, |(joints, _)| joints);
    *spin = match cycle::read(&resolve_beside(path, &file_name), joints, &location.location, report)
    {
        Some((time_s, speed_rpm)) => {
            for (column, values) in [("time_s", &time_s), ("speed_rpm", &speed_rpm)] {
                for k in 0..values.len() {
                    report
                        .record_location(format!("spin_{column}[{k}]"), location.location.clone());
                }
            }
            Spin::Table { time_s, speed_rpm }
        }
        None => PLACEHOLDER_SPIN,
    };
}

/// Walks over the keys of a peak and a ramp.
fn walk_ramp(profile: Profile, spin: &mut Spin, keys: &mut Keys<'_>) {
    let reason = format!("only the profile \"{TABLE_PROFILE}\" has it, not \"{}\"", profile.name());
    keys.mark_misplaced(&["time_s", "speed_rpm"], &reason);
    keys.mark_misplaced(&["file", "joints"], NEEDS_FILE_PROFILE);
    let Spin::Ramped { profile: spin_profile, peak_rpm, ramp_s } = spin else {
        let title = "the grid's spin is a table, which has no peak and no ramp";
        keys.refuse_option("profile", title, "expected a grid file with `peak_rpm` and `ramp_s`");
        return;
    };
    let mut is_valid = true;
    for (key, parameter, expected, value) in [
        ("peak_rpm", "spin_peak_rpm", "the greatest speed in rpm", &mut *peak_rpm),
        ("ramp_s", "spin_ramp_s", "the duration of the run-up in s", &mut *ramp_s),
    ] {
        if let Ok(parameter) =
            MachineParameter::find(parameter, &Machine::paper(), &PLACEHOLDER_SPIN)
        {
            let range = parameter.range();
            let description = describe_parameter(&engine_parameter(
                parameter,
                &Machine::paper(),
                &PLACEHOLDER_SPIN,
            ));
            let key = Key::new(key, &description).required(expected);
            let field = keys.walk_key(key, &Form::Number(range), value);
            is_valid &= matches!(field, Field::Present(_)) || keys.section().is_none();
        }
    }
    *spin_profile = profile;
    if !is_valid {
        *spin = PLACEHOLDER_SPIN;
    }
}

/// Walks over the keys of a table of times and speeds.
fn walk_table(spin: &mut Spin, keys: &mut Keys<'_>) {
    keys.mark_misplaced(&["peak_rpm", "ramp_s"], "a table gives `time_s` and `speed_rpm` instead");
    keys.mark_misplaced(&["file", "joints"], NEEDS_FILE_PROFILE);
    let (mut time_s, mut speed_rpm) = match std::mem::replace(spin, PLACEHOLDER_SPIN) {
        Spin::Table { time_s, speed_rpm } => (time_s, speed_rpm),
        _ => Default::default(),
    };
    let times_form = NumberArray {
        help: Some("leave out rows between which the speed is linear"),
        ..NumberArray::new(
            Range::NonNegative,
            0..=MAX_TABLE_ROWS,
            format!("expected at most {MAX_TABLE_ROWS}"),
        )
    };
    // The range of the speeds is checked with the whole table.
    let speeds_form = NumberArray {
        range: Range::Within(-1e5, 1e5),
        read_range: Range::Any,
        ..times_form.clone()
    };
    let mut walk_column =
        |key: &'static str, description: &'static str, numbers, column: &mut Vec<f64>| {
            let key = Key::new(key, description).required("an array of numbers");
            matches!(keys.walk_key(key, &Form::Numbers(numbers), column), Field::Present(_))
        };
    let columns_are_given = [
        walk_column("time_s", "increasing times from 0, s", times_form, &mut time_s),
        walk_column("speed_rpm", "speeds at these times, rpm", speeds_form, &mut speed_rpm),
    ];
    if keys.section().is_some() && columns_are_given != [true; 2] {
        // Mistakes of the columns have been reported; the empty table that replaces them is not a
        // further one.
        if let Some(report) = keys.report() {
            report.mark_invalid("spin_time_s");
        }
        (time_s, speed_rpm) = Default::default();
    }
    *spin = Spin::Table { time_s, speed_rpm };
}
