"""Processor time of a command by thread name: scripts/benchmarks/thread_times.py
target/release/sweep run GRID.toml --fresh

A sweep's workers are called sweep-0, sweep-1, ...; they run the engine and nothing else. The main
thread does all the rest: chunks, their hashes, syncs and renames, progress, joining. Linux only.
What a thread does in its last milliseconds is missed.
"""

import subprocess
import sys
import time
from pathlib import Path

began = time.monotonic()
process = subprocess.Popen(sys.argv[1:])
threads: dict[str, tuple[str, float]] = {}
while process.poll() is None:
    for task in Path(f"/proc/{process.pid}/task").glob("*"):
        try:
            name = (task / "comm").read_text().strip()
            spent_ns = int((task / "schedstat").read_text().split()[0])
        except (OSError, IndexError):
            continue  # the thread ended between two looks
        threads[task.name] = ("main" if task.name == str(process.pid) else name, spent_ns / 1e9)
    time.sleep(0.005)

total = sum(spent for _, spent in threads.values())
print(f"{'wall':>10} {time.monotonic() - began:9.3f} s")
for name, spent in sorted(threads.values()):
    print(f"{name:>10} {spent:9.3f} s {100 * spent / total:6.2f} %")
sys.exit(process.returncode)
