"""A Pareto front of tub travel against cabinet force, over springs and dampers, by pymoo.

    python docs/python/pareto.py [PICTURE.svg]

Stiff springs keep the tub in its place and shake the cabinet. Which choices are not beaten in both?
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "pareto"
import matplotlib.pyplot as plt
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize

import washer_sweep

GRID = {
    "name": "pareto",
    "metrics": ["cabinet_force", "static_sag"],
    "spin": {"profile": "triangular", "peak_rpm": 350.0, "ramp_s": 50.0},
    "time": {"end_s": 50.0, "window_s": [0.0, 50.0]},
    "set": {"unbalance_mass_kg": 0.3},
    "axis": [
        {"parameter": "spring_stiffness_n_per_m",
         "range": {"from": 5000.0, "to": 12000.0, "count": 2}},
        {"parameter": "damping_n_s_per_m", "range": {"from": 60.0, "to": 400.0, "count": 2}},
    ],
}
TRAVEL = ["nonlinear_tub_front_y", "nonlinear_tub_front_z"]
FORCE = "cabinet_force_nonlinear_n"
STUDY = pathlib.Path(__file__).resolve().parent.parent / "examples/pareto.toml"
OBJECTIVES = ["static_sag_m_plus_nonlinear_tub_front_y", "cabinet_force_nonlinear_n"]


def objectives(plan, designs):
    """Greatest travel of the tub's front (m) and force on the cabinet (N), a row a design. The
    travel is from where the machine is drawn: soft springs let the tub sink.

    A design whose model fails is worse than any other.
    """
    columns = dict(zip(plan.axes, designs.T, strict=True))
    result = plan.evaluate(columns)
    travel = result["static_sag_m"] + np.maximum(result[TRAVEL[0]], result[TRAVEL[1]])
    return np.nan_to_num(np.column_stack([travel, result[FORCE]]), nan=1e9)


class Suspension(Problem):
    """Both objectives over the plan's axes; a generation is one call."""

    def __init__(self, plan):
        low, high = np.array(list(plan.axes.values())).T
        super().__init__(n_var=len(low), n_obj=2, xl=low, xu=high)
        self.plan = plan

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = objectives(self.plan, x)


def front(plan):
    """Designs and objectives that none other beats, by travel."""
    found = minimize(Suspension(plan), NSGA2(pop_size=32), ("n_gen", 16), seed=1)
    order = np.argsort(found.F[:, 0])
    return found.X[order], found.F[order]


def main():
    """Search, tell, draw."""
    plan = washer_sweep.Plan(GRID)
    designs, values = front(plan)
    # As many designs at random, which the search has to beat.
    low, high = np.array(list(plan.axes.values())).T
    others = objectives(plan, np.random.default_rng(1).uniform(low, high, (512, 2)))
    worst = others.max(axis=0)
    volume = HV(ref_point=[1, 1])
    found, chance = volume(values / worst), volume(others / worst)
    print(f"{len(designs)} designs; hypervolume {found:.4f}, of 512 at random {chance:.4f}")
    assert found >= chance
    # The same study by the command's own search.
    study = washer_sweep.optimise(STUDY, progress=False)
    own = np.column_stack([study[name] for name in OBJECTIVES])[study["on_front"].astype(bool)]
    print(f"sweep optimise: {len(own)} designs; hypervolume {volume(own / worst):.4f}")
    assert volume(own / worst) > found - 1e-3
    print("travel mm  force N   N/m  N s/m")
    for (stiffness, damping), (travel, force) in zip(designs, values, strict=True):
        if travel in np.quantile(values[:, 0], [0, 0.25, 0.5, 0.75, 1], method="nearest"):
            print(f"{1e3 * travel:9.1f} {force:8.0f} {stiffness:5.0f} {damping:6.0f}")
    if len(sys.argv) > 1:
        figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
        axes.plot(1e3 * others[:, 0], others[:, 1], ".", color="0.8", label="at random")
        drawn = axes.scatter(1e3 * values[:, 0], values[:, 1], c=designs[:, 0], label="front")
        figure.colorbar(drawn, label="springs, N/m")
        axes.set_xlabel("greatest travel of the tub's front, mm")
        axes.set_ylabel("greatest force on the cabinet, N")
        axes.legend()
        figure.savefig(sys.argv[1], metadata={"Date": None})


if __name__ == "__main__":
    main()
