"""What memory a call of the Python package takes beside its table and its result.

    python scripts/benchmarks/python_memory.py ROWS

Rows are of trajectories of 0.05 s: what a row costs in memory does not go by its time.
"""

import resource
import sys
import time

import numpy as np
import pyarrow as pa

import washer_sweep

GRID = {
    "name": "many",
    "spin": {"profile": "ramp", "peak_rpm": 300, "ramp_s": 0.05},
    "time": {"end_s": 0.05},
    "axis": [
        {"parameter": "unbalance_mass_kg", "values": [0.1, 0.9]},
        {"parameter": "damping_n_s_per_m", "values": [60, 300]},
    ],
}


def peak_mb():
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main():
    """Measure and tell."""
    rows = int(sys.argv[1])
    plan = washer_sweep.Plan(GRID)
    rng = np.random.default_rng(1)
    table = pa.table({"unbalance_mass_kg": rng.uniform(0.1, 0.9, rows),
                      "damping_n_s_per_m": rng.uniform(60.0, 300.0, rows)})
    # Code and threads are there.
    plan.evaluate(table.slice(0, 1000))
    before, began = peak_mb(), time.perf_counter()
    result = plan.evaluate(table)
    took_s, more = time.perf_counter() - began, peak_mb() - before
    held = pa.table(result).nbytes / 2**20
    print(f"{rows} rows, {rows / took_s:.0f}/s: result {held:.1f} MB, {more - held:.1f} MB beside "
          "it and the table")


if __name__ == "__main__":
    main()
