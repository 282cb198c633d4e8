#!/usr/bin/env python3
"""The nonlinear model against the same machine put together from standard parts in Exudyn.

    python scripts/crosscheck/against_exudyn.py [--sweep BINARY] [--step S]
        [--table PAGE.md | --trace FILE.parquet]

Exudyn (https://exudyn.readthedocs.io) is a general multibody program: three rigid bodies in
absolute coordinates, joints, connectors, an implicit integrator. Nothing of this project's
derivation is in it, as little as the paper's was in the commercial program that it compared with.
Four comparisons: the static equilibrium, a run-up to 600 rpm in 4 s, a release from 0.1 rad of
rocking at 270 rpm, and a run-up of a machine with friction dampers, a stop and a gasket; the
motions at two steps of Exudyn's and extrapolated from these. Exit code 1 if
any differs by more than its bound. With --trace no comparison: Exudyn's run-up of the paper's Fig.
6 as a trace file, for `sweep plot --against`.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import exudyn
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from exudyn_washer import RPM, Washer, cycloidal, riding_along

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
# Tub and shaft's displacements and angles, and the hinge's angles, which are a hundred times
# smaller: each is judged against the largest deviation within its slice.
KINDS = {"tub and shaft": [slice(0, 4), slice(4, 8)], "drum's hinge": [slice(8, 10)]}
# Bounds on the difference, as a share of that deviation: at the step asked for, and extrapolated
# from it and half of it by Exudyn's second order. A release sets the drum ringing on its undamped
# shaft at 64 Hz, where a step of 1e-4 s loses phase; of the hinge's angles that is a noticeable
# share.
EQUILIBRIUM_BOUND = 1e-10
BOUNDS = {
    ("run-up", "tub and shaft"): (1e-5, 1e-6),
    ("run-up", "drum's hinge"): (1e-5, 1e-6),
    ("release", "tub and shaft"): (1e-5, 1e-6),
    ("release", "drum's hinge"): (1e-3, 1e-4),
    ("elements", "tub and shaft"): (2e-5, 1e-6),
    ("elements", "drum's hinge"): (5e-3, 1e-4),
}
# The machine with further elements: what stands in place of its dampers' lines, and what is added.
# Friction and contact set in over widths that Exudyn's steps resolve.
DAMPING = "damping_n_s_per_m = 140.0"
FRICTION = """damping_n_s_per_m = 20.0
friction_n = 40.0
friction_speed_m_per_s = 0.05
friction_linear_speed_m_per_s = 0.3"""
FURTHER = """
[[stops]]
tub_m = [0.45, 0.0, 0.28]
direction = [0.0, 0.6, 0.8]
clearance_m = 0.002
stiffness_n_per_m = 4e4
damping_n_s_per_m = 100.0
softness_m = 1e-3

[[bushings]]
tub_m = [0.45, 0.0, 0.0]
stiffness_n_per_m = [0.0, 600.0, 600.0]
cubic_n_per_m3 = [0.0, 5e6, 5e6]
damping_n_s_per_m = [0.0, 12.0, 12.0]
"""
# Where the table stands in a page.
TABLE_BEGINS, TABLE_ENDS = "<!-- table: scripts/crosscheck/run.sh -->", "<!-- end of table -->"


def grid(spin, end_s, machine="paper"):
    """A grid file with accurate adaptive steps."""
    lines = [f"{key} = {json.dumps(value)}" for key, value in spin.items()]
    return "\n".join(
        [
            f'machine = "{machine}"',
            "[spin]",
            *lines,
            "[time]",
            f"end_s = {end_s}",
            "[integrator]",
            'method = "dopri5"',
            "rtol = 1e-10",
            "atol = 1e-13",
            "",
        ]
    )


def ours(sweep, spin, end_s, every_s, start=(), machine=None, with_speeds=False):
    """Deviations q1 to q10 by `sweep trace`, and the machine as run; `machine` is the text of its
    file."""
    with tempfile.TemporaryDirectory() as folder:
        grid_file, out = pathlib.Path(folder) / "check.toml", pathlib.Path(folder) / "check.parquet"
        named = "paper"
        if machine:
            named = "machine.toml"
            (pathlib.Path(folder) / named).write_text(machine)
        grid_file.write_text(grid(spin, end_s, named))
        starts = [word for pair in start for word in ("--start", pair)]
        subprocess.run(
            [sweep, "trace", grid_file, "--every", str(every_s), "--states", *starts, "--out", out],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        table = pq.read_table(out)
        told = json.loads(pq.read_metadata(out).metadata[b"sweep.trace"])
    units = ["m"] * 4 + ["rad"] * 6
    columns = [f"q{i}_nonlinear_{unit}" for i, unit in enumerate(units, 1)]
    if with_speeds:
        columns += [f"u{i}_nonlinear_{unit}_per_s" for i, unit in enumerate(units, 1)]
    return np.array([table[name].to_numpy() for name in columns]).T, told


def differences(ours_q, theirs_q):
    """Of each kind, the largest difference of any coordinate as a share of the largest deviation
    within its slice."""

    def share(part):
        return np.abs(ours_q[:, part] - theirs_q[:, part]).max() / np.abs(theirs_q[:, part]).max()

    return {kind: max(map(share, parts)) for kind, parts in KINDS.items()}


def compare(ours_q, theirs, step_s):
    """Differences at the step, at half of it, and extrapolated; `theirs` gives deviations at a
    step."""
    whole, half = theirs(step_s), theirs(step_s / 2)
    return [differences(ours_q, found) for found in (whole, half, (4 * half - whole) / 3)]


def table(step_s, equilibrium, motions):
    """Lines of the table, and whether every difference is within its bound."""
    sound = equilibrium <= EQUILIBRIUM_BOUND
    lines = [
        f"| comparison | coordinates | at {step_s * 1e6:g} µs | at {step_s * 5e5:g} µs | "
        f"extrapolated | bounds |",
        "|---|---|---|---|---|---|",
        f"| static equilibrium (m, rad) | all ten | {equilibrium:.1e} | | | "
        f"{EQUILIBRIUM_BOUND:.0e} |",
    ]
    for (motion, title), (whole, half, extrapolated) in motions.items():
        for kind in KINDS:
            bounds = BOUNDS[motion, kind]
            lines.append(
                f"| {title} | {kind} | {whole[kind]:.1e} | {half[kind]:.1e} | "
                f"{extrapolated[kind]:.1e} "
                f"| {bounds[0]:.0e}, {bounds[1]:.0e} |"
            )
            sound &= whole[kind] <= bounds[0] and extrapolated[kind] <= bounds[1]
    return lines, sound


def write_trace(path, machine, rest, step_s):
    """The run-up of sweeps/fig6.toml in Exudyn: channels of tub and mass centre as deviations from
    equilibrium."""
    spin = tomllib.loads((ROOT / "sweeps/fig6.toml").read_text())
    peak_rpm, ramp_s, end_s = (
        spin["spin"]["peak_rpm"],
        spin["spin"]["ramp_s"],
        spin["time"]["end_s"],
    )
    every_s, front_m = 0.002, machine["tub"]["front_x_m"]
    washer = Washer(machine, rest, np.zeros(10), cycloidal(peak_rpm, ramp_s), 0.0)
    # The first instant is equilibrium.
    q, centre = washer.motion(end_s, step_s, every_s)
    channels = {
        "tub_front_y": q[:, 0] + front_m * np.sin(q[:, 5]),
        "tub_front_z": q[:, 1] - front_m * np.sin(q[:, 4]) * np.cos(q[:, 5]),
        "total_centre_y": centre[:, 1],
        "total_centre_z": centre[:, 2],
        "tub_yaw": q[:, 4],
        "tub_pitch": q[:, 5],
    }
    columns = {f"nonlinear_{name}": values - values[0] for name, values in channels.items()}
    told = {"sweep.plan": json.dumps({"name": f"Exudyn {exudyn.__version__}", "machine": machine})}
    table = pa.table({"time_s": every_s * np.arange(len(q)), **columns})
    pq.write_table(table.replace_schema_metadata(told), path, compression="zstd")


def main():
    """Compare, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sweep", default=str(ROOT / "target/release/sweep"), help="the binary")
    parser.add_argument("--step", type=float, default=1e-4, help="Exudyn's longer step, s")
    parser.add_argument("--table", help="renew the table in this page, between its two comments")
    parser.add_argument(
        "--trace", help="write Exudyn's run-up of Fig. 6 to this file and compare nothing"
    )
    arguments = parser.parse_args()
    exudyn.config.printToConsole = False
    sweep, every_s = arguments.sweep, 0.01
    machine_file = subprocess.run(
        [sweep, "init", "--machine", "-"], check=True, capture_output=True, text=True
    ).stdout
    machine = tomllib.loads(machine_file)

    still = np.zeros(10)
    rest = Washer(machine, still, still, lambda t: 0.0, 0.0).rest()

    if arguments.trace:
        write_trace(arguments.trace, machine, rest, arguments.step)
        return 0

    # Run-up: 600 rpm on a cycloidal ramp of 4 s, then constant.
    peak_rpm, ramp_s, end_s = 600, 4.0, 4.5
    theta = cycloidal(peak_rpm, ramp_s)
    run_up, told = ours(
        sweep, {"profile": "cycloidal", "peak_rpm": peak_rpm, "ramp_s": ramp_s}, end_s, every_s
    )
    our_rest = np.array([told["equilibrium"][f"q{i}"] for i in range(1, 11)])
    motions = {
        ("run-up", f"run-up to {peak_rpm} rpm in {ramp_s:g} s, to {end_s:g} s"): compare(
            run_up,
            lambda step_s: Washer(machine, rest, still, theta, 0.0).run(end_s, step_s, every_s)
            - rest,
            arguments.step,
        )
    }

    # Release: tub, shaft and drum tilted together by 0.1 rad of yaw while the drum turns at 270
    # rpm.
    speed, end_s = 270 * RPM, 1.0
    tilted = rest.copy()
    tilted[[4, 6]] += 0.1
    q, u = riding_along(machine, tilted, speed)
    start = [
        f"{letter}{i}={value!r}"
        for letter, values in [("q", q - rest), ("u", u)]
        for i, value in enumerate(values.tolist(), 1)
        if value
    ]
    release, _ = ours(
        sweep,
        {"profile": "table", "time_s": [0, 1], "speed_rpm": [270, 270]},
        end_s,
        every_s,
        start,
    )
    motions["release", f"release from 0.1 rad of yaw at 270 rpm, to {end_s:g} s"] = compare(
        release,
        lambda step_s: Washer(machine, q, u, lambda t: speed * t, speed).run(end_s, step_s, every_s)
        - rest,
        arguments.step,
    )

    # The same run-up, shorter and slower, with friction, a stop and a gasket.
    assert machine_file.count(DAMPING) == len(machine["dampers"])
    further_file = machine_file.replace(DAMPING, FRICTION) + FURTHER
    further = tomllib.loads(further_file)
    peak_rpm, ramp_s, end_s = 300, 2.0, 3.0
    further_run_up, told = ours(
        sweep,
        {"profile": "cycloidal", "peak_rpm": peak_rpm, "ramp_s": ramp_s},
        end_s,
        every_s,
        machine=further_file,
    )
    further_rest = Washer(further, still, still, lambda t: 0.0, 0.0).rest()
    further_ours = np.array([told["equilibrium"][f"q{i}"] for i in range(1, 11)])
    at_rest = np.abs(np.array([our_rest - rest, further_ours - further_rest])).max()
    theta = cycloidal(peak_rpm, ramp_s)
    title = f"run-up to {peak_rpm} rpm in {ramp_s:g} s, to {end_s:g} s, with friction, stop, gasket"
    motions["elements", title] = compare(
        further_run_up,
        lambda step_s: Washer(further, further_rest, still, theta, 0.0).run(end_s, step_s, every_s)
        - further_rest,
        arguments.step,
    )

    lines, sound = table(arguments.step, at_rest, motions)
    print("\n".join(lines))
    if arguments.table:
        page = pathlib.Path(arguments.table)
        before, _, remainder = page.read_text().partition(TABLE_BEGINS)
        _, found, after = remainder.partition(TABLE_ENDS)
        if not found:
            sys.exit(
                f"{page} has no place for the table: `{TABLE_BEGINS}` and `{TABLE_ENDS}`, each on "
                f"a line"
            )
        page.write_text("\n".join([before + TABLE_BEGINS, *lines, TABLE_ENDS]) + after)
    if not sound:
        print("a difference exceeds its bound", file=sys.stderr)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
