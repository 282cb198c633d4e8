"""Tests of signals, threads and forks."""

import ast
import inspect
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import washer_sweep

# The greatest time from Ctrl-C to the exception (s), on a machine that may be busy.
MAX_ANSWER_S = 0.5

# A point of the grids of the fixtures.
POINT = {"unbalance_mass_kg": 0.4, "damping_n_s_per_m": 100.0}


def random_points(rows):
    """Returns random points within the ranges of the short grid."""
    rng = np.random.default_rng(2)
    return {"unbalance_mass_kg": rng.uniform(0.1, 0.9, rows),
            "damping_n_s_per_m": rng.uniform(60.0, 300.0, rows)}


def interrupt_call(call, after_s, ready=lambda: True):
    """Interrupts a call by SIGINT after `after_s`, once `ready` returns true. Returns the
    exception, and the time (s) from the signal to the exception."""
    send_times_s = []

    def send():
        while not ready():
            time.sleep(0.01)
        send_times_s.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after_s, send)
    timer.start()
    with pytest.raises(KeyboardInterrupt) as caught:
        call()
    answered_s = time.perf_counter() - send_times_s[0]
    timer.join()
    return caught.value, answered_s


def test_ctrl_c_ends_an_evaluation_and_leaves_its_rows(short_plan):
    points = random_points(20_000)
    stopped, answered_s = interrupt_call(lambda: short_plan.evaluate(points, threads=2), 2.0)
    assert answered_s < MAX_ANSWER_S
    rows = pa.table(stopped.result)
    assert 0 < len(rows) < 20_000
    some_points = rows["point"].to_numpy()[:20]
    again = short_plan.evaluate({name: values[some_points] for name, values in points.items()})
    expected = rows.slice(0, 20).drop_columns("point").combine_chunks()
    assert pa.table(again).drop_columns("point").combine_chunks() == expected
    with pytest.raises(washer_sweep.PlanError, match="not interrupted"):
        stopped.result.save("never.parquet")


@pytest.mark.parametrize("method", ["run", "evaluate", "boundary", "trace", "stability", "explain"])
def test_ctrl_c_is_answered_in_half_a_second(long_plan, method):
    stopped, answered_s = interrupt_call({
        "run": lambda: long_plan.run(progress=False),
        "evaluate": lambda: long_plan.evaluate(random_points(1000)),
        "boundary": lambda: long_plan.boundary(progress=False),
        "trace": lambda: long_plan.trace(POINT, every=1.0),
        "stability": lambda: washer_sweep.stability(long_plan, np.arange(60, 400, 0.1),
                                                    progress=False),
        "explain": lambda: washer_sweep.explain(long_plan, POINT),
    }[method], 0.3)
    assert answered_s < MAX_ANSWER_S
    assert isinstance(stopped, washer_sweep.Interrupted)
    # Traces and explanations have no result before their end.
    assert stopped.result is None or method not in ("trace", "explain")


def test_ctrl_c_just_before_the_end_of_a_call_raises_the_exception(short_plan):
    # The call takes some hundredths of a second, less than the interval between two checks of
    # signals. On a busy machine it may take longer.
    for rows in (200, 400, 800, 1600):
        start_s = time.perf_counter()
        short_plan.evaluate(random_points(rows), threads=1)
        duration_s = time.perf_counter() - start_s
        if duration_s > 0.03:
            break
    stopped, _ = interrupt_call(lambda: short_plan.evaluate(random_points(rows), threads=1),
                                0.3 * duration_s)
    assert isinstance(stopped, washer_sweep.Interrupted)
    assert 0 < len(pa.table(stopped.result)) <= rows


def test_ctrl_c_at_a_speed_that_takes_too_many_steps_is_answered(long_plan):
    # At this speed the search ends at once, because a turn would take too many steps.
    start_s = time.perf_counter()
    rows = pa.table(washer_sweep.stability(long_plan, [0.01], progress=False))
    assert time.perf_counter() - start_s < 5.0
    assert set(rows["status"].to_pylist()) == {"too_slow"}


def test_ctrl_c_ends_the_threads_of_an_explanation(long_plan):
    def threads():
        return len(os.listdir("/proc/self/task"))

    thread_count_before = threads()
    speeds = np.arange(60, 400, 0.01)
    interrupt_call(lambda: washer_sweep.explain(long_plan, POINT, speeds_rpm=speeds), 0.5)
    end_s = time.perf_counter() + 10.0
    # The threads of the computation and of the timer end by themselves.
    while threads() > thread_count_before and time.perf_counter() < end_s:
        time.sleep(0.05)
    assert threads() <= thread_count_before


def test_a_run_into_a_file_continues_after_ctrl_c(short_plan, tmp_path):
    path, whole = tmp_path / "x.parquet", tmp_path / "whole.parquet"
    grid = short_plan.to_dict()
    grid.pop("machine")
    for axis, count in zip(grid["axis"], (40, 30), strict=True):
        axis["range"]["count"] = count
    plan = washer_sweep.Plan(grid)

    def part_files():
        return list((tmp_path / "x.parquet.partial").glob("*.parquet"))

    stopped, _ = interrupt_call(lambda: plan.run(path, progress=False), 0.0, ready=part_files)
    assert stopped.result is None
    assert "the same call continues" in str(stopped)
    assert not path.exists()
    assert part_files()
    finished_rows = pq.read_table(sorted(part_files()))
    plan.run(path, progress=False)
    plan.run(whole, progress=False)
    assert path.read_bytes() == whole.read_bytes()
    # Parts are Parquet files like the result, and their rows are rows of the result.
    result = pq.read_table(whole)
    assert 0 < finished_rows.num_rows < result.num_rows
    assert finished_rows == result.take(finished_rows["point"])


def test_other_python_threads_run_during_a_call(short_plan):
    tick_times_s = []
    is_done = threading.Event()

    def tick():
        while not is_done.wait(0.005):
            tick_times_s.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    thread.start()
    began = time.perf_counter()
    short_plan.evaluate(random_points(500), threads=1)
    duration_s = time.perf_counter() - began
    is_done.set()
    thread.join()
    assert len(tick_times_s) > duration_s / 0.1, "the lock was held"


def test_two_threads_may_call_at_once(short_plan):
    expected = pa.table(short_plan.evaluate(random_points(60)))
    tables = []

    def evaluate():
        tables.append(pa.table(short_plan.evaluate(random_points(60))))

    callers = [threading.Thread(target=evaluate) for _ in range(2)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert tables == [expected, expected]


def evaluate_in_child(queue):
    """Runs the engine in a forked process, and puts a column of the result into the queue."""
    from conftest_grid import SHORT_GRID

    queue.put(washer_sweep.Plan(SHORT_GRID).evaluate(random_points(20))["ratio_max"].tolist())


def test_a_fork_after_use_works(short_plan):
    expected = short_plan.evaluate(random_points(20))["ratio_max"].tolist()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    process = context.Process(target=evaluate_in_child, args=(queue,))
    process.start()
    assert queue.get(timeout=60) == expected
    process.join(timeout=60)
    assert process.exitcode == 0


def test_sigterm_of_a_script_ends_it():
    script = ("import conftest_grid, washer_sweep\n"
              "grid = {**conftest_grid.SHORT_GRID, 'time': {'end_s': 500.0}}\n"
              "print('ready', flush=True)\n"
              "washer_sweep.Plan(grid).run(progress=False)\n")
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE,
                          cwd=os.path.dirname(__file__)) as process:
        process.stdout.readline()
        time.sleep(0.5)
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=5) == -signal.SIGTERM


def find_docstrings(body, owner=washer_sweep):
    """Yields the functions and methods of the stubs with their docstrings, without properties and
    special methods."""
    for node in body:
        if isinstance(node, ast.ClassDef):
            yield from find_docstrings(node.body, getattr(owner, node.name))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            if text := ast.get_docstring(node):
                is_property = any(getattr(of, "id", "") == "property" for of in node.decorator_list)
                if not is_property:
                    yield getattr(owner, node.name), text


def test_docstrings_are_those_of_the_stubs():
    stubs = pathlib.Path(washer_sweep.__file__).with_suffix(".pyi").read_text()
    found = list(find_docstrings(ast.parse(stubs).body))
    assert len(found) > 12
    for function, text in found:
        assert inspect.getdoc(function) == text, function
