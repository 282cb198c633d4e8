#!/usr/bin/env python3
"""Runs every program of the comparison and writes the page of it: called by run.sh, which says
how."""

import csv
import itertools
import json
import os
import platform
import re
import statistics
import subprocess
import sys
import time
import tomllib

import matplotlib
from measured import IS_CHECK, ROOT, commit, figure, machine, put, run, wrapped

WORK = ROOT / "target/peers"
# A check runs everything once for trajectories of a second, and keeps what it writes to itself.
OUT = WORK if IS_CHECK else ROOT / "results/benchmarks"
CORES = sorted(os.sched_getaffinity(0))
POINTS = 20 if IS_CHECK else 1000
# Where errors are measured: the ensemble's first points; and other programs run so many of these,
# or fewer where a trajectory takes more than SLOW_S.
REFERENCE_POINTS, SAMPLE, FEW = (2, 2, 2) if IS_CHECK else (40, 20, 5)
SLOW_S = 2.0
# Twice of it changes the results by what the page says.
REFERENCE_STEP_S = 1.25e-5
ACCURACIES = (1e-3, 1e-4)
MODELS = ("nonlinear", "linear")
PLAN = (ROOT / "scripts/peers/ensemble.toml").read_text()
CHANNELS = tomllib.loads(PLAN)["reliability"]["channels"]


def power(number):
    """A figure and its power of ten, as in 1e-3."""
    return f"{number:.0e}".replace("e-0", "e-")


def sweep(integrator, points):
    """Seconds of `sweep run` from start to end, and its rows."""
    plan = re.sub(r'method = "rk4-mass-scaled"\n.*', integrator, PLAN)
    plan = re.sub(r"points = .*", f"points = {points}", plan)
    if IS_CHECK:
        end = float(os.environ["END_S"])
        plan = re.sub(r"end_s = .*", f"end_s = {end}", plan)
        plan = re.sub(r"window_s = .*", f"window_s = [{0.6 * end}, {end}]", plan)
    path = WORK / "ensemble.toml"
    path.write_text(plan)
    program, result, rows = ROOT / "target/release/sweep", WORK / "ensemble.parquet", WORK / "e.csv"
    begin = time.perf_counter()
    run(program, "run", path, "--out", result, "--fresh", "--threads", len(CORES),
        "--progress", "none")
    seconds = time.perf_counter() - begin
    run(program, "export", result, rows)
    lines = [line for line in rows.read_text().splitlines() if not line.startswith("#")]
    return seconds, list(csv.DictReader(lines))


def amplitudes(row, channels):
    return [float(row[f"{model}_{channel}"]) for model in MODELS for channel in channels]


def errors(rows, reference, channels=("tub_yaw",)):
    """Relative, of every amplitude."""
    return [
        abs(a / b - 1.0)
        for row, true in zip(rows, reference)
        for a, b in zip(amplitudes(row, channels), amplitudes(true, channels))
    ]


def ours(reference):
    """`sweep run` by each accuracy: its checks and recomputed points are part of it."""
    program = run(ROOT / "target/release/sweep", "--version")
    for accuracy in (1e-2, 1e-3, 1e-4):
        seconds = []
        while len(seconds) < 3 and sum(seconds) < 30.0:
            took, rows = sweep(f'method = "rk4-mass-scaled"\naccuracy = {accuracy}', POINTS)
            seconds.append(took)
        observed = sorted(errors(rows, reference, CHANNELS))
        yield {
            "program": program,
            "method": "`sweep run`",
            "settings": f"accuracy {power(accuracy)}",
            "points": POINTS,
            "error": max(errors(rows[:SAMPLE], reference)),
            "both_s": statistics.median(seconds),
            "observed_worst": observed[-1],
            "observed_95_percent": observed[int(0.95 * (len(observed) - 1))],
        }


def peers():
    """Commands without their tolerances, and the digits of these, looser ones first."""
    cvode, odeint, diffsol = WORK / "cvode", WORK / "odeint", WORK / "diffsol/release/diffsol-peer"
    python = [sys.executable, ROOT / "scripts/peers/python_peers.py"]
    return [
        ([cvode, "bdf", 2], range(3, 7)),
        ([cvode, "bdf", 5], range(3, 8, 2)),
        ([cvode, "adams", 12], range(4, 7)),
        ([diffsol, "bdf"], range(3, 8, 2)),
        ([diffsol, "tr_bdf2"], range(3, 9)),
        ([diffsol, "esdirk34"], range(3, 10)),
        ([odeint], range(3, 7)),
        ([*python, "numbalsoda"], range(3, 7)),
        ([*python, "radau"], range(3, 6)),
        ([*python, "lsoda"], range(3, 7, 3)),
    ]


def trajectories(command, points):
    """A row per point of both models; each core has a process, and they share the trajectories."""
    tasks = [
        f"{model} {row['unbalance_mass_kg']} {row['damping_n_s_per_m']}\n"
        for model in MODELS
        for row in points
    ]
    processes = []
    for k, core in enumerate(CORES):
        process = subprocess.Popen(
            ["taskset", "-c", str(core), *map(str, command)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )
        process.stdin.write("".join(tasks[k :: len(CORES)]))
        process.stdin.close()
        processes.append(process)
    lines = [[json.loads(line) for line in process.stdout] for process in processes]
    for process in processes:
        if process.wait():
            raise subprocess.CalledProcessError(process.returncode, process.args)
    lines = [line for turn in itertools.zip_longest(*lines) for line in turn if line]
    rows = []
    for pair in zip(lines[: len(points)], lines[len(points) :]):
        row = {key: pair[0][key] for key in ("program", "method", "settings")}
        for model, line in zip(MODELS, pair):
            row |= {f"{model}_tub_yaw": line["tub_yaw"], f"{model}_s": line["seconds"]}
        rows.append(row)
    return rows


def theirs(reference):
    """Each program by finer and finer tolerances, until it is as accurate as asked."""
    for command, digits in peers():
        for digit in digits:
            asked = [*command, f"1e-{digit}", f"1e-{digit + 3}"]
            try:
                rows = trajectories(asked, reference[:FEW])
                if max(row["nonlinear_s"] for row in rows) < SLOW_S:
                    rows += trajectories(asked, reference[FEW:SAMPLE])
            except subprocess.CalledProcessError as failed:
                if IS_CHECK:
                    raise
                print(failed, file=sys.stderr)
                continue
            entry = {key: rows[0][key] for key in ("program", "method", "settings")}
            for model in MODELS:
                mean = statistics.mean(row[f"{model}_s"] for row in rows)
                entry[f"{model}_s"] = POINTS * mean / len(CORES)
            entry["both_s"] = sum(entry[f"{model}_s"] for model in MODELS)
            entry |= {"points": len(rows), "error": max(errors(rows, reference))}
            yield entry
            if IS_CHECK and entry["error"] > 0.1:
                raise SystemExit("that is another trajectory")
            if IS_CHECK or entry["error"] <= min(ACCURACIES):
                break


def quickest(entries, accuracy):
    """Of each method the quickest setting that is at least so accurate; the quickest first."""
    chosen = {}
    for entry in sorted(entries, key=lambda entry: entry["both_s"]):
        if IS_CHECK or entry["error"] <= accuracy:
            chosen.setdefault((entry["program"], entry["method"]), entry)
    return list(chosen.values())


def table(entries, accuracy):
    """Our run of this accuracy, our quickest one that is as good, and the others' quickest ones."""
    own = next(e for e in entries if e["settings"] == f"accuracy {power(accuracy)}")
    others = quickest([e for e in entries if e["program"] != own["program"]], accuracy)
    quick = quickest([e for e in entries if e["program"] == own["program"]], accuracy)
    runs = [own, *(entry for entry in quick if entry is not own)]
    lines = [
        f"| program and method | for {power(accuracy)} | its error | points run | nonlinear, s | "
        "linear, s | both, s | times `sweep run` |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for entry in [*runs, *others]:
        parts = ["" if entry in runs else figure(entry[f"{model}_s"]) for model in MODELS]
        lines.append(
            f"| {entry['program']}, {entry['method']} "
            f"| {entry['settings'].replace('e-0', 'e-')} "
            f"| {power(entry['error'])} | {entry['points']} | {' | '.join(parts)} "
            f"| {figure(entry['both_s'])} | {figure(entry['both_s'] / own['both_s'])} |"
        )
    return own, others[0], lines


def diagram(entries, path):
    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "peers"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(9, 6), layout="constrained")
    curves = {}
    for entry in entries:
        if entry["error"] > 0:
            curves.setdefault((entry["program"], entry["method"]), []).append(
                (entry["error"], entry["both_s"])
            )
    for k, ((program, method), points) in enumerate(curves.items()):
        points.sort()
        own = program.startswith("sweep")
        axes.loglog(
            *zip(*points),
            marker="osD^v<>PX"[k % 9],
            linewidth=2.2 if own else 1.2,
            linestyle="-" if own else "--",
            color=matplotlib.colormaps["tab20"](k % 20),
            label=f"{program}, {method}",
        )
    axes.invert_xaxis()
    axes.set_xlabel("relative error of the greatest yaw, worst of the points run, both models")
    axes.set_ylabel(f"seconds for {POINTS} points by both models")
    axes.grid(True, which="major", alpha=0.4)
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, metadata={"Date": None})


def paragraphs(*texts):
    return "\n\n".join(map(wrapped, texts))


def main():
    load = os.getloadavg()[0]
    reference, coarser = (
        sweep(f'method = "rk4"\nstep_s = {step}', REFERENCE_POINTS)[1]
        for step in (REFERENCE_STEP_S, 2.0 * REFERENCE_STEP_S)
    )
    left = max(errors(coarser, reference, CHANNELS))
    entries = []
    for entry in itertools.chain(ours(reference), theirs(reference)):
        print(json.dumps(entry), file=sys.stderr)
        entries.append(entry)
    write(entries, left, load)


def write(entries, left, load):
    """The page with its files, and the sentence of README."""
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "peers.jsonl").write_text("".join(json.dumps(entry) + "\n" for entry in entries))
    diagram(entries, OUT / "peers.svg")

    compiler, rust = run("c++", "--version").splitlines()[0], run("rustc", "--version")
    text = [
        "# An ensemble by other programs' integrators",
        paragraphs(
            f"{POINTS} points by both models on {len(CORES)} cores: unbalance masses of 0.2 to 0.6 "
            "kg and dampings of 50 to 200 N s/m by a Sobol sequence "
            "(`scripts/peers/ensemble.toml`), 0 to 350 rpm in 50 s. `sweep run` computes all of "
            "it, start to end, checks and recomputed points included. The others call its "
            "right-hand side by way of the C ABI (`crates/washer-capi`), implicit ones but "
            "numbalsoda with its exact Jacobian, a trajectory at a time on each core. They run the "
            f"first {SAMPLE} points, or {FEW} where a trajectory takes more than {SLOW_S:.0f} s; "
            "their times are those of the trajectories, without the program's start, scaled up. A "
            "setting with which a program fails on a point is left out.",
            "Error: relative, on the greatest yaw in 30 to 50 s, the worst of the points run by "
            f"either model (of `sweep run`: of the first {SAMPLE}) against RK4 at "
            f"{REFERENCE_STEP_S * 1e3} ms, of which twice the step changes nothing by more than "
            f"{power(left)}.",
            "heyoka is left out: its steps need the equations as its own expressions.",
            f"Machine: {machine()}. {rust}; {compiler}, `-O3 -march=native`; Python "
            f"{platform.python_version()}. Load when it began: {load:.1f}. Commit {commit()}. "
            "Command: `scripts/peers/run.sh`. Every setting: `peers.jsonl`.",
        ),
        "![work-precision diagram](peers.svg)",
    ]
    sentence = []
    for accuracy in ACCURACIES:
        own, best, lines = table(entries, accuracy)
        text += [
            f"## Within {power(accuracy)}",
            "\n".join(lines),
            paragraphs(
                f"Observed in all six channels of both models over the first {REFERENCE_POINTS} "
                f"points of `sweep run`: 95 % within {power(own['observed_95_percent'])}, the "
                f"worst {power(own['observed_worst'])}."
            ),
        ]
        times = best["both_s"] / own["both_s"]
        sentence.append(
            f"{times:.{0 if times >= 10 else 1}f} times as long within {power(accuracy)} "
            f"({best['program']}, {best['method']})"
        )
    (OUT / "peers.md").write_text("\n\n".join(text) + "\n")
    put(
        "README.md",
        "peers",
        f"The quickest [other integrator](results/benchmarks/peers.md) for {POINTS} points by both "
        f"models takes {', and '.join(sentence)}.",
    )


if __name__ == "__main__":
    main()
