"""The least damping that stays reliable, by scipy: a root of the ratio over its limit.

    python docs/python/least_damping.py [PICTURE.svg]

A scan finds the last change of side, which a root finder then closes; the program's own search for
the boundary confirms it.
"""

import sys

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "least_damping"
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import washer_sweep

LIMIT = 2.0
MASSES_KG = [0.2, 0.3, 0.4, 0.5, 0.6]
GRID = {
    "name": "least_damping",
    "spin": {"profile": "triangular", "peak_rpm": 350.0, "ramp_s": 50.0},
    "time": {"end_s": 50.0, "window_s": [30.0, 50.0]},
    "axis": [
        {"parameter": "unbalance_mass_kg", "values": MASSES_KG},
        {"parameter": "damping_n_s_per_m", "range": {"from": 60.0, "to": 300.0, "count": 25}},
    ],
}


def least_damping(plan, mass_kg, ratios, dampings):
    """The damping above which the ratio stays below its limit (N s/m), to 0.01."""
    unreliable = np.flatnonzero(~(ratios < LIMIT))
    if not unreliable.size:
        return dampings[0]
    if unreliable[-1] == len(dampings) - 1:
        return np.nan

    def distance(damping):
        table = {"unbalance_mass_kg": [mass_kg], "damping_n_s_per_m": [damping]}
        return float(np.log(plan.evaluate(table)["ratio_max"][0] / LIMIT))

    low, high = dampings[unreliable[-1] : unreliable[-1] + 2]
    return brentq(distance, low, high, xtol=0.01)


def main():
    """Search, compare, draw."""
    plan = washer_sweep.Plan(GRID)
    scan = plan.run(progress=False)
    ratios = scan["ratio_max"].reshape(len(MASSES_KG), -1)
    dampings = scan["damping_n_s_per_m"].reshape(ratios.shape)[0]
    boundary = plan.boundary(progress=False)
    masses, crossings = boundary["unbalance_mass_kg"], boundary["damping_n_s_per_m"]
    found = []
    print("unbalance kg  least damping N s/m  sweep boundary")
    for mass_kg, row in zip(MASSES_KG, ratios, strict=True):
        least = least_damping(plan, mass_kg, row, dampings)
        found.append(least)
        # The last crossing of this mass; none where all of the range is reliable.
        traced = crossings[(masses == mass_kg) & ~np.isnan(crossings)]
        told = f"{traced.max():.2f}" if traced.size else "none"
        print(f"{mass_kg:12.1f} {least:20.2f} {told:>15}")
        if traced.size:
            # The search ends when a bracket is 0.5 wide.
            assert abs(least - traced.max()) < 0.5
    if len(sys.argv) > 1:
        figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
        for mass_kg, row, least in zip(MASSES_KG, ratios, found, strict=True):
            (line,) = axes.semilogy(dampings, row, label=f"{mass_kg} kg")
            axes.plot(least, LIMIT, "o", color=line.get_color())
        axes.axhline(LIMIT, color="0.5", lw=1)
        axes.set_xlabel("damping, N s/m")
        axes.set_ylabel("greatest ratio, nonlinear over linear")
        axes.legend()
        figure.savefig(sys.argv[1], metadata={"Date": None})


if __name__ == "__main__":
    main()
