#!/usr/bin/env python3
"""Counts the cache misses of an RK4 step in a first-level cache, simulated by valgrind's callgrind.

    python3 scripts/benchmarks/cache_misses.py [BENCH_BINARY]

Runs the benchmark `whole_trajectory` (`cargo bench --bench kernels`; built if no binary is given)
of both models with AVX2. Callgrind does not support AVX-512, whose kernels are the same with lanes
twice as wide. They are simulated as AVX2 with a cache and lines of half the size. Writes a table in
Markdown, in about ten minutes.
"""

import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

from kernel_profile import STEPS, build_benchmark

LINE_BYTES = 64
CACHES = {"32 KiB, 8 ways": (32768, 8), "48 KiB, 12 ways": (49152, 12)}
# The instruction sets, with the divisor of the sizes of cache and lines.
SIZE_DIVISORS = {"avx2": 1, "avx512": 2}
MODELS = ["Nonlinear", "Linear"]


def count_misses(binary, model, size_divisor, cache):
    """Returns the number of reads and writes that miss the cache, per step of all lanes."""
    size, ways = cache
    with tempfile.TemporaryDirectory() as folder:
        command = [
            "valgrind",
            "--tool=callgrind",
            "--cache-sim=yes",
            f"--D1={size // size_divisor},{ways},{LINE_BYTES // size_divisor}",
            f"--callgrind-out-file={folder}/out",
            binary,
            "--bench",
            rf"whole_trajectory::\({model}, Avx2\)",
            "--sample-count=1",
            "--sample-size=1",
        ]
        report = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    return int(re.search(r"D1 +misses: +([\d,]+)", report)[1].replace(",", "")) / STEPS


def main():
    binary = sys.argv[1] if len(sys.argv) > 1 else build_benchmark()
    models_and_sets = [(model, name) for name in SIZE_DIVISORS for model in MODELS]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        rows = [
            [
                pool.submit(count_misses, binary, model, SIZE_DIVISORS[name], cache)
                for cache in CACHES.values()
            ]
            for model, name in models_and_sets
        ]
        print("Lines of 64 bytes that a step of all lanes misses in a first-level cache of\n")
        print("| | " + " | ".join(CACHES) + " |")
        print("|---|" + "---:|" * len(CACHES))
        for (model, name), row in zip(models_and_sets, rows, strict=True):
            cells = [f"{future.result():.0f}" for future in row]
            print(f"| {model.lower()}, {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
