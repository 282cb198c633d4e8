//! The search for the valid name nearest to a misspelt one.

/// The least similarity of a name that is suggested, from 0 to 1. Basis: the names in the test
/// below. Doubling it suggests nothing.
const MIN_SIMILARITY: f64 = 0.8;

/// The number of characters of a misspelt name that are compared. Basis: no valid name is longer.
/// Doubling it takes four times the time for longer texts.
const MAX_COMPARED_CHARACTERS: usize = 80;

/// Returns the valid name most similar to the typed one, if any is similar enough.
pub fn nearest<'a, I>(typed: &str, valid: I) -> Option<&'a str>
where
    I: IntoIterator<Item = &'a str>,
{
    let typed: String =
        typed.chars().take(MAX_COMPARED_CHARACTERS).flat_map(char::to_lowercase).collect();
    let mut nearest_name = None;
    let mut greatest_similarity = MIN_SIMILARITY;
    for name in valid {
        let similarity = similarity(&typed, name);
        if similarity > greatest_similarity {
            greatest_similarity = similarity;
            nearest_name = Some(name);
        }
    }
    nearest_name
}

/// Returns the similarity of a typed name to a valid one, from 0 to 1.
fn similarity(typed: &str, name: &str) -> f64 {
    // Users leave out the unit or the first words as often as they mistype a letter.
    if typed.len() >= 4 {
        if name.starts_with(typed) {
            return 1.0;
        }
        if name.split('_').any(|word| word == typed) {
            return 0.95;
        }
    }
    let similarity = strsim::jaro_winkler(typed, name)
        .min(strsim::normalized_damerau_levenshtein(typed, name) + 0.45);
    // Both measures are low for a short word with one wrong letter, so that it is counted as
    // similar.
    let has_one_typo = typed.len() >= 3 && strsim::damerau_levenshtein(typed, name) == 1;
    if has_one_typo { similarity.max(0.9) } else { similarity }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_found_for_common_typos() {
        let valid = [
            "unbalance_mass_kg",
            "frame_mass_kg",
            "damping_n_s_per_m",
            "spring_stiffness_n_per_m",
            "spin_ramp_s",
            "run",
            "damper_2_friction_n",
            "damper_1_friction_n",
        ];
        let find_nearest = |typed: &str| nearest(typed, valid);
        assert_eq!(find_nearest("unbalance_mas_kg"), Some("unbalance_mass_kg"));
        assert_eq!(find_nearest("Unbalance_Mass_kg"), Some("unbalance_mass_kg"));
        assert_eq!(find_nearest("frame_mass"), Some("frame_mass_kg"));
        assert_eq!(find_nearest("damping"), Some("damping_n_s_per_m"));
        assert_eq!(find_nearest("damper_1_friction"), Some("damper_1_friction_n"));
        assert_eq!(find_nearest("spring_stifness_n_per_m"), Some("spring_stiffness_n_per_m"));
        assert_eq!(
            [find_nearest("rnu"), find_nearest("runn"), find_nearest("rum")],
            [Some("run"); 3]
        );
        assert_eq!(find_nearest("colour"), None);
        assert_eq!([find_nearest(""), find_nearest("r"), find_nearest("man")], [None; 3]);
        assert_eq!(find_nearest(&"damping".repeat(1000)), None);
    }
}
