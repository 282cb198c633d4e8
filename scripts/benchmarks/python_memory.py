"""Measures the memory of a call of the Python package beside its table and its result.

    python scripts/benchmarks/python_memory.py ROWS

The trajectories last 0.05 s, because the memory of a row does not depend on its duration.
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
    """Returns the peak memory of this process (MiB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main():
    """Measures a call and prints the result."""
    rows = int(sys.argv[1])
    plan = washer_sweep.Plan(GRID)
    rng = np.random.default_rng(1)
    table = pa.table({"unbalance_mass_kg": rng.uniform(0.1, 0.9, rows),
                      "damping_n_s_per_m": rng.uniform(60.0, 300.0, rows)})
    # The first call loads the code and starts the threads.
    plan.evaluate(table.slice(0, 1000))
    peak_before_mb, start_s = peak_mb(), time.perf_counter()
    result = plan.evaluate(table)
    elapsed_s, added_mb = time.perf_counter() - start_s, peak_mb() - peak_before_mb
    result_mb = pa.table(result).nbytes / 2**20
    print(f"{rows} rows, {rows / elapsed_s:.0f}/s: result {result_mb:.1f} MB, "
          f"{added_mb - result_mb:.1f} MB beside it and the table")


if __name__ == "__main__":
    main()
