"""Tests that stability, attractors, explanations and fits have the bytes and the text of the
command."""

import json
import pickle
import subprocess

import numpy as np
import pyarrow.csv
import pytest
from conftest import ROOT, rows
from conftest_grid import SHORT_GRID

import washer_sweep
from washer_sweep import Plan, PlanError

QUICK_GRID = ROOT / "sweeps/quick.toml"
POINT = {"unbalance_mass_kg": 0.4, "damping_n_s_per_m": 100.0}


def standard_output(*command):
    """Returns the standard output of a command."""
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_stability_has_the_bytes_of_the_command(sweep, tmp_path):
    by_command, by_call, saved = (tmp_path / f"{name}.parquet" for name in "abc")
    standard_output(sweep, "stability", QUICK_GRID, "--speed", "240:320:20", "--out", by_command,
                    "--progress", "none")
    plan = Plan.from_toml(QUICK_GRID)
    result = washer_sweep.stability(plan, range(240, 321, 20), by_call, progress=False)
    assert by_call.read_bytes() == by_command.read_bytes()
    in_memory = washer_sweep.stability(plan, np.arange(240.0, 321.0, 20.0), progress=False)
    in_memory.save(saved)
    assert saved.read_bytes() == by_command.read_bytes()
    assert rows(in_memory) == rows(result)
    assert result.kind == in_memory.kind == washer_sweep.read(by_command).kind == "stability"
    # A point at a speed may have several responses.
    assert len(result) >= 5 * len(plan)
    assert (result["stable"] == False).any(), "250 rpm is unstable"  # noqa: E712
    with pytest.raises(PlanError, match="another plan"):
        washer_sweep.stability(plan, [240.0], by_call, progress=False)


def test_attractors_have_the_bytes_of_the_command(sweep, tmp_path):
    by_command, by_call, saved = (tmp_path / f"{name}.parquet" for name in "abc")
    standard_output(sweep, "dwell", QUICK_GRID, "--speed", "250,297.5", "--starts", "2", "--out",
                    by_command, "--progress", "none")
    plan = Plan.from_toml(QUICK_GRID)
    result = washer_sweep.dwell(plan, [250, 297.5], by_call, starts=2, progress=False)
    assert by_call.read_bytes() == by_command.read_bytes()
    washer_sweep.dwell(plan, [250, 297.5], starts=2, progress=False).save(saved)
    assert saved.read_bytes() == by_command.read_bytes()
    assert result.kind == "dwell"
    for options, expected_text in [
        ({"starts": 0}, "from 1 to 1024"), ({"kick": -1}, "above 0"), ({"carry": "x"}, "up or down")
    ]:
        with pytest.raises(ValueError, match=expected_text):
            washer_sweep.dwell(plan, [250], **options)


def test_an_explanation_is_that_of_the_command(sweep):
    command = [sweep, "explain", QUICK_GRID, "--speed", "240:320:4"]
    for name, value in POINT.items():
        command += ["--at", f"{name}={value}"]
    plan = Plan.from_toml(QUICK_GRID)
    computed = washer_sweep.explain(plan, POINT, speeds_rpm=range(240, 321, 4))
    assert computed == json.loads(standard_output(*command, "--json"))
    assert str(computed) == computed.text == standard_output(*command)
    restored = pickle.loads(pickle.dumps(computed))
    assert (restored, restored.text) == (computed, computed.text)


def test_a_fit_is_that_of_the_command(sweep, tmp_path):
    bench_grid = ROOT / "sweeps/bench.toml"
    table = pyarrow.csv.read_csv(ROOT / "crates/sweep/testdata/fit/viscous.csv").slice(0, 250)
    measurement_file = tmp_path / "table"
    pyarrow.csv.write_csv(table, measurement_file)
    free, own = ["damping_n_s_per_m=50:500"], ["unbalance_mass_kg"]
    command = [sweep, "fit", bench_grid, measurement_file,
               f"{measurement_file}@spring_stiffness_n_per_m=8350", "--free", free[0],
               "--own", own[0], "--draws", "4", "--progress", "none"]
    at = [{}, {"spring_stiffness_n_per_m": 8350}]
    computed = washer_sweep.fit(Plan.from_toml(bench_grid), [table, table], free, own=own, at=at,
                                draws=4)
    by_command = json.loads(standard_output(*command, "--json"))
    # The second table has no name of its own.
    assert computed["files"][1].pop("file") == "table 2"
    assert by_command["files"][1].pop("file") == "table"
    for report in (computed, by_command):
        assert report["parameters"][2].pop("file") in ("table", "table 2")
    assert computed.keys() == by_command.keys()
    for key in computed.keys() - {"minima"}:
        assert computed[key] == by_command[key], key
    assert [fit["name"] for fit in computed["parameters"]] == [*free[0].split("=")[:1], *own, *own]
    assert computed["verdict"]["draws"] == 4
    with pytest.raises(PlanError, match="did you mean `damping_n_s_per_m`"):
        washer_sweep.fit(Plan.from_toml(bench_grid), table, ["dampin_n_s_per_m"])


def test_growth_is_a_metric_of_a_table_too(tmp_path):
    grid = {**SHORT_GRID, "metrics": ["growth"], "stability": {"speed_rpm": "240:260:10"}}
    plan = Plan(grid)
    by_run = rows(plan.run(tmp_path / "x.parquet", progress=False))
    by_table = plan.evaluate(by_run.select(list(POINT)))
    assert rows(by_table) == by_run
    assert not np.isnan(by_table["growth_per_s"]).any()


def test_a_file_of_differences_is_read(sweep, tmp_path):
    old, new, out = (tmp_path / f"{name}.parquet" for name in ("old", "new", "out"))
    Plan(SHORT_GRID).run(old, progress=False)
    Plan(SHORT_GRID, set={"tub_mass_kg": 20}).run(new, progress=False)
    standard_output(sweep, "compare", old, new, "--out", out)
    computed = washer_sweep.read(out)
    assert computed.kind == "differences"
    assert len(computed) == 20


@pytest.mark.parametrize(("invalid_call", "expected_text"), [
    (lambda plan: washer_sweep.stability(plan, []), "from 1 to 100000 finite speeds"),
    (lambda plan: washer_sweep.stability(plan, [0.0]), "above 0"),
    (lambda plan: washer_sweep.stability(plan, [100.0, 100.0]), "each above the one before"),
    (lambda plan: washer_sweep.stability(plan, [float("inf")]), "finite"),
    (lambda plan: washer_sweep.explain(plan), "needs a value of"),
    (lambda plan: washer_sweep.explain(plan, POINT, speeds_rpm=[200, 210, 230]), "equally spaced"),
    (lambda plan: washer_sweep.explain(plan, POINT, speeds_rpm=[0, 10]), "above 0"),
    (lambda plan: washer_sweep.explain(plan, POINT, threads=0), "expected a number from 1"),
    (lambda plan: washer_sweep.fit(plan, [], ["tub_mass_kg"]), "a table or more"),
])
def test_invalid_arguments_are_rejected(short_plan, invalid_call, expected_text):
    with pytest.raises(PlanError, match=expected_text):
        invalid_call(short_plan)


def test_held_speeds_conflict_with_an_axis_of_the_speed():
    axis = {"parameter": "spin_peak_rpm", "range": {"from": 200, "to": 300, "count": 3}}
    plan = Plan({**SHORT_GRID, "axis": [axis]})
    with pytest.raises(PlanError, match="give its range as speeds"):
        washer_sweep.stability(plan, [240.0], progress=False)
