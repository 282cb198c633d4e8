"""The map with pandas, which drops metadata: units come from the file by way of pyarrow.

    python docs/recipes/with_pandas.py results/quick.parquet [MASS_KG]

Answers: which least damping keeps this unbalance reliable? And shows the map as a table.
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


def least_damping(path, mass_kg):
    """(mass, damping): the first mass of the grid not below `mass_kg`, and the damping from which
    on it is reliable.

    The damping is None if even the strongest of the map does not do.
    """
    reliable = load(path).pivot(
        index="damping_n_s_per_m", columns="unbalance_mass_kg", values="reliable"
    )
    mass = min(mass for mass in reliable.columns if mass >= mass_kg)
    # From the strongest damping down, as long as every one is reliable; a row without a verdict is
    # not.
    column = reliable[mass].sort_index(ascending=False).fillna(False)
    kept = column[column.astype(bool).cummin()]
    return mass, kept.index.min() if len(kept) else None


def main():
    """Read the command line, tell."""
    path, mass_kg = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.6
    unit = units(path)
    table = load(path)
    print(
        f"ratio_max over damping ({unit['damping_n_s_per_m']}) and mass "
        f"({unit['unbalance_mass_kg']})"
    )
    picture = table.pivot(
        index="damping_n_s_per_m", columns="unbalance_mass_kg", values="ratio_max"
    )
    print(picture.sort_index(ascending=False).to_string(float_format="{:.2f}".format))
    mass, damping = least_damping(path, mass_kg)
    answer = "at no damping of this map" if damping is None else f"from {damping:g} N s/m"
    print(f"{mass_kg:g} kg stays reliable {answer} (grid: {mass:g} kg)")


if __name__ == "__main__":
    main()
