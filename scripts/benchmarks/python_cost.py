"""Compares the costs of the Python package and of the command: the processor times of the 1287
points of Fig. 12 by `sweep run` and by `plan.evaluate`, in turns.

    python scripts/benchmarks/python_cost.py SWEEP_BINARY [ROUNDS]

Each runs in a separate process, whose time includes the start, the reading and, for the command,
the writing of the result. Times are sums over threads, in user and kernel mode. Then the script
measures the parts of a call outside of the engine: reading and checking the table, and converting
all columns of eight rows to arrays.
"""

import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

GRID = pathlib.Path(__file__).resolve().parent.parent.parent / "sweeps/fig12.toml"
# A script that prints the processor time of a call of `plan.evaluate` (s).
CALL_SCRIPT = f"""
import itertools, resource, numpy as np, washer_sweep
plan = washer_sweep.Plan.from_toml({str(GRID)!r})
points = np.array(list(itertools.product(np.linspace(0.05, 1, 39), np.linspace(60, 300, 33)))).T
table = dict(zip(plan.axes, points))
def processor_time_s():
    now = resource.getrusage(resource.RUSAGE_SELF)
    return now.ru_utime + now.ru_stime
start_s = processor_time_s()
result = plan.evaluate(table)
ratios = result["ratio_max"]
print(processor_time_s() - start_s)
"""
# A script that prints the least times to check a table and to convert the columns (s).
PARTS_SCRIPT = f"""
import itertools, timeit, numpy as np, washer_sweep
plan = washer_sweep.Plan.from_toml({str(GRID)!r})
points = np.array(list(itertools.product(np.linspace(0.05, 1, 39), np.linspace(60, 300, 33)))).T
points[0, -1] = 2
invalid_table = dict(zip(plan.axes, points))
def check():
    try:
        plan.evaluate(invalid_table)
    except washer_sweep.PlanError:
        pass
def least_time_s(function):
    return min(timeit.repeat(function, number=10, repeat=5)) / 10
result = plan.evaluate(dict(zip(plan.axes, points[:, :8])))
print(least_time_s(check), least_time_s(lambda: [result[name] for name in result.columns]))
"""


def run_measured(command):
    """Returns the processor time of a command (s) and its output."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, output


def main():
    """Measures both ways and prints the results."""
    sweep, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    command_times_s, call_times_s = [], []
    with tempfile.TemporaryDirectory() as folder:
        for round_number in range(rounds):
            output_file = pathlib.Path(folder, f"{round_number}.parquet")
            command = [sweep, "run", GRID, "--out", output_file, "--progress", "none"]
            command_times_s.append(run_measured(command)[0])
            call_times_s.append(float(run_measured([sys.executable, "-c", CALL_SCRIPT])[1]))
    part_times = run_measured([sys.executable, "-c", PARTS_SCRIPT])[1]
    check_s, conversion_s = map(float, part_times.split())
    command_s, call_s = statistics.median(command_times_s), statistics.median(call_times_s)
    print(f"sweep run      {command_s:.2f} s of processor time "
          f"(of {rounds}: {min(command_times_s):.2f} to {max(command_times_s):.2f})")
    print(f"plan.evaluate  {call_s:.2f} s ({min(call_times_s):.2f} to {max(call_times_s):.2f}), "
          f"{100 * (call_s / command_s - 1):+.1f} %")
    print(f"of that        {1e3 * check_s:.2f} ms to read and check the table, "
          f"{1e3 * conversion_s:.2f} ms to convert the columns: "
          f"{100 * (check_s + conversion_s) / call_s:.3f} %")


if __name__ == "__main__":
    main()
