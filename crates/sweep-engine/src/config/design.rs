//! `[design]`: points by a rule over the axes' ranges, or listed in a file of their own.

use super::keys::Variants;
use super::{Field, Key, Keys, Kind, Walk};
use crate::Design;
use crate::plan::MOST_POINTS;

/// The methods by name, each with what it does.
const METHODS: [(&str, &str); 4] = [
    (
        "latin_hypercube",
        "every axis cut into as many strata as there are points, one point in each",
    ),
    ("sobol", "a scrambled Sobol sequence; a power of two points is the most even"),
    ("monte_carlo", "every point at random, independent of all others"),
    ("list", "points as listed"),
];
/// `seed` when the grid names none.
pub const DEFAULT_SEED: u64 = 0;
/// Greatest seed: what JSON and TOML carry exactly everywhere.
pub const MOST_SEED: u64 = (1 << 53) - 1;
/// Points of Sobol's sequence with 32 bits.
const MOST_SOBOL: u64 = 1 << 32;

/// Walks over the section. Where it is read there is no design after a mistake, and a list has no
/// points yet.
pub fn walk(design: &mut Option<Design>, keys: &mut Keys<'_>) -> Field<()> {
    keys.table(Key::new("design", ""), |keys| {
        let method =
            Key::new("method", "").needed("`latin_hypercube`, `sobol`, `monte_carlo` or `list`");
        let variants = Variants { all: METHODS.to_vec(), default: None, set: 0 };
        let of = |design: &Design| METHODS.iter().position(|(name, _)| *name == design.method());
        let now = design.as_ref().and_then(of);
        let chosen = keys.variants(method, &variants, now, |keys, k| match METHODS[k].0 {
            "list" => listed(design, keys),
            method => spread(method, design, keys),
        });
        if chosen.is_none() {
            *design = None;
        }
        let is_spread = chosen.is_some_and(|method| METHODS[method].0 != "list");
        if matches!(keys.walk, Walk::Set(_)) && !is_spread {
            spread(METHODS[0].0, &mut None, keys);
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
    let found = keys.key(key, &Kind::Text, &mut file);
    keys.write("points", points.into());
    keys.write("hash", hash.as_str().into());
    if found.given().is_some() || keys.section().is_none() {
        *design = Some(Design::List { file, points, hash });
    }
}

fn spread(method: &str, design: &mut Option<Design>, keys: &mut Keys<'_>) {
    keys.misplace(&["file"], "only the method \"list\" has it");
    let numbers = match design {
        Some(
            Design::LatinHypercube { points, seed }
            | Design::Sobol { points, seed }
            | Design::MonteCarlo { points, seed },
        ) => Some((*points, *seed)),
        Some(Design::List { .. }) | None => None,
    };
    // Stand-ins for what is refused, so that the axes are read all the same.
    let (mut points, mut seed) = numbers.unwrap_or((1, DEFAULT_SEED));
    let most = if method == "sobol" { MOST_SOBOL } else { MOST_POINTS };
    let key = Key::new("points", "how many").needed("the number of points").set();
    let found = [
        ("points", keys.key(key, &Kind::Whole(1..=most), &mut points)),
        (
            "seed",
            keys.key(
                Key::new("seed", "another seed, another draw").set(),
                &Kind::Whole(0..=MOST_SEED),
                &mut seed,
            ),
        ),
    ];
    for (name, field) in found {
        if let (None, Field::Given(_)) = (numbers, field) {
            let title =
                format!("`{name}` belongs to a design, and this grid has none that takes it");
            keys.refuse(name, &title, "expected a grid file with [design]");
        }
    }
    *design = Some(match method {
        "sobol" => Design::Sobol { points, seed },
        "monte_carlo" => Design::MonteCarlo { points, seed },
        _ => Design::LatinHypercube { points, seed },
    });
}
