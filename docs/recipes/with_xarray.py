"""The map as an xarray dataset: one dimension per axis of the grid, units and descriptions as
attributes.

    python docs/recipes/with_xarray.py results/quick.parquet [FIRST [PICTURE.png | MAP.nc]]

Answers: from which value of the second axis on is this value of the first reliable? Draws the map.
A name that ends in .nc is written as NetCDF (with `pip install netCDF4`), for MATLAB, Octave and
ncview.
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


def least_second(path, first):
    """The first value of the first axis that is not below `first`, and the value of the second axis
    from which on it is reliable; None if even the greatest is not.
    """
    data = load(path)["reliable"]
    first_axis, second_axis = data.dims
    column = data.isel({first_axis: data[first_axis].values.searchsorted(first)})
    # From the greatest value down, as long as every one is reliable; a row without a verdict is
    # not.
    downward = column.sortby(second_axis, ascending=False) == True  # noqa: E712
    kept = downward[second_axis].where(downward.cumprod(second_axis) == 1, drop=True)
    return float(column[first_axis]), float(kept.min()) if kept.size else None


def write_netcdf(data, path):
    """The dataset as a file; truth values with gaps become words, which NetCDF has."""
    mixed = [name for name, variable in data.variables.items() if variable.dtype == object]
    data.assign({name: data[name].astype(str) for name in mixed}).to_netcdf(path)


def main():
    """Read the command line, tell, draw."""
    path, first = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else float("-inf")
    data = load(path)
    first_axis, second_axis = data["reliable"].dims
    print(data["ratio_max"])
    if len(sys.argv) > 3 and sys.argv[3].endswith(".nc"):
        write_netcdf(data, sys.argv[3])
    elif len(sys.argv) > 3:
        limit = json.loads(data.attrs["plan"])["reliability"]["ratio_limit"]
        data["ratio_max"].plot.contourf(
            x=first_axis, levels=[0, 1, limit, 5, 10, 50], figsize=(8, 6)
        )
        plt.savefig(sys.argv[3], dpi=120)
    kept, least = least_second(path, first)
    answer = "none of this map" if least is None else f"{least:g} and above"
    print(f"{first_axis} {kept:g} stays reliable at {second_axis} {answer}")


if __name__ == "__main__":
    main()
