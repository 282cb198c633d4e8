//! The search for the valid name nearest to a misspelt one.

/// The least similarity of a name that is suggested, from 0 to 1. Basis: the names in the test
/// below. Doubling it suggests nothing.
const MIN_SIMILARITY: f64 = 0.8;

/// The number of characters of a misspelt name that are compared. Basis: no valid name is longer.
/// Doubling it takes four times the time for longer texts.
const MAX_COMPARED_CHARACTERS: usize = 80;

/// Returns the valid name most similar to the typed one, if any is similar enough.
pub fn nearest_name<'a, I>(typed_name: &str, valid_names: I) -> Option<&'a str>
where
    I: IntoIterator<Item = &'a str>,
{
    let typed_name: String =
        typed_name.chars().take(MAX_COMPARED_CHARACTERS).flat_map(char::to_lowercase).collect();
    let mut best_name = None;
    let mut greatest_similarity = MIN_SIMILARITY;
    for name in valid_names {
        let similarity = similarity(&typed_name, name);
        if similarity > greatest_similarity {
            greatest_similarity = similarity;
            best_name = Some(name);
        }
    }
    best_name
}

/// Returns the similarity of a typed name to a valid one, from 0 to 1.
fn similarity(typed_name: &str, name: &str) -> f64 {
    // Users leave out the unit or the first words as often as they mistype a letter.
    if typed_name.len() >= 4 {
        if name.starts_with(typed_name) {
            return 1.0;
        }
        if name.split('_').any(|word| word == typed_name) {
            return 0.95;
        }
    }
    let similarity = strsim::jaro_winkler(typed_name, name)
        .min(strsim::normalized_damerau_levenshtein(typed_name, name) + 0.45);
    // Both measures are low for a short word with one wrong letter, so that it is counted as
    // similar.
    let has_one_mistake =
        typed_name.len() >= 3 && strsim::damerau_levenshtein(typed_name, name) == 1;
    if has_one_mistake { similarity.max(0.9) } else { similarity }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_found_for_common_typos() {
        let valid_names = [
            "unbalance_mass_kg",
            "frame_mass_kg",
            "damping_n_s_per_m",
            "spring_stiffness_n_per_m",
            "spin_ramp_s",
            "run",
            "damper_2_friction_n",
            "damper_1_friction_n",
        ];
        let find_nearest = |typed_name: &str| nearest_name(typed_name, valid_names);
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
