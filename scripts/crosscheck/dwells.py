#!/usr/bin/env python3
"""Dwells at constant speed in Exudyn: do disturbances grow as `sweep stability` says?

    python scripts/crosscheck/dwells.py [--sweep BINARY] [--step S]

The paper's machine at 250 and at 305 rpm, where its periodic response is unstable. Exudyn starts
beside the periodic motion, which is found from turns by `sweep trace`, and dwells. Looks once a
turn give the multiplier of what grows in Exudyn, and so its growth; the spectrum of yaw and pitch,
less what repeats every turn, gives the lines. Exit code 1 if growth or a line differs by more than
its bound.
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


def told(sweep, speed_rpm):
    """Growth (1/s) and lines (cycles per minute) by `sweep stability`."""
    with tempfile.TemporaryDirectory() as folder:
        grid_file, out = pathlib.Path(folder) / "dwell.toml", pathlib.Path(folder) / "a.parquet"
        grid_file.write_text(grid({"profile": "ramp", "peak_rpm": 1.0, "ramp_s": 1.0}, 1.0))
        speeds = f"{speed_rpm}:{speed_rpm + 1}:1"
        command = [sweep, "stability", grid_file, "--speed", speeds, "--out", out]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        row = pq.read_table(out).slice(0, 1).to_pylist()[0]
    assert row["speed_rpm"] == speed_rpm
    return row["growth_per_s"], sorted({row["frequency_cpm"], row["other_frequency_cpm"]})


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
        # Steps that end at every look.
        step_s = every_s / math.ceil(every_s / arguments.step)
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
    if not sound:
        print("a difference exceeds its bound", file=sys.stderr)
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
