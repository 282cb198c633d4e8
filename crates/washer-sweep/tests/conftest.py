"""Fixtures and functions that the package's tests share. `scripts/checks/python.sh` runs the
tests."""

import os
import pathlib
import signal

import pyarrow as pa
import pytest
from conftest_grid import SHORT_GRID

import washer_sweep

ROOT = pathlib.Path(__file__).resolve().parents[3]

# Shells start background jobs of scripts with SIGINT ignored, and Python keeps this setting.
signal.signal(signal.SIGINT, signal.default_int_handler)


def rows(result):
    """Returns the rows as a pyarrow table in which dictionary columns are plain strings.

    Dictionaries of a file have only the words that occur in the file, those of a result in memory
    have all words that may occur.
    """
    table = pa.table(result)
    string_fields = [field.with_type(pa.string()) if pa.types.is_dictionary(field.type) else field
             for field in table.schema]
    return table.cast(pa.schema(string_fields)).combine_chunks()


@pytest.fixture
def short_plan():
    """Returns a plan of 20 points."""
    return washer_sweep.Plan(SHORT_GRID)


@pytest.fixture
def long_plan():
    """Returns a plan whose run takes minutes."""
    time = {"end_s": 200.0, "window_s": [0.5, 200.0]}
    return washer_sweep.Plan({**SHORT_GRID, "name": "long", "time": time,
                              "integrator": {"method": "rk4", "step_s": 1e-4}})


@pytest.fixture(scope="session")
def sweep():
    """Returns the path of the command `sweep` of the same build."""
    return os.environ["SWEEP"]
