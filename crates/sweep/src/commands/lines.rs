//! Examples of the subcommands that the engine has.

use sweep_engine::commands::examples::Examples;

/// Examples of `sweep run`.
pub(super) const RUN: Examples = &[
    ["sweep run my.toml", "to results/NAME.parquet, on every core"],
    ["sweep run my.toml --set tub_mass_kg=20 --out light.parquet", "the same with another tub"],
    ["sweep run my.toml --progress plain 2> run.log", "a line every 5 s, for a log"],
    ["sweep run my.toml --shard 3/16", "one sixteenth; `sweep merge` joins them"],
];

/// Examples of `sweep check`.
pub(super) const CHECK: Examples = &[
    ["sweep check my.toml", "the plan, or every mistake with its place"],
    ["sweep check my.toml --json", "the plan with every default in place"],
];

/// Examples of `sweep merge`.
pub(super) const MERGE: Examples =
    &[["sweep merge my.toml", "when `sweep status my.toml` finds no shard missing"]];

/// Examples of `sweep status`.
pub(super) const STATUS: Examples = &[
    ["sweep status my.toml", "how far it is"],
    ["sweep status my.toml --json", "the same for a program, missing shards as a list"],
];

/// Examples of `sweep show`.
pub(super) const SHOW: Examples = &[
    ["sweep show map.parquet", "verdicts, extremes, metrics"],
    ["sweep show map.parquet --all", "every column, with unit and range"],
    ["sweep show map.parquet --top 10 --by ratio_tub_yaw", "the ten worst points"],
    ["sweep show map.parquet --where 'not reliable' --top 5", "the first unreliable ones"],
    ["sweep show map.parquet --json", "the same for a program"],
];

/// Examples of `sweep report`.
pub(super) const REPORT: Examples = &[
    ["sweep report map.parquet", "to map.html: print it from a browser"],
    ["sweep report map.parquet dwell.parquet modes.parquet", "with their figures"],
    ["sweep report map.parquet --require 'min(slip_margin_nonlinear_n)>0'", "a limit of your own"],
];

/// Examples of `sweep require`.
pub(super) const REQUIRE: Examples = &[
    ["sweep require map.parquet 'ratio_max<1.5' 'min_gap_nonlinear_m>0'", "of every row"],
    ["sweep require map.parquet 'share(reliable)>=0.5'", "of the file as a whole"],
    ["sweep require map.parquet reliable --where 'damping_n_s_per_m>=140'", "of some rows"],
];

/// Examples of `sweep compare`.
pub(super) const COMPARE: Examples = &[
    ["sweep compare old.parquet new.parquet", "plans, verdicts, boundary, greatest changes"],
    ["sweep compare old.parquet new.parquet --fail-on flips", "exit code 4 if a verdict flipped"],
    ["sweep compare old.parquet new.parquet --out d.parquet", "for `sweep plot d.parquet`"],
];

/// Examples of `sweep export`.
pub(super) const EXPORT: Examples = &[
    ["sweep export map.parquet map.csv", "text; units in comments (pandas: comment=\"#\")"],
    ["sweep export map.parquet map.xlsx", "a workbook: rows, columns with units, plan"],
];

/// Examples of `sweep optimise`.
pub(super) const OPTIMISE: Examples = &[
    ["sweep optimise study.toml", "to results/NAME.parquet; after an interruption, it goes on"],
    ["sweep optimise study.toml --best machine.toml", "and the machine file of the best"],
    ["sweep optimise study.toml --best soft.toml --candidate 412", "of another one"],
];

/// Examples of `sweep boundary`.
pub(super) const BOUNDARY: Examples = &[
    [
        "sweep boundary my.toml --out line.parquet",
        "the line on which the ratio is at its limit, without the map",
    ],
    ["sweep plot line.parquet", "drawn with the brackets it is known to lie in"],
];

/// Examples of `sweep parameters`.
pub(super) const PARAMETERS: Examples = &[
    ["sweep parameters", "names, values, units, meaning and where each value is from"],
    ["sweep parameters my.toml", "the same with the values of this grid's machine"],
];
