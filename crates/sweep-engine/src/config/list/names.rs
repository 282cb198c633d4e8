//! From the headers of a table to the names of what its columns hold: by the user's own names, and
//! by units in brackets, in a row of their own or at the end of a name.

use super::super::section::short;
use super::units::{Scale, endings, is_unit, of_suffix, scale};

/// The names that a reader of a table knows.
pub struct Names<'a> {
    /// Returns the name of a quantity that this text names, and its unit.
    pub known: &'a dyn Fn(&str) -> Option<(String, String)>,
    /// Headers of the file with the names of what they hold, as the user gives them.
    pub renamed: &'a [(String, String)],
}

/// A column that is known.
#[derive(Debug, PartialEq)]
pub(super) struct Match {
    /// The name of what it holds.
    pub(super) name: String,
    /// The factor to the unit of that name.
    pub(super) scale: Scale,
}

/// A header that names two units, or one of another kind: the mistake, and what was expected.
pub(super) type Contradiction = [String; 2];

impl Names<'_> {
    /// Returns what a column holds, if it is known; `unit` is that of a row of units.
    ///
    /// # Errors
    /// A unit that contradicts the name.
    pub(super) fn find(
        &self,
        header: &str,
        unit: Option<&str>,
    ) -> Result<Option<Match>, Contradiction> {
        let (stem, bracketed) = parted(header);
        let unit = bracketed.or(unit).filter(|unit| !unit.is_empty());
        let by_user = |(written, _): &&(String, String)| {
            let written = written.trim();
            written == header || written == stem
        };
        if let Some((_, name)) = self.renamed.iter().find(by_user) {
            let Some((name, own)) = (self.known)(name) else {
                let title = format!("the column `{}` is called `{}`", short(header), short(name));
                return Err([title, "expected a name of what is read here".to_owned()]);
            };
            return converted(header, name, unit, &own).map(Some);
        }
        let stem = plain(stem);
        let exact = (self.known)(header).or_else(|| (self.known)(&stem));
        let by_unit = || {
            let names = endings(unit?).into_iter().map(|ending| format!("{stem}_{ending}"));
            names.filter_map(|name| (self.known)(&name)).next()
        };
        if let Some((name, own)) = exact {
            let found = converted(header, name, unit, &own);
            let says_unit = ending(&stem).is_some();
            return match (found, by_unit()) {
                (Ok(found), _) if found.scale == Scale::ONE || !says_unit => Ok(Some(found)),
                (Err(_), Some((name, own))) if !says_unit => {
                    converted(header, name, unit, &own).map(Some)
                }
                (Err(contradiction), _) => Err(contradiction),
                (Ok(found), _) => Err([
                    format!("the column `{}` names two units", short(header)),
                    format!("expected {own}, which the name `{}` ends with", found.name),
                ]),
            };
        }
        if let Some((name, own)) = by_unit() {
            return converted(header, name, unit, &own).map(Some);
        }
        // As mass_g for mass_kg.
        if unit.is_none()
            && let Some((stem, suffix)) = ending(&stem)
        {
            let written = of_suffix(suffix);
            let names = endings(&written).into_iter().map(|ending| format!("{stem}_{ending}"));
            if let Some((name, own)) = names.filter_map(|name| (self.known)(&name)).next() {
                return converted(header, name, Some(&written), &own).map(Some);
            }
        }
        Ok(None)
    }

    /// Whether a header is that of a known column.
    pub(super) fn has(&self, header: &str) -> bool {
        !matches!(self.find(header, None), Ok(None))
    }
}

/// Returns a known column with the factor from its unit.
fn converted(
    header: &str,
    name: String,
    unit: Option<&str>,
    own: &str,
) -> Result<Match, Contradiction> {
    let Some(unit) = unit else { return Ok(Match { name, scale: Scale::ONE }) };
    if unit == own {
        return Ok(Match { name, scale: Scale::ONE });
    }
    match scale(unit, own) {
        Some(scale) => Ok(Match { name, scale }),
        None => {
            let title =
                format!("the column `{}` is in `{}`, not in {own}", short(header), short(unit));
            let kind =
                if is_unit(unit) { "a unit of the same kind as" } else { "a known unit, as" };
            Err([title, format!("expected {kind} {own}, the unit of `{name}`")])
        }
    }
}

/// Returns a header without the unit in brackets at its end, and that unit.
fn parted(header: &str) -> (&str, Option<&str>) {
    let header = header.trim();
    let pairs = [('[', ']'), ('(', ')')];
    let parted = pairs.into_iter().find_map(|(open, close)| {
        let (stem, unit) = header.strip_suffix(close)?.rsplit_once(open)?;
        (!stem.trim().is_empty()).then_some((stem.trim(), Some(unit.trim())))
    });
    parted.unwrap_or((header, None))
}

/// Returns a text as names are written: small letters, words joined by underscores.
fn plain(text: &str) -> String {
    let words = text.split(|letter: char| letter.is_whitespace() || letter == '-');
    let words: Vec<String> = words.filter(|word| !word.is_empty()).map(str::to_lowercase).collect();
    words.join("_")
}

/// Returns a name without the unit at its end, and that unit as it is written there.
fn ending(name: &str) -> Option<(&str, &str)> {
    let splits = name.match_indices('_').map(|(at, _)| (&name[..at], &name[at + 1..]));
    splits.into_iter().find(|(_, suffix)| is_unit(&of_suffix(suffix)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [(&str, &str); 6] = [
        ("time_s", "s"),
        ("speed_rpm", "rpm"),
        ("arm_end_y", "m"),
        ("arm_end_y_m_per_s2", "m/s^2"),
        ("arm_yaw_rad", "rad"),
        ("unbalance_mass_kg", "kg"),
    ];

    fn find(header: &str, unit: Option<&str>) -> Result<Option<(String, f64)>, Contradiction> {
        let known = |name: &str| {
            let found = KNOWN.iter().find(|(known, _)| *known == name);
            found.map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned()))
        };
        let renamed = [("Acc front".to_owned(), "arm_end_y_m_per_s2".to_owned())];
        let names = Names { known: &known, renamed: &renamed };
        let found = names.find(header, unit)?;
        Ok(found.map(|found| (found.name, found.scale.apply(1.0))))
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
            let found = find(header, unit).unwrap().unwrap_or_else(|| panic!("{header}"));
            assert_eq!(found, (name.to_owned(), factor), "{header}");
        }
    }

    #[test]
    fn what_contradicts_itself_is_refused_and_what_is_unknown_is_not_taken() {
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
