"""Tests the package without NumPy and other libraries. `scripts/checks/python.sh` runs this script
in an environment that has only the wheel."""

import importlib.util
import pathlib

import washer_sweep

from conftest_grid import SHORT_GRID

assert importlib.util.find_spec("numpy") is None, "the environment is not clean"
assert (pathlib.Path(washer_sweep.__file__).parent / "py.typed").exists()
result = washer_sweep.Plan(SHORT_GRID).evaluate(
    {"unbalance_mass_kg": [0.1, 0.5], "damping_n_s_per_m": [60, 100.0]}
)
assert len(result) == 2
assert result.units["unbalance_mass_kg"] == "kg"
assert "<svg" in washer_sweep.modes()._repr_svg_()
print(result)
