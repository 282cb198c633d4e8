//! `[design]`: points by a rule over the axes' ranges, or listed in a file of their own.

use std::path::Path;

use super::list::{self, List};
use super::{Field, Located, Section};
use crate::Design;
use crate::plan::MOST_POINTS;

/// The methods by name.
pub const METHODS: [&str; 4] = ["latin_hypercube", "sobol", "monte_carlo", "list"];
/// `seed` when the grid names none.
pub const DEFAULT_SEED: u64 = 0;
/// Greatest seed: what JSON and TOML carry exactly everywhere.
pub const MOST_SEED: u64 = (1 << 53) - 1;
/// Points of Sobol's sequence with 32 bits.
pub const MOST_SOBOL: u64 = 1 << 32;

/// What `[design]` says.
pub enum WrittenDesign {
    /// Nothing: a grid.
    None,
    /// Something wrong, already reported.
    Bad,
    /// Points over ranges.
    Box(Located<Design>),
    /// Points as listed.
    List(List),
}

/// Reads the section, and the file it names.
pub fn read(root: &Section<'_>, grid: &Path) -> WrittenDesign {
    let section = match root.table("design", "[design]") {
        Field::Absent => return WrittenDesign::None,
        Field::Bad => return WrittenDesign::Bad,
        Field::Given(section) => section.value,
    };
    let at = section.at().clone();
    let field = section.choice("method", &METHODS);
    let expected = "`latin_hypercube`, `sobol`, `monte_carlo` or `list`";
    let Some(method) = section.require(field, "method", expected) else {
        // An unknown method has no list of keys, but each key has its range.
        let _ = section.count("points", MOST_POINTS);
        let _ = section.whole("seed", 0..=MOST_SEED);
        let _ = section.text("file");
        section.finish();
        return WrittenDesign::Bad;
    };
    let written = if METHODS[method.value] == "list" {
        section.misplace(&["points", "seed"], "a list has the points that it lists");
        let field = section.text("file");
        let file = section.require(field, "file", "a CSV or Parquet file, relative to this file");
        file.and_then(|file| list::read(&file, grid, root.report))
            .map_or(WrittenDesign::Bad, WrittenDesign::List)
    } else {
        section.misplace(&["file"], "only the method \"list\" has it");
        let chosen = METHODS[method.value];
        let sobol = chosen == "sobol";
        let field = section.count("points", if sobol { MOST_SOBOL } else { MOST_POINTS });
        let points = section.require(field, "points", "the number of points");
        let seed = section.whole("seed", 0..=MOST_SEED).or(DEFAULT_SEED);
        // Stand-ins for what was refused, so that the axes are read all the same.
        let (points, seed) =
            (points.map_or(1, |points| points.value), seed.unwrap_or(DEFAULT_SEED));
        let design = match chosen {
            "sobol" => Design::Sobol { points, seed },
            "monte_carlo" => Design::MonteCarlo { points, seed },
            _ => Design::LatinHypercube { points, seed },
        };
        WrittenDesign::Box(Located { value: design, at })
    };
    section.finish();
    written
}
