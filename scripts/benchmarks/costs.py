#!/usr/bin/env python3
"""Measures the costs of features, of many points and of a build, and writes the tables of
docs/friction.md, docs/scaling.md and docs/building.md.

    scripts/tools/python.sh scripts/benchmarks/costs.py SWEEP_BINARY [PART ...]

Parts: elements, points, build. Times are processor times, which other work on the machine disturbs
less than wall times. With CHECK=1, as in CI, the script does little work and prints the tables.
"""

import math
import pathlib
import re
import statistics
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import pyarrow.parquet as pq
from measured import (
    IS_CHECK,
    ROOT,
    MeasuredCommand,
    format_number,
    markdown_table,
    measurement_note,
    run_command,
    write_between_marks,
)

# The tables of the machine file of docs/friction.md.
MACHINE_TABLES = re.split(r"\n(?=\[)", (ROOT / "docs/examples/friction.toml").read_text())
RUN_UP = """name = "elements"
machine = "machine.toml"

[spin]
profile = "ramp"
peak_rpm = 350.0
ramp_s = 6.0

[time]
end_s = 6.0

[[axis]]
parameter = "unbalance_mass_kg"
values = [0.2, 0.4]
"""
SHARDS = 3 if IS_CHECK else 64
ROUNDS = 1 if IS_CHECK else 3
# The grid files of a map by the fast method and by plain rk4.
FAST_GRID = "quick" if IS_CHECK else "fig12"
PLAIN_GRID = "quick" if IS_CHECK else "fig12_reference"
SPEEDS = "240:260:10" if IS_CHECK else "210:350:1"
# The numbers of unbalance masses in the grids of a million and of ten million rows.
MASSES = (100, 300) if IS_CHECK else (1000, 10_000)


def machine_with_elements(names):
    """Returns the machine file with only the named kinds of elements."""
    kept_tables = []
    for text in MACHINE_TABLES:
        table_name = text.split("]")[0].lstrip("[")
        if table_name in ("stops", "bushings") and table_name not in names:
            continue
        if table_name == "dampers" and "friction" not in names:
            text = text.replace("damping_n_s_per_m = 10.0 ", "damping_n_s_per_m = 100.0 ")
            text = re.sub(r"friction_n = \S+", "friction_n = 0.0", text)
        if table_name == "springs" and "springs" in names:
            text += "\ncubic_n_per_m3 = 1e6"
        kept_tables.append(text)
    return "\n".join(kept_tables)


def measure_elements(sweep, folder):
    """Measures each command for machines with each kind of element, and the time of a row with
    friction."""
    grid, point = folder / "elements.toml", ("--at", "unbalance_mass_kg=0.4")
    speeds = ("--speed", "200:300:10")
    grid.write_text(RUN_UP)
    result, page = folder / "elements.parquet", folder / "elements.html"

    def output_options(name):
        return "--out", folder / f"{name}.parquet", "--fresh"

    commands = {
        "run": ("run", grid, *output_options("elements")),
        "trace": ("trace", grid, *point, "--out", folder / "trace.parquet"),
        "modes": ("modes", grid),
        "stability": ("stability", grid, *point, *speeds, *output_options("speeds")),
        "dwell": ("dwell", grid, *point, "--speed", "250", *output_options("held")),
        "explain": ("explain", grid, *point, *speeds),
        "plot --live": ("plot", result, "--live", "-o", page),
    }
    kinds = {
        "none": (),
        "friction": ("friction",),
        "stops": ("stops",),
        "gasket": ("bushings",),
        "stiffening springs": ("springs",),
        "all of these": ("friction", "stops", "bushings", "springs"),
    }
    if IS_CHECK:
        kinds = {kind: kinds[kind] for kind in ("none", "all of these")}
    rows = []
    for kind, names in kinds.items():
        (folder / "machine.toml").write_text(machine_with_elements(names))
        core_times_s = [MeasuredCommand(sweep, *command).core_s for command in commands.values()]
        rows.append([kind, *map(format_number, core_times_s)])
        print(rows[-1], file=sys.stderr, flush=True)
    times_by_grid_ms = {"fig12": [], "friction": []}
    for _ in range(ROUNDS):
        for name, row_times_ms in times_by_grid_ms.items():
            words = ("run", f"sweeps/{name}.toml", *output_options("map"))
            core_s = MeasuredCommand(sweep, *words).core_s
            row_times_ms.append(1e3 * core_s / count_rows(folder / "map.parquet"))
    per_row_ms = {name: statistics.median(times) for name, times in times_by_grid_ms.items()}
    ratio = per_row_ms["friction"] / per_row_ms["fig12"]
    write_between_marks(
        "docs/friction.md",
        "elements",
        f"A row of `sweeps/friction.toml` takes {format_number(ratio)} times as long as one of "
        f"`sweeps/fig12.toml` ({format_number(per_row_ms['friction'])} and "
        f"{format_number(per_row_ms['fig12'])} core-milliseconds, three runs of each in turns): "
        "each hard hit of a stop amplifies errors, which takes short steps. Core-seconds:",
        markdown_table(["element", *(f"`{name}`" for name in commands)], rows),
        measurement_note(),
    )


def count_rows(result):
    """Returns the number of rows of a result file."""
    return pq.read_metadata(result).num_rows


def measure_threads(sweep, words, result):
    """Measures the wall time of a run (s), its core-seconds, and the main thread's share."""
    command = [sys.executable, "scripts/benchmarks/thread_times.py", sweep, *words.split()]
    text = run_command(*command, "--fresh", "--out", result, "--progress", "none")
    thread_times = re.findall(r"^ *(\S+) +(\S+) s +\S+ %$", text, re.MULTILINE)
    total_s = sum(float(seconds) for _, seconds in thread_times)
    main_s = sum(float(seconds) for name, seconds in thread_times if name == "main")
    return float(re.search(r"wall +(\S+) s", text)[1]), total_s, main_s / total_s


def measure_second_thread(sweep, folder):
    """Measures the gain by a second thread, and by a second process at the same time."""

    def measure_wall_s(threads, output_number=0):
        words = ("run", f"sweeps/{FAST_GRID}.toml", "--threads", threads, "--progress", "none")
        result = folder / f"second-{output_number}.parquet"
        return MeasuredCommand(sweep, *words, "--fresh", "--out", result).wall_s

    def measure_two_processes_s():
        with ThreadPoolExecutor() as pool:
            return statistics.mean(pool.map(measure_wall_s, (1, 1), (1, 2)))

    rounds = [
        (measure_wall_s(1), measure_wall_s(2), measure_two_processes_s()) for _ in range(ROUNDS)
    ]
    one_thread_s, two_threads_s, two_processes_s = map(statistics.median, zip(*rounds))
    thread_gain = format_number(one_thread_s / two_threads_s)
    process_gain = format_number(2 * one_thread_s / two_processes_s)
    return [
        ["a second thread", f"{thread_gain} times as quick ({format_number(one_thread_s)} s, "
         f"{format_number(two_threads_s)} s)",
         f"`sweep run sweeps/{FAST_GRID}.toml --threads 1`, and 2"],
        ["a second process at once, a thread each", f"{process_gain} times the "
         f"work ({format_number(two_processes_s)} s)", "the same, `--threads 1` twice"],
    ]


def measure_points(sweep, folder):
    """Measures the costs of points, and of files of a million and of ten million rows."""
    rows, points_per_core_s, main_thread_shares = [], [], []
    methods = {
        "`rk4-mass-scaled`, accuracy 1e-3, checks included": f"run sweeps/{FAST_GRID}.toml",
        "`rk4`, step 2e-4 s": f"run sweeps/{PLAIN_GRID}.toml",
    }
    for method, words in methods.items():
        wall_s, core_s, share = measure_threads(sweep, words, folder / "threads.parquet")
        count = count_rows(folder / "threads.parquet")
        points_per_core_s.append(count / core_s)
        main_thread_shares.append(f"{100 * share:.2f} %")
        rows.append([f"a point, {method}",
                     f"{format_number(count / core_s)} a core-second "
                     f"({count} in {core_s:.1f} core-s, {wall_s:.2f} s)",
                     f"`thread_times.py` of `sweep {words}`"])
    rows.append(["chunks, hashes, syncs, progress and join",
                 ", ".join(main_thread_shares) + " of these times", "the same: the main thread"])
    rows += measure_second_thread(sweep, folder)
    words = f"stability sweeps/{FAST_GRID}.toml --speed {SPEEDS}"
    result = folder / "speeds.parquet"
    stability = MeasuredCommand(sweep, *words.split(), "--out", result, "--fresh")
    rows.append([f"stability of {count_rows(result)} responses",
                 describe_run(stability, result.stat().st_size / 1e6), f"`sweep {words}`"])
    small_grid, large_grid = (folder / f"{count}.toml" for count in MASSES)
    for grid, count in zip((small_grid, large_grid), MASSES):
        grid_text = (ROOT / "sweeps/million.toml").read_text()
        grid.write_text(grid_text.replace("count = 1000", f"count = {count}", 1))
    grid, result = small_grid, folder / "few.parquet"
    whole_run = MeasuredCommand(sweep, "run", grid, "--out", result, "--fresh")
    result_mb = result.stat().st_size / 1e6
    rows.append(["a million rows", describe_run(whole_run, result_mb),
                 "`sweep run sweeps/million.toml`"])
    result = folder / "shards.parquet"
    shards = [MeasuredCommand(sweep, "run", grid, "--out", result, "--shard", f"{k}/{SHARDS}")
              for k in range(1, SHARDS + 1)]
    chunks_mb = measure_chunks_mb(result)
    merge = MeasuredCommand(sweep, "merge", grid, "--out", result)
    core_s = sum(shard.core_s for shard in shards)
    rows.append([f"the same by {SHARDS} shards, one after the other",
                 f"{format_number(core_s)} core-s, {format_number(chunks_mb)} MB of chunks",
                 f"`--shard K/{SHARDS}`"])
    rows.append(["their merge", describe_run(merge, result_mb),
                 "`sweep merge sweeps/million.toml`"])
    resumed_run = measure_resumed_run(sweep, grid, folder / "few.parquet", 0.5 * chunks_mb)
    rows.append(["a million, interrupted in the middle and resumed",
                 describe_run(resumed_run, result_mb), "`sweep run`, SIGINT, the same again"])
    result = folder / "many.parquet"
    half_mb = 0.5 * chunks_mb * MASSES[1] / MASSES[0]
    resumed_run = measure_resumed_run(sweep, large_grid, result, half_mb)
    rows.append(["ten million, interrupted in the middle and resumed",
                 describe_run(resumed_run, result.stat().st_size / 1e6),
                 "the same, of 10,000 masses"])
    table = markdown_table(["what", "figure", "command"], rows)
    write_between_marks("docs/scaling.md", "points", table, measurement_note())
    paragraphs = estimate_costs(points_per_core_s, chunks_mb, result_mb, merge.core_s)
    write_between_marks("docs/scaling.md", "estimates", *paragraphs)


def measure_chunks_mb(result):
    """Returns the size of the chunks that an unfinished run has written (MB)."""
    parts = result.with_name(f"{result.name}.partial").glob("part-*.parquet")
    return sum(path.stat().st_size for path in parts) / 1e6


def measure_resumed_run(sweep, grid, result, half_mb):
    """Measures a run that is interrupted after `half_mb` of chunks and then resumed."""
    first_part = MeasuredCommand(sweep, "run", grid, "--out", result, "--fresh",
                                 is_enough=lambda: measure_chunks_mb(result) >= half_mb)
    second_part = MeasuredCommand(sweep, "run", grid, "--out", result)
    second_part.wall_s += first_part.wall_s
    second_part.core_s += first_part.core_s
    second_part.memory_mb = max(first_part.memory_mb, second_part.memory_mb)
    return second_part


def describe_run(command, result_mb):
    """Describes the time, the memory and the output size of a run."""
    return (f"{format_number(command.wall_s)} s, {format_number(command.core_s)} core-s, "
            f"{format_number(command.memory_mb)} MB of memory, "
            f"{format_number(result_mb)} MB written")


def format_duration(seconds):
    """Formats a duration in days, hours, minutes or seconds."""
    for unit, length_s in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 1.5 * length_s:
            return f"{format_number(seconds / length_s)} {unit}"
    return f"{format_number(seconds)} s"


def estimate_costs(points_per_core_s, chunks_mb, result_mb, join_s):
    """Estimates the costs of a million and of a billion points of 50 s."""
    fast, plain = points_per_core_s
    # The number of points, and of points in a chunk.
    chunk_sizes = [(1e6, 1024), (1e9, 4096)]
    chunk_counts = [(count, math.ceil(count / size), size) for count, size in chunk_sizes]
    rows = [
        ["core-time, and 1 core", *(format_duration(count / fast) for count, _ in chunk_sizes)],
        ["100 cores", *(format_duration(count / fast / 100) for count, _ in chunk_sizes)],
        ["10,000 cores", *(
            f"{format_duration(rounds * size / fast)}: {rounds} of the chunks a core, "
            f"{format_number(size / fast)} s each"
            for _, number, size in chunk_counts
            for rounds in [math.ceil(number / 1e4)]
        )],
        ["chunks", *(f"{number} of {size} points, {format_number(count / 1e9 * chunks_mb)} GB"
                     for count, number, size in chunk_counts)],
        ["result", *(f"{format_number(count / 1e9 * result_mb)} GB" for count, _ in chunk_sizes)],
        ["join, one core", *(format_duration(count / 1e6 * join_s) for count, _ in chunk_sizes)],
    ]
    ratio = format_number(fast / plain)
    return (f"By the fast method; plain `rk4` takes {ratio} times the core-time.",
            markdown_table(["", "10^6 points", "10^9 points"], rows))


def format_minutes(command):
    """Formats the core-time and the wall time of a command in minutes."""
    minutes, seconds = divmod(round(command.wall_s), 60)
    return f"{command.core_s / 60:.1f} core-minutes, {minutes}:{seconds:02} min"


def measure_build(_, folder):
    """Measures a build from an empty target folder, and counts the crates of the program."""
    program_build = MeasuredCommand(
        "cargo", "build", "--release", "--locked", "-p", "sweep", "--target-dir", folder
    )
    program, stripped = folder / "release/sweep", folder / "stripped"
    run_command("strip", "-o", stripped, program)
    sizes = [f"{path.stat().st_size / 1e6:.1f} MB" for path in (program, stripped)]

    def count_crates(package):
        tree = run_command(
            "cargo", "tree", "--locked", "-p", package, "-e", "normal", "--prefix", "none"
        )
        return len({line.split(" (")[0] for line in tree.splitlines()})

    wheel_build = MeasuredCommand(
        "env", f"CARGO_TARGET_DIR={folder}/wheel", sys.executable, "-m", "pip", "wheel",
        "--no-deps", "-w", folder, "."
    )

    tree_command = ("`cargo tree -p sweep -e normal --prefix none \\| sed 's/ (.*//' "
                    "\\| sort -u \\| wc -l`")
    rows = [
        ["crates in the binary, ours included", count_crates("sweep"), tree_command],
        ["`lane-ode` alone", count_crates("lane-ode"), "the same with `-p lane-ode`"],
        ["`washer-model` alone, most of them of faer, the linear algebra",
         count_crates("washer-model"), "the same with `-p washer-model`"],
        ["the binary, and without symbols", ", ".join(sizes),
         "`ls -l target/release/sweep`, and after `strip`"],
        ["from an empty target folder", format_minutes(program_build),
         "`time cargo build --release --locked -p sweep`"],
        ["the Python package, the same", format_minutes(wheel_build),
         "`time pip wheel --no-deps .`"],
    ]
    table = markdown_table(["what", "figure", "command"], rows)
    write_between_marks("docs/building.md", "build", table, measurement_note())


MEASUREMENTS = {"elements": measure_elements, "points": measure_points, "build": measure_build}


def main():
    """Measures the requested parts and writes their tables into the pages."""
    sweep, *parts = sys.argv[1:]
    for part in parts or MEASUREMENTS:
        with tempfile.TemporaryDirectory() as folder:
            MEASUREMENTS[part](pathlib.Path(sweep).resolve(), pathlib.Path(folder))


if __name__ == "__main__":
    main()
