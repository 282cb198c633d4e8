//! The section `[design]`: points by a rule over the axes' ranges, or listed in a file.

use super::keys::KeyVariants;
use super::{Field, Form, Key, KeyWalk, Keys};
use crate::Design;
use crate::design::DesignRule;
use crate::plan::MAX_POINTS;

/// The seed of a design whose file gives none.
pub const DEFAULT_SEED: u64 = 0;
/// Maximum seed. Basis: every JSON and TOML reader represents it exactly. Doubling it loses the
/// last bit in readers with floating-point numbers.
pub const MAX_SEED: u64 = (1 << 53) - 1;
/// The number of points of a Sobol sequence with 32 bits.
const MAX_SOBOL_POINTS: u64 = 1 << 32;

/// Walks over the section. After reading, a list has no points yet.
pub fn walk_design(design: &mut Option<Design>, keys: &mut Keys<'_>) -> Field<()> {
    keys.walk_table(Key::new("design", ""), |keys| {
        let rule_words = DesignRule::ALL.map(|(_, name, description)| (name, description));
        let words = [&rule_words[..], &[("list", "points as listed")]].concat();
        let current_rule = design.as_ref().map(Design::method);
        let current_rule = words.iter().position(|(name, _)| Some(*name) == current_rule);
        let key =
            Key::new("method", "").required("`latin_hypercube`, `sobol`, `monte_carlo` or `list`");
        let variants = KeyVariants { words, default_index: None, settable_count: 0 };
        let selected_rule = keys.walk_variants(key, &variants, current_rule, |keys, k| {
            match DesignRule::ALL.get(k) {
                Some((rule, ..)) => walk_spread(*rule, design, keys),
                None => walk_list(design, keys),
            }
        });
        // A placeholder for a rejected design lets the axes be read.
        if selected_rule.is_none() && keys.section().is_some() && design.is_none() {
            *design = Some(Design::Spread {
                rule: DesignRule::MonteCarlo,
                points: 1,
                seed: DEFAULT_SEED,
            });
        }
        if matches!(keys.walk, KeyWalk::Set(_)) && !matches!(design, Some(Design::Spread { .. })) {
            walk_spread(DesignRule::LatinHypercube, &mut None, keys);
        }
    })
}

fn walk_list(design: &mut Option<Design>, keys: &mut Keys<'_>) {
    keys.mark_misplaced(&["points", "seed"], "a list has the points that it lists");
    let key = Key::new(
        "file",
        "CSV or Parquet, relative to this file: one column a parameter, one row a point",
    );
    let (mut file, points, hash) = match design.take() {
        Some(Design::List { file, points, hash }) => (file, points, hash),
        _ => Default::default(),
    };
    let key = key.required("a CSV or Parquet file, relative to this file");
    let field = keys.walk_key(key, &Form::Text, &mut file);
    keys.write_value("points", points.into());
    keys.write_value("hash", hash.as_str().into());
    if field.into_located().is_some() || keys.section().is_none() {
        *design = Some(Design::List { file, points, hash });
    }
}

fn walk_spread(rule: DesignRule, design: &mut Option<Design>, keys: &mut Keys<'_>) {
    keys.mark_misplaced(&["file"], "only the method \"list\" has it");
    let points_and_seed = match design {
        Some(Design::Spread { points, seed, .. }) => Some((*points, *seed)),
        Some(Design::List { .. }) | None => None,
    };
    // Placeholders for rejected numbers let the axes be read.
    let (mut points, mut seed) = points_and_seed.unwrap_or((1, DEFAULT_SEED));
    let max_points = if rule == DesignRule::Sobol { MAX_SOBOL_POINTS } else { MAX_POINTS };
    let key =
        Key::new("points", "the number of points").required("the number of points").settable();
    let points_field = keys.walk_key(key, &Form::Whole(1..=max_points), &mut points);
    let key = Key::new("seed", "the seed of the random positions").settable();
    let seed_field = keys.walk_key(key, &Form::Whole(0..=MAX_SEED), &mut seed);
    for (name, field) in [("points", points_field), ("seed", seed_field)] {
        if let (None, Field::Present(_)) = (points_and_seed, field) {
            let title =
                format!("`{name}` belongs to a design, and this grid has none that takes it");
            keys.refuse_option(name, &title, "expected a grid file with [design]");
        }
    }
    *design = Some(Design::Spread { rule, points, seed });
}
