#!/usr/bin/env python3
"""Computes how the boundary of Fig. 12 depends on numbers that the paper does not give, and writes
the table of docs/sensitivity.md.

    python scripts/figures/sensitivity.py [SWEEP_BINARY] [--check]

Follows the boundary of `sweeps/sensitivity.toml`, unchanged and for each variant below. With
--check the script only compares the table with the document. Requires pyarrow.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import pyarrow.parquet

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
GRID = ROOT / "sweeps/sensitivity.toml"
DOCUMENT = ROOT / "docs/sensitivity.md"
BEGIN_MARK, END_MARK = "<!-- table: begin -->", "<!-- table: end -->"
FIRST_AXIS, SECOND_AXIS = "unbalance_mass_kg", "damping_n_s_per_m"

# The varied lengths: description, parameter, other values and assumed value.
LENGTHS = [
    ("front bearing, L_fb", "bearing_front_x_m", [0.030, 0.080], 0.050),
    ("rear bearing, -L_rb", "bearing_rear_x_m", [-0.030, -0.080], -0.050),
    ("hinge, L_D", "drum_hinge_x_m", [0.100, 0.200], 0.150),
    ("drum's front, L_D + L_DE", "drum_front_x_m", [0.400, 0.500], 0.450),
    ("tub's front", "tub_front_x_m", [0.400, 0.500], 0.450),
    ("radial clearance", "radial_clearance_m", [0.005, 0.020], 0.010),
]
# The other durations of the ramp and the assumed one. The window and the end of the run scale with
# the duration.
RAMPS_S, RAMP_S = [25.0, 100.0], 50.0


def follow_boundary(
    sweep: str, grid: pathlib.Path, constants: list[str]
) -> tuple[dict[float, list[dict]], int]:
    """Follows the boundary of a grid; returns its rows by mass, and the number of points."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "boundary.parquet"
        command = [sweep, "boundary", str(grid), "--out", str(out)]
        command += ["--tolerance", "0.5", "--lattice", "4"]
        for constant in constants:
            command += ["--set", constant]
        completed = subprocess.run(command, capture_output=True, text=True)
        if completed.returncode != 0:
            sys.exit(f"{' '.join(command)}\n{completed.stderr}")
        rows = pyarrow.parquet.read_table(out).to_pylist()
    by_mass: dict[float, list[dict]] = {}
    for row in rows:
        by_mass.setdefault(row[FIRST_AXIS], []).append(row)
    return by_mass, sum(rows[0]["points"] for rows in by_mass.values())


def loaded_spring_lengths(sweep: str) -> list[str]:
    """Returns free lengths with which the tabulated position is that of the loaded machine.

    The load of each spring follows from the law of the lever.
    """
    command = [sweep, "parameters", "--json"]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    value = {row["name"]: row["value"] for row in json.loads(output)}
    centre_names = {
        "tub": "centre_x_m",
        "shaft": "centre_x_m",
        "drum": "centre_x_m",
        "unbalance": "x_m",
    }
    masses = {body: value[f"{body}_mass_kg"] for body in centre_names}
    mass = sum(masses.values())
    centre = sum(masses[body] * value[f"{body}_{name}"] for body, name in centre_names.items())
    centre /= mass
    constants = []
    for spring, other in [(1, 3), (2, 4), (3, 1), (4, 2)]:
        cabinet, tub = (
            [value[f"spring_{spring}_{end}_{axis}_m"] for axis in "xyz"]
            for end in ["cabinet", "tub"]
        )
        lever = value[f"spring_{other}_tub_x_m"]
        load_share = (centre - lever) / (tub[0] - lever) / 2
        length = math.dist(cabinet, tub)
        upwards = (cabinet[1] - tub[1]) / length
        tension = load_share * mass * value["gravity_m_per_s2"] / upwards
        free_length = length - tension / value["spring_stiffness_n_per_m"]
        constants.append(f"spring_{spring}_free_length_m={free_length!r}")
    return constants


def grid_with_ramp(ramp_s: float) -> str:
    """Returns the grid with another ramp. Speeds in its window are the same."""
    text = GRID.read_text()
    for old_text, new_text in [
        (f"ramp_s = {RAMP_S}", f"ramp_s = {ramp_s}"),
        (f"end_s = {RAMP_S}", f"end_s = {ramp_s}"),
        ("window_s = [30.0, 50.0]", f"window_s = [{0.6 * ramp_s}, {ramp_s}]"),
    ]:
        if text.count(old_text) != 1:
            sys.exit(f"{GRID} must have `{old_text}` once")
        text = text.replace(old_text, new_text)
    return text


def format_cell(rows: list[dict], base: list[dict] | None) -> str:
    """Returns a cell of the table: the boundary and its change, or the reason for its absence."""
    if any(row["kind"] != "crossing" for row in rows):
        return ", ".join(row["kind"].replace("_", " ") for row in rows)
    dampings = [row[SECOND_AXIS] for row in rows]
    text = ", ".join(f"{damping:.1f}" for damping in dampings)
    base_dampings = [row[SECOND_AXIS] for row in base or [] if row["kind"] == "crossing"]
    if len(dampings) == len(base_dampings) == 1:
        text += f" ({dampings[0] - base_dampings[0]:+.1f})".replace("-0.0", "+0.0")
    return text


def main() -> int:
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("sweep", nargs="?", default="sweep", help="the binary")
    arguments.add_argument(
        "--check", action="store_true", help="compare with the document instead of writing it"
    )
    options = arguments.parse_args()

    base, points = follow_boundary(options.sweep, GRID, [])
    masses = sorted(base)
    lines = [
        "| varied | from, to | " + " | ".join(f"{mass:g} kg" for mass in masses) + " |",
        "|---|---|" + "---|" * len(masses),
        "| as assumed | | " + " | ".join(format_cell(base[mass], None) for mass in masses) + " |",
    ]

    changes_without_effect: dict[str, list[str]] = {}

    def add_line(
        description: str, change: str, rows_by_mass: dict[float, list[dict]]
    ) -> None:
        cells = [format_cell(rows_by_mass[mass], base[mass]) for mass in masses]
        if all(text.endswith("(+0.0)") for text in cells):
            changes_without_effect.setdefault(description, []).append(change)
            return
        lines.append(f"| {description} | {change} | " + " | ".join(cells) + " |")
        print(lines[-1], file=sys.stderr)

    for description, name, values, assumed in LENGTHS:
        for value in values:
            rows_by_mass, added_points = follow_boundary(
                options.sweep, GRID, [f"{name}={value}"]
            )
            points += added_points
            add_line(description, f"{assumed * 1000:g} to {value * 1000:g} mm", rows_by_mass)
    rows_by_mass, added_points = follow_boundary(
        options.sweep, GRID, loaded_spring_lengths(options.sweep)
    )
    points += added_points
    add_line("springs' ends in Table 4", "without load to with it", rows_by_mass)
    for ramp_s in RAMPS_S:
        with tempfile.TemporaryDirectory() as folder:
            grid = pathlib.Path(folder) / "sensitivity.toml"
            grid.write_text(grid_with_ramp(ramp_s))
            rows_by_mass, added_points = follow_boundary(options.sweep, grid, [])
        points += added_points
        add_line("ramp", f"{RAMP_S:g} to {ramp_s:g} s", rows_by_mass)
    descriptions = [
        f"- {description}: {', '.join(changes)}"
        for description, changes in changes_without_effect.items()
    ]
    lines += ["", "These move the boundary by less than 0.05 N s/m:", "", *descriptions]
    lines += ["", f"{points} points in all."]

    table = "\n".join(lines)
    document = DOCUMENT.read_text()
    before, rest = document.split(BEGIN_MARK)
    _, after = rest.split(END_MARK)
    updated_document = f"{before}{BEGIN_MARK}\n\n{table}\n\n{END_MARK}{after}"
    if options.check:
        is_same = updated_document == document
        print("as in the document" if is_same else "other than in the document", file=sys.stderr)
        return int(not is_same)
    DOCUMENT.write_text(updated_document)
    return 0


if __name__ == "__main__":
    sys.exit(main())
