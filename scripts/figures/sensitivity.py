#!/usr/bin/env python3
"""How far the boundary of Fig. 12 moves with what the paper does not print; writes the table of
docs/sensitivity.md.

    python scripts/figures/sensitivity.py [SWEEP_BINARY] [--check]

Traces `sweeps/sensitivity.toml` once as it is and once for each variant below. With --check the
document must already hold the table that came out. Needs pyarrow.
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
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"
FIRST, SECOND = "unbalance_mass_kg", "damping_n_s_per_m"

# What is changed, to what, and how: constants, or the ramp's duration, with which window and end
# scale.
LENGTHS = [
    ("front bearing, L_fb", "bearing_front_x_m", [0.030, 0.080], 0.050),
    ("rear bearing, -L_rb", "bearing_rear_x_m", [-0.030, -0.080], -0.050),
    ("hinge, L_D", "drum_hinge_x_m", [0.100, 0.200], 0.150),
    ("drum's front, L_D + L_DE", "drum_front_x_m", [0.400, 0.500], 0.450),
    ("tub's front", "tub_front_x_m", [0.400, 0.500], 0.450),
    ("radial clearance", "radial_clearance_m", [0.005, 0.020], 0.010),
]
RAMPS_S, RAMP_S = [25.0, 100.0], 50.0


def trace(
    sweep: str, grid: pathlib.Path, constants: list[str]
) -> tuple[dict[float, list[dict]], int]:
    """The rows of a boundary file by mass, and how many points it took."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "boundary.parquet"
        command = [sweep, "boundary", str(grid), "--out", str(out)]
        command += ["--tolerance", "0.5", "--lattice", "4"]
        for constant in constants:
            command += ["--set", constant]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}\n{done.stderr}")
        rows = pyarrow.parquet.read_table(out).to_pylist()
    by_mass: dict[float, list[dict]] = {}
    for row in rows:
        by_mass.setdefault(row[FIRST], []).append(row)
    return by_mass, sum(rows[0]["points"] for rows in by_mass.values())


def loaded_springs(sweep: str) -> list[str]:
    """Free lengths by which the tabulated place is that of the loaded machine.

    By the law of the lever each spring carries its share of the weight there.
    """
    command = [sweep, "parameters", "--json"]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    value = {row["name"]: row["value"] for row in json.loads(listed)}
    places = {"tub": "centre_x_m", "shaft": "centre_x_m", "drum": "centre_x_m", "unbalance": "x_m"}
    masses = {body: value[f"{body}_mass_kg"] for body in places}
    mass = sum(masses.values())
    centre = sum(masses[body] * value[f"{body}_{place}"] for body, place in places.items()) / mass
    constants = []
    for spring, other in [(1, 3), (2, 4), (3, 1), (4, 2)]:
        cabinet, tub = (
            [value[f"spring_{spring}_{end}_{axis}_m"] for axis in "xyz"]
            for end in ["cabinet", "tub"]
        )
        lever = value[f"spring_{other}_tub_x_m"]
        share = (centre - lever) / (tub[0] - lever) / 2
        length = math.dist(cabinet, tub)
        upwards = (cabinet[1] - tub[1]) / length
        tension = share * mass * value["gravity_m_per_s2"] / upwards
        free = length - tension / value["spring_stiffness_n_per_m"]
        constants.append(f"spring_{spring}_free_length_m={free!r}")
    return constants


def ramped(ramp_s: float) -> str:
    """The grid with another ramp: the window stays where the speeds are the same."""
    text = GRID.read_text()
    for old, new in [
        (f"ramp_s = {RAMP_S}", f"ramp_s = {ramp_s}"),
        (f"end_s = {RAMP_S}", f"end_s = {ramp_s}"),
        ("window_s = [30.0, 50.0]", f"window_s = [{0.6 * ramp_s}, {ramp_s}]"),
    ]:
        if text.count(old) != 1:
            sys.exit(f"{GRID} should say `{old}` once")
        text = text.replace(old, new)
    return text


def cell(rows: list[dict], base: list[dict] | None) -> str:
    """Where the boundary is, or why there is none; beside the change against the base."""
    if any(row["kind"] != "crossing" for row in rows):
        return ", ".join(row["kind"].replace("_", " ") for row in rows)
    places = [row[SECOND] for row in rows]
    said = ", ".join(f"{place:.1f}" for place in places)
    known = [row[SECOND] for row in base or [] if row["kind"] == "crossing"]
    if len(places) == len(known) == 1:
        said += f" ({places[0] - known[0]:+.1f})".replace("-0.0", "+0.0")
    return said


def main() -> int:
    arguments = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    arguments.add_argument("sweep", nargs="?", default="sweep", help="the binary")
    arguments.add_argument(
        "--check", action="store_true", help="compare with the document instead of writing it"
    )
    options = arguments.parse_args()

    base, points = trace(options.sweep, GRID, [])
    masses = sorted(base)
    lines = [
        "| varied | from, to | " + " | ".join(f"{mass:g} kg" for mass in masses) + " |",
        "|---|---|" + "---|" * len(masses),
        "| as assumed | | " + " | ".join(cell(base[mass], None) for mass in masses) + " |",
    ]

    unmoved: dict[str, list[str]] = {}

    def add(what: str, change: str, found: dict[float, list[dict]]) -> None:
        cells = [cell(found[mass], base[mass]) for mass in masses]
        if all(said.endswith("(+0.0)") for said in cells):
            unmoved.setdefault(what, []).append(change)
            return
        lines.append(f"| {what} | {change} | " + " | ".join(cells) + " |")
        print(lines[-1], file=sys.stderr)

    for what, name, values, assumed in LENGTHS:
        for value in values:
            found, more = trace(options.sweep, GRID, [f"{name}={value}"])
            points += more
            add(what, f"{assumed * 1000:g} to {value * 1000:g} mm", found)
    found, more = trace(options.sweep, GRID, loaded_springs(options.sweep))
    points += more
    add("springs' ends in Table 4", "without load to with it", found)
    for ramp_s in RAMPS_S:
        with tempfile.TemporaryDirectory() as folder:
            grid = pathlib.Path(folder) / "sensitivity.toml"
            grid.write_text(ramped(ramp_s))
            found, more = trace(options.sweep, grid, [])
        points += more
        add("ramp", f"{RAMP_S:g} to {ramp_s:g} s", found)
    listed = [f"- {what}: {', '.join(changes)}" for what, changes in unmoved.items()]
    lines += ["", "These move the boundary by less than 0.05 N s/m:", "", *listed]
    lines += ["", f"{points} points in all."]

    table = "\n".join(lines)
    document = DOCUMENT.read_text()
    before, rest = document.split(BEGIN)
    _, after = rest.split(END)
    written = f"{before}{BEGIN}\n\n{table}\n\n{END}{after}"
    if options.check:
        same = written == document
        print("as in the document" if same else "other than in the document", file=sys.stderr)
        return int(written != document)
    DOCUMENT.write_text(written)
    return 0


if __name__ == "__main__":
    sys.exit(main())
