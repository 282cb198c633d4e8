"""What the Python package costs beside the command: processor time of Fig. 12's 1287 points, by
`sweep run` and by `plan.evaluate`, in turns.

    python scripts/benchmarks/python_cost.py SWEEP_BINARY [ROUNDS]

Each is a process of its own, with all that it takes to start, read and, for the command, write the
result. Times are the sum over threads, in user and kernel mode. Then the parts of a call that are
not the engine's: the table read and checked, and all columns of eight rows made arrays.
"""

import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

GRID = pathlib.Path(__file__).resolve().parent.parent.parent / "sweeps/fig12.toml"
# The last line of what it prints: seconds of processor time that the call took.
CALL = f"""
import itertools, resource, numpy as np, washer_sweep
plan = washer_sweep.Plan.from_toml({str(GRID)!r})
points = np.array(list(itertools.product(np.linspace(0.05, 1, 39), np.linspace(60, 300, 33)))).T
table = dict(zip(plan.axes, points))
def used():
    now = resource.getrusage(resource.RUSAGE_SELF)
    return now.ru_utime + now.ru_stime
began = used()
result = plan.evaluate(table)
ratios = result["ratio_max"]
print(used() - began)
"""
PARTS = f"""
import itertools, timeit, numpy as np, washer_sweep
plan = washer_sweep.Plan.from_toml({str(GRID)!r})
points = np.array(list(itertools.product(np.linspace(0.05, 1, 39), np.linspace(60, 300, 33)))).T
points[0, -1] = 2
refused = dict(zip(plan.axes, points))
def check():
    try:
        plan.evaluate(refused)
    except washer_sweep.PlanError:
        pass
def least(work):
    return min(timeit.repeat(work, number=10, repeat=5)) / 10
some = plan.evaluate(dict(zip(plan.axes, points[:, :8])))
print(least(check), least(lambda: [some[name] for name in some.columns]))
"""


def used(words):
    """Seconds of processor time that a command takes, and what it prints."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, told


def main():
    """Measure and tell."""
    sweep, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    commands, calls = [], []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(rounds):
            out = pathlib.Path(folder, f"{k}.parquet")
            run = [sweep, "run", GRID, "--out", out, "--progress", "none"]
            commands.append(used(run)[0])
            calls.append(float(used([sys.executable, "-c", CALL])[1]))
    check, hand_over = map(float, used([sys.executable, "-c", PARTS])[1].split())
    command, call = statistics.median(commands), statistics.median(calls)
    print(f"sweep run      {command:.2f} s of processor time (of {rounds}: {min(commands):.2f} to "
          f"{max(commands):.2f})")
    print(f"plan.evaluate  {call:.2f} s ({min(calls):.2f} to {max(calls):.2f}), "
          f"{100 * (call / command - 1):+.1f} %")
    print(f"of that        {1e3 * check:.2f} ms to read and check the table, {1e3 * hand_over:.2f} "
          f"ms to hand over the columns: {100 * (check + hand_over) / call:.3f} %")


if __name__ == "__main__":
    main()
