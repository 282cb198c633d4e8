#!/usr/bin/env python3
"""Runs all programs of the comparison and writes its page. `run.sh` calls this script."""

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
from measured import (
    IS_CHECK,
    ROOT,
    describe_commit,
    describe_machine,
    format_number,
    run_command,
    wrap_paragraph,
    write_between_marks,
)

WORK_FOLDER = ROOT / "target/peers"
# The folder of the results. A trial does not change those of the repository.
OUTPUT_FOLDER = WORK_FOLDER if IS_CHECK else ROOT / "results/benchmarks"
CORES = sorted(os.sched_getaffinity(0))
POINTS = 20 if IS_CHECK else 1000
# The number of the ensemble's first points with a reference, the number that other programs run,
# and the number that they run if a trajectory takes more than SLOW_S.
REFERENCE_POINTS, PEER_POINTS, SLOW_PEER_POINTS = (2, 2, 2) if IS_CHECK else (40, 20, 5)
SLOW_S = 2.0
# The step of the reference. The page has the change of the results at twice this step.
REFERENCE_STEP_S = 1.25e-5
ACCURACIES = (1e-3, 1e-4)
MODELS = ("nonlinear", "linear")
PLAN = (ROOT / "scripts/peers/ensemble.toml").read_text()
CHANNELS = tomllib.loads(PLAN)["reliability"]["channels"]


def format_power(number):
    """Formats a number with one digit and a power of ten, as in 1e-3."""
    return f"{number:.0e}".replace("e-0", "e-")


def run_sweep(integrator, points):
    """Runs `sweep run` for a number of points; returns its wall time (s) and its rows."""
    plan = re.sub(r'method = "rk4-mass-scaled"\n.*', integrator, PLAN)
    plan = re.sub(r"points = .*", f"points = {points}", plan)
    if IS_CHECK:
        end = float(os.environ["END_S"])
        plan = re.sub(r"end_s = .*", f"end_s = {end}", plan)
        plan = re.sub(r"window_s = .*", f"window_s = [{0.6 * end}, {end}]", plan)
    path = WORK_FOLDER / "ensemble.toml"
    path.write_text(plan)
    program, result = ROOT / "target/release/sweep", WORK_FOLDER / "ensemble.parquet"
    rows = WORK_FOLDER / "e.csv"
    start_s = time.perf_counter()
    run_command(program, "run", path, "--out", result, "--fresh", "--threads", len(CORES),
        "--progress", "none")
    seconds = time.perf_counter() - start_s
    run_command(program, "export", result, rows)
    lines = [line for line in rows.read_text().splitlines() if not line.startswith("#")]
    return seconds, list(csv.DictReader(lines))


def read_amplitudes(row, channels):
    """Returns the amplitudes of both models in a row."""
    return [float(row[f"{model}_{channel}"]) for model in MODELS for channel in channels]


def relative_errors(rows, reference, channels=("tub_yaw",)):
    """Returns the relative errors of all amplitudes."""
    return [
        abs(a / b - 1.0)
        for row, reference_row in zip(rows, reference)
        for a, b in zip(
            read_amplitudes(row, channels), read_amplitudes(reference_row, channels)
        )
    ]


def measure_sweep(reference):
    """Yields the results of `sweep run` for each accuracy, including checks and recomputations."""
    program = run_command(ROOT / "target/release/sweep", "--version")
    for accuracy in (1e-2, 1e-3, 1e-4):
        seconds = []
        while len(seconds) < 3 and sum(seconds) < 30.0:
            integrator = f'method = "rk4-mass-scaled"\naccuracy = {accuracy}'
            elapsed_s, rows = run_sweep(integrator, POINTS)
            seconds.append(elapsed_s)
        observed_errors = sorted(relative_errors(rows, reference, CHANNELS))
        yield {
            "program": program,
            "method": "`sweep run`",
            "settings": f"accuracy {format_power(accuracy)}",
            "points": POINTS,
            "error": max(relative_errors(rows[:PEER_POINTS], reference)),
            "both_s": statistics.median(seconds),
            "observed_worst": observed_errors[-1],
            "observed_95_percent": observed_errors[int(0.95 * (len(observed_errors) - 1))],
        }


def peer_commands():
    """Returns the commands without tolerances, and the tolerances' digits, the loosest first."""
    cvode, odeint = WORK_FOLDER / "cvode", WORK_FOLDER / "odeint"
    diffsol = WORK_FOLDER / "diffsol/release/diffsol-peer"
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


def run_trajectories(command, points):
    """Runs trajectories of both models in a process per core; returns a row for each point."""
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


def measure_peers(reference):
    """Yields the results of each program with finer and finer tolerances, until it reaches the
    greatest requested accuracy."""
    for command, digits in peer_commands():
        for digit in digits:
            full_command = [*command, f"1e-{digit}", f"1e-{digit + 3}"]
            try:
                rows = run_trajectories(full_command, reference[:SLOW_PEER_POINTS])
                if max(row["nonlinear_s"] for row in rows) < SLOW_S:
                    further_points = reference[SLOW_PEER_POINTS:PEER_POINTS]
                    rows += run_trajectories(full_command, further_points)
            except subprocess.CalledProcessError as error:
                if IS_CHECK:
                    raise
                print(error, file=sys.stderr)
                continue
            entry = {key: rows[0][key] for key in ("program", "method", "settings")}
            for model in MODELS:
                mean = statistics.mean(row[f"{model}_s"] for row in rows)
                entry[f"{model}_s"] = POINTS * mean / len(CORES)
            entry["both_s"] = sum(entry[f"{model}_s"] for model in MODELS)
            entry |= {"points": len(rows), "error": max(relative_errors(rows, reference))}
            yield entry
            if IS_CHECK and entry["error"] > 0.1:
                raise SystemExit("the error is that of another trajectory")
            if IS_CHECK or entry["error"] <= min(ACCURACIES):
                break


def fastest_settings(entries, accuracy):
    """Returns the fastest setting of each method that reaches an accuracy, the fastest first."""
    fastest = {}
    for entry in sorted(entries, key=lambda entry: entry["both_s"]):
        if IS_CHECK or entry["error"] <= accuracy:
            fastest.setdefault((entry["program"], entry["method"]), entry)
    return list(fastest.values())


def format_table(entries, accuracy):
    """Returns the entry of `sweep run` with an accuracy, the fastest entry of another program, and
    the lines of the table."""
    own = next(e for e in entries if e["settings"] == f"accuracy {format_power(accuracy)}")
    others = fastest_settings([e for e in entries if e["program"] != own["program"]], accuracy)
    own_entries = fastest_settings([e for e in entries if e["program"] == own["program"]], accuracy)
    own_entries = [own, *(entry for entry in own_entries if entry is not own)]
    lines = [
        f"| program and method | for {format_power(accuracy)} | its error | points run "
        "| nonlinear, s | linear, s | both, s | times `sweep run` |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for entry in [*own_entries, *others]:
        model_times = [
            "" if entry in own_entries else format_number(entry[f"{model}_s"]) for model in MODELS
        ]
        lines.append(
            f"| {entry['program']}, {entry['method']} "
            f"| {entry['settings'].replace('e-0', 'e-')} "
            f"| {format_power(entry['error'])} | {entry['points']} | {' | '.join(model_times)} "
            f"| {format_number(entry['both_s'])} "
            f"| {format_number(entry['both_s'] / own['both_s'])} |"
        )
    return own, others[0], lines


def draw_diagram(entries, path):
    """Draws the errors and times of all settings."""
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


def join_paragraphs(*texts):
    """Returns wrapped paragraphs with blank lines between them."""
    return "\n\n".join(map(wrap_paragraph, texts))


def main():
    load = os.getloadavg()[0]
    reference, coarser = (
        run_sweep(f'method = "rk4"\nstep_s = {step}', REFERENCE_POINTS)[1]
        for step in (REFERENCE_STEP_S, 2.0 * REFERENCE_STEP_S)
    )
    reference_error = max(relative_errors(coarser, reference, CHANNELS))
    entries = []
    for entry in itertools.chain(measure_sweep(reference), measure_peers(reference)):
        print(json.dumps(entry), file=sys.stderr)
        entries.append(entry)
    write_results(entries, reference_error, load)


def write_results(entries, reference_error, load):
    """Writes the page with its files, and the sentence of README."""
    OUTPUT_FOLDER.mkdir(parents=True, exist_ok=True)
    lines = "".join(json.dumps(entry) + "\n" for entry in entries)
    (OUTPUT_FOLDER / "peers.jsonl").write_text(lines)
    draw_diagram(entries, OUTPUT_FOLDER / "peers.svg")

    compiler = run_command("c++", "--version").splitlines()[0]
    rust = run_command("rustc", "--version")
    text = [
        "# An ensemble by other programs' integrators",
        join_paragraphs(
            f"{POINTS} points by both models on {len(CORES)} cores: unbalance masses of 0.2 to 0.6 "
            "kg and dampings of 50 to 200 N s/m by a Sobol sequence "
            "(`scripts/peers/ensemble.toml`), 0 to 350 rpm in 50 s. `sweep run` computes all of "
            "it, start to end, checks and recomputed points included. The others call its "
            "right-hand side by way of the C ABI (`crates/washer-capi`), implicit ones but "
            "numbalsoda with its exact Jacobian, a trajectory at a time on each core. They run the "
            f"first {PEER_POINTS} points, or {SLOW_PEER_POINTS} where a trajectory takes more than "
            f"{SLOW_S:.0f} s; "
            "their times are those of the trajectories, without the program's start, scaled up. A "
            "setting with which a program fails on a point is left out.",
            "Error: relative, on the greatest yaw in 30 to 50 s, the worst of the points run by "
            f"either model (of `sweep run`: of the first {PEER_POINTS}) against RK4 at "
            f"{REFERENCE_STEP_S * 1e3} ms, of which twice the step changes nothing by more than "
            f"{format_power(reference_error)}.",
            "heyoka is left out: its steps need the equations as its own expressions.",
            f"Machine: {describe_machine()}. {rust}; {compiler}, `-O3 -march=native`; Python "
            f"{platform.python_version()}. Load when it began: {load:.1f}. "
            f"Commit {describe_commit()}. Command: `scripts/peers/run.sh`. Every setting: "
            "`peers.jsonl`.",
        ),
        "![work-precision diagram](peers.svg)",
    ]
    phrases = []
    for accuracy in ACCURACIES:
        own, best, lines = format_table(entries, accuracy)
        text += [
            f"## Within {format_power(accuracy)}",
            "\n".join(lines),
            join_paragraphs(
                f"Observed in all six channels of both models over the first {REFERENCE_POINTS} "
                f"points of `sweep run`: 95 % within {format_power(own['observed_95_percent'])}, "
                f"the worst {format_power(own['observed_worst'])}."
            ),
        ]
        ratio = best["both_s"] / own["both_s"]
        phrases.append(
            f"{ratio:.{0 if ratio >= 10 else 1}f} times as long within {format_power(accuracy)} "
            f"({best['program']}, {best['method']})"
        )
    (OUTPUT_FOLDER / "peers.md").write_text("\n\n".join(text) + "\n")
    write_between_marks(
        "README.md",
        "peers",
        f"The quickest [other integrator](results/benchmarks/peers.md) for {POINTS} points by both "
        f"models takes {', and '.join(phrases)}.",
    )


if __name__ == "__main__":
    main()
