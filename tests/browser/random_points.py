"""Pages that compute, of random machines, held against the program's rows.

    python random_points.py SWEEP_BINARY [--maps N] [--seed N]

Each map has nine points of a random machine, spin profile, window and criterion; each point is
typed into the map's live page. Says how far the page's amplitudes, ratios and metrics are from the
file's, as a share of each, and exits with 1 if a reliable point is further off than a page
promises.
"""

import argparse
import math
import pathlib
import random
import subprocess
import sys
import tempfile

from check_live import BOUND, LONGEST_CHECK_S, Live, log_axes_have_log_sliders, opens
from check_page import Map

# Parameters, their usual values, and by which factor they may be greater or less.
PARAMETERS = {
    "spring_stiffness_n_per_m": (8000.0, 1.6),
    "flexure_stiffness_n_m_per_rad": (29670.0, 2.0),
    "tub_mass_kg": (23.87, 1.5),
    "drum_mass_kg": (3.64, 1.5),
    "unbalance_x_m": (0.3, 1.4),
    "damper_1_cabinet_z_m": (0.28, 1.4),
    "tub_inertia_22_kg_m2": (1.61, 1.4),
}


def grid(chance):
    """The text of a grid file."""
    def about(value, factor):
        return value * factor ** chance.uniform(-1.0, 1.0)

    chosen = chance.sample(sorted(PARAMETERS), 3)
    constants = [f"{name} = {about(*PARAMETERS[name])!r}" for name in chosen]
    profile = chance.choice(["ramp", "triangular", "cycloidal"])
    end_s = chance.uniform(5.0, 20.0)
    from_s = chance.uniform(0.0, 0.7) * end_s
    masses = [about(mass_kg, 1.4) for mass_kg in (0.05, 0.3, 0.8)]
    dampings = f"from = {about(70.0, 1.4)!r}, to = {about(280.0, 1.4)!r}, count = 3"
    return "\n".join([
        'name = "random"',
        'metrics = ["static_sag", "cabinet_force", "clash_time"]',
        "[reliability]", f'criterion = "{chance.choice(["peak", "rms", "envelope"])}"',
        "[set]", *constants,
        "[spin]", f'profile = "{profile}"',
        f"peak_rpm = {about(320.0, 1.6)!r}", f"ramp_s = {chance.uniform(0.4, 1.1) * end_s!r}",
        "[time]", f"end_s = {end_s!r}", f"window_s = [{from_s!r}, {end_s!r}]",
        "[[axis]]", 'parameter = "unbalance_mass_kg"', f"values = {sorted(masses)!r}",
        "[[axis]]", 'parameter = "damping_n_s_per_m"',
        f'range = {{ {dampings}, spacing = "log" }}', "",
    ])


def distances(page, data):
    """Of each row without a flag, whether it is reliable, and the greatest difference."""
    for row in data.rows:
        if row["status"] != "ok" or row["sensitive"]:
            continue
        where = {axis: row[axis] for axis in data.axes}
        found = {"static_sag_m": None}
        for model, record in zip(("nonlinear", "linear"), page.computed(where)):
            found |= {f"{model}_{channel}": record[channel] for channel in data.channels}
            found |= record["metrics"]
        names = [channel["name"] for channel in page.live["channels"]]
        ratios = dict(zip(names, map(float, page.panel("ratios").split())))
        found |= {f"ratio_{channel}": ratios[channel] for channel in data.channels}
        found["static_sag_m"] = float(page.panel("sag"))
        yield bool(row["reliable"]), max(
            (apart(column, value, row[column]), column, where) for column, value in found.items())


def apart(column, value, true):
    """The relative difference; of times, which may be zero, in seconds."""
    difference = abs(value - true) if column.endswith("_s") else abs(value / true - 1)
    return math.inf if math.isnan(difference) else difference


def main():
    """Compare, and say what was found."""
    parser = argparse.ArgumentParser(description="Hold live pages of random machines to rows.")
    parser.add_argument("sweep")
    parser.add_argument("--maps", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    counts, worst = {True: 0, False: 0}, {True: (0.0,), False: (0.0,)}
    with tempfile.TemporaryDirectory() as name:
        plan, result, html = (pathlib.Path(name) / f"random.{end}"
                              for end in ("toml", "parquet", "html"))
        for number in range(arguments.maps):
            plan.write_text(grid(random.Random(f"{arguments.seed} {number}")))
            quiet = {"check": True, "capture_output": True}
            subprocess.run([arguments.sweep, "run", plan, "--out", result, "--fresh"], **quiet)
            subprocess.run([arguments.sweep, "plot", result, "--live", "-o", html], **quiet)
            page = Live(html, None)
            try:
                page.driver.set_script_timeout(LONGEST_CHECK_S)
                opens(page)
                log_axes_have_log_sliders(page)
                for reliable, distance in distances(page, Map(result)):
                    counts[reliable] += 1
                    worst[reliable] = max(worst[reliable], (distance[0], number, *distance[1:]),
                                          key=lambda found: found[0])
            finally:
                page.close()
    print(f"{arguments.maps} maps, seed {arguments.seed}")
    print(f"reliable: {counts[True]} points, at most {worst[True]}")
    print(f"not reliable: {counts[False]} points, at most {worst[False]}")
    sys.exit(worst[True][0] > BOUND)


if __name__ == "__main__":
    main()
