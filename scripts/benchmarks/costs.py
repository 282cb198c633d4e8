#!/usr/bin/env python3
"""What features, many points and a build cost: writes the tables of docs/friction.md,
docs/scaling.md and docs/building.md.

    scripts/tools/python.sh scripts/benchmarks/costs.py SWEEP_BINARY [PART ...]

Parts: elements, points, build. Processor times are told, which other work on the machine disturbs
less than it does the wall's. With CHECK=1 it runs on little, and prints; in CI.
"""

import math
import pathlib
import re
import statistics
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import pyarrow.parquet as pq
from measured import IS_CHECK, ROOT, Spent, figure, put, run, said, table

# The machine of docs/friction.md, by its tables.
TABLES = re.split(r"\n(?=\[)", (ROOT / "docs/examples/friction.toml").read_text())
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
# Maps by the fast method and by plain rk4, and masses of the grids that show what files cost.
FAST, PLAIN = ("quick", "quick") if IS_CHECK else ("fig12", "fig12_reference")
SPEEDS = "240:260:10" if IS_CHECK else "210:350:1"
MASSES = (100, 300) if IS_CHECK else (1000, 10_000)


def with_elements(names):
    """The machine with these kinds of elements alone."""
    kept = []
    for text in TABLES:
        head = text.split("]")[0].lstrip("[")
        if head in ("stops", "bushings") and head not in names:
            continue
        if head == "dampers" and "friction" not in names:
            text = text.replace("damping_n_s_per_m = 10.0 ", "damping_n_s_per_m = 100.0 ")
            text = re.sub(r"friction_n = \S+", "friction_n = 0.0", text)
        if head == "springs" and "springs" in names:
            text += "\ncubic_n_per_m3 = 1e6"
        kept.append(text)
    return "\n".join(kept)


def elements(sweep, folder):
    """Each feature for a machine with each kind of element, and a row with friction."""
    grid, point = folder / "elements.toml", ("--at", "unbalance_mass_kg=0.4")
    speeds = ("--speed", "200:300:10")
    grid.write_text(RUN_UP)
    result, page = folder / "elements.parquet", folder / "elements.html"

    def fresh(name):
        return "--out", folder / f"{name}.parquet", "--fresh"

    commands = {
        "run": ("run", grid, *fresh("elements")),
        "trace": ("trace", grid, *point, "--out", folder / "trace.parquet"),
        "modes": ("modes", grid),
        "stability": ("stability", grid, *point, *speeds, *fresh("speeds")),
        "dwell": ("dwell", grid, *point, "--speed", "250", *fresh("held")),
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
        (folder / "machine.toml").write_text(with_elements(names))
        spent = [figure(Spent(sweep, *command).core_s) for command in commands.values()]
        rows.append([kind, *spent])
        print(rows[-1], file=sys.stderr, flush=True)
    a_row_ms = {"fig12": [], "friction": []}
    for _ in range(ROUNDS):
        for name, found in a_row_ms.items():
            core_s = Spent(sweep, "run", f"sweeps/{name}.toml", *fresh("map")).core_s
            found.append(1e3 * core_s / rows_in(folder / "map.parquet"))
    per_row_ms = {name: statistics.median(found) for name, found in a_row_ms.items()}
    ratio = per_row_ms["friction"] / per_row_ms["fig12"]
    put(
        "docs/friction.md",
        "elements",
        f"A row of `sweeps/friction.toml` takes {figure(ratio)} times as long as one of "
        f"`sweeps/fig12.toml` ({figure(per_row_ms['friction'])} and "
        f"{figure(per_row_ms['fig12'])} core-milliseconds, three runs of each in turns): "
        "each hard hit of a stop amplifies errors, which takes short steps. Core-seconds:",
        table(["element", *(f"`{name}`" for name in commands)], rows),
        said(),
    )


def rows_in(result):
    """How many a file has."""
    return pq.read_metadata(result).num_rows


def of_threads(sweep, words, result):
    """A run's time on the wall (s), its core-seconds, and the main thread's share of these."""
    command = [sys.executable, "scripts/benchmarks/thread_times.py", sweep, *words.split()]
    text = run(*command, "--fresh", "--out", result, "--progress", "none")
    spent = re.findall(r"^ *(\S+) +(\S+) s +\S+ %$", text, re.MULTILINE)
    total_s = sum(float(seconds) for _, seconds in spent)
    main_s = sum(float(seconds) for name, seconds in spent if name == "main")
    return float(re.search(r"wall +(\S+) s", text)[1]), total_s, main_s / total_s


def second_thread(sweep, folder):
    """What a second thread gains, beside what the machine gives to a second process."""
    def by(threads, place=0):
        words = ("run", f"sweeps/{FAST}.toml", "--threads", threads, "--progress", "none")
        return Spent(sweep, *words, "--fresh", "--out", folder / f"second-{place}.parquet").wall_s

    def side_by_side():
        with ThreadPoolExecutor() as both:
            return statistics.mean(both.map(by, (1, 1), (1, 2)))

    rounds = [(by(1), by(2), side_by_side()) for _ in range(ROUNDS)]
    alone_s, two_s, beside_s = map(statistics.median, zip(*rounds))
    return [
        ["a second thread", f"{figure(alone_s / two_s)} times as quick ({figure(alone_s)} s, "
         f"{figure(two_s)} s)", f"`sweep run sweeps/{FAST}.toml --threads 1`, and 2"],
        ["a second process at once, a thread each", f"{figure(2 * alone_s / beside_s)} times the "
         f"work ({figure(beside_s)} s)", "the same, `--threads 1` twice"],
    ]


def files(sweep, folder):
    """What points cost, and what files of a million and of ten million rows cost beside them."""
    rows, per_core_s, shares = [], [], []
    methods = {
        "`rk4-mass-scaled`, accuracy 1e-3, checks included": f"run sweeps/{FAST}.toml",
        "`rk4`, step 2e-4 s": f"run sweeps/{PLAIN}.toml",
    }
    for method, words in methods.items():
        wall_s, core_s, share = of_threads(sweep, words, folder / "threads.parquet")
        count = rows_in(folder / "threads.parquet")
        per_core_s.append(count / core_s)
        shares.append(f"{100 * share:.2f} %")
        rows.append([f"a point, {method}",
                     f"{figure(count / core_s)} a core-second ({count} in {core_s:.1f} core-s, "
                     f"{wall_s:.2f} s)",
                     f"`thread_times.py` of `sweep {words}`"])
    rows.append(["chunks, hashes, syncs, progress and join",
                 ", ".join(shares) + " of these times", "the same: the main thread"])
    rows += second_thread(sweep, folder)
    words, result = f"stability sweeps/{FAST}.toml --speed {SPEEDS}", folder / "speeds.parquet"
    spent = Spent(sweep, *words.split(), "--out", result, "--fresh")
    rows.append([f"stability of {rows_in(result)} responses",
                 told(spent, result.stat().st_size / 1e6), f"`sweep {words}`"])
    few, many = (folder / f"{count}.toml" for count in MASSES)
    for grid, count in zip((few, many), MASSES):
        million = (ROOT / "sweeps/million.toml").read_text()
        grid.write_text(million.replace("count = 1000", f"count = {count}", 1))
    grid, result = few, folder / "few.parquet"
    whole = Spent(sweep, "run", grid, "--out", result, "--fresh")
    result_mb = result.stat().st_size / 1e6
    rows.append(["a million rows", told(whole, result_mb), "`sweep run sweeps/million.toml`"])
    result = folder / "shards.parquet"
    shards = [Spent(sweep, "run", grid, "--out", result, "--shard", f"{k}/{SHARDS}")
              for k in range(1, SHARDS + 1)]
    chunks_mb = in_chunks_mb(result)
    merged = Spent(sweep, "merge", grid, "--out", result)
    core_s = sum(shard.core_s for shard in shards)
    rows.append([f"the same by {SHARDS} shards, one after the other",
                 f"{figure(core_s)} core-s, {figure(chunks_mb)} MB of chunks",
                 f"`--shard K/{SHARDS}`"])
    rows.append(["their merge", told(merged, result_mb), "`sweep merge sweeps/million.toml`"])
    parts = in_two(sweep, grid, folder / "few.parquet", 0.5 * chunks_mb)
    rows.append(["a million, interrupted in the middle and resumed", told(parts, result_mb),
                 "`sweep run`, SIGINT, the same again"])
    result = folder / "many.parquet"
    parts = in_two(sweep, many, result, 0.5 * chunks_mb * MASSES[1] / MASSES[0])
    rows.append(["ten million, interrupted in the middle and resumed",
                 told(parts, result.stat().st_size / 1e6), "the same, of 10,000 masses"])
    put("docs/scaling.md", "points", table(["what", "figure", "command"], rows), said())
    put("docs/scaling.md", "estimates", *estimates(per_core_s, chunks_mb, result_mb, merged.core_s))


def in_chunks_mb(result):
    """What a run that is under way has written."""
    parts = result.with_name(f"{result.name}.partial").glob("part-*.parquet")
    return sum(path.stat().st_size for path in parts) / 1e6


def in_two(sweep, grid, result, half_mb):
    """A run that is interrupted, and resumed."""
    half = Spent(sweep, "run", grid, "--out", result, "--fresh",
                 is_enough=lambda: in_chunks_mb(result) >= half_mb)
    rest = Spent(sweep, "run", grid, "--out", result)
    rest.wall_s += half.wall_s
    rest.core_s += half.core_s
    rest.memory_mb = max(half.memory_mb, rest.memory_mb)
    return rest


def told(spent, result_mb):
    """Time, memory and size of a run."""
    return (f"{figure(spent.wall_s)} s, {figure(spent.core_s)} core-s, "
            f"{figure(spent.memory_mb)} MB of memory, {figure(result_mb)} MB written")


def duration(seconds):
    """In a unit of a clock or a calendar."""
    for unit, length_s in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 1.5 * length_s:
            return f"{figure(seconds / length_s)} {unit}"
    return f"{figure(seconds)} s"


def estimates(per_core_s, chunks_mb, result_mb, join_s):
    """What a million and a billion points of 50 s would cost."""
    fast, plain = per_core_s
    chunks = [(1e6, 1024), (1e9, 4096)]
    whole = [(count, math.ceil(count / size), size) for count, size in chunks]
    rows = [
        ["core-time, and 1 core", *(duration(count / fast) for count, _ in chunks)],
        ["100 cores", *(duration(count / fast / 100) for count, _ in chunks)],
        ["10,000 cores", *(
            f"{duration(rounds * size / fast)}: {rounds} of the chunks a core, "
            f"{figure(size / fast)} s each"
            for _, number, size in whole
            for rounds in [math.ceil(number / 1e4)]
        )],
        ["chunks", *(f"{number} of {size} points, {figure(count / 1e9 * chunks_mb)} GB"
                     for count, number, size in whole)],
        ["result", *(f"{figure(count / 1e9 * result_mb)} GB" for count, _ in chunks)],
        ["join, one core", *(duration(count / 1e6 * join_s) for count, _ in chunks)],
    ]
    return (f"By the fast method; plain `rk4` takes {figure(fast / plain)} times the core-time.",
            table(["", "10^6 points", "10^9 points"], rows))


def minutes(spent):
    """Of the cores, and on the wall."""
    whole, seconds = divmod(round(spent.wall_s), 60)
    return f"{spent.core_s / 60:.1f} core-minutes, {whole}:{seconds:02} min"


def build(_, folder):
    """The program from nothing, and what it is made of."""
    spent = Spent("cargo", "build", "--release", "--locked", "-p", "sweep", "--target-dir", folder)
    program, stripped = folder / "release/sweep", folder / "stripped"
    run("strip", "-o", stripped, program)
    sizes = [f"{path.stat().st_size / 1e6:.1f} MB" for path in (program, stripped)]

    def crates(package):
        tree = run("cargo", "tree", "--locked", "-p", package, "-e", "normal", "--prefix", "none")
        return len({line.split(" (")[0] for line in tree.splitlines()})

    wheel = Spent("env", f"CARGO_TARGET_DIR={folder}/wheel", sys.executable, "-m", "pip", "wheel",
                  "--no-deps", "-w", folder, ".")

    tree = "`cargo tree -p sweep -e normal --prefix none \\| sed 's/ (.*//' \\| sort -u \\| wc -l`"
    rows = [
        ["crates in the binary, ours included", crates("sweep"), tree],
        ["`lane-ode` alone", crates("lane-ode"), "the same with `-p lane-ode`"],
        ["`washer-model` alone, most of them of faer, the linear algebra",
         crates("washer-model"), "the same with `-p washer-model`"],
        ["the binary, and without symbols", ", ".join(sizes),
         "`ls -l target/release/sweep`, and after `strip`"],
        ["from an empty target folder", minutes(spent),
         "`time cargo build --release --locked -p sweep`"],
        ["the Python package, the same", minutes(wheel), "`time pip wheel --no-deps .`"],
    ]
    put("docs/building.md", "build", table(["what", "figure", "command"], rows), said())


PARTS = {"elements": elements, "points": files, "build": build}


def main():
    """Measure, and put the tables into their pages."""
    sweep, *parts = sys.argv[1:]
    for part in parts or PARTS:
        with tempfile.TemporaryDirectory() as folder:
            PARTS[part](pathlib.Path(sweep).resolve(), pathlib.Path(folder))


if __name__ == "__main__":
    main()
