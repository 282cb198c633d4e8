"""The map with polars, lazily: only the columns and row groups that a question needs are read.

    python docs/recipes/with_polars.py results/quick.parquet [MASS_KG]

Answers: which least damping keeps each unbalance reliable, and which channel decides?
"""

import json
import sys

import polars as pl


def units(path):
    """Column name to unit, from the file's metadata."""
    dictionary = json.loads(pl.read_parquet_metadata(path)["sweep.columns"])
    return {name: facts["unit"] for name, facts in dictionary.items()}


def requirement(path):
    """One row per mass of the grid: the damping from which on it is reliable; null if no damping of
    the map does."""
    rows = pl.scan_parquet(path)
    # A row without a verdict (null) is not a reliable one.
    worst = pl.col("damping_n_s_per_m").filter(~pl.col("reliable").fill_null(False)).max()
    above = pl.col("damping_n_s_per_m").filter(
        pl.col("damping_n_s_per_m") > worst.fill_null(float("-inf"))
    )
    return (
        rows.group_by("unbalance_mass_kg")
        .agg(above.min().alias("damping_n_s_per_m"))
        .sort("unbalance_mass_kg")
    )


def least_damping(path, mass_kg):
    """(mass, damping): the first mass of the grid not below `mass_kg`, and the damping from which
    on it is reliable.

    The damping is None if even the strongest of the map does not do.
    """
    return requirement(path).filter(pl.col("unbalance_mass_kg") >= mass_kg).first().collect().row(0)


def main():
    """Read the command line, tell."""
    path, mass_kg = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.6
    unit = units(path)
    print(
        f"damping ({unit['damping_n_s_per_m']}) from which on a mass ({unit['unbalance_mass_kg']}) "
        f"is reliable"
    )
    print(requirement(path).collect())
    deciding = pl.col("ratio_max_channel")
    print(pl.scan_parquet(path).group_by(deciding).len().sort("len", descending=True).collect())
    mass, damping = least_damping(path, mass_kg)
    answer = "at no damping of this map" if damping is None else f"from {damping:g} N s/m"
    print(f"{mass_kg:g} kg stays reliable {answer} (grid: {mass:g} kg)")


if __name__ == "__main__":
    main()
