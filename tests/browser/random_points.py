"""Compares live pages of random machines with rows of the program.

    python random_points.py SWEEP_BINARY [--maps N] [--seed N]

Each map has nine points of a random machine, spin profile, window and criterion. Each point is
typed into the map's live page. Prints the greatest relative differences of amplitudes, ratios and
metrics from the file, and exits with 1 if a reliable point exceeds the bound of live pages.
"""

import argparse
import math
import pathlib
import random
import subprocess
import sys
import tempfile

from check_live import (
    LIMIT_OF_CHECK_S,
    MAX_PEAK_DIFFERENCE,
    Live,
    check_module,
    check_slider_scales,
)
from check_page import Map

# Parameters with their usual values and the greatest factors by which they are changed.
PARAMETERS = {
    "spring_stiffness_n_per_m": (8000.0, 1.6),
    "flexure_stiffness_n_m_per_rad": (29670.0, 2.0),
    "tub_mass_kg": (23.87, 1.5),
    "drum_mass_kg": (3.64, 1.5),
    "unbalance_x_m": (0.3, 1.4),
    "damper_1_cabinet_z_m": (0.28, 1.4),
    "tub_inertia_22_kg_m2": (1.61, 1.4),
}


def random_grid(generator):
    """Returns the text of a grid file with random numbers."""

    def vary(value, factor):
        return value * factor ** generator.uniform(-1.0, 1.0)

    names = generator.sample(sorted(PARAMETERS), 3)
    constants = [f"{name} = {vary(*PARAMETERS[name])!r}" for name in names]
    profile = generator.choice(["ramp", "triangular", "cycloidal"])
    end_s = generator.uniform(5.0, 20.0)
    from_s = generator.uniform(0.0, 0.7) * end_s
    masses = [vary(mass_kg, 1.4) for mass_kg in (0.05, 0.3, 0.8)]
    dampings = f"from = {vary(70.0, 1.4)!r}, to = {vary(280.0, 1.4)!r}, count = 3"
    return "\n".join([
        'name = "random"',
        'metrics = ["static_sag", "cabinet_force", "clash_time"]',
        "[reliability]", f'criterion = "{generator.choice(["peak", "rms", "envelope"])}"',
        "[set]", *constants,
        "[spin]", f'profile = "{profile}"',
        f"peak_rpm = {vary(320.0, 1.6)!r}", f"ramp_s = {generator.uniform(0.4, 1.1) * end_s!r}",
        "[time]", f"end_s = {end_s!r}", f"window_s = [{from_s!r}, {end_s!r}]",
        "[[axis]]", 'parameter = "unbalance_mass_kg"', f"values = {sorted(masses)!r}",
        "[[axis]]", 'parameter = "damping_n_s_per_m"',
        f'range = {{ {dampings}, spacing = "log" }}', "",
    ])


def row_differences(page, data):
    """Yields for each regular row whether it is reliable, and its greatest difference."""
    for row in data.rows:
        if row["status"] != "ok" or row["sensitive"]:
            continue
        where = {axis: row[axis] for axis in data.axes}
        page_values = {"static_sag_m": None}
        for model, record in zip(("nonlinear", "linear"), page.compute(where)):
            page_values |= {f"{model}_{channel}": record[channel] for channel in data.channels}
            page_values |= record["metrics"]
        names = [channel["name"] for channel in page.live["channels"]]
        ratios = dict(zip(names, map(float, page.panel("ratios").split())))
        page_values |= {f"ratio_{channel}": ratios[channel] for channel in data.channels}
        page_values["static_sag_m"] = float(page.panel("sag"))
        yield bool(row["reliable"]), max(
            (difference_of(column, value, row[column]), column, where)
            for column, value in page_values.items()
        )


def difference_of(column, value, file_value):
    """Returns the relative difference, or that in seconds for times, which may be zero."""
    is_time = column.endswith("_s")
    difference = abs(value - file_value) if is_time else abs(value / file_value - 1)
    return math.inf if math.isnan(difference) else difference


def main():
    """Compares all maps and prints the greatest differences."""
    parser = argparse.ArgumentParser(description="Compare live pages of random machines with rows.")
    parser.add_argument("sweep")
    parser.add_argument("--maps", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    counts, max_differences = {True: 0, False: 0}, {True: (0.0,), False: (0.0,)}
    with tempfile.TemporaryDirectory() as name:
        plan, result, html = (pathlib.Path(name) / f"random.{end}"
                              for end in ("toml", "parquet", "html"))
        for number in range(arguments.maps):
            plan.write_text(random_grid(random.Random(f"{arguments.seed} {number}")))
            run_options = {"check": True, "capture_output": True}
            command = [arguments.sweep, "run", plan, "--out", result, "--fresh"]
            subprocess.run(command, **run_options)
            subprocess.run([arguments.sweep, "plot", result, "--live", "-o", html], **run_options)
            page = Live(html, None)
            try:
                page.driver.set_script_timeout(LIMIT_OF_CHECK_S)
                check_module(page)
                check_slider_scales(page)
                for is_reliable, difference in row_differences(page, Map(result)):
                    counts[is_reliable] += 1
                    entry = (difference[0], number, *difference[1:])
                    max_differences[is_reliable] = max(max_differences[is_reliable], entry,
                                          key=lambda entry: entry[0])
            finally:
                page.close()
    print(f"{arguments.maps} maps, seed {arguments.seed}")
    print(f"reliable: {counts[True]} points, at most {max_differences[True]}")
    print(f"not reliable: {counts[False]} points, at most {max_differences[False]}")
    sys.exit(max_differences[True][0] > MAX_PEAK_DIFFERENCE)


if __name__ == "__main__":
    main()
