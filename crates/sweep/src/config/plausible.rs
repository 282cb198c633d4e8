//! Typed numbers that no washing machine has: in most cases they are in another unit. They are
//! accepted, and the user is told.

use sweep_engine::config::Draft;
use washer_model::{Parameter, Target, decimal};

use crate::model::Washer;

/// Numbers that machines have.
struct Usual {
    /// The least and the greatest magnitude; 0 is always accepted.
    bounds: [f64; 2],
    /// Units in which such a number is written by mistake, with their size.
    mistaken: &'static [(&'static str, f64)],
}

/// Notes that are shown; further ones are counted.
const MOST_NOTES: usize = 8;

/// Notes what of the typed numbers no machine has.
pub(super) fn note(draft: &Draft<'_, Washer>) {
    let plan = &draft.plan;
    let Washer { machine, spin, .. } = &plan.model;
    let written = draft.report.written();
    let mut notes = Vec::new();
    for parameter in Parameter::all(machine, spin) {
        let is_typed = written.contains_key(parameter.name()) && !parameter.target().is_several();
        if let Some(value) = parameter.get(machine, spin).filter(|_| is_typed) {
            notes.extend(doubt(&parameter, value));
        }
    }
    for axis in &plan.axes {
        let ends = axis.values.extremes();
        notes.extend(ends.into_iter().find_map(|end| doubt(&axis.parameter, end)));
    }
    let unbalance_kg = machine.unbalance.mass_kg;
    let moving_kg = machine.tub.mass_kg + machine.shaft.mass_kg + machine.drum.mass_kg;
    if notes.is_empty() && written.contains_key("unbalance_mass_kg") && unbalance_kg > moving_kg {
        notes.push(format!(
            "unbalance_mass_kg = {} kg is more than tub, shaft and drum together, {} kg",
            decimal(unbalance_kg),
            decimal(moving_kg)
        ));
    }
    let further = notes.len().saturating_sub(MOST_NOTES);
    notes.into_iter().take(MOST_NOTES).for_each(|note| draft.report.note(note));
    if further > 0 {
        draft.report.note(format!("{further} more numbers are as unusual"));
    }
}

/// Returns what is unusual about a parameter's value, if anything is.
fn doubt(parameter: &Parameter, value: f64) -> Option<String> {
    let usual = usual(parameter)?;
    let [least, most] = usual.bounds;
    let is_usual = |value: f64| value == 0.0 || (least..=most).contains(&value.abs());
    if is_usual(value) {
        return None;
    }
    let unit = parameter.unit();
    let [name, value_said] = [parameter.name().to_owned(), decimal(value)];
    let range = format!("machines have {} to {}", decimal(least), decimal(most));
    // 10 m for a gap of 10 mm: a mistaken unit makes it a usual number.
    let meant = usual.mistaken.iter().find(|(_, size)| is_usual(value * size));
    let meant = meant.map(|(other, size)| {
        let times = value * size;
        format!(": {value_said} {other} would be {} {unit}", decimal(rounded(times)))
    });
    let meant = meant.unwrap_or_default();
    Some(format!("unusual: {name} = {value_said} {unit}, {range}{meant}"))
}

/// Returns a number of at most six digits, for a message.
fn rounded(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

const MASSES: &[(&str, f64)] = &[("g", 1e-3)];
const LENGTHS: &[(&str, f64)] = &[("mm", 1e-3), ("cm", 1e-2)];
const STIFFNESSES: &[(&str, f64)] = &[("N/mm", 1e3), ("kN/m", 1e3)];
const DAMPINGS: &[(&str, f64)] = &[("N s/mm", 1e3)];
const INERTIAS: &[(&str, f64)] = &[("kg mm^2", 1e-6), ("g m^2", 1e-3)];
const TIMES: &[(&str, f64)] = &[("ms", 1e-3)];

/// Returns the numbers that machines have of a parameter: from the smallest toy to the largest
/// washer-extractor (some 400 kg of laundry), with a margin of about three on both sides. A wider
/// margin would let grams pass for kilograms.
fn usual(parameter: &Parameter) -> Option<Usual> {
    let name = parameter.name();
    let has = |word: &str| name.contains(word);
    let (bounds, mistaken) = match parameter.unit() {
        "kg" if has("unbalance") => ([1e-6, 100.0], MASSES),
        "kg" if has("tub") => ([0.3, 1e4], MASSES),
        "kg" if has("cabinet") => ([1.0, 1e5], MASSES),
        "kg" => ([0.1, 3e3], MASSES),
        "m" if has("clearance") => ([1e-4, 0.3], LENGTHS),
        "m" if has("softness") => ([1e-7, 0.03], LENGTHS),
        "m" => ([0.0, 5.0], LENGTHS),
        "N/m" if has("bearing") => ([1e5, 1e12], STIFFNESSES),
        "N/m" => ([30.0, 1e9], STIFFNESSES),
        "N s/m" => ([1.0, 1e6], DAMPINGS),
        "N" => ([0.1, 2e4], &[][..]),
        "kg m^2" => ([1e-5, 1e4], INERTIAS),
        "N m/rad" => ([10.0, 1e11], &[][..]),
        "rpm" => ([0.0, 5e3], &[][..]),
        "s" if parameter.target() == Target::Spin && !has("table") => ([0.05, 7200.0], TIMES),
        _ => return None,
    };
    Some(Usual { bounds, mistaken })
}
