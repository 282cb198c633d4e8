//! The names of a table's columns. A column is recognised by the name that the user gives its
//! header, and by its unit in brackets, in a row of units or at the end of the header.

use super::super::section::shorten;
use super::units::{UnitScale, find_unit_scale, is_unit_name, unit_from_suffix, unit_suffixes};

/// The unit of a quantity whose scale does not matter, such as a signal of pulses. Its column may
/// have any unit, and is not converted.
pub const ANY_UNIT: &str = "any unit";

/// The column names that the reader of a table knows.
pub struct ColumnNames<'a> {
    /// The function that returns the name and the unit of the quantity that a text names, if the
    /// reader knows it.
    pub find_quantity: &'a dyn Fn(&str) -> Option<(String, String)>,
    /// Headers of the file with the names that the user gives them.
    pub renamed_headers: &'a [(String, String)],
}

/// A known column.
#[derive(Debug, PartialEq)]
pub(super) struct KnownName {
    /// The name of the quantity.
    pub(super) name: String,
    /// The factor to the unit in the quantity's name.
    pub(super) unit_scale: UnitScale,
}

/// The mistake of a header with two units, or with a unit of another kind: title and expectation.
pub(super) type UnitContradiction = [String; 2];

impl ColumnNames<'_> {
    /// Finds the quantity of a column, if it is known. `unit` is the column's unit in the row of
    /// units, if there is one.
    ///
    /// # Errors
    /// A unit that contradicts the name.
    pub(super) fn find_known_name(
        &self,
        header: &str,
        unit: Option<&str>,
    ) -> Result<Option<KnownName>, UnitContradiction> {
        let (stem, bracketed_unit) = split_bracketed(header);
        let unit = bracketed_unit.or(unit).filter(|unit| !unit.is_empty());
        let is_renamed_header = |(header_text, _): &&(String, String)| {
            let header_text = header_text.trim();
            header_text == header || header_text == stem
        };
        if let Some((_, name)) = self.renamed_headers.iter().find(is_renamed_header) {
            let Some((name, unit_of_name)) = (self.find_quantity)(name) else {
                let title =
                    format!("the column `{}` is called `{}`", shorten(header), shorten(name));
                return Err([title, "expected a name of what is read here".to_owned()]);
            };
            return match_with_scale(header, name, unit, &unit_of_name).map(Some);
        }
        let stem = normalise_header(stem);
        let exact_match = (self.find_quantity)(header).or_else(|| (self.find_quantity)(&stem));
        let find_by_unit = || {
            let candidate_names =
                unit_suffixes(unit?).into_iter().map(|suffix| format!("{stem}_{suffix}"));
            candidate_names.filter_map(|name| (self.find_quantity)(&name)).next()
        };
        if let Some((name, unit_of_name)) = exact_match {
            let match_result = match_with_scale(header, name, unit, &unit_of_name);
            let has_unit_suffix = split_unit_suffix(&stem).is_some();
            return match (match_result, find_by_unit()) {
                (Ok(match_result), _)
                    if match_result.unit_scale == UnitScale::IDENTITY || !has_unit_suffix =>
                {
                    Ok(Some(match_result))
                }
                (Err(_), Some((name, unit_of_name))) if !has_unit_suffix => {
                    match_with_scale(header, name, unit, &unit_of_name).map(Some)
                }
                (Err(contradiction), _) => Err(contradiction),
                (Ok(match_result), _) => Err([
                    format!("the column `{}` names two units", shorten(header)),
                    format!(
                        "expected {unit_of_name}, which the name `{}` ends with",
                        match_result.name
                    ),
                ]),
            };
        }
        if let Some((name, unit_of_name)) = find_by_unit() {
            return match_with_scale(header, name, unit, &unit_of_name).map(Some);
        }
        // A header such as `mass_g` names the quantity `mass_kg`, in another unit.
        if unit.is_none()
            && let Some((stem, suffix)) = split_unit_suffix(&stem)
        {
            let written_unit = unit_from_suffix(suffix);
            let candidate_names =
                unit_suffixes(&written_unit).into_iter().map(|suffix| format!("{stem}_{suffix}"));
            if let Some((name, unit_of_name)) =
                candidate_names.filter_map(|name| (self.find_quantity)(&name)).next()
            {
                return match_with_scale(header, name, Some(&written_unit), &unit_of_name)
                    .map(Some);
            }
        }
        Ok(None)
    }

    /// Returns whether a header is that of a known column.
    pub(super) fn is_known_header(&self, header: &str) -> bool {
        !matches!(self.find_known_name(header, None), Ok(None))
    }
}

/// Returns a known column with the factor from its unit.
fn match_with_scale(
    header: &str,
    name: String,
    unit: Option<&str>,
    unit_of_name: &str,
) -> Result<KnownName, UnitContradiction> {
    let Some(unit) = unit else { return Ok(KnownName { name, unit_scale: UnitScale::IDENTITY }) };
    if unit == unit_of_name || unit_of_name == ANY_UNIT {
        return Ok(KnownName { name, unit_scale: UnitScale::IDENTITY });
    }
    match find_unit_scale(unit, unit_of_name) {
        Some(scale) => Ok(KnownName { name, unit_scale: scale }),
        None => {
            let title = format!(
                "the column `{}` is in `{}`, not in {unit_of_name}",
                shorten(header),
                shorten(unit)
            );
            let expected_kind =
                if is_unit_name(unit) { "a unit of the same kind as" } else { "a known unit, as" };
            Err([title, format!("expected {expected_kind} {unit_of_name}, the unit of `{name}`")])
        }
    }
}

/// Splits a header into its stem and the unit in brackets at its end.
fn split_bracketed(header: &str) -> (&str, Option<&str>) {
    let header = header.trim();
    let bracket_pairs = [('[', ']'), ('(', ')')];
    let stem_and_unit = bracket_pairs.into_iter().find_map(|(open, close)| {
        let (stem, unit) = header.strip_suffix(close)?.rsplit_once(open)?;
        (!stem.trim().is_empty()).then_some((stem.trim(), Some(unit.trim())))
    });
    stem_and_unit.unwrap_or((header, None))
}

/// Returns a text in the form of names: lower case, words joined by underscores.
fn normalise_header(text: &str) -> String {
    let words = text.split(|letter: char| letter.is_whitespace() || letter == '-');
    let words: Vec<String> = words.filter(|word| !word.is_empty()).map(str::to_lowercase).collect();
    words.join("_")
}

/// Splits a name into its stem and the unit at its end.
fn split_unit_suffix(name: &str) -> Option<(&str, &str)> {
    let underscore_splits =
        name.match_indices('_').map(|(index, _)| (&name[..index], &name[index + 1..]));
    underscore_splits.into_iter().find(|(_, suffix)| is_unit_name(&unit_from_suffix(suffix)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN_QUANTITIES: [(&str, &str); 6] = [
        ("time_s", "s"),
        ("speed_rpm", "rpm"),
        ("arm_end_y", "m"),
        ("arm_end_y_m_per_s2", "m/s^2"),
        ("arm_yaw_rad", "rad"),
        ("unbalance_mass_kg", "kg"),
    ];

    fn find(header: &str, unit: Option<&str>) -> Result<Option<(String, f64)>, UnitContradiction> {
        let known = |name: &str| {
            let found = KNOWN_QUANTITIES.iter().find(|(known, _)| *known == name);
            found.map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned()))
        };
        let renamed = [("Acc front".to_owned(), "arm_end_y_m_per_s2".to_owned())];
        let candidate_names = ColumnNames { find_quantity: &known, renamed_headers: &renamed };
        let found = candidate_names.find_known_name(header, unit)?;
        Ok(found.map(|found| (found.name, found.unit_scale.apply(1.0))))
    }

    #[test]
    fn headers_are_read_with_their_units() {
        for (header, unit, name, factor) in [
            ("time_s", None, "time_s", 1.0),
            ("Time [ms]", None, "time_s", 1e-3),
            ("time", Some("min"), "time_s", 60.0),
            ("time_s", Some("s"), "time_s", 1.0),
            ("time_ms", None, "time_s", 1e-3),
            ("Speed (Hz)", None, "speed_rpm", 60.0),
            ("speed_hz", None, "speed_rpm", 60.0),
            ("Acc front [g]", None, "arm_end_y_m_per_s2", 9.80665),
            ("Acc front", Some("g"), "arm_end_y_m_per_s2", 9.80665),
            ("arm_end_y [mm]", None, "arm_end_y", 1e-3),
            ("arm_end_y [g]", None, "arm_end_y_m_per_s2", 9.80665),
            ("Arm yaw [deg]", None, "arm_yaw_rad", std::f64::consts::PI / 180.0),
            ("unbalance_mass_g", None, "unbalance_mass_kg", 1e-3),
            ("Unbalance mass [kg]", None, "unbalance_mass_kg", 1.0),
        ] {
            let known_name = find(header, unit).unwrap().unwrap_or_else(|| panic!("{header}"));
            assert_eq!(known_name, (name.to_owned(), factor), "{header}");
        }
    }

    #[test]
    fn contradictory_units_are_rejected_and_unknown_headers_ignored() {
        for (header, unit) in
            [("time_s [ms]", None), ("time_s", Some("ms")), ("arm_yaw_rad [g]", None)]
        {
            assert!(find(header, unit).is_err(), "{header}");
        }
        assert!(find("Acc front [parsec]", None).is_err());
        for header in ["time", "speed", "temperature [°C]", "mass_g", ""] {
            assert_eq!(find(header, None), Ok(None), "{header}");
        }
    }
}
