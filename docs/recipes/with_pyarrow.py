"""The map with pyarrow, which sees everything: types, nulls, and the file's own metadata.

    python docs/recipes/with_pyarrow.py results/quick.parquet [FIRST]

Answers: from which value of the second axis on is this value of the first reliable?
"""

import json
import sys

import pyarrow.compute as pc
import pyarrow.parquet as pq


def units(path):
    """Column name to unit, from the file's metadata."""
    dictionary = json.loads(pq.read_metadata(path).metadata[b"sweep.columns"])
    return {name: dictionary[name]["unit"] for name in pq.read_schema(path).names}


def axes(path):
    """The names of the map's two axes."""
    plan = json.loads(pq.read_metadata(path).metadata[b"sweep.plan"])
    return [axis["parameter"] for axis in plan["axis"]]


def least_second(path, first):
    """The first value of the first axis that is not below `first`, and the value of the second axis
    from which on it is reliable; None if even the greatest is not.
    """
    first_axis, second_axis = axes(path)
    rows = pq.read_table(path, columns=[first_axis, second_axis, "reliable"])
    rows = rows.filter(pc.field(first_axis) >= first)
    first = pc.min(rows[first_axis]).as_py()
    column = rows.filter(pc.field(first_axis) == first)
    # A row without a verdict (null) is not a reliable one.
    reliable = pc.field("reliable").is_valid() & pc.field("reliable")
    worst = pc.max(column.filter(~reliable)[second_axis]).as_py()
    above = column if worst is None else column.filter(pc.field(second_axis) > worst)
    return first, pc.min(above[second_axis]).as_py()


def main():
    """Read the command line, tell."""
    path, first = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else float("-inf")
    metadata = pq.read_metadata(path).metadata
    plan = json.loads(metadata[b"sweep.plan"])
    print(f"{plan['name']}: made by sweep {metadata[b'sweep.version'].decode()}")
    first_axis, second_axis = axes(path)
    for name, unit in units(path).items():
        print(f"  {name:24} {unit}")
    kept, least = least_second(path, first)
    answer = "none of this map" if least is None else f"{least:g} and above"
    print(f"{first_axis} {kept:g} stays reliable at {second_axis} {answer}")


if __name__ == "__main__":
    main()
