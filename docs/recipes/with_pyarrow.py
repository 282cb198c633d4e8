"""The map with pyarrow, which sees everything: types, nulls, and the file's own metadata.

    python docs/recipes/with_pyarrow.py results/quick.parquet [MASS_KG]

Answers: which least damping keeps this unbalance reliable?
"""

import json
import sys

import pyarrow.compute as pc
import pyarrow.parquet as pq


def units(path):
    """Column name to unit, from the file's metadata."""
    dictionary = json.loads(pq.read_metadata(path).metadata[b"sweep.columns"])
    return {name: dictionary[name]["unit"] for name in pq.read_schema(path).names}


def least_damping(path, mass_kg):
    """(mass, damping): the first mass of the grid not below `mass_kg`, and the damping from which
    on it is reliable.

    The damping is None if even the strongest of the map does not do.
    """
    columns = ["unbalance_mass_kg", "damping_n_s_per_m", "reliable"]
    rows = pq.read_table(path, columns=columns)
    heavier = rows.filter(pc.field("unbalance_mass_kg") >= mass_kg)
    mass = pc.min(heavier["unbalance_mass_kg"]).as_py()
    column = heavier.filter(pc.field("unbalance_mass_kg") == mass)
    # A row without a verdict (null) is not a reliable one.
    reliable = pc.field("reliable").is_valid() & pc.field("reliable")
    worst = pc.max(column.filter(~reliable)["damping_n_s_per_m"]).as_py()
    above = column if worst is None else column.filter(pc.field("damping_n_s_per_m") > worst)
    return mass, pc.min(above["damping_n_s_per_m"]).as_py()


def main():
    """Read the command line, tell."""
    path, mass_kg = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.6
    metadata = pq.read_metadata(path).metadata
    plan = json.loads(metadata[b"sweep.plan"])
    print(f"{plan['name']}: made by sweep {metadata[b'sweep.version'].decode()}")
    for name, unit in units(path).items():
        print(f"  {name:24} {unit}")
    mass, damping = least_damping(path, mass_kg)
    answer = "at no damping of this map" if damping is None else f"from {damping:g} N s/m"
    print(f"{mass_kg:g} kg stays reliable {answer} (grid: {mass:g} kg)")


if __name__ == "__main__":
    main()
