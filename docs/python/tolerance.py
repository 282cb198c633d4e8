"""A tolerance study: 500 machines with normal scatter. How many of them are reliable?

    python docs/python/tolerance.py [PICTURE.svg]
"""

import sys

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "tolerance"
import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import binomtest, truncnorm

import washer_sweep

MACHINES = 500
LIMIT = 2.0
# Mean, standard deviation. Draws end at four deviations, which is where the plan's axes end.
SCATTER = {
    "damping_n_s_per_m": (150.0, 10.0),
    "spring_stiffness_n_per_m": (8000.0, 160.0),
    "tub_mass_kg": (23.87, 0.24),
    "unbalance_mass_kg": (0.4, 0.02),
}
DEVIATIONS = 4.0


def plan():
    """The machine, with an axis for each number that scatters."""
    ends = {
        name: (mean - DEVIATIONS * deviation, mean + DEVIATIONS * deviation)
        for name, (mean, deviation) in SCATTER.items()
    }
    return washer_sweep.Plan({
        "name": "tolerance",
        "spin": {"profile": "triangular", "peak_rpm": 350.0, "ramp_s": 50.0},
        "time": {"end_s": 50.0, "window_s": [30.0, 50.0]},
        "axis": [
            {"parameter": name, "range": {"from": low, "to": high, "count": 2}}
            for name, (low, high) in ends.items()
        ],
    })


def machines():
    """A table of machines."""
    rng = np.random.default_rng(1)
    draw = truncnorm(-DEVIATIONS, DEVIATIONS)
    return {
        name: mean + deviation * draw.rvs(MACHINES, random_state=rng)
        for name, (mean, deviation) in SCATTER.items()
    }


def main():
    """Evaluate, tell, draw."""
    ratios = plan().evaluate(machines())["ratio_max"]
    # A machine without a ratio is not reliable.
    reliable = int((ratios < LIMIT).sum())
    interval = binomtest(reliable, MACHINES).proportion_ci(method="wilson")
    print(f"{reliable} of {MACHINES} machines are reliable: {100 * reliable / MACHINES:.1f} %, "
          f"95 % confidence {100 * interval.low:.1f} to {100 * interval.high:.1f} %")
    low, middle, high = np.nanquantile(ratios, [0.05, 0.5, 0.95])
    print(f"ratio: median {middle:.2f}, 90 % between {low:.2f} and {high:.2f}")
    if len(sys.argv) > 1:
        figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
        axes.hist(ratios, bins=40)
        axes.axvline(LIMIT, color="C3", label="limit")
        axes.set_xlabel("greatest ratio, nonlinear over linear")
        axes.set_ylabel("machines")
        axes.legend()
        figure.savefig(sys.argv[1], metadata={"Date": None})


if __name__ == "__main__":
    main()
