//! `[spin]`: the profiles by name, and how each is read and described.

use serde_json::{Value, json};
use washer_model::{Machine, Parameter, Range, Spin, decimal};

use super::machine;
use sweep_engine::config::report::Diagnostic;
use sweep_engine::config::section::{Section, listed};

/// Most rows of a table. Each is a leg of every trajectory, kept in memory for all points that are
/// made ready together.
pub(super) const MOST_ROWS: usize = 20_000;

/// The range of a parameter of the spin.
fn range(parameter: &str, spin: &Spin) -> Range {
    Parameter::find(parameter, &Machine::paper(), spin)
        .map_or(Range::Any, |parameter| parameter.range())
}

/// A profile that a peak and a ramp give.
pub(super) struct Ramped {
    pub(super) name: &'static str,
    pub(super) description: &'static str,
    make: fn(f64, f64) -> Spin,
}

/// The profiles that a peak and a ramp give.
pub(super) const RAMPED: [Ramped; 3] = [
    Ramped {
        name: "cycloidal",
        description: "smooth run-up, then constant",
        make: |peak_rpm, ramp_s| Spin::Cycloidal { peak_rpm, ramp_s },
    },
    Ramped {
        name: "triangular",
        description: "linear up, and as long down",
        make: |peak_rpm, ramp_s| Spin::Triangular { peak_rpm, ramp_s },
    },
    Ramped {
        name: "ramp",
        description: "linear up, then constant",
        make: |peak_rpm, ramp_s| Spin::Ramp { peak_rpm, ramp_s },
    },
];

/// The profile that is given as a table.
pub(super) const TABLE: &str = "table";

/// A spin's profile.
pub(super) const fn name(spin: &Spin) -> &'static str {
    match spin {
        Spin::Cycloidal { .. } => RAMPED[0].name,
        Spin::Triangular { .. } => RAMPED[1].name,
        Spin::Ramp { .. } => RAMPED[2].name,
        Spin::Table { .. } => TABLE,
    }
}

/// A spin as a grid file has it.
pub(crate) fn to_json(spin: &Spin) -> Value {
    let profile = name(spin);
    match spin {
        Spin::Cycloidal { peak_rpm, ramp_s }
        | Spin::Triangular { peak_rpm, ramp_s }
        | Spin::Ramp { peak_rpm, ramp_s } => {
            json!({ "profile": profile, "peak_rpm": peak_rpm, "ramp_s": ramp_s })
        }
        Spin::Table { time_s, speed_rpm } => {
            json!({ "profile": profile, "time_s": time_s, "speed_rpm": speed_rpm })
        }
    }
}

/// The same spin by another profile that a peak and a ramp give; none of a table.
pub(super) fn by_profile(spin: &Spin, profile: &Ramped) -> Option<Spin> {
    match *spin {
        Spin::Cycloidal { peak_rpm, ramp_s }
        | Spin::Triangular { peak_rpm, ramp_s }
        | Spin::Ramp { peak_rpm, ramp_s } => Some((profile.make)(peak_rpm, ramp_s)),
        Spin::Table { .. } => None,
    }
}

pub(crate) fn read(root: &Section<'_>) -> Spin {
    // Stands in for a wrong spin, so that axes over its numbers are still known.
    let stand_in = Spin::Triangular { peak_rpm: 350.0, ramp_s: 50.0 };
    let field = root.table("spin", "[spin]");
    let Some(section) = root.require(field, "spin", "a section [spin]") else { return stand_in };
    let section = section.value;
    let [cycloidal, triangular, ramp] = RAMPED.map(|profile| profile.name);
    let profiles = [cycloidal, triangular, ramp, TABLE];
    let field = section.choice("profile", &profiles);
    let profile = section.require(field, "profile", &listed(&profiles));
    // The table stands behind those that a peak and a ramp give.
    let profile = profile.map(|profile| RAMPED.get(profile.value));
    let spin = match profile {
        Some(Some(Ramped { name, make, .. })) => {
            let reason = format!("only the profile \"{TABLE}\" has it, not \"{name}\"");
            section.misplace(&["time_s", "speed_rpm"], &reason);
            ramped(&section, true, &stand_in).map(|[peak_rpm, ramp_s]| make(peak_rpm, ramp_s))
        }
        Some(None) => {
            let reason = "a table gives `time_s` and `speed_rpm` instead";
            section.misplace(&["peak_rpm", "ramp_s"], reason);
            table(&section, true)
        }
        // Of none that there is, the numbers are still checked.
        None => {
            ramped(&section, false, &stand_in);
            table(&section, false);
            None
        }
    };
    section.finish();
    spin.unwrap_or_else(|| match profile {
        Some(None) => {
            // The table's mistakes are reported; that the stand-in has no rows is not one of them.
            root.report.doubt("spin.time_s");
            machine::no_spin()
        }
        Some(Some(_)) | None => stand_in,
    })
}

/// Peak and ramp.
fn ramped(section: &Section<'_>, needed: bool, stand_in: &Spin) -> Option<[f64; 2]> {
    let number = |key, parameter: &str, expected| {
        let field = section.number(key, range(parameter, stand_in));
        let found = section.require_if(needed, field, key, expected)?;
        section.report.put(parameter, found.at);
        Some(found.value)
    };
    let peak_rpm = number("peak_rpm", "spin_peak_rpm", "the greatest speed in rpm");
    let ramp_s = number("ramp_s", "spin_ramp_s", "the duration of the run-up in s");
    Some([peak_rpm?, ramp_s?])
}

fn table(section: &Section<'_>, needed: bool) -> Option<Spin> {
    let column = |key, range| {
        let field = section.numbers(key, range);
        let found = section.require_if(needed, field, key, "an array of numbers")?;
        let report = section.report;
        if found.value.len() > MOST_ROWS {
            let title = format!("`{key}` has {} numbers", decimal(found.value.len() as f64));
            let expected = format!("expected at most {MOST_ROWS}");
            let refusal = Diagnostic::new(title).at(&found.at, expected);
            report.push(refusal.help("leave out rows between which the speed is linear"));
            return None;
        }
        report.put(format!("spin.{key}"), found.at);
        let mut values = Vec::with_capacity(found.value.len());
        for (k, entry) in found.value.into_iter().enumerate() {
            report.put(format!("spin.{key}[{k}]"), entry.at);
            values.push(entry.value);
        }
        Some(values)
    };
    let (time_s, speed_rpm) =
        (column("time_s", Range::NonNegative), column("speed_rpm", Range::Any));
    Some(Spin::Table { time_s: time_s?, speed_rpm: speed_rpm? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_has_one_name() {
        for Ramped { name, make, .. } in &RAMPED {
            assert_eq!(super::name(&make(350.0, 50.0)), *name);
        }
    }
}
