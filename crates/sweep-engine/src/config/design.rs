//! `[design]`: points by a rule over the axes' ranges, or listed in a file of their own.

use super::keys::Variants;
use super::{Field, Form, Key, Keys, Walk};
use crate::Design;
use crate::design::Rule;
use crate::plan::MAX_POINTS;

/// `seed` when the grid names none.
pub const DEFAULT_SEED: u64 = 0;
/// Greatest seed: what JSON and TOML carry exactly everywhere.
pub const MOST_SEED: u64 = (1 << 53) - 1;
/// Points of Sobol's sequence with 32 bits.
const MOST_SOBOL: u64 = 1 << 32;

/// Walks over the section. Where it is read a list has no points yet.
pub fn walk(design: &mut Option<Design>, keys: &mut Keys<'_>) -> Field<()> {
    keys.table(Key::new("design", ""), |keys| {
        let rules = Rule::ALL.map(|(_, name, about)| (name, about));
        let all = [&rules[..], &[("list", "points as listed")]].concat();
        let now = design.as_ref().map(Design::method);
        let now = all.iter().position(|(name, _)| Some(*name) == now);
        let key =
            Key::new("method", "").needed("`latin_hypercube`, `sobol`, `monte_carlo` or `list`");
        let variants = Variants { all, default: None, set: 0 };
        let chosen = keys.variants(key, &variants, now, |keys, k| match Rule::ALL.get(k) {
            Some((rule, ..)) => spread(*rule, design, keys),
            None => listed(design, keys),
        });
        // A stand-in for what is refused, so that the axes are read all the same.
        if chosen.is_none() && keys.section().is_some() && design.is_none() {
            *design =
                Some(Design::Spread { rule: Rule::MonteCarlo, points: 1, seed: DEFAULT_SEED });
        }
        if matches!(keys.walk, Walk::Set(_)) && !matches!(design, Some(Design::Spread { .. })) {
            spread(Rule::LatinHypercube, &mut None, keys);
        }
    })
}

fn listed(design: &mut Option<Design>, keys: &mut Keys<'_>) {
    keys.misplace(&["points", "seed"], "a list has the points that it lists");
    let key = Key::new(
        "file",
        "CSV or Parquet, relative to this file: one column a parameter, one row a point",
    );
    let (mut file, points, hash) = match design.take() {
        Some(Design::List { file, points, hash }) => (file, points, hash),
        _ => Default::default(),
    };
    let key = key.needed("a CSV or Parquet file, relative to this file");
    let found = keys.key(key, &Form::Text, &mut file);
    keys.write("points", points.into());
    keys.write("hash", hash.as_str().into());
    if found.given().is_some() || keys.section().is_none() {
        *design = Some(Design::List { file, points, hash });
    }
}

fn spread(rule: Rule, design: &mut Option<Design>, keys: &mut Keys<'_>) {
    keys.misplace(&["file"], "only the method \"list\" has it");
    let numbers = match design {
        Some(Design::Spread { points, seed, .. }) => Some((*points, *seed)),
        Some(Design::List { .. }) | None => None,
    };
    // Stand-ins for what is refused, so that the axes are read all the same.
    let (mut points, mut seed) = numbers.unwrap_or((1, DEFAULT_SEED));
    let most = if rule == Rule::Sobol { MOST_SOBOL } else { MAX_POINTS };
    let key = Key::new("points", "how many").needed("the number of points").set();
    let points_found = keys.key(key, &Form::Whole(1..=most), &mut points);
    let key = Key::new("seed", "another seed, another draw").set();
    let seed_found = keys.key(key, &Form::Whole(0..=MOST_SEED), &mut seed);
    for (name, field) in [("points", points_found), ("seed", seed_found)] {
        if let (None, Field::Given(_)) = (numbers, field) {
            let title =
                format!("`{name}` belongs to a design, and this grid has none that takes it");
            keys.refuse(name, &title, "expected a grid file with [design]");
        }
    }
    *design = Some(Design::Spread { rule, points, seed });
}
