#!/usr/bin/env python3
"""Runs every program of the comparison in turns and writes the table and the work-precision
diagram: called by run.sh, which says how."""

import json
import os
import pathlib
import platform
import re
import statistics
import subprocess
import sys
import time

import matplotlib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
WORK = ROOT / "target/peers"
# A check runs everything once for a trajectory of a second, and keeps what it writes to itself.
IS_CHECK = "END_S" in os.environ
OUT = WORK if IS_CHECK else ROOT / "results/benchmarks"
SWEEP = ROOT / "target/release/examples/trajectory"
PYTHON = [sys.executable, str(ROOT / "scripts/peers/python_peers.py")]
SLOW_S = 10.0
# Converged: half of its step changes the result by less than 1e-9 of it, which the table shows.
REFERENCE = "step 2.5e-5 s"


def instruction_sets():
    """The widest first, as this machine has them."""
    listed = [name for name in ["avx512", "avx2", "neon", "scalar"] if has(name)]
    return listed, listed[0]


def has(name):
    return subprocess.run([SWEEP, name, "rk4", "0.01"], capture_output=True).returncode != 2


def commands():
    sets, best = instruction_sets()
    sweep = [[SWEEP, name, "rk4", "2.5e-4"] for name in sets]
    sweep += [[SWEEP, best, "rk4", step] for step in ["1e-4", "5e-5", "2.5e-5"]]
    adaptive = [
        ("1e-3", "1e-6"),
        ("1e-4", "1e-7"),
        ("1e-5", "1e-8"),
        ("1e-6", "1e-9"),
        ("1e-7", "1e-10"),
    ]
    sweep += [
        [SWEEP, name, "rk4-mass-scaled", accuracy]
        for accuracy in ["1e-3", "1e-4", "1e-6"]
        for name in sets
    ]
    sweep += [[SWEEP, best, "dopri5", *pair] for pair in adaptive[1:4:2]]
    loose = [("3e-2", "3e-5"), ("1e-2", "1e-5"), ("3e-3", "3e-6")]
    sweep += [[SWEEP, "scalar", "rodas5p", *pair] for pair in [*loose, *adaptive[:4]]]
    cvode = [[WORK / "cvode", "bdf", "2", *pair] for pair in adaptive[:4]]
    cvode += [[WORK / "cvode", "bdf", "5", *pair] for pair in adaptive[1:]]
    cvode += [[WORK / "cvode", "adams", "12", *pair] for pair in adaptive[1:4:2]]
    odeint = [[WORK / "odeint", *pair] for pair in adaptive[:4]]
    lsoda = [[*PYTHON, "numbalsoda", *pair] for pair in adaptive[:4]]
    scipy = [[*PYTHON, "radau", *pair] for pair in adaptive[:3]]
    scipy += [[*PYTHON, "lsoda", *pair] for pair in adaptive[:4:3]]
    scipy += [[*PYTHON, "rk45", *adaptive[0]]]
    return sweep + cvode + odeint + lsoda + scipy


def measure(repeats):
    """Raw runs, and one entry by command with the median of its times."""
    raw, entries = [], {}
    for turn in range(repeats):
        for command in map(tuple, commands()):
            if turn and entries[command][0]["seconds"] > SLOW_S:
                continue
            done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
            if done.returncode:
                raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
            found = json.loads(done.stdout)
            entries.setdefault(command, []).append(found)
            raw.append({"round": turn + 1, **found})
            print(
                f"round {turn + 1}: {found['program']}, {found['method']}, {found['settings']}: "
                f"{found['seconds'] * 1e3:.1f} ms",
                file=sys.stderr,
            )
    medians = {
        command: {
            **runs[0],
            "seconds": statistics.median(run["seconds"] for run in runs),
            "runs": len(runs),
        }
        for command, runs in entries.items()
    }
    return raw, medians


def whole_map(medians, repeats):
    """Fig. 12 by `sweep run`, checks and recomputed points included, beside CVODE's time for one
    point as often as the map has points."""
    grid = (ROOT / "sweeps/fig12.toml").read_text()
    if IS_CHECK:
        grid = subprocess.run(
            ["scripts/tools/short_grid.sh", "fast"], cwd=ROOT, capture_output=True, text=True
        ).stdout
    lines = [
        "| accuracy | `sweep run`, s | CVODE | its error | nonlinear, ms | linear, ms | "
        "the map, s | times longer |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for accuracy in ["1e-3", "1e-6"]:
        path, out = WORK / "fig12.toml", WORK / "fig12.parquet"
        path.write_text(re.sub(r"(?m)^accuracy = \S+", f"accuracy = {accuracy}", grid))
        seconds = []
        for _ in range(repeats):
            begin = time.perf_counter()
            subprocess.run(
                [
                    ROOT / "target/release/sweep",
                    "run",
                    path,
                    "--out",
                    out,
                    "--fresh",
                    "--threads",
                    "1",
                    "--progress",
                    "none",
                ],
                check=True,
                capture_output=True,
            )
            seconds.append(time.perf_counter() - begin)
        run = json.loads(out.with_suffix(".run.json").read_text())
        ours = statistics.median(seconds)
        peers = [
            (entry["seconds"], command, entry)
            for command, entry in medians.items()
            if "CVODE" in entry["program"] and (IS_CHECK or entry["error"] <= float(accuracy))
        ]
        _, command, nonlinear = min(peers, key=lambda peer: peer[0])
        done = subprocess.run(
            list(map(str, command)),
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "LINEAR": "1"},
        )
        linear = json.loads(done.stdout)["seconds"]
        theirs = run["points"] * (nonlinear["seconds"] + linear)
        lines.append(
            f"| {accuracy} | {ours:.2f} | {nonlinear['method']}, "
            f"{nonlinear['settings']} "
            f"| {nonlinear['error']:.0e} | {nonlinear['seconds'] * 1e3:.1f} | {linear * 1e3:.1f} | "
            f"{theirs:.0f} "
            f"| {theirs / ours:.0f} |"
        )
    return lines


def version(command, line=0):
    return (
        subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
        .stdout.splitlines()[line]
        .strip()
    )


def machine():
    models = [
        line.split(":", 1)[1].strip()
        for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    family = version(
        ["sh", "-c", "lscpu | grep -E '^(CPU family|Model):' | tr -s ' ' | paste -sd, -"]
    )
    model = models[0] if models else platform.machine()
    return f"{model} ({family}), {platform.system()} {platform.release()}"


def quickest(medians, accuracy):
    """The quickest setting of each method that is at least so accurate."""
    chosen = {}
    for entry in medians:
        if entry["error"] <= accuracy and entry["settings"] != REFERENCE:
            key = (entry["program"], entry["method"])
            if key not in chosen or entry["seconds"] < chosen[key]["seconds"]:
                chosen[key] = entry
    return chosen


def table(medians):
    """Both bounds side by side, in the order of the looser one."""
    loose, tight = (quickest(medians, accuracy) for accuracy in (1e-3, 1e-6))

    def cells(entry):
        return f"{entry['settings']} | {entry['error']:.0e} | {entry['seconds'] * 1e3:.1f}"

    lines = [
        "| program and method | for 1e-3 | error | ms | for 1e-6 | error | ms |",
        "|---|---|---|---|---|---|---|",
    ]
    for key, entry in sorted(loose.items(), key=lambda item: item[1]["seconds"]):
        other = tight.get(key)
        right = "the same | | " if other is entry else cells(other) if other else "none | | "
        lines.append(f"| {', '.join(key)} | {cells(entry)} | {right} |")
    return lines


def diagram(medians, path):
    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "peers"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9, 6), layout="constrained")
    curves = {}
    for entry in medians:
        if entry["settings"] != REFERENCE and entry["error"] > 0:
            curves.setdefault((entry["program"], entry["method"]), []).append(
                (entry["error"], entry["seconds"] * 1e3)
            )
    for k, ((program, method), points) in enumerate(curves.items()):
        points.sort()
        ours = program.startswith("sweep")
        axes.loglog(
            *zip(*points),
            marker="osD^v<>PX"[k % 9],
            linewidth=2.2 if ours else 1.2,
            linestyle="-" if ours else "--",
            color=matplotlib.colormaps["tab20"](k % 20),
            label=f"{program}, {method}",
        )
    axes.invert_xaxis()
    axes.set_xlabel("relative error of the greatest yaw in 30 to 50 s")
    axes.set_ylabel("ms a trajectory, one core")
    axes.grid(True, which="major", alpha=0.4)
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, metadata={"Date": None})


def main():
    repeats = int(sys.argv[1])
    load = os.getloadavg()[0]
    raw, by_command = measure(repeats)
    medians = list(by_command.values())
    reference = next(entry for entry in medians if entry["settings"] == REFERENCE)["yaw_rad"]
    for entry in medians:
        entry["error"] = abs(entry["yaw_rad"] / reference - 1.0)
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "peers.jsonl").write_text("".join(json.dumps(run) + "\n" for run in raw))
    diagram(medians, OUT / "peers.svg")
    text = [
        "# One trajectory by other programs' integrators",
        "",
        "One nonlinear trajectory of the paper's machine: 0.4 kg, 140 N s/m, 0 to 350 rpm in 50 s. "
        "Every program calls this project's right-hand",
        "side, the others by way of the C ABI (`crates/washer-capi`), implicit ones with its exact "
        "Jacobian. Error: relative, on the greatest yaw in",
        f"30 to 50 s, against converged RK4 ({REFERENCE}).",
        "",
        f"Machine: {machine()}; one core (`taskset`). {version(['rustc', '--version'])}; "
        f"{version(['c++', '--version'])}, `-O3 -march=native`; "
        f"Python {platform.python_version()}. Load when it began: {load:.1f} on {os.cpu_count()} "
        f"cores. Commit {version(['git', 'describe', '--always', '--dirty'])}.",
        f"Command: `scripts/peers/run.sh {repeats}`; medians of {repeats} round(s) in which all "
        f"take turns, of one where a run takes more than "
        f"{SLOW_S:.0f} s. Raw runs: `peers.jsonl`.",
        "Times in lanes are a trajectory's share of a full lane group.",
        "",
        "![work-precision diagram](peers.svg)",
    ]
    text += [
        "",
        "## The quickest setting of each within either error, ms a trajectory",
        "",
        *table(medians),
    ]
    text += [
        "",
        "## A whole map",
        "",
        "Fig. 12, 1287 points by both models, on the same core: `sweep run sweeps/fig12.toml`, "
        "checks and recomputed points included, start to end;",
        "and CVODE's quickest setting that is so accurate, as if all points cost what the one "
        "above does (the chaotic ones cost more).",
        "",
        *whole_map(by_command, repeats),
    ]
    (OUT / "peers.md").write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
