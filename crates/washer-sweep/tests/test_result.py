"""Tests of results: rows that are not copied, files with the bytes of the command, figures."""

import subprocess

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import ROOT, rows

import washer_sweep
from washer_sweep import Plan

QUICK_GRID = ROOT / "sweeps/quick.toml"


def buffer_addresses(table):
    """Returns the addresses of the buffers of every column."""
    return [buffer.address for column in table.columns for chunk in column.chunks
            for buffer in chunk.buffers() if buffer is not None]


def test_rows_are_not_copied(short_plan):
    result = short_plan.run(progress=False)
    first, second = pa.table(result), pa.table(result)
    assert buffer_addresses(first) == buffer_addresses(second) != []
    # NumPy arrays of the columns share the same buffers.
    steps = first["steps_nonlinear"].chunk(0)
    assert steps.to_numpy(zero_copy_only=True).ctypes.data == steps.buffers()[1].address
    frame = pl.DataFrame(result)
    assert frame["steps_nonlinear"].to_numpy().ctypes.data == steps.buffers()[1].address


def test_a_saved_copy_has_the_bytes_that_were_read(short_plan, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "map.parquet"
    short_plan.run("map.parquet", progress=False)
    original_bytes = path.read_bytes()
    result = washer_sweep.read("map.parquet")
    # The result does not depend on the file after it was read, nor on the working folder.
    path.write_bytes(original_bytes[:-1])
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    result.save("copy.parquet")
    assert (tmp_path / "elsewhere/copy.parquet").read_bytes() == original_bytes
    result.save("map.svg")
    path.unlink()
    result.save("again.parquet")
    assert (tmp_path / "elsewhere/again.parquet").read_bytes() == original_bytes


def test_rows_outlive_their_result(short_plan):
    table = pa.table(short_plan.run(progress=False))
    rows_before = table.to_pydict()
    short_plan.run(progress=False)
    assert table.to_pydict() == rows_before


def test_a_table_of_points_is_not_copied():
    # All values of a table of 200 MB are rejected. A copy of the table would raise the peak of the
    # memory by as much.
    script = """
import resource, numpy as np, pyarrow as pa, washer_sweep
from conftest_grid import SHORT_GRID
plan = washer_sweep.Plan(SHORT_GRID)
n = 12_500_000
table = pa.table({"unbalance_mass_kg": np.full(n, 2.0), "damping_n_s_per_m": np.full(n, 60.0)})
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    plan.evaluate(table)
except washer_sweep.PlanError:
    pass
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
    import sys

    printed = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True,
                          text=True, cwd=ROOT / "crates/washer-sweep/tests")
    assert int(printed.stdout) < 20_000, "kB beside the table"


def test_units_and_descriptions_are_in_the_schema(short_plan):
    result = short_plan.run(progress=False)
    assert result.units["min_gap_nonlinear_m"] == "m"
    field = pa.table(result).schema.field("min_gap_nonlinear_m")
    assert field.metadata[b"unit"] == b"m"
    assert field.metadata[b"description"].decode() == result.descriptions["min_gap_nonlinear_m"]
    assert result.columns[:3] == ["point", "unbalance_mass_kg", "damping_n_s_per_m"]
    assert "ratio_max" in result and "nothing" not in result
    with pytest.raises(KeyError, match="no column `nothing`"):
        result["nothing"]


def test_columns_are_numpy_arrays(short_plan):
    result = short_plan.run(progress=False)
    frame = pd.DataFrame.from_arrow(result)
    assert result["steps_linear"].dtype == np.uint64
    np.testing.assert_array_equal(result["ratio_max"], frame["ratio_max"].to_numpy(float))
    assert np.isnan(result["fail_time_s"]).all()
    assert set(result["status"]) == {"ok"}
    assert set(result["reliable"]) <= {True, False, None}


def test_a_run_writes_the_commands_bytes(sweep, tmp_path):
    by_command, by_run, saved = (tmp_path / f"{name}.parquet" for name in "abc")
    subprocess.run([sweep, "run", QUICK_GRID, "--out", by_command, "--progress", "none"],
                   check=True, capture_output=True)
    plan = Plan.from_toml(QUICK_GRID)
    result = plan.run(by_run, progress=False)
    assert by_run.read_bytes() == by_command.read_bytes()
    plan.run(progress=False).save(saved)
    assert saved.read_bytes() == by_command.read_bytes()
    assert pa.table(result) == pa.table(washer_sweep.read(by_command))
    # The file is complete, so that the second run reads it.
    assert pa.table(plan.run(by_run, progress=False)) == pa.table(result)
    with pytest.raises(washer_sweep.PlanError, match="already holds the result of another plan"):
        Plan.from_toml(QUICK_GRID, set={"tub_mass_kg": 20}).run(by_run, progress=False)


def test_traces_boundaries_and_modes_have_the_commands_bytes(sweep, tmp_path):
    def command(*words):
        subprocess.run([sweep, *words], check=True, capture_output=True)

    by_call, commands = tmp_path / "mine.parquet", tmp_path / "commands.parquet"
    plan = Plan.from_toml(QUICK_GRID)
    mass, damping = 0.4, 100.0
    plan.trace({"unbalance_mass_kg": mass, "damping_n_s_per_m": damping}, every=0.05, states=True,
               forces=True, start={"q5": 0.01}).save(by_call)
    command("trace", QUICK_GRID, "--at", f"unbalance_mass_kg={mass}", "--at",
            f"damping_n_s_per_m={damping}", "--every", "0.05", "--states", "--forces", "--start",
            "q5=0.01", "--out", commands)
    assert by_call.read_bytes() == commands.read_bytes()
    by_call.unlink()
    commands.unlink()
    computed = plan.boundary(tolerance=20.0, lattice=2, progress=False)
    computed.save(by_call)
    command("boundary", QUICK_GRID, "--tolerance", "20", "--lattice", "2", "--out", commands,
            "--progress", "none")
    assert by_call.read_bytes() == commands.read_bytes()
    by_call.unlink()
    saved_boundary = plan.boundary(tolerance=20.0, lattice=2, out=by_call, progress=False)
    assert by_call.read_bytes() == commands.read_bytes()
    assert pa.table(saved_boundary) == pa.table(computed)
    by_call.unlink()
    commands.unlink()
    washer_sweep.modes(plan, speeds_rpm=[0, 100, 200],
                       at={"unbalance_mass_kg": mass, "damping_n_s_per_m": damping}).save(by_call)
    command("modes", QUICK_GRID, "--at", f"unbalance_mass_kg={mass}", "--at",
            f"damping_n_s_per_m={damping}", "--speed", "0:200:100", "--out", commands)
    assert by_call.read_bytes() == commands.read_bytes()
    assert [washer_sweep.read(by_call).kind, computed.kind] == ["modes", "boundary"]


def test_invalid_options_are_rejected(short_plan):
    point = {"unbalance_mass_kg": 0.4, "damping_n_s_per_m": 100}
    for invalid_call, expected_text in [
        (lambda: short_plan.trace({"unbalance_mass_kg": 0.4}), "a point of the grid needs a value"),
        (lambda: short_plan.trace(point, every=9), "expected from"),
        (lambda: short_plan.trace(point, start={"q11": 1}), "a coordinate q1 to q10"),
        (lambda: short_plan.boundary("ratio"), "expected"),
        (lambda: short_plan.boundary(lattice=0), "from 1 to 1000"),
        (lambda: short_plan.boundary(tolerance=-1), "out of range"),
        (lambda: washer_sweep.modes(speeds_rpm=[100, 0]), "each above the one before"),
        (lambda: washer_sweep.modes(speeds_rpm=[0, float("inf")]), "finite"),
    ]:
        with pytest.raises(washer_sweep.PlanError, match=expected_text):
            invalid_call()


def test_figures_have_the_bytes_of_the_command(sweep, short_plan, tmp_path):
    file, drawn, by_call = (tmp_path / name for name in ("m.parquet", "drawn.svg", "mine.svg"))
    result = short_plan.run(file, progress=False)
    subprocess.run([sweep, "plot", file, "-o", drawn], check=True, capture_output=True)
    result.save(by_call)
    assert by_call.read_bytes() == drawn.read_bytes()
    assert result._repr_svg_() == drawn.read_text()
    assert short_plan.run(progress=False)._repr_svg_() == drawn.read_text()
    for name in ("mine.png", "mine.html"):
        result.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 10_000
    with pytest.raises(washer_sweep.PlanError, match="svg"):
        result.save(tmp_path / "mine.jpg")
    scattered_points = {"unbalance_mass_kg": [0.11, 0.5], "damping_n_s_per_m": [99, 60]}
    scattered_result = short_plan.evaluate(scattered_points)
    assert scattered_result._repr_svg_() is None, "a map of them would be empty"
    points = short_plan.run(progress=False)
    whole_grid_result = short_plan.evaluate({name: points[name] for name in short_plan.axes})
    assert "<svg" in whole_grid_result._repr_svg_()
    assert repr(scattered_result).startswith("<washer_sweep.Result: map of short, 2 rows,")
    one_point_result = short_plan.evaluate({"unbalance_mass_kg": [0.11], "damping_n_s_per_m": [99]})
    assert repr(one_point_result).startswith("<washer_sweep.Result: map of short, 1 row,")
    trace = short_plan.trace({"unbalance_mass_kg": 0.4, "damping_n_s_per_m": 100})
    assert "<svg" in trace._repr_svg_()


def test_files_of_the_user_are_not_overwritten(short_plan, tmp_path):
    thesis = tmp_path / "thesis.parquet"
    thesis.write_text("my thesis")
    result = short_plan.run(progress=False)
    for invalid_call in (lambda: result.save(thesis), lambda: short_plan.run(thesis)):
        with pytest.raises(OSError, match="cannot be an output"):
            invalid_call()
    assert thesis.read_text() == "my thesis"
    with pytest.raises(OSError, match="cannot open"):
        washer_sweep.read(tmp_path / "none.parquet")
    with pytest.raises(OSError, match="thesis"):
        washer_sweep.read(thesis)


def test_an_evaluated_table_can_be_saved_and_read(short_plan, tmp_path):
    file = tmp_path / "points.parquet"
    points = {"unbalance_mass_kg": [0.11, 0.5], "damping_n_s_per_m": [99, 60]}
    computed = short_plan.evaluate(points)
    computed.save(file)
    again = washer_sweep.read(file)
    assert rows(again) == rows(computed)
    assert again.plan == computed.plan
    assert computed.plan["design"]["method"] == "table"
