#!/usr/bin/env python3
"""Dwells at constant speed in Exudyn: do disturbances grow as `sweep stability` says, and does the
machine end as `sweep dwell` says?

    python scripts/crosscheck/dwells.py [--sweep BINARY] [--step S]

The paper's machine at 250 and at 305 rpm, where its periodic response is unstable. Exudyn starts
beside the periodic motion, which is found from turns by `sweep trace`, and dwells. Looks once a
turn give the multiplier of what grows in Exudyn, and so its growth; the spectrum of yaw and pitch,
less what repeats every turn, gives the lines. Then Exudyn goes on from the motions that `sweep
dwell` ends in, two frequencies at 250 rpm and every second turn at 297.5: it must stay in them.
Exit code 1 if growth, a line or a largest deviation differs by more than its bound.
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
from against_exudyn import ROOT, grid, ours
from exudyn_washer import RPM, Washer

# Speed (rpm) and length of the dwell (s).
DWELLS = [(250.0, 9.6), (305.0, 12.0)]
# Speed (rpm) and kind of motions that are gone on with, and for how many turns.
ENDS = [(250.0, "quasi_periodic", 64), (297.5, "periodic_2", 32)]
# Looks at the motion in a turn, and the coordinates that show what grows: yaw and pitch of the tub.
LOOKS, SHOWN = 48, [4, 5]
# Yaw by which the start is off the periodic response (rad), of tub and shaft together.
DISTURBANCE_RAD = 5e-5
# A start is periodic once a turn leaves this of it (m, rad).
CLOSED = 1e-9
# Looks before these turns still have other motions in them.
SETTLED_TURNS = 8
# Turns that a turn is a combination of: two for what grows, the others for what decays.
TURNS_BEFORE = 4
# Bounds: growth, as a share of it; lines, cycles per minute.
GROWTH_BOUND, LINE_BOUND = 0.02, 1.5
# Largest deviations, as a share: looks miss 0.2 %, and other turns of two frequencies differ.
END_BOUND = 0.01
STATES = [f"{letter}{i}" for letter in "qu" for i in range(1, 11)]


def after_a_turn(sweep, speed_rpm, start):
    """Where a turn at constant speed leads from a start: deviations from rest and their speeds."""
    turn_s = 60 / speed_rpm
    spin = {"profile": "table", "time_s": [0, 1], "speed_rpm": [speed_rpm, speed_rpm]}
    pairs = [f"{name}={value!r}" for name, value in zip(STATES, start.tolist()) if value]
    motion, told_of_it = ours(sweep, spin, turn_s, turn_s, pairs, with_speeds=True)
    rest = np.array([told_of_it["equilibrium"][f"q{i}"] for i in range(1, 11)])
    return motion[-1], rest


def periodic(sweep, speed_rpm):
    """The start from which a turn leads back to itself, by Newton's method with differences; and
    the place of rest."""
    start = np.zeros(20)
    sizes = np.concatenate([np.full(4, 1e-6), np.full(6, 1e-6), np.full(10, 1e-4)])
    end, rest = after_a_turn(sweep, speed_rpm, start)
    slopes = np.zeros((20, 20))
    for j, size in enumerate(sizes):
        beside = start.copy()
        beside[j] += size
        slopes[:, j] = (after_a_turn(sweep, speed_rpm, beside)[0] - end) / size
    # The matrix at rest serves all steps: what is not linear is a small part.
    for _ in range(40):
        start = start + np.linalg.solve(np.eye(20) - slopes, end - start)
        end, _ = after_a_turn(sweep, speed_rpm, start)
        if np.abs(end - start)[:10].max() < CLOSED:
            return start, rest
    sys.exit(f"no periodic motion was found at {speed_rpm} rpm")


def first_row(sweep, verb, speed_rpm, *options):
    """The first row that a command writes of the paper's machine at a speed."""
    with tempfile.TemporaryDirectory() as folder:
        grid_file, out = pathlib.Path(folder) / "dwell.toml", pathlib.Path(folder) / "a.parquet"
        grid_file.write_text(grid({"profile": "ramp", "peak_rpm": 1.0, "ramp_s": 1.0}, 1.0))
        command = [sweep, verb, grid_file, "--speed", str(speed_rpm), *options, "--out", out]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        return pq.read_table(out).slice(0, 1).to_pylist()[0]


def told(sweep, speed_rpm):
    """Growth (1/s) and lines (cycles per minute) by `sweep stability`."""
    row = first_row(sweep, "stability", speed_rpm)
    return row["growth_per_s"], sorted({row["frequency_cpm"], row["other_frequency_cpm"]})


def gone_on(sweep, machine, row, turns, step_s):
    """Exudyn's coordinates from rest at the looks of some turns, from the state of a row."""
    units = ["m"] * 4 + ["rad"] * 6
    q = np.array([row[f"q{i}_{unit}"] for i, unit in enumerate(units, 1)])
    u = np.array([row[f"u{i}_{unit}_per_s"] for i, unit in enumerate(units, 1)])
    speed_rpm = row["speed_rpm"]
    _, rest = after_a_turn(sweep, speed_rpm, np.zeros(20))
    every_s, speed = 60 / speed_rpm / LOOKS, speed_rpm * RPM
    washer = Washer(machine, rest + q, u, lambda t: speed * t, speed)
    return washer.run(turns * LOOKS * every_s, step(every_s, step_s), every_s) - rest


def step(every_s, longest_s):
    """A step that ends at every look."""
    return every_s / math.ceil(every_s / longest_s)


def multiplier(looks):
    """The largest factor by which what is not periodic changes in a turn, from looks (turns, places
    in the turn, coordinates): what a turn adds is a combination of what the turns before it
    added."""
    added = np.diff(looks, axis=0)
    added = added / np.abs(added).max(axis=(0, 1))
    turns = len(added) - TURNS_BEFORE
    before = [added[first : first + turns] for first in reversed(range(TURNS_BEFORE))]
    rows = np.array([part.ravel() for part in before]).T
    parts = np.linalg.lstsq(rows, added[TURNS_BEFORE:].ravel(), rcond=None)[0]
    return max(np.roots([1.0, *-parts]), key=abs)


def lines(values, every_s, speed_rpm, growth_per_s, count):
    """The strongest lines below the drum's speed (cycles per minute), less what repeats every turn
    and what grows evened out."""
    times = every_s * np.arange(len(values))
    swing = np.exp(growth_per_s * times)
    whole = math.tau * speed_rpm / 60 * times
    basis = np.array([f(k * whole) for k in range(4) for f in (np.cos, np.sin)]).T
    total = np.zeros(1 << 17)
    for column in values.T:
        rest = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
        even = rest / swing * np.hanning(len(rest))
        spectrum = np.abs(np.fft.rfft(even, 2 * len(total)))[: len(total)]
        total += spectrum / spectrum.max()
    frequency = np.arange(len(total)) / (2 * len(total) * every_s) * 60
    inside = (frequency > 20) & (frequency < speed_rpm - 20)
    peaks = [
        k
        for k in range(1, len(total) - 1)
        if inside[k] and total[k] >= total[k - 1] and total[k] > total[k + 1]
    ]
    strongest = sorted(peaks, key=lambda k: -total[k])[:count]
    return sorted(frequency[k] for k in strongest)


def main():
    """Compare, print, judge."""
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
    sound = True
    for speed_rpm, dwell_s in DWELLS:
        growth_per_s, our_lines = told(sweep, speed_rpm)
        start, rest = periodic(sweep, speed_rpm)
        q, u = rest + start[:10], start[10:]
        q[[4, 6]] += DISTURBANCE_RAD
        every_s = 60 / speed_rpm / LOOKS
        step_s = step(every_s, arguments.step)
        looks = math.floor(dwell_s / every_s)
        speed = speed_rpm * RPM
        washer = Washer(machine, q, u, lambda t, speed=speed: speed * t, speed)
        motion = washer.run(looks * every_s, step_s, every_s)[:, SHOWN]
        settled = motion[SETTLED_TURNS * LOOKS :]
        turns = len(settled) // LOOKS
        factor = multiplier(settled[: turns * LOOKS].reshape(turns, LOOKS, len(SHOWN)))
        theirs = math.log(abs(factor)) * speed_rpm / 60
        their_lines = lines(settled, every_s, speed_rpm, theirs, len(our_lines))
        print(
            f"| {speed_rpm:g} | {growth_per_s:.4f} | {theirs:.4f} "
            f"| {', '.join(f'{line:.1f}' for line in our_lines)} "
            f"| {', '.join(f'{line:.1f}' for line in their_lines)} |"
        )
        sound &= abs(theirs / growth_per_s - 1) <= GROWTH_BOUND
        apart = [abs(a - b) for a, b in zip(our_lines, their_lines)]
        sound &= len(their_lines) == len(our_lines) and max(apart) <= LINE_BOUND
    print("\n| dwell, rpm | kind | yaw and pitch, mrad | Exudyn, of 32 turns at least |")
    print("|---|---|---|---|")
    for speed_rpm, kind, turns in ENDS:
        row = first_row(sweep, "dwell", speed_rpm, "--starts", "1", "--sections", "1")
        motion = np.abs(gone_on(sweep, machine, row, turns, arguments.step)[:, SHOWN])
        theirs = motion.max(axis=0)
        ends = np.array([row["nonlinear_tub_yaw"], row["nonlinear_tub_pitch"]])
        shown = [", ".join(f"{1e3 * value:.1f}" for value in of) for of in (ends, theirs)]
        print(f"| {speed_rpm:g} | {row['kind']} | {shown[0]} | {shown[1]} |")
        sound &= row["kind"] == kind and np.abs(theirs / ends - 1).max() <= END_BOUND
    if not sound:
        print("a difference exceeds its bound", file=sys.stderr)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
