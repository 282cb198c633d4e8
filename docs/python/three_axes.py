"""A map over three axes as an xarray dataset: unbalance, damping and the greatest spin speed.

    python docs/python/three_axes.py [PICTURE.svg]
"""

import sys

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "three_axes"
import matplotlib.pyplot as plt
import pandas as pd
import xarray as xr

import washer_sweep

GRID = {
    "name": "three_axes",
    "spin": {"profile": "triangular", "peak_rpm": 350.0, "ramp_s": 50.0},
    "time": {"end_s": 50.0, "window_s": [0.0, 50.0]},
    "axis": [
        {"parameter": "spin_peak_rpm", "values": [250.0, 300.0, 350.0]},
        {"parameter": "unbalance_mass_kg", "range": {"from": 0.1, "to": 0.9, "count": 9}},
        {"parameter": "damping_n_s_per_m", "range": {"from": 60.0, "to": 300.0, "count": 13}},
    ],
}


def dataset(result):
    """A result on its grid, with units where xarray's plots look for them."""
    axes = [axis["parameter"] for axis in result.plan["axis"]]
    rows = pd.DataFrame({name: result[name] for name in result.columns})
    data = xr.Dataset.from_dataframe(rows.set_index(axes))
    for name, unit in result.units.items():
        data[name].attrs = {"units": unit, "long_name": name,
                            "description": result.descriptions[name]}
    return data


def main():
    """Run, tell, draw."""
    data = dataset(washer_sweep.Plan(GRID).run(progress=False))
    print(dict(data.sizes))
    # A point without a verdict is not reliable.
    reliable = data["reliable"] == True  # noqa: E712
    share = reliable.mean(["unbalance_mass_kg", "damping_n_s_per_m"])
    for speed, part in zip(data["spin_peak_rpm"].values, share.values, strict=True):
        print(f"up to {speed:.0f} rpm: {100 * part:.1f} % reliable")
    if len(sys.argv) > 1:
        drawn = data["ratio_max"].plot.contourf(
            x="unbalance_mass_kg", y="damping_n_s_per_m", col="spin_peak_rpm",
            levels=[0, 1, 2, 5, 10, 50], figsize=(10, 3.4),
        )
        drawn.fig.savefig(sys.argv[1], metadata={"Date": None})
        plt.close(drawn.fig)


if __name__ == "__main__":
    main()
