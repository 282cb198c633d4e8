#!/usr/bin/env python3
"""Compares dwells at constant speed in Exudyn with `sweep stability` and `sweep dwell`.

    python scripts/crosscheck/dwells.py [--sweep BINARY] [--step S]

At 250 and 305 rpm the periodic response of the paper's machine is unstable. Exudyn's dwell starts
near this motion, which is found by `sweep trace` over single turns. The change of the motion from
turn to turn gives the multiplier and the growth of the disturbance. The spectrum of yaw and pitch
without the periodic part gives the frequencies of its lines.

Then Exudyn continues the motions at the end of `sweep dwell`, and must stay in them: a motion with
two frequencies at 250 rpm, and one that repeats every second turn at 297.5 rpm. The exit code is 1
if a growth, a line or a largest deviation differs by more than its bound.
"""

import argparse
import math
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import exudyn
import numpy as np
import pyarrow.parquet as pq
from against_exudyn import ROOT, grid, trace_motion
from exudyn_washer import RAD_PER_S_PER_RPM, Washer

# The speeds (rpm) and durations (s) of the dwells.
DWELLS = [(250.0, 9.6), (305.0, 12.0)]
# The speeds (rpm) and kinds of the motions that Exudyn continues, and the numbers of turns.
FINAL_MOTIONS = [(250.0, "quasi_periodic", 64), (297.5, "periodic_2", 32)]
# The number of samples per turn.
SAMPLES_PER_TURN = 48
# The coordinates in which the disturbance is observed: yaw and pitch of the tub.
OBSERVED_COORDINATES = [4, 5]
# The initial deviation of the yaw of tub and shaft from the periodic response (rad).
DISTURBANCE_RAD = 5e-5
# The greatest change by a turn at which a motion counts as periodic (m, rad).
PERIODIC_TOLERANCE = 1e-9
# The number of initial turns that are not used, because other motions have not decayed yet.
SETTLED_TURNS = 8
# The number of preceding turns of which a turn is a linear combination: two for the growing part,
# the others for decaying parts.
PRECEDING_TURNS = 4
# The bounds of the relative difference of growth, and of the difference of lines (cycles/min).
GROWTH_BOUND, LINE_BOUND = 0.02, 1.5
# The bound of the relative difference of largest deviations. Samples miss peaks by up to 0.2 %, and
# peaks of a motion with two frequencies differ between turns.
DEVIATION_BOUND = 0.01
STATES = [f"{letter}{i}" for letter in "qu" for i in range(1, 11)]


def after_a_turn(sweep, speed_rpm, start):
    """Returns the state after a turn at constant speed (deviations from the equilibrium, and
    speeds), and the equilibrium."""
    turn_s = 60 / speed_rpm
    spin = {"profile": "table", "time_s": [0, 1], "speed_rpm": [speed_rpm, speed_rpm]}
    start_options = [f"{name}={value!r}" for name, value in zip(STATES, start.tolist()) if value]
    motion, metadata = trace_motion(sweep, spin, turn_s, turn_s, start_options, with_speeds=True)
    rest = np.array([metadata["equilibrium"][f"q{i}"] for i in range(1, 11)])
    return motion[-1], rest


def find_periodic_state(sweep, speed_rpm):
    """Finds the periodic state by Newton's method with finite differences. Returns it with the
    equilibrium."""
    start = np.zeros(20)
    sizes = np.concatenate([np.full(4, 1e-6), np.full(6, 1e-6), np.full(10, 1e-4)])
    end, rest = after_a_turn(sweep, speed_rpm, start)
    slopes = np.zeros((20, 20))
    for j, size in enumerate(sizes):
        shifted_start = start.copy()
        shifted_start[j] += size
        slopes[:, j] = (after_a_turn(sweep, speed_rpm, shifted_start)[0] - end) / size
    # All steps use the Jacobian at equilibrium, because the nonlinear part is small.
    for _ in range(40):
        start = start + np.linalg.solve(np.eye(20) - slopes, end - start)
        end, _ = after_a_turn(sweep, speed_rpm, start)
        if np.abs(end - start)[:10].max() < PERIODIC_TOLERANCE:
            return start, rest
    sys.exit(f"no periodic motion was found at {speed_rpm} rpm")


def first_row(sweep, verb, speed_rpm, *options):
    """Returns the first row that a command computes for the paper's machine at a speed."""
    with tempfile.TemporaryDirectory() as folder:
        grid_file, out = pathlib.Path(folder) / "dwell.toml", pathlib.Path(folder) / "a.parquet"
        grid_file.write_text(grid({"profile": "ramp", "peak_rpm": 1.0, "ramp_s": 1.0}, 1.0))
        command = [sweep, verb, grid_file, "--speed", str(speed_rpm), *options, "--out", out]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        return pq.read_table(out).slice(0, 1).to_pylist()[0]


def stability_result(sweep, speed_rpm):
    """Returns the growth (1/s) and the lines (cycles/min) by `sweep stability`."""
    row = first_row(sweep, "stability", speed_rpm)
    return row["growth_per_s"], sorted({row["frequency_cpm"], row["other_frequency_cpm"]})


def continue_motion(sweep, machine, row, turns, step_s):
    """Continues the motion of a row in Exudyn. Returns the deviations from the equilibrium at the
    samples."""
    units = ["m"] * 4 + ["rad"] * 6
    q = np.array([row[f"q{i}_{unit}"] for i, unit in enumerate(units, 1)])
    u = np.array([row[f"u{i}_{unit}_per_s"] for i, unit in enumerate(units, 1)])
    speed_rpm = row["speed_rpm"]
    _, rest = after_a_turn(sweep, speed_rpm, np.zeros(20))
    every_s, speed = 60 / speed_rpm / SAMPLES_PER_TURN, speed_rpm * RAD_PER_S_PER_RPM
    washer = Washer(machine, rest + q, u, lambda t: speed * t, speed)
    end_s = turns * SAMPLES_PER_TURN * every_s
    return washer.run(end_s, dividing_step_s(every_s, step_s), every_s) - rest


def dividing_step_s(every_s, longest_s):
    """Returns the longest step, up to `longest_s`, that divides the interval between samples."""
    return every_s / math.ceil(every_s / longest_s)


def largest_multiplier(samples):
    """Returns the largest multiplier of the non-periodic part per turn. `samples` has the
    dimensions turn, sample and coordinate. The change in a turn is fitted by a linear combination
    of the changes in preceding turns."""
    changes = np.diff(samples, axis=0)
    changes = changes / np.abs(changes).max(axis=(0, 1))
    turns = len(changes) - PRECEDING_TURNS
    preceding = [changes[first : first + turns] for first in reversed(range(PRECEDING_TURNS))]
    rows = np.array([part.ravel() for part in preceding]).T
    coefficients = np.linalg.lstsq(rows, changes[PRECEDING_TURNS:].ravel(), rcond=None)[0]
    return max(np.roots([1.0, *-coefficients]), key=abs)


def find_lines(values, every_s, speed_rpm, growth_per_s, count):
    """Returns the frequencies of the strongest lines below the drum's speed (cycles/min). The
    periodic part is subtracted, and the growth is divided out."""
    times = every_s * np.arange(len(values))
    growth_factors = np.exp(growth_per_s * times)
    angles = math.tau * speed_rpm / 60 * times
    basis = np.array([f(k * angles) for k in range(4) for f in (np.cos, np.sin)]).T
    total = np.zeros(1 << 17)
    for column in values.T:
        remainder = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
        windowed = remainder / growth_factors * np.hanning(len(remainder))
        spectrum = np.abs(np.fft.rfft(windowed, 2 * len(total)))[: len(total)]
        total += spectrum / spectrum.max()
    frequency = np.arange(len(total)) / (2 * len(total) * every_s) * 60
    is_candidate = (frequency > 20) & (frequency < speed_rpm - 20)
    peaks = [
        k
        for k in range(1, len(total) - 1)
        if is_candidate[k] and total[k] >= total[k - 1] and total[k] > total[k + 1]
    ]
    strongest = sorted(peaks, key=lambda k: -total[k])[:count]
    return sorted(frequency[k] for k in strongest)


def main():
    """Prints all comparisons; returns 1 if a difference exceeds its bound."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sweep", default=str(ROOT / "target/release/sweep"), help="the binary")
    parser.add_argument("--step", type=float, default=2e-4, help="Exudyn's step, s")
    arguments = parser.parse_args()
    exudyn.config.printToConsole = False
    sweep = arguments.sweep
    machine = tomllib.loads(
        subprocess.run(
            [sweep, "init", "--machine", "-"], check=True, capture_output=True, text=True
        ).stdout
    )
    print("| dwell, rpm | growth, 1/s | Exudyn | lines, per minute | Exudyn |")
    print("|---|---|---|---|---|")
    is_within_bounds = True
    for speed_rpm, dwell_s in DWELLS:
        growth_per_s, own_lines = stability_result(sweep, speed_rpm)
        start, rest = find_periodic_state(sweep, speed_rpm)
        q, u = rest + start[:10], start[10:]
        q[[4, 6]] += DISTURBANCE_RAD
        every_s = 60 / speed_rpm / SAMPLES_PER_TURN
        step_s = dividing_step_s(every_s, arguments.step)
        sample_count = math.floor(dwell_s / every_s)
        speed = speed_rpm * RAD_PER_S_PER_RPM
        washer = Washer(machine, q, u, lambda t, speed=speed: speed * t, speed)
        motion = washer.run(sample_count * every_s, step_s, every_s)[:, OBSERVED_COORDINATES]
        settled_motion = motion[SETTLED_TURNS * SAMPLES_PER_TURN :]
        turns = len(settled_motion) // SAMPLES_PER_TURN
        samples = settled_motion[: turns * SAMPLES_PER_TURN]
        shape = (turns, SAMPLES_PER_TURN, len(OBSERVED_COORDINATES))
        multiplier = largest_multiplier(samples.reshape(shape))
        exudyn_growth_per_s = math.log(abs(multiplier)) * speed_rpm / 60
        exudyn_lines = find_lines(
            settled_motion, every_s, speed_rpm, exudyn_growth_per_s, len(own_lines)
        )
        print(
            f"| {speed_rpm:g} | {growth_per_s:.4f} | {exudyn_growth_per_s:.4f} "
            f"| {', '.join(f'{line:.1f}' for line in own_lines)} "
            f"| {', '.join(f'{line:.1f}' for line in exudyn_lines)} |"
        )
        is_within_bounds &= abs(exudyn_growth_per_s / growth_per_s - 1) <= GROWTH_BOUND
        differences = [abs(a - b) for a, b in zip(own_lines, exudyn_lines)]
        has_all_lines = len(exudyn_lines) == len(own_lines)
        is_within_bounds &= has_all_lines and max(differences) <= LINE_BOUND
    print("\n| dwell, rpm | kind | yaw and pitch, mrad | Exudyn, of 32 turns at least |")
    print("|---|---|---|---|")
    for speed_rpm, kind, turns in FINAL_MOTIONS:
        row = first_row(sweep, "dwell", speed_rpm, "--starts", "1", "--sections", "1")
        motion = continue_motion(sweep, machine, row, turns, arguments.step)
        motion = np.abs(motion[:, OBSERVED_COORDINATES])
        exudyn_maxima = motion.max(axis=0)
        own_maxima = np.array([row["nonlinear_tub_yaw"], row["nonlinear_tub_pitch"]])
        cells = [
            ", ".join(f"{1e3 * value:.1f}" for value in maxima)
            for maxima in (own_maxima, exudyn_maxima)
        ]
        print(f"| {speed_rpm:g} | {row['kind']} | {cells[0]} | {cells[1]} |")
        is_within_bounds &= row["kind"] == kind
        is_within_bounds &= np.abs(exudyn_maxima / own_maxima - 1).max() <= DEVIATION_BOUND
    if not is_within_bounds:
        print("a difference exceeds its bound", file=sys.stderr)
    return 0 if is_within_bounds else 1


if __name__ == "__main__":
    sys.exit(main())
