//! Notes on numbers that no washing machine has, which are mostly in another unit. The numbers are
//! accepted.

use sweep_engine::config::Draft;
use washer_model::{MachineParameter, Target, decimal};

use crate::model::Washer;

/// The values that a parameter has in washing machines.
struct UsualRange {
    /// The least and the greatest magnitude; 0 is always accepted.
    bounds: [f64; 2],
    /// The units in which the number is entered by mistake, each with its size in the parameter's
    /// unit.
    mistaken_units: &'static [(&'static str, f64)],
}

/// Maximum number of notes that are shown; the others are counted. Basis: they fit on a screen.
/// Doubling it doubles the longest list.
const MAX_NOTES: usize = 8;

/// Adds notes on unusual numbers among those that the user has written.
pub(super) fn note_unusual_numbers(draft: &Draft<'_, Washer>) {
    let plan = &draft.plan;
    let Washer { machine, spin, .. } = &plan.model;
    let user_parameters = draft.report.parameter_sources();
    let mut notes = Vec::new();
    for parameter in MachineParameter::all(machine, spin) {
        let is_single_user_number = user_parameters.contains_key(parameter.name())
            && !parameter.target().has_several_numbers();
        if let Some(value) = parameter.get(machine, spin).filter(|_| is_single_user_number) {
            notes.extend(find_unusual_note(&parameter, value));
        }
    }
    for axis in &plan.axes {
        let axis_ends = axis.values.extremes();
        notes.extend(
            axis_ends.into_iter().find_map(|end| find_unusual_note(&axis.parameter.handle, end)),
        );
    }
    let unbalance_kg = machine.unbalance.mass_kg;
    let moving_kg = machine.tub.mass_kg + machine.shaft.mass_kg + machine.drum.mass_kg;
    if notes.is_empty()
        && user_parameters.contains_key("unbalance_mass_kg")
        && unbalance_kg > moving_kg
    {
        notes.push(format!(
            "unbalance_mass_kg = {} kg is more than tub, shaft and drum together, {} kg",
            decimal(unbalance_kg),
            decimal(moving_kg)
        ));
    }
    let omitted_count = notes.len().saturating_sub(MAX_NOTES);
    notes.into_iter().take(MAX_NOTES).for_each(|note| draft.report.add_note(note));
    if omitted_count > 0 {
        draft.report.add_note(format!("{omitted_count} more numbers are as unusual"));
    }
}

/// Returns a note if a parameter's value is unusual.
fn find_unusual_note(parameter: &MachineParameter, value: f64) -> Option<String> {
    let usual_range = find_usual_range(parameter)?;
    let [least, greatest] = usual_range.bounds;
    let is_usual = |value: f64| value == 0.0 || (least..=greatest).contains(&value.abs());
    if is_usual(value) {
        return None;
    }
    let unit = parameter.unit();
    let name = parameter.name();
    let value_text = decimal(value);
    let range_text = format!("machines have {} to {}", decimal(least), decimal(greatest));
    // In the unit that was meant the number is usual, such as 10 mm for a clearance of "10" m.
    let intended_unit = usual_range.mistaken_units.iter().find(|(_, size)| is_usual(value * size));
    let conversion_text = intended_unit.map(|(other, size)| {
        format!(
            ": {value_text} {other} would be {} {unit}",
            decimal(round_to_6_digits(value * size))
        )
    });
    let conversion_text = conversion_text.unwrap_or_default();
    Some(format!("unusual: {name} = {value_text} {unit}, {range_text}{conversion_text}"))
}

/// Returns a number of at most six digits, for a message.
fn round_to_6_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Units of mass in place of kg.
const MASS_UNITS: &[(&str, f64)] = &[("g", 1e-3)];
/// Units of length in place of m.
const LENGTH_UNITS: &[(&str, f64)] = &[("mm", 1e-3), ("cm", 1e-2)];
/// Units of stiffness in place of N/m.
const STIFFNESS_UNITS: &[(&str, f64)] = &[("N/mm", 1e3), ("kN/m", 1e3)];
/// Units of damping in place of N s/m.
const DAMPING_UNITS: &[(&str, f64)] = &[("N s/mm", 1e3)];
/// Units of moments of inertia in place of kg m^2.
const INERTIA_UNITS: &[(&str, f64)] = &[("kg mm^2", 1e-6), ("g m^2", 1e-3)];
/// Units of time in place of s.
const TIME_UNITS: &[(&str, f64)] = &[("ms", 1e-3)];

/// Returns the usual range of a parameter, if it has one: from the smallest toy to the largest
/// washer-extractor (about 400 kg of laundry), widened by a factor of about three on both sides.
/// With a greater factor grams would be accepted as kilograms.
fn find_usual_range(parameter: &MachineParameter) -> Option<UsualRange> {
    let name = parameter.name();
    let name_contains = |word: &str| name.contains(word);
    let (bounds, mistaken_units) = match parameter.unit() {
        "kg" if name_contains("unbalance") => ([1e-6, 100.0], MASS_UNITS),
        "kg" if name_contains("tub") => ([0.3, 1e4], MASS_UNITS),
        "kg" if name_contains("cabinet") => ([1.0, 1e5], MASS_UNITS),
        "kg" => ([0.1, 3e3], MASS_UNITS),
        "m" if name_contains("clearance") => ([1e-4, 0.3], LENGTH_UNITS),
        "m" if name_contains("softness") => ([1e-7, 0.03], LENGTH_UNITS),
        "m" => ([0.0, 5.0], LENGTH_UNITS),
        "N/m" if name_contains("bearing") => ([1e5, 1e12], STIFFNESS_UNITS),
        "N/m" => ([30.0, 1e9], STIFFNESS_UNITS),
        "N s/m" => ([1.0, 1e6], DAMPING_UNITS),
        "N" => ([0.1, 2e4], &[][..]),
        "kg m^2" => ([1e-5, 1e4], INERTIA_UNITS),
        "N m/rad" => ([10.0, 1e11], &[][..]),
        "rpm" => ([0.0, 5e3], &[][..]),
        "s" if parameter.target() == Target::Spin && !name_contains("table") => {
            ([0.05, 7200.0], TIME_UNITS)
        }
        _ => return None,
    };
    Some(UsualRange { bounds, mistaken_units })
}
