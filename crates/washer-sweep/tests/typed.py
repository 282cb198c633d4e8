"""Uses of the package that are checked by mypy, which scripts/checks/python.sh runs. Each
`type: ignore` marks an error that mypy must find; otherwise mypy reports the comment as unused."""

from typing import Any, assert_type

import numpy as np
import polars as pl
from numpy.typing import NDArray

import washer_sweep

plan = washer_sweep.Plan.from_toml("sweeps/fig12.toml", set={"tub_mass_kg": 20})
masses: dict[str, NDArray[np.float64]] = {"unbalance_mass_kg": np.linspace(0.1, 1.0, 3)}
counts: dict[str, int] = {"tub_mass_kg": 20}

assert_type(washer_sweep.Plan({"name": "x"}, set=counts), washer_sweep.Plan)
assert_type(plan.evaluate(masses), washer_sweep.Result)
assert_type(plan.evaluate({"unbalance_mass_kg": [0.4], "damping_n_s_per_m": 100.0}, threads=2),
            washer_sweep.Result)
assert_type(plan.evaluate(pl.DataFrame(masses)), washer_sweep.Result)
assert_type(plan.axes["unbalance_mass_kg"], tuple[float, float])
assert_type(plan.run()["ratio_max"], NDArray[Any])
assert_type(washer_sweep.stability(plan, range(200, 300)), washer_sweep.Result)
assert_type(washer_sweep.explain(plan, counts).text, str)
assert_type(washer_sweep.parameters()[0]["value"], float | None)
try:
    plan.run("map.parquet", progress=False)
except washer_sweep.Interrupted as stopped:
    assert_type(stopped.result, washer_sweep.Result | None)
except washer_sweep.PlanError as wrong:
    assert_type(wrong.diagnostics[0]["line"], int | None)

plan.evaluate([1, 2])  # type: ignore[arg-type]
plan.evaluate(masses, 2)  # type: ignore[call-arg]
plan.runs()  # type: ignore[attr-defined]
washer_sweep.Plan.from_toml(3)  # type: ignore[arg-type]
washer_sweep.stability(plan)  # type: ignore[call-arg]
