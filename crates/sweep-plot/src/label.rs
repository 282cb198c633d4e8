//! Labels: column names in words, units as engineers write them, numbers with few digits.

use std::fmt;

/// The units that name suffixes consist of: `_n_s_per_m` is N s/m, `_kg_m2` is kg m².
const UNIT_SUFFIXES: [(&str, &str); 8] = [
    ("n", "N"),
    ("m", "m"),
    ("kg", "kg"),
    ("s", "s"),
    ("rad", "rad"),
    ("rpm", "rpm"),
    ("deg", "°"),
    ("hz", "Hz"),
];

/// Returns the unit, with its power, that a part of a name stands for.
fn unit_from_part(part: &str) -> Option<String> {
    let stem = part.trim_end_matches(['2', '3']);
    let (_, unit) = UNIT_SUFFIXES.iter().find(|(base, _)| *base == stem)?;
    let power = match &part[stem.len()..] {
        "" => "",
        "2" => "²",
        "3" => "³",
        _ => return None,
    };
    Some(format!("{unit}{power}"))
}

/// Splits a name into its words and its unit, which is empty if the name has none.
fn split_unit(name: &str) -> (Vec<&str>, String) {
    let mut words: Vec<&str> = name.split('_').collect();
    let mut units_by_side = [Vec::new(), Vec::new()];
    // The parts are read from the end: a denominator comes before its `per`.
    let mut is_denominator = false;
    while let [_, .., word] = words[..] {
        match unit_from_part(word) {
            Some(unit) => units_by_side[usize::from(is_denominator)].insert(0, unit),
            None if word == "per" && !is_denominator && !units_by_side[0].is_empty() => {
                is_denominator = true
            }
            None => break,
        }
        words.pop();
    }
    let [mut denominator, mut numerator] = units_by_side.map(|units| units.join(" "));
    if !is_denominator {
        std::mem::swap(&mut denominator, &mut numerator);
    } else if numerator.is_empty() {
        numerator = "1".to_owned();
    }
    let unit =
        if denominator.is_empty() { numerator } else { format!("{numerator}/{denominator}") };
    (words, unit)
}

/// Returns the unit that a name's suffix gives; empty if it gives none.
pub fn unit_of_name(name: &str) -> String {
    split_unit(name).1
}

/// Returns the name of a parameter or column in words, without its unit: `unbalance_mass_kg` is
/// "Unbalance mass".
pub fn name_in_words(name: &str) -> String {
    capitalise(&split_unit(name).0.join(" "))
}

/// Splits a column's name into its words, without unit and model, and the model: `min_gap_linear_m`
/// is the "least gap" of "linear".
pub fn split_model(name: &str) -> (String, &'static str) {
    let (mut words, _) = split_unit(name);
    let model = ["nonlinear", "linear"].into_iter().find(|model| words.contains(model));
    words.retain(|word| Some(*word) != model);
    if matches!(words[..], [_, .., "min" | "max"]) {
        words.rotate_right(1);
    }
    match words.first_mut() {
        Some(first) if *first == "min" => *first = "least",
        Some(first) if *first == "max" => *first = "greatest",
        _ => {}
    }
    (words.join(" "), model.unwrap_or(""))
}

/// Returns the condition, as the user typed it, if a traced quantity is its margin.
pub fn condition(quantity: &str) -> Option<&str> {
    quantity.strip_prefix("margin(")?.strip_suffix(')')
}

/// Returns the name of a result's column in words, without unit and model: `nonlinear_body_front_y`
/// is "Body front, vertical".
pub fn quantity_in_words(name: &str) -> String {
    capitalise(&channel_in_words(&split_model(name).0.replace(' ', "_")))
}

/// Returns a channel's name in words: `body_front_y` is "body front, vertical".
pub fn channel_in_words(name: &str) -> String {
    for (suffix, words) in [("_y", ", vertical"), ("_z", ", horizontal")] {
        if let Some(stem) = name.strip_suffix(suffix) {
            return stem.replace('_', " ") + words;
        }
    }
    name.replace('_', " ")
}

/// Returns the unit of a channel whose file has none: angles are named after their axis, other
/// channels are displacements.
pub fn unit_of_channel(name: &str) -> &'static str {
    match name.rsplit('_').next() {
        Some("x" | "y" | "z") => "m",
        Some("yaw" | "pitch" | "roll") => "rad",
        _ => "",
    }
}

/// Returns the text with a capital first letter.
pub fn capitalise(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// The label of an axis; as text, with the unit in brackets.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Label {
    pub words: String,
    /// The unit; empty if there is none.
    pub unit: String,
}

impl Label {
    pub fn new(words: &str, unit: &str) -> Self {
        Self { words: words.to_owned(), unit: unit.to_owned() }
    }
}

impl fmt::Display for Label {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&with_unit(&self.words, &self.unit))
    }
}

/// Returns words and unit as an axis label.
pub fn with_unit(words: &str, unit: &str) -> String {
    if unit.is_empty() { words.to_owned() } else { format!("{words} ({unit})") }
}

/// Returns words, a value to four digits and its unit: "damping 140 N s/m".
pub fn with_value(words: &str, value: f64, unit: &str) -> String {
    format!("{words} {} {unit}", format_significant(value, 4)).trim().to_owned()
}

/// Returns the unit in which small motions are shown, and the factor from `unit` to it.
pub fn display_unit(unit: &str) -> (&str, f64) {
    match unit {
        "m" => ("mm", 1e3),
        "rad" => ("mrad", 1e3),
        unit => (unit, 1.0),
    }
}

/// Returns a number to `digits` significant digits, without trailing zeros.
pub fn format_significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0".to_owned() } else { "–".to_owned() };
    }
    // The exponent is taken after rounding: 9.996 to three digits is 10.0.
    let scientific_text = format!("{value:.*e}", digits.saturating_sub(1));
    let exponent: i32 = scientific_text
        .split_once('e')
        .and_then(|(_, exponent_text)| exponent_text.parse().ok())
        .unwrap_or_default();
    if !(-4..7).contains(&exponent) {
        return scientific_text;
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or_default();
    trim_decimals(&format!("{value:.decimals$}")).to_owned()
}

/// Returns a number without the zeros at the end of its decimals.
pub fn trim_decimals(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_split_into_words_and_units() {
        for (name, words, unit) in [
            ("unbalance_mass_kg", "Unbalance mass", "kg"),
            ("damping_n_s_per_m", "Damping", "N s/m"),
            ("spring_stiffness_n_per_m", "Spring stiffness", "N/m"),
            ("flexure_stiffness_n_m_per_rad", "Flexure stiffness", "N m/rad"),
            ("peak_rpm", "Peak", "rpm"),
            ("min_gap_linear_m", "Min gap linear", "m"),
            ("body_inertia_11_kg_m2", "Body inertia 11", "kg m²"),
            ("friction_speed_m_per_s", "Friction speed", "m/s"),
            ("spring_1_cubic_n_per_m3", "Spring 1 cubic", "N/m³"),
            ("gravity_m_per_s2", "Gravity", "m/s²"),
            ("body_front_x_m", "Body front x", "m"),
            ("growth_per_s", "Growth", "1/s"),
            ("ratio_max", "Ratio max", ""),
            ("s", "S", ""),
        ] {
            assert_eq!((name_in_words(name).as_str(), unit_of_name(name).as_str()), (words, unit));
        }
        assert_eq!(channel_in_words("end_front_z"), "end front, horizontal");
        assert_eq!(split_model("min_gap_linear_m"), ("least gap".to_owned(), "linear"));
        assert_eq!(
            split_model("stop_2_force_nonlinear_n"),
            ("stop 2 force".to_owned(), "nonlinear")
        );
        for (name, words) in [
            ("nonlinear_body_front_y", "Body front, vertical"),
            ("ratio_max", "Greatest ratio"),
            ("min_gap_nonlinear_m", "Least gap"),
        ] {
            assert_eq!(quantity_in_words(name), words);
        }
        assert_eq!(split_model("static_sag_m"), ("static sag".to_owned(), ""));
    }

    #[test]
    fn numbers_are_rounded() {
        for (value, text) in [
            (9.996, "10"),
            (0.1234, "0.123"),
            (-140.0, "-140"),
            (1.0e-9, "1.00e-9"),
            (123_456.0, "123456"),
            (0.0, "0"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(format_significant(value, 3), text);
        }
    }
}
