#!/usr/bin/env python3
"""How often a step of RK4 misses the first-level cache, simulated by valgrind's callgrind.

    python3 scripts/benchmarks/cache_misses.py [BENCH_BINARY]

Runs the benchmark `whole_trajectory` (`cargo bench --bench kernels`; built if no binary is given)
of both models by AVX2. Callgrind does not know AVX-512, which has the same kernels with lanes twice
as wide: a cache and lines of half the size stand for that. Writes a Markdown table, in ten minutes
or so.
"""

import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

from kernel_profile import STEPS, built

LINE = 64  # bytes
CACHES = {"32 KiB, 8 ways": (32768, 8), "48 KiB, 12 ways": (49152, 12)}
SETS = {"avx2": 1, "avx512": 2}
MODELS = ["Nonlinear", "Linear"]


def misses(binary, model, narrower, cache):
    """Reads and writes that miss in a step of all lanes."""
    size, ways = cache
    with tempfile.TemporaryDirectory() as folder:
        command = [
            "valgrind",
            "--tool=callgrind",
            "--cache-sim=yes",
            f"--D1={size // narrower},{ways},{LINE // narrower}",
            f"--callgrind-out-file={folder}/out",
            binary,
            "--bench",
            rf"whole_trajectory::\({model}, Avx2\)",
            "--sample-count=1",
            "--sample-size=1",
        ]
        found = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    return int(re.search(r"D1 +misses: +([\d,]+)", found)[1].replace(",", "")) / STEPS


def main():
    binary = sys.argv[1] if len(sys.argv) > 1 else built()
    kinds = [(model, name) for name in SETS for model in MODELS]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        rows = [
            [pool.submit(misses, binary, model, SETS[name], cache) for cache in CACHES.values()]
            for model, name in kinds
        ]
        print("Lines of 64 bytes that a step of all lanes misses in a first-level cache of\n")
        print("| | " + " | ".join(CACHES) + " |")
        print("|---|" + "---:|" * len(CACHES))
        for (model, name), row in zip(kinds, rows, strict=True):
            cells = [f"{found.result():.0f}" for found in row]
            print(f"| {model.lower()}, {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
