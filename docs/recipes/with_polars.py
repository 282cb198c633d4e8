"""The map with polars, lazily: only the columns and row groups that a question needs are read.

    python docs/recipes/with_polars.py results/quick.parquet [FIRST]

Answers: from which value of the second axis on is each of the first reliable, and which channel
decides?
"""

import json
import sys

import polars as pl


def units(path):
    """Column name to unit, from the file's metadata."""
    dictionary = json.loads(pl.read_parquet_metadata(path)["sweep.columns"])
    return {name: facts["unit"] for name, facts in dictionary.items()}


def axes(path):
    """The names of the map's two axes."""
    plan = json.loads(pl.read_parquet_metadata(path)["sweep.plan"])
    return [axis["parameter"] for axis in plan["axis"]]


def requirement(path):
    """One row per value of the first axis: the value of the second one from which on it is
    reliable; null if even the greatest is not."""
    first_axis, second_axis = axes(path)
    rows = pl.scan_parquet(path)
    # A row without a verdict (null) is not a reliable one.
    worst = pl.col(second_axis).filter(~pl.col("reliable").fill_null(False)).max()
    above = pl.col(second_axis).filter(pl.col(second_axis) > worst.fill_null(float("-inf")))
    return rows.group_by(first_axis).agg(above.min().alias(second_axis)).sort(first_axis)


def least_second(path, first):
    """The first value of the first axis that is not below `first`, and the value of the second axis
    from which on it is reliable; None if even the greatest is not.
    """
    return requirement(path).filter(pl.col(axes(path)[0]) >= first).first().collect().row(0)


def main():
    """Read the command line, tell."""
    path, first = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else float("-inf")
    unit = units(path)
    first_axis, second_axis = axes(path)
    print(f"{second_axis} ({unit[second_axis]}) from which on a value of {first_axis} is reliable")
    print(requirement(path).collect())
    deciding = pl.col("ratio_max_channel")
    print(pl.scan_parquet(path).group_by(deciding).len().sort("len", descending=True).collect())
    kept, least = least_second(path, first)
    answer = "none of this map" if least is None else f"{least:g} and above"
    print(f"{first_axis} {kept:g} stays reliable at {second_axis} {answer}")


if __name__ == "__main__":
    main()
