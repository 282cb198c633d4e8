"""Sobol indices of the tub's yaw amplitude, by SALib: which number of the machine decides it?

    python docs/python/sobol.py [PICTURE.svg]

First the method on Ishigami's function, whose indices are known, to see that it is used rightly.
"""

import sys

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "sobol"
import matplotlib.pyplot as plt
import numpy as np
from SALib.analyze import sobol as indices
from SALib.sample import sobol as sample
from SALib.test_functions import Ishigami

import washer_sweep

# First-order and total indices of Ishigami's function with a = 7, b = 0.1, from its variances.
ISHIGAMI = {"S1": [0.3139, 0.4424, 0.0], "ST": [0.5576, 0.4424, 0.2437]}

RANGES = {
    "unbalance_mass_kg": (0.1, 0.6),
    "damping_n_s_per_m": (100.0, 300.0),
    "spring_stiffness_n_per_m": (7200.0, 8800.0),
    "tub_mass_kg": (21.5, 26.3),
}
GRID = {
    "name": "sobol",
    "spin": {"profile": "triangular", "peak_rpm": 350.0, "ramp_s": 50.0},
    "time": {"end_s": 50.0, "window_s": [30.0, 50.0]},
    "axis": [
        {"parameter": name, "range": {"from": low, "to": high, "count": 2}}
        for name, (low, high) in RANGES.items()
    ],
}


def analysed(problem, points, function):
    """Indices of a function over points that are `points` times a power of two."""
    table = sample.sample(problem, points, calc_second_order=False, seed=1)
    return indices.analyze(problem, function(table), calc_second_order=False, seed=1)


def ishigami():
    """The greatest distance of an estimate from the known indices."""
    names = ["x1", "x2", "x3"]
    problem = {"num_vars": 3, "names": names, "bounds": [[-np.pi, np.pi]] * 3}
    found = analysed(problem, 4096, Ishigami.evaluate)
    return max(np.abs(found[key] - known).max() for key, known in ISHIGAMI.items())


def yaw():
    """The indices of the nonlinear model's yaw amplitude."""
    plan = washer_sweep.Plan(GRID)
    names = list(plan.axes)
    problem = {"num_vars": len(names), "names": names, "bounds": list(plan.axes.values())}

    def amplitude(table):
        # Saltelli's scheme scales onto the ranges; its last digit may lie beyond them.
        columns = {
            name: np.clip(column, *plan.axes[name])
            for name, column in zip(names, table.T, strict=True)
        }
        return plan.evaluate(columns)["nonlinear_tub_yaw"]

    return names, analysed(problem, 512, amplitude)


def main():
    """Analyse, tell, draw."""
    error = ishigami()
    print(f"Ishigami's function: within {error:.3f} of the known indices")
    assert error < 0.02
    names, found = yaw()
    print(f"{'tub yaw':26}  first  +-      total  +-")
    for k, name in enumerate(names):
        print(f"{name:26} {found['S1'][k]:6.2f} {found['S1_conf'][k]:5.2f} "
              f"{found['ST'][k]:8.2f} {found['ST_conf'][k]:5.2f}")
    if len(sys.argv) > 1:
        figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
        places = np.arange(len(names))
        for shift, key, label in [(-0.2, "S1", "first order"), (0.2, "ST", "total")]:
            axes.barh(places + shift, found[key], 0.4, xerr=found[key + "_conf"], label=label)
        axes.set_yticks(places, names)
        axes.invert_yaxis()
        axes.set_xlabel("share of the variance of the tub's yaw amplitude")
        axes.legend(loc="lower right")
        figure.savefig(sys.argv[1], metadata={"Date": None})


if __name__ == "__main__":
    main()
