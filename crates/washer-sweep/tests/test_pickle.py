"""Tests of plans and results that are pickled for other processes."""

import concurrent.futures
import multiprocessing
import pickle

import pytest
from conftest import rows

import washer_sweep


def evaluate_masses(plan, masses):
    """Returns the rows of a plan. In a worker process the plan is received, and the rows are
    returned, by pickle."""
    return plan.evaluate({"unbalance_mass_kg": masses, "damping_n_s_per_m": [100.0] * len(masses)})


def test_a_plan_and_its_rows_go_through_a_pool_of_processes(short_plan):
    own_rows = evaluate_masses(short_plan, [0.2, 0.4])
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=context) as pool:
        pool_rows = pool.submit(evaluate_masses, short_plan, [0.2, 0.4]).result()
    assert rows(pool_rows) == rows(own_rows)
    assert (pool_rows.kind, pool_rows.plan) == (own_rows.kind, own_rows.plan)
    assert pool_rows.units == own_rows.units


def test_a_plan_is_the_same_from_a_file_a_text_and_a_table(tmp_path, monkeypatch):
    text = """
name = "pickled"
spin = { profile = "triangular", peak_rpm = 350, ramp_s = 50 }
time = { end_s = 0.1 }
integrator = { method = "rk4" }
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.1, 0.2]
"""
    (tmp_path / "grid.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    sets = {"tub_mass_kg": 20.0}
    plans = [washer_sweep.Plan.from_toml("grid.toml", set=sets),
             washer_sweep.Plan.from_toml(text, set=sets)]
    (tmp_path / "elsewhere").mkdir()
    for plan in plans:
        pickled = pickle.dumps(plan)
        monkeypatch.chdir(tmp_path / "elsewhere")
        restored_plan = pickle.loads(pickled)
        monkeypatch.chdir(tmp_path)
        assert restored_plan.to_dict() == plan.to_dict()
    keys = {"name": "pickled", "time": {"end_s": 0.1}, "integrator": {"method": "rk4"},
            "spin": {"profile": "triangular", "peak_rpm": 350, "ramp_s": 50}}
    plan = washer_sweep.Plan(keys, set=sets)
    assert pickle.loads(pickle.dumps(plan)).to_dict() == plan.to_dict()


def test_a_result_that_was_saved_has_the_same_bytes_after_pickling(short_plan, tmp_path):
    result = evaluate_masses(short_plan, [0.3])
    pickle.loads(pickle.dumps(result)).save(tmp_path / "again.parquet")
    result.save(tmp_path / "first.parquet")
    assert (tmp_path / "again.parquet").read_bytes() == (tmp_path / "first.parquet").read_bytes()


def test_a_pickled_plan_without_its_file_raises_an_error(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text("spin = { profile = \"triangular\", peak_rpm = 350, ramp_s = 50 }\n"
                    "time = { end_s = 0.1 }\n")
    pickled = pickle.dumps(washer_sweep.Plan.from_toml(path))
    path.unlink()
    with pytest.raises(washer_sweep.PlanError, match="grid.toml"):
        pickle.loads(pickled)
