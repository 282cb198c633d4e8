"""Measures the processor time of a command by thread.

    scripts/benchmarks/thread_times.py target/release/sweep run GRID.toml --fresh

The worker threads of a sweep have the names sweep-0, sweep-1, ... and run only the engine. The main
thread does the other work: it writes, hashes, syncs, renames and joins chunks, and shows progress.
The last milliseconds of a thread are not measured. Works on Linux only.
"""

import subprocess
import sys
import time
from pathlib import Path

start_s = time.monotonic()
process = subprocess.Popen(sys.argv[1:])
time_by_thread: dict[str, tuple[str, float]] = {}
while process.poll() is None:
    for task in Path(f"/proc/{process.pid}/task").glob("*"):
        try:
            name = (task / "comm").read_text().strip()
            spent_ns = int((task / "schedstat").read_text().split()[0])
        except (OSError, IndexError):
            continue  # the thread ended after the listing
        thread_name = "main" if task.name == str(process.pid) else name
        time_by_thread[task.name] = (thread_name, spent_ns / 1e9)
    time.sleep(0.005)

total_s = sum(processor_time_s for _, processor_time_s in time_by_thread.values())
print(f"{'wall':>10} {time.monotonic() - start_s:9.3f} s")
for name, processor_time_s in sorted(time_by_thread.values()):
    print(f"{name:>10} {processor_time_s:9.3f} s {100 * processor_time_s / total_s:6.2f} %")
sys.exit(process.returncode)
