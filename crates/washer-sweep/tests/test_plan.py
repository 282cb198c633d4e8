"""Tests of plans, and of the errors for invalid plans."""

import importlib.metadata
import pickle

import numpy as np
import pytest
from conftest import ROOT
from conftest_grid import SHORT_GRID

import washer_sweep
from washer_sweep import Plan, PlanError


def test_a_file_its_text_and_a_dictionary_give_the_same_plan():
    path = ROOT / "sweeps/fig12.toml"
    from_file = Plan.from_toml(path)
    assert Plan.from_toml(str(path)).to_dict() == from_file.to_dict()
    from_text = Plan.from_toml(path.read_text()).to_dict()
    assert from_text | {"name": "fig12"} == from_file.to_dict()
    assert len(from_file) == 1287
    assert from_file.axes["damping_n_s_per_m"] == (60.0, 300.0)
    # The dictionary of a plan is a valid plan, except for the machine, which a grid names as a
    # file.
    other_tables = {k: v for k, v in from_file.to_dict().items() if k != "machine"}
    assert Plan(other_tables).to_dict() == from_file.to_dict()


def test_the_package_has_the_engines_version():
    assert washer_sweep.__version__ == importlib.metadata.version("washer-sweep")


def test_a_dictionary_may_contain_values_of_numpy_and_pathlib():
    axis = [{"parameter": "unbalance_mass_kg", "values": np.linspace(0.1, 0.9, 3)},
            {"parameter": "damping_n_s_per_m", "values": (np.int64(60), np.float32(80.0))}]
    plan = Plan({**SHORT_GRID, "axis": axis})
    assert plan.to_dict()["axis"][0]["values"] == [0.1, 0.5, 0.9]
    assert plan.to_dict()["axis"][1]["values"] == [60.0, 80.0]
    with pytest.raises(PlanError, match="cannot read the machine file"):
        Plan({**SHORT_GRID, "machine": ROOT / "none.toml"})


def test_constants_replace_values_of_the_machine():
    plan = Plan(SHORT_GRID, set={"tub_mass_kg": 20.123456789012345})
    assert plan.to_dict()["machine"]["tub"]["mass_kg"] == 20.123456789012345
    with pytest.raises(PlanError, match="unknown parameter `tub_mass`"):
        Plan(SHORT_GRID, set={"tub_mass": 20})
    with pytest.raises(TypeError, match="`tub_mass_kg`: expected a number, got `str`"):
        Plan(SHORT_GRID, set={"tub_mass_kg": "20"})


def test_a_dictionary_that_is_nested_too_deep_is_rejected():
    endless = dict(SHORT_GRID)
    endless["spin"] = endless
    nested_grid = {}
    nested_list = []
    for _ in range(20_000):
        nested_grid = {"spin": nested_grid}
        nested_list = [nested_list]
    lists = []
    lists.append(lists)
    for grid in (endless, nested_grid, {"axis": nested_list}, {"axis": lists}):
        with pytest.raises(ValueError, match="nested deeper than 24"):
            Plan(grid)


@pytest.mark.parametrize("value", [True, np.True_, 2j, np.complex128(2 + 1j), np.ma.masked,
                                   np.datetime64("2020-01-01")])
def test_a_constant_is_a_number(value):
    with pytest.raises(TypeError, match="`tub_mass_kg`: expected a number, got"):
        Plan(SHORT_GRID, set={"tub_mass_kg": value})


def test_a_mistake_has_fields_and_the_text_of_the_command(sweep, tmp_path):
    import subprocess

    path = tmp_path / "wrong.toml"
    path.write_text('[spin]\nprofile = "ramp"\npeak_rpm = 300\nramp_s = -1\n'
                    "[time]\nend_s = 2\nwindow = [0, 1]\n")
    with pytest.raises(PlanError) as caught:
        Plan.from_toml(path)
    first, second = caught.value.diagnostics
    assert (first["line"], first["column"], first["file"]) == (4, 10, str(path))
    assert first["message"] == "`ramp_s` = -1 is out of range"
    assert second["hint"] == "did you mean `window_s`?"
    completed = subprocess.run([sweep, "check", path], capture_output=True, text=True, check=False)
    assert completed.returncode == 2
    assert completed.stderr.strip() == str(caught.value).strip()
    restored_error = pickle.loads(pickle.dumps(caught.value))
    assert restored_error.diagnostics == caught.value.diagnostics


@pytest.mark.parametrize(("grid", "error"), [
    ({}, PlanError),
    ({"spin": 3}, PlanError),
    ({"spin": None}, TypeError),
    ({3: 4}, TypeError),
    ({**SHORT_GRID, "name": "a\nb"}, PlanError),
    ({**SHORT_GRID, "axis": [{"parameter": "x\x00"}]}, PlanError),
    ({**SHORT_GRID, "time": {"end_s": float("nan")}}, PlanError),
    ({**SHORT_GRID, "axis": [3]}, PlanError),
    ({**SHORT_GRID, "time": {"end_s": 10**30}}, PlanError),
])
def test_invalid_plans_are_rejected(grid, error):
    with pytest.raises(error):
        Plan(grid)


def test_parameters_are_those_of_the_command(sweep):
    import json
    import subprocess

    completed = subprocess.run([sweep, "parameters", "--json"], capture_output=True, check=True)
    assert washer_sweep.parameters() == json.loads(completed.stdout)
    heavy_plan = Plan(SHORT_GRID, set={"tub_mass_kg": 31})
    value = {entry["name"]: entry["value"] for entry in washer_sweep.parameters(heavy_plan)}
    assert value["tub_mass_kg"] == 31
