"""The map with pandas, which drops metadata: units come from the file by way of pyarrow.

    python docs/recipes/with_pandas.py results/quick.parquet [FIRST]

Answers: from which value of the second axis on is this value of the first reliable? And shows the
map as a table.
"""

import json
import sys

import pandas as pd
import pyarrow.parquet as pq


def units(path):
    """Column name to unit, from the file's metadata."""
    dictionary = json.loads(pq.read_metadata(path).metadata[b"sweep.columns"])
    return {name: facts["unit"] for name, facts in dictionary.items()}


def load(path):
    """The whole map. Arrow's types keep a null apart from false and from NaN."""
    return pd.read_parquet(path, dtype_backend="pyarrow")


def axes(path):
    """The names of the map's two axes."""
    plan = json.loads(pq.read_metadata(path).metadata[b"sweep.plan"])
    return [axis["parameter"] for axis in plan["axis"]]


def least_second(path, first):
    """The first value of the first axis that is not below `first`, and the value of the second axis
    from which on it is reliable; None if even the greatest is not.
    """
    first_axis, second_axis = axes(path)
    reliable = load(path).pivot(index=second_axis, columns=first_axis, values="reliable")
    first = min(value for value in reliable.columns if value >= first)
    # From the greatest value down, as long as every one is reliable; a row without a verdict is
    # not.
    column = reliable[first].sort_index(ascending=False).fillna(False)
    kept = column[column.astype(bool).cummin()]
    return first, kept.index.min() if len(kept) else None


def main():
    """Read the command line, tell."""
    path, first = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else float("-inf")
    unit = units(path)
    table = load(path)
    first_axis, second_axis = axes(path)
    print(f"ratio_max over {second_axis} ({unit[second_axis]}) and {first_axis}")
    picture = table.pivot(index=second_axis, columns=first_axis, values="ratio_max")
    print(picture.sort_index(ascending=False).to_string(float_format="{:.2f}".format))
    kept, least = least_second(path, first)
    answer = "none of this map" if least is None else f"{least:g} and above"
    print(f"{first_axis} {kept:g} stays reliable at {second_axis} {answer}")


if __name__ == "__main__":
    main()
