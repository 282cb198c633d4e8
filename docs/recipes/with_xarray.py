"""The map as an xarray dataset: one dimension per axis of the grid, units and descriptions as
attributes.

    python docs/recipes/with_xarray.py results/quick.parquet [MASS_KG [PICTURE.png | MAP.nc]]

Answers: which least damping keeps this unbalance reliable? Works for any number of axes; with two
it draws the map. A name that ends in .nc is written as NetCDF (with `pip install netCDF4`), for
MATLAB, Octave and ncview.
"""

import json
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pandas as pd
import pyarrow.parquet as pq
import xarray as xr


def load(path):
    """The map on its grid."""
    metadata = pq.read_metadata(path).metadata
    axes = [axis["parameter"] for axis in json.loads(metadata[b"sweep.plan"])["axis"]]
    rows = pd.read_parquet(path).set_index(axes)
    data = xr.Dataset.from_dataframe(rows)
    for name, facts in json.loads(metadata[b"sweep.columns"]).items():
        # What plots and netCDF readers look for.
        data[name].attrs = {
            "units": facts["unit"],
            "long_name": name,
            "description": facts["description"],
        }
    data.attrs = {
        "plan": metadata[b"sweep.plan"].decode(),
        "sweep": metadata[b"sweep.version"].decode(),
    }
    return data


def units(path):
    """Column name to unit, as the dataset carries them."""
    return {name: variable.attrs["units"] for name, variable in load(path).variables.items()}


def least_damping(path, mass_kg):
    """(mass, damping): the first mass of the grid not below `mass_kg`, and the damping from which
    on it is reliable.

    The damping is None if even the strongest of the map does not do.
    """
    column = load(path)["reliable"].sel(unbalance_mass_kg=mass_kg, method="bfill")
    # From the strongest damping down, as long as every one is reliable; a row without a verdict is
    # not.
    downward = column.sortby("damping_n_s_per_m", ascending=False) == True  # noqa: E712
    kept = downward.damping_n_s_per_m.where(downward.cumprod("damping_n_s_per_m") == 1, drop=True)
    return float(column.unbalance_mass_kg), float(kept.min()) if kept.size else None


def write_netcdf(data, path):
    """The dataset as a file; truth values with gaps become words, which NetCDF has."""
    mixed = [name for name, variable in data.variables.items() if variable.dtype == object]
    data.assign({name: data[name].astype(str) for name in mixed}).to_netcdf(path)


def main():
    """Read the command line, tell, draw."""
    path, mass_kg = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.6
    data = load(path)
    print(data["ratio_max"])
    if len(sys.argv) > 3 and sys.argv[3].endswith(".nc"):
        write_netcdf(data, sys.argv[3])
    elif len(sys.argv) > 3 and data["ratio_max"].ndim == 2:
        limit = json.loads(data.attrs["plan"])["reliability"]["ratio_limit"]
        data["ratio_max"].plot.contourf(
            x="unbalance_mass_kg", levels=[0, 1, limit, 5, 10, 50], figsize=(8, 6)
        )
        plt.savefig(sys.argv[3], dpi=120)
    mass, damping = least_damping(path, mass_kg)
    answer = "at no damping of this map" if damping is None else f"from {damping:g} N s/m"
    print(f"{mass_kg:g} kg stays reliable {answer} (grid: {mass:g} kg)")


if __name__ == "__main__":
    main()
