//! The valid name nearest to a misspelt one.

/// The valid name most like what was typed, if any is near.
pub fn nearest<'a, I>(typed: &str, valid: I) -> Option<&'a str>
where
    I: IntoIterator<Item = &'a str>,
{
    // Comparing takes time with the square of the length, and no valid name is long.
    let typed: String = typed.chars().take(80).flat_map(char::to_lowercase).collect();
    let likeness = |name: &str| {
        // Leaving out the unit or a leading word is as common as a slip of the finger.
        let is_word = || name.split('_').any(|word| word == typed);
        let is_long = typed.len() >= 4;
        if is_long && name.starts_with(&typed) {
            return 1.0;
        }
        // One slip in a short word leaves too little for the measures of likeness.
        let one_slip = typed.len() >= 3 && strsim::damerau_levenshtein(&typed, name) == 1;
        if is_long && is_word() {
            return 0.95;
        }
        let measured = strsim::jaro_winkler(&typed, name)
            .min(strsim::normalized_damerau_levenshtein(&typed, name) + 0.45);
        if one_slip { measured.max(0.9) } else { measured }
    };
    let rated = valid.into_iter().map(|name| (name, likeness(name)));
    let near = rated.filter(|&(_, likeness)| likeness > 0.8);
    near.reduce(|best, next| if best.1 >= next.1 { best } else { next }).map(|(name, _)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_what_a_reader_would_say() {
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
        let near = |typed| nearest(typed, valid);
        assert_eq!(near("unbalance_mas_kg"), Some("unbalance_mass_kg"));
        assert_eq!(near("Unbalance_Mass_kg"), Some("unbalance_mass_kg"));
        assert_eq!(near("frame_mass"), Some("frame_mass_kg"));
        assert_eq!(near("damping"), Some("damping_n_s_per_m"));
        assert_eq!(near("damper_1_friction"), Some("damper_1_friction_n"));
        assert_eq!(near("spring_stifness_n_per_m"), Some("spring_stiffness_n_per_m"));
        assert_eq!([near("rnu"), near("runn"), near("rum")], [Some("run"); 3]);
        assert_eq!(near("colour"), None);
        assert_eq!([near(""), near("r"), near("man")], [None; 3]);
        assert_eq!(near(&"damping".repeat(1000)), None);
    }
}
