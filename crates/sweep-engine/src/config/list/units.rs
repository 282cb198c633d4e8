//! Units as people and loggers write them, and conversion between them.

/// A conversion factor as a quotient, so that 300 g are exactly 0.3 kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct UnitScale {
    numerator: f64,
    denominator: f64,
}

impl UnitScale {
    /// The factor between equal units.
    pub(super) const IDENTITY: Self = Self { numerator: 1.0, denominator: 1.0 };

    /// Converts a number to the other unit.
    pub(super) fn apply(self, value: f64) -> f64 {
        value * self.numerator / self.denominator
    }
}

/// A unit: its names in lower case without spaces, its base unit, and its size as a quotient.
struct UnitEntry {
    unit_names: &'static [&'static str],
    base_unit: &'static str,
    base_scale: UnitScale,
}

const fn unit_entry(
    unit_names: &'static [&'static str],
    base_unit: &'static str,
    numerator: f64,
    denominator: f64,
) -> UnitEntry {
    UnitEntry { unit_names, base_unit, base_scale: UnitScale { numerator, denominator } }
}

/// Standard gravity, the unit of accelerometers (m/s^2), exact by definition.
const STANDARD_GRAVITY: f64 = 9.806_65;
/// The ratio of a circle's circumference to its diameter.
const PI: f64 = std::f64::consts::PI;

/// The units that are read. `g` is listed twice, as grams and as standard gravity: the measured
/// quantity decides which one it is.
static UNITS: &[UnitEntry] = &[
    unit_entry(&["s", "sec", "secs", "second", "seconds", "sek"], "s", 1.0, 1.0),
    unit_entry(&["ms", "msec", "millisecond", "milliseconds"], "s", 1.0, 1e3),
    unit_entry(&["us", "usec", "microseconds"], "s", 1.0, 1e6),
    unit_entry(&["min", "mins", "minute", "minutes"], "s", 60.0, 1.0),
    unit_entry(&["h", "hour", "hours"], "s", 3600.0, 1.0),
    unit_entry(&["m"], "m", 1.0, 1.0),
    unit_entry(&["mm"], "m", 1.0, 1e3),
    unit_entry(&["cm"], "m", 1.0, 1e2),
    unit_entry(&["um"], "m", 1.0, 1e6),
    unit_entry(&["in", "inch"], "m", 0.0254, 1.0),
    unit_entry(&["rad"], "rad", 1.0, 1.0),
    unit_entry(&["mrad"], "rad", 1.0, 1e3),
    unit_entry(&["deg", "degree", "degrees", "grad"], "rad", PI, 180.0),
    unit_entry(&["hz", "1/s", "rev/s", "rps"], "turn/s", 1.0, 1.0),
    unit_entry(
        &["rpm", "1/min", "min^-1", "min-1", "u/min", "r/min", "rev/min"],
        "turn/s",
        1.0,
        60.0,
    ),
    unit_entry(&["rad/s"], "turn/s", 1.0, 2.0 * PI),
    unit_entry(&["deg/s"], "turn/s", 1.0, 360.0),
    unit_entry(&["rad/s^2"], "rad/s^2", 1.0, 1.0),
    unit_entry(&["deg/s^2"], "rad/s^2", PI, 180.0),
    unit_entry(&["m/s"], "m/s", 1.0, 1.0),
    unit_entry(&["mm/s"], "m/s", 1.0, 1e3),
    unit_entry(&["m/s^2"], "m/s^2", 1.0, 1.0),
    unit_entry(&["mm/s^2"], "m/s^2", 1.0, 1e3),
    unit_entry(&["g", "gn", "g_n", "gee"], "m/s^2", STANDARD_GRAVITY, 1.0),
    unit_entry(&["mg"], "m/s^2", STANDARD_GRAVITY, 1e3),
    unit_entry(&["kg"], "kg", 1.0, 1.0),
    unit_entry(&["g", "gram", "grams"], "kg", 1.0, 1e3),
    unit_entry(&["t"], "kg", 1e3, 1.0),
    unit_entry(&["lb", "lbs"], "kg", 0.453_592_37, 1.0),
    unit_entry(&["n"], "n", 1.0, 1.0),
    unit_entry(&["kn"], "n", 1e3, 1.0),
    unit_entry(&["n/m"], "n/m", 1.0, 1.0),
    unit_entry(&["n/mm"], "n/m", 1e3, 1.0),
    unit_entry(&["kn/m"], "n/m", 1e3, 1.0),
    unit_entry(&["n/m^3"], "n/m^3", 1.0, 1.0),
    unit_entry(&["n/mm^3"], "n/m^3", 1e9, 1.0),
    unit_entry(&["ns/m", "kg/s"], "ns/m", 1.0, 1.0),
    unit_entry(&["ns/mm"], "ns/m", 1e3, 1.0),
    unit_entry(&["kns/m"], "ns/m", 1e3, 1.0),
    unit_entry(&["kgm^2"], "kgm^2", 1.0, 1.0),
    unit_entry(&["kgmm^2"], "kgm^2", 1.0, 1e6),
    unit_entry(&["gm^2"], "kgm^2", 1.0, 1e3),
    unit_entry(&["nm/rad"], "nm/rad", 1.0, 1.0),
    unit_entry(&["nm/deg"], "nm/rad", 180.0, PI),
];

/// Returns a unit's name in the form of the table.
fn normalise_unit_name(name: &str) -> String {
    let letters = name.chars().flat_map(char::to_lowercase);
    let normalise_letter = |letter: char| match letter {
        ' ' | '\u{a0}' | '*' | '·' | '⋅' | '.' => String::new(),
        'µ' | 'μ' => "u".to_owned(),
        '°' => "deg".to_owned(),
        '²' => "^2".to_owned(),
        '³' => "^3".to_owned(),
        other => other.to_string(),
    };
    let name: String = letters.map(normalise_letter).collect();
    let name = name.replace("**", "^");
    // The forms m/s2 and kg m2 stand for exponents.
    match name.strip_suffix(['2', '3']) {
        Some(rest) if rest.ends_with(['s', 'm']) => format!("{rest}^{}", &name[rest.len()..]),
        _ => name,
    }
}

/// Yields every unit of this name.
fn find_units(name: &str) -> impl Iterator<Item = &'static UnitEntry> {
    let name = normalise_unit_name(name);
    UNITS.iter().filter(move |unit| unit.unit_names.contains(&name.as_str()))
}

/// Returns whether a text is the name of a unit.
pub(super) fn is_unit_name(name: &str) -> bool {
    find_units(name).next().is_some()
}

/// Returns the factor from one unit to another, if both measure the same kind of quantity.
pub(super) fn find_unit_scale(from: &str, to: &str) -> Option<UnitScale> {
    let mut unit_pairs = find_units(from).flat_map(|from| find_units(to).map(move |to| (from, to)));
    let (from, to) = unit_pairs.find(|(from, to)| from.base_unit == to.base_unit)?;
    if from.base_scale == to.base_scale {
        return Some(UnitScale::IDENTITY);
    }
    Some(UnitScale {
        numerator: from.base_scale.numerator * to.base_scale.denominator,
        denominator: from.base_scale.denominator * to.base_scale.numerator,
    })
}

/// The unit suffixes of names for each base unit.
const UNIT_SUFFIXES: [(&str, &[&str]); 14] = [
    ("s", &["s"]),
    ("m", &["m"]),
    ("rad", &["rad"]),
    ("turn/s", &["rpm", "rad_per_s"]),
    ("rad/s^2", &["rad_per_s2"]),
    ("m/s", &["m_per_s"]),
    ("m/s^2", &["m_per_s2"]),
    ("kg", &["kg"]),
    ("n", &["n"]),
    ("n/m", &["n_per_m"]),
    ("n/m^3", &["n_per_m3"]),
    ("ns/m", &["n_s_per_m"]),
    ("kgm^2", &["kg_m2"]),
    ("nm/rad", &["n_m_per_rad"]),
];

/// Returns the suffixes of the units to which a unit converts.
pub(super) fn unit_suffixes(name: &str) -> Vec<&'static str> {
    let bases: Vec<&str> = find_units(name).map(|unit| unit.base_unit).collect();
    let matching_entries = UNIT_SUFFIXES.iter().filter(|(base, _)| bases.contains(base));
    matching_entries.flat_map(|(_, unit_suffixes)| unit_suffixes.iter().copied()).collect()
}

/// Returns the name of the unit that a suffix such as `m_per_s2` gives.
pub(super) fn unit_from_suffix(suffix: &str) -> String {
    suffix.replace("_per_", "/").replace('_', "")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn convert(value: f64, from: &str, to: &str) -> f64 {
        find_unit_scale(from, to).unwrap_or_else(|| panic!("{from} to {to}")).apply(value)
    }

    #[test]
    fn numbers_are_converted_between_units_of_one_kind() {
        assert_eq!(convert(300.0, "g", "kg"), 0.3);
        assert_eq!(convert(700.0, "mm", "m"), 0.7);
        assert_eq!(convert(2.0, "g", "m/s^2"), 2.0 * 9.80665);
        assert_eq!(convert(180.0, "°", "rad"), std::f64::consts::PI);
        assert_eq!(convert(5.0, "Hz", "rpm"), 300.0);
        assert!((convert(10.0, "rad/s", "rpm") - 95.492_965_855_137_2).abs() < 1e-12);
        assert_eq!(convert(1200.0, "U/min", "rpm"), 1200.0);
        assert_eq!(convert(1.5, "min", "s"), 90.0);
        assert_eq!(convert(0.12, "N s/mm", "N s/m"), 120.0);
        assert_eq!(convert(8.0, "N/mm", "N/m"), 8000.0);
        assert_eq!(convert(3.0, "m/s²", "m/s2"), 3.0);
        assert_eq!(convert(5.0, "kg·m²", "kg m^2"), 5.0);
    }

    #[test]
    fn units_of_different_kinds_do_not_convert() {
        for (from, to) in [("g", "rad"), ("mm", "s"), ("parsec", "m"), ("", "m"), ("rad", "rad/s")]
        {
            assert_eq!(find_unit_scale(from, to), None, "{from} to {to}");
        }
        assert!(is_unit_name("[g]".trim_matches(['[', ']'])) && !is_unit_name("front"));
        assert_eq!(unit_from_suffix("m_per_s2"), "m/s2");
        assert!(find_unit_scale(&unit_from_suffix("n_s_per_mm"), "N s/m").is_some());
    }
}
