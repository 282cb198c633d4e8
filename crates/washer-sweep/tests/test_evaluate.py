"""Tests of `Plan.evaluate`, which computes a table of results from a table of points."""

import itertools
import types

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from conftest import ROOT, rows
from conftest_grid import SHORT_GRID

import washer_sweep
from washer_sweep import Plan, PlanError

AXES = ["unbalance_mass_kg", "damping_n_s_per_m"]


def grid_columns(plan):
    """Returns the plan's grid as columns."""
    points = itertools.product(np.linspace(0.1, 0.9, 5), np.linspace(60.0, 300.0, 4))
    return dict(zip(AXES, map(np.array, zip(*points)), strict=True))


def test_fig12_has_the_bits_of_the_commands_rows(sweep, tmp_path):
    import subprocess

    path = tmp_path / "fig12.parquet"
    grid = ROOT / "sweeps/fig12.toml"
    subprocess.run([sweep, "run", grid, "--out", path, "--progress", "none"], check=True,
                   capture_output=True)
    table = rows(washer_sweep.read(path))
    # The points are evaluated in another order and in several pieces, first only a part of them.
    order = np.random.default_rng(1).permutation(len(table))
    plan = Plan.from_toml(grid)
    for order_part in (order[:37], order):
        points = pa.concat_tables([table.select(AXES).take(part)
                                   for part in np.array_split(order_part, 3)])
        result_rows = rows(plan.evaluate(points)).drop_columns("point")
        assert result_rows == table.take(order_part).drop_columns("point").combine_chunks()


def test_numbers_of_every_format_are_read_and_other_values_are_rejected(short_plan):
    table = grid_columns(short_plan)
    expected = rows(short_plan.evaluate(table))
    for dtype in (">f8", "<f8", ">f4", "O", "longdouble"):
        typed_table = {name: values.astype(dtype) for name, values in table.items()}
        if dtype == ">f4":
            table = {name: values.astype("f4").astype("f8") for name, values in table.items()}
        assert rows(short_plan.evaluate(typed_table)) == rows(short_plan.evaluate(table)), dtype
        table = grid_columns(short_plan)
    counts = {name: np.round(values + 0.5).astype(">i4") for name, values in table.items()}
    counts["unbalance_mass_kg"] = table["unbalance_mass_kg"]
    assert rows(short_plan.evaluate(counts))["damping_n_s_per_m"].to_pylist() == list(
        np.round(table["damping_n_s_per_m"] + 0.5))
    lists = {name: list(values) for name, values in table.items()}
    assert expected == rows(short_plan.evaluate(lists))
    mass = table["unbalance_mass_kg"]
    for invalid_values in (np.ma.masked_less(mass, 0.3), mass + 0j, mass.astype("c8"), mass > 0.5,
                           list(mass > 0.5), [True] * len(mass), mass.astype("M8[s]"),
                           mass.astype("U")):
        with pytest.raises(TypeError, match="column `unbalance_mass_kg`: expected numbers"):
            short_plan.evaluate({**table, "unbalance_mass_kg": invalid_values})
    for invalid_values in (np.ma.masked_less(np.arange(60.0, 63.0), 61), np.arange(60, 62) + 0j,
                           [True]):
        with pytest.raises(TypeError, match="expected"):
            washer_sweep.modes(speeds_rpm=invalid_values)
    assert rows(washer_sweep.modes(speeds_rpm=np.array([60.0, 70.0]).astype(">f8"))) == rows(
        washer_sweep.modes(speeds_rpm=[60, 70]))


def test_every_kind_of_table_gives_the_same_rows(short_plan):
    table = grid_columns(short_plan)
    expected = pa.table(short_plan.evaluate(table))
    assert expected == pa.table(short_plan.run(progress=False))
    relation = pd.DataFrame(table)
    for source in (
        pa.table(table),
        pa.table(table).to_batches()[0],
        pa.RecordBatchReader.from_batches(pa.table(table).schema,
                                          pa.table(table).to_batches(max_chunksize=7)),
        pl.DataFrame(table),
        relation,
        duckdb.sql("select * from relation"),
        {name: list(values) for name, values in table.items()},
        {name: values[::-1].copy()[::-1] for name, values in table.items()},
        dict(reversed(table.items())),
        types.MappingProxyType(table),
        {name: pd.Series(values) for name, values in table.items()},
        {name: pl.Series(values) for name, values in table.items()},
        pa.table(expected.select(AXES)),
    ):
        assert pa.table(short_plan.evaluate(source)) == expected, type(source)
    integer_table = {"unbalance_mass_kg": np.array([1]),
                     "damping_n_s_per_m": np.array([60, 300])[:1]}
    plan = Plan({**SHORT_GRID, "axis": [{"parameter": AXES[0], "values": [1, 0.1]},
                                        {"parameter": AXES[1], "values": [60, 300]}]})
    assert plan.evaluate(integer_table)["unbalance_mass_kg"].tolist() == [1.0]


def test_no_row_depends_on_the_others_or_on_threads(short_plan):
    table = grid_columns(short_plan)
    expected = pa.table(short_plan.evaluate(table))
    for row in (0, 7, 19):
        one_row_table = {name: values[row : row + 1] for name, values in table.items()}
        result_rows = pa.table(short_plan.evaluate(one_row_table, threads=1)).drop_columns("point")
        assert result_rows == expected.slice(row, 1).drop_columns("point")
    assert pa.table(short_plan.evaluate(table, threads=1)) == expected
    assert pa.table(short_plan.evaluate(table, threads=3)) == expected


@pytest.mark.parametrize(("table", "expected_text"), [
    ({"unbalance_mass_kg": [0.1]}, "the table has no column `damping_n_s_per_m`"),
    ({"unbalance_mass": [0.1], "damping_n_s_per_m": [60]}, "did you mean `unbalance_mass_kg`"),
    ({"unbalance_mass_kg": [0.1], "damping_n_s_per_m": [60], "tub_mass_kg": [20]},
     "`tub_mass_kg` is no axis of this plan"),
    ({"unbalance_mass_kg": [0.1, 0.95], "damping_n_s_per_m": [60, 60]},
     "row 2 of `unbalance_mass_kg` = 0.95 is off the plan's axis"),
    ({"unbalance_mass_kg": [-1], "damping_n_s_per_m": [60]}, "= -1 is out of range"),
    ({"unbalance_mass_kg": [float("nan")], "damping_n_s_per_m": [60]}, "is not a number"),
    ({"unbalance_mass_kg": [0.1, 0.2], "damping_n_s_per_m": [60]}, "has 1 values"),
    (pa.table({"unbalance_mass_kg": [0.1, None], "damping_n_s_per_m": [60.0, 70.0]}),
     "row 2 of `unbalance_mass_kg` has no value"),
    (pa.table({"unbalance_mass_kg": ["a"], "damping_n_s_per_m": [60.0]}), "holds no numbers"),
    (pa.table([[0.1], [0.1], [60.0]], names=[*AXES[:1], *AXES[:1], AXES[1]]), "is given twice"),
    ({}, "has no column `unbalance_mass_kg`"),
])
def test_an_invalid_table_is_rejected_with_the_location(short_plan, table, expected_text):
    with pytest.raises(PlanError) as caught:
        short_plan.evaluate(table)
    assert expected_text in str(caught.value)
    assert caught.value.diagnostics[0]["file"] == "table"


def test_other_objects_than_tables_are_rejected(short_plan):
    for table in ([1, 2], None, "x", 3.0):
        with pytest.raises(TypeError, match="__arrow_c_stream__"):
            short_plan.evaluate(table)
    with pytest.raises(TypeError, match="column `unbalance_mass_kg`: expected numbers"):
        short_plan.evaluate({"unbalance_mass_kg": ["a"], "damping_n_s_per_m": [60]})
    for square in (np.ones((2, 2)), np.ones((2, 2), int), np.ones((2, 1)), np.ones((2, 1), int)):
        with pytest.raises(TypeError, match="expected numbers"):
            short_plan.evaluate({"unbalance_mass_kg": square, "damping_n_s_per_m": [60, 60]})
    for threads in (0, 5000):
        with pytest.raises(PlanError, match="expected a number from 1 to 4096"):
            short_plan.evaluate(grid_columns(short_plan), threads=threads)


def test_a_table_without_rows_gives_a_result_without_rows(short_plan):
    result_rows = short_plan.evaluate({"unbalance_mass_kg": [], "damping_n_s_per_m": []})
    assert len(result_rows) == 0
    assert pa.table(result_rows).schema == pa.table(short_plan.run(progress=False)).schema


def test_an_axis_of_one_value_may_be_left_out():
    axes = [*SHORT_GRID["axis"], {"parameter": "tub_mass_kg", "values": [20]}]
    plan = Plan({**SHORT_GRID, "axis": axes})
    result_rows = plan.evaluate({"unbalance_mass_kg": [0.4], "damping_n_s_per_m": [100]})
    assert result_rows["tub_mass_kg"].tolist() == [20.0]


def test_a_million_invalid_rows_are_reported_quickly(short_plan):
    with pytest.raises(PlanError, match=r"1000000 mistakes \(100 shown\)"):
        short_plan.evaluate({"unbalance_mass_kg": np.full(1_000_000, 2.0),
                             "damping_n_s_per_m": np.full(1_000_000, 60.0)})
