"""What the package's tests share. `scripts/checks/python.sh` runs them."""

import os
import pathlib
import signal

import pyarrow as pa
import pytest
from conftest_grid import SHORT

import washer_sweep

ROOT = pathlib.Path(__file__).resolve().parents[3]

# Shells let a script's background jobs ignore it, and Python leaves that so.
signal.signal(signal.SIGINT, signal.default_int_handler)


def rows(result):
    """Rows as a table of pyarrow's, words as such: a file's dictionaries hold those words alone
    that appear in it, and a result's in memory all that may."""
    table = pa.table(result)
    words = [field.with_type(pa.string()) if pa.types.is_dictionary(field.type) else field
             for field in table.schema]
    return table.cast(pa.schema(words)).combine_chunks()


@pytest.fixture
def short():
    """A plan of 20 points."""
    return washer_sweep.Plan(SHORT)


@pytest.fixture
def long():
    """A plan that takes minutes."""
    time = {"end_s": 200.0, "window_s": [0.5, 200.0]}
    return washer_sweep.Plan({**SHORT, "name": "long", "time": time,
                              "integrator": {"method": "rk4", "step_s": 1e-4}})


@pytest.fixture(scope="session")
def sweep():
    """The command, of the same build."""
    return os.environ["SWEEP"]
