#!/usr/bin/env python3
"""Compares the nonlinear model with the same machine, assembled from standard parts in Exudyn.

    python scripts/crosscheck/against_exudyn.py [--sweep BINARY] [--step S]
        [--table PAGE.md | --trace FILE.parquet]

Exudyn (https://exudyn.readthedocs.io) is a general multibody program. The machine has three rigid
bodies in absolute coordinates, joints, connectors and an implicit integrator, and uses nothing of
this project's derivation.

There are four comparisons: the static equilibrium, a run-up to 600 rpm in 4 s, a release from
0.1 rad of rocking at 270 rpm, and a run-up of a machine with friction dampers, a stop and a gasket.
Motions are compared at two steps of Exudyn and at the values extrapolated from both. The exit code
is 1 if a difference exceeds its bound. With --trace the script only writes Exudyn's run-up of the
paper's Fig. 6 to a trace file, for `sweep plot --against`.
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
from exudyn_washer import RAD_PER_S_PER_RPM, Washer, carried_pose, cycloidal

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
# The kinds of coordinates: displacements and angles of tub and shaft, and the angles of the hinge,
# which are a hundred times smaller. Differences are relative to the largest deviation in a slice.
COORDINATE_KINDS = {"tub and shaft": [slice(0, 4), slice(4, 8)], "drum's hinge": [slice(8, 10)]}
# Bounds of the relative differences at the requested step, and of the values extrapolated from this
# step and half of it by Exudyn's second order. After a release the drum rings on its undamped shaft
# at 64 Hz. Steps of 1e-4 s delay the ringing, which is a noticeable part of the hinge's angles.
EQUILIBRIUM_BOUND = 1e-10
BOUNDS = {
    ("run-up", "tub and shaft"): (1e-5, 1e-6),
    ("run-up", "drum's hinge"): (1e-5, 1e-6),
    ("release", "tub and shaft"): (1e-5, 1e-6),
    ("release", "drum's hinge"): (1e-3, 1e-4),
    ("elements", "tub and shaft"): (2e-5, 1e-6),
    ("elements", "drum's hinge"): (5e-3, 1e-4),
}
# The line of a damper, its replacement, and the further elements of the second machine. Friction
# and contact set in over widths that Exudyn's steps resolve.
DAMPING = "damping_n_s_per_m = 140.0"
FRICTION = """damping_n_s_per_m = 20.0
friction_n = 40.0
friction_speed_m_per_s = 0.05
friction_linear_speed_m_per_s = 0.3"""
FURTHER_ELEMENTS = """
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
# The comments around the table in a page.
TABLE_BEGIN_MARK = "<!-- table: scripts/crosscheck/run.sh -->"
TABLE_END_MARK = "<!-- end of table -->"


def grid(spin, end_s, machine="paper"):
    """Returns a grid file with accurate adaptive steps."""
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


def trace_motion(sweep, spin, end_s, every_s, start=(), machine=None, with_speeds=False):
    """Computes a motion by `sweep trace`. Returns its deviations q1 to q10, with speeds if
    requested, and the metadata of the trace. `machine` is the text of a machine file."""
    with tempfile.TemporaryDirectory() as folder:
        grid_file, out = pathlib.Path(folder) / "check.toml", pathlib.Path(folder) / "check.parquet"
        machine_name = "paper"
        if machine:
            machine_name = "machine.toml"
            (pathlib.Path(folder) / machine_name).write_text(machine)
        grid_file.write_text(grid(spin, end_s, machine_name))
        starts = [word for pair in start for word in ("--start", pair)]
        subprocess.run(
            [sweep, "trace", grid_file, "--every", str(every_s), "--states", *starts, "--out", out],
            check=True,
            stderr=subprocess.DEVNULL,
        )
        table = pq.read_table(out)
        metadata = json.loads(pq.read_metadata(out).metadata[b"sweep.trace"])
    units = ["m"] * 4 + ["rad"] * 6
    columns = [f"q{i}_nonlinear_{unit}" for i, unit in enumerate(units, 1)]
    if with_speeds:
        columns += [f"u{i}_nonlinear_{unit}_per_s" for i, unit in enumerate(units, 1)]
    return np.array([table[name].to_numpy() for name in columns]).T, metadata


def max_differences(own_q, exudyn_q):
    """Returns the largest difference of each kind of coordinates, relative to the largest deviation
    within a slice."""

    def relative_difference(indices):
        difference = np.abs(own_q[:, indices] - exudyn_q[:, indices]).max()
        return difference / np.abs(exudyn_q[:, indices]).max()

    return {kind: max(map(relative_difference, parts)) for kind, parts in COORDINATE_KINDS.items()}


def compare(own_q, exudyn_motion, step_s):
    """Returns the differences at the step, at half of it, and of the extrapolated motion.
    `exudyn_motion` computes deviations with a step."""
    exudyn_q, half_step_q = exudyn_motion(step_s), exudyn_motion(step_s / 2)
    extrapolated_q = (4 * half_step_q - exudyn_q) / 3
    return [max_differences(own_q, q) for q in (exudyn_q, half_step_q, extrapolated_q)]


def format_table(step_s, equilibrium, motions):
    """Returns the lines of the table, and whether every difference is within its bound."""
    is_within_bounds = equilibrium <= EQUILIBRIUM_BOUND
    lines = [
        f"| comparison | coordinates | at {step_s * 1e6:g} µs | at {step_s * 5e5:g} µs | "
        f"extrapolated | bounds |",
        "|---|---|---|---|---|---|",
        f"| static equilibrium (m, rad) | all ten | {equilibrium:.1e} | | | "
        f"{EQUILIBRIUM_BOUND:.0e} |",
    ]
    for (motion, title), (at_step, at_half_step, extrapolated) in motions.items():
        for kind in COORDINATE_KINDS:
            bounds = BOUNDS[motion, kind]
            lines.append(
                f"| {title} | {kind} | {at_step[kind]:.1e} | {at_half_step[kind]:.1e} | "
                f"{extrapolated[kind]:.1e} "
                f"| {bounds[0]:.0e}, {bounds[1]:.0e} |"
            )
            is_within_bounds &= at_step[kind] <= bounds[0] and extrapolated[kind] <= bounds[1]
    return lines, is_within_bounds


def write_trace(path, machine, rest, step_s):
    """Writes Exudyn's run-up of sweeps/fig6.toml: channels of tub and mass centre as deviations
    from the equilibrium."""
    spin = tomllib.loads((ROOT / "sweeps/fig6.toml").read_text())
    peak_rpm, ramp_s, end_s = (
        spin["spin"]["peak_rpm"],
        spin["spin"]["ramp_s"],
        spin["time"]["end_s"],
    )
    every_s, front_m = 0.002, machine["tub"]["front_x_m"]
    washer = Washer(machine, rest, np.zeros(10), cycloidal(peak_rpm, ramp_s), 0.0)
    # At the first instant the machine is in equilibrium.
    q, centre = washer.run_with_centre(end_s, step_s, every_s)
    channels = {
        "tub_front_y": q[:, 0] + front_m * np.sin(q[:, 5]),
        "tub_front_z": q[:, 1] - front_m * np.sin(q[:, 4]) * np.cos(q[:, 5]),
        "total_centre_y": centre[:, 1],
        "total_centre_z": centre[:, 2],
        "tub_yaw": q[:, 4],
        "tub_pitch": q[:, 5],
    }
    columns = {f"nonlinear_{name}": values - values[0] for name, values in channels.items()}
    plan = {"name": f"Exudyn {exudyn.__version__}", "machine": machine}
    metadata = {"sweep.plan": json.dumps(plan)}
    table = pa.table({"time_s": every_s * np.arange(len(q)), **columns})
    pq.write_table(table.replace_schema_metadata(metadata), path, compression="zstd")


def main():
    """Prints all comparisons; returns 1 if a difference exceeds its bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sweep", default=str(ROOT / "target/release/sweep"), help="the binary")
    parser.add_argument("--step", type=float, default=1e-4, help="Exudyn's longer step, s")
    parser.add_argument("--table", help="update the table in this page, between its two comments")
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

    zero_vector = np.zeros(10)
    rest = Washer(machine, zero_vector, zero_vector, lambda t: 0.0, 0.0).solve_equilibrium()

    if arguments.trace:
        write_trace(arguments.trace, machine, rest, arguments.step)
        return 0

    # A run-up to 600 rpm on a cycloidal ramp of 4 s.
    peak_rpm, ramp_s, end_s = 600, 4.0, 4.5
    theta = cycloidal(peak_rpm, ramp_s)
    run_up, metadata = trace_motion(
        sweep, {"profile": "cycloidal", "peak_rpm": peak_rpm, "ramp_s": ramp_s}, end_s, every_s
    )
    own_rest = np.array([metadata["equilibrium"][f"q{i}"] for i in range(1, 11)])
    motions = {
        ("run-up", f"run-up to {peak_rpm} rpm in {ramp_s:g} s, to {end_s:g} s"): compare(
            run_up,
            lambda step_s: Washer(machine, rest, zero_vector, theta, 0.0).run(
                end_s, step_s, every_s
            )
            - rest,
            arguments.step,
        )
    }

    # A release of tub, shaft and drum from a yaw of 0.1 rad, while the drum turns at 270 rpm.
    speed, end_s = 270 * RAD_PER_S_PER_RPM, 1.0
    tilted_q = rest.copy()
    tilted_q[[4, 6]] += 0.1
    q, u = carried_pose(machine, tilted_q, speed)
    start = [
        f"{letter}{i}={value!r}"
        for letter, values in [("q", q - rest), ("u", u)]
        for i, value in enumerate(values.tolist(), 1)
        if value
    ]
    release, _ = trace_motion(
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

    # A shorter and slower run-up with friction, a stop and a gasket.
    assert machine_file.count(DAMPING) == len(machine["dampers"])
    further_file = machine_file.replace(DAMPING, FRICTION) + FURTHER_ELEMENTS
    further_machine = tomllib.loads(further_file)
    peak_rpm, ramp_s, end_s = 300, 2.0, 3.0
    further_run_up, metadata = trace_motion(
        sweep,
        {"profile": "cycloidal", "peak_rpm": peak_rpm, "ramp_s": ramp_s},
        end_s,
        every_s,
        machine=further_file,
    )
    washer = Washer(further_machine, zero_vector, zero_vector, lambda t: 0.0, 0.0)
    further_rest = washer.solve_equilibrium()
    further_own_rest = np.array([metadata["equilibrium"][f"q{i}"] for i in range(1, 11)])
    equilibrium_error = np.abs(np.array([own_rest - rest, further_own_rest - further_rest])).max()
    theta = cycloidal(peak_rpm, ramp_s)
    title = f"run-up to {peak_rpm} rpm in {ramp_s:g} s, to {end_s:g} s, with friction, stop, gasket"
    motions["elements", title] = compare(
        further_run_up,
        lambda step_s: Washer(further_machine, further_rest, zero_vector, theta, 0.0).run(
            end_s, step_s, every_s
        )
        - further_rest,
        arguments.step,
    )

    lines, is_within_bounds = format_table(arguments.step, equilibrium_error, motions)
    print("\n".join(lines))
    if arguments.table:
        page = pathlib.Path(arguments.table)
        before, _, remainder = page.read_text().partition(TABLE_BEGIN_MARK)
        _, end_mark, after = remainder.partition(TABLE_END_MARK)
        if not end_mark:
            sys.exit(
                f"{page} must have the lines `{TABLE_BEGIN_MARK}` and `{TABLE_END_MARK}` around "
                f"the table"
            )
        page.write_text("\n".join([before + TABLE_BEGIN_MARK, *lines, TABLE_END_MARK]) + after)
    if not is_within_bounds:
        print("a difference exceeds its bound", file=sys.stderr)
    return 0 if is_within_bounds else 1


if __name__ == "__main__":
    sys.exit(main())
