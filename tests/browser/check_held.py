"""Compares the results of live pages at constant speeds, in headless Chromium, with rows.

    python check_held.py SWEEP_BINARY [--screenshots FOLDER]

Two maps, of the paper's machine and of a machine with friction, have the metrics growth and dwell
at two speeds. Each point is typed into the map's live page, which computes both metrics. Exits with
1 if a number differs by more than the results of two trajectories of a motion.
"""

import argparse
import math
import pathlib
import shutil
import subprocess
import tempfile

from check_live import LIMIT_OF_CHECK_S, Live, check_module
from check_page import Map, check

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
GRID = """name = "held"
machine = "MACHINE"
metrics = ["growth", "dwell"]
stability = { speed_rpm = "230,250" }
spin = { profile = "triangular", peak_rpm = 350, ramp_s = 20 }
time = { end_s = 20, window_s = [5, 20] }
[[axis]]
parameter = "unbalance_mass_kg"
values = [0.3]
[[axis]]
parameter = "tub_mass_kg"
values = [24.0, 25.0]
"""
# The bounds of the difference of growth (1/s) and of the relative difference of deviations.
BOUNDS = {"growth": 1e-5, "dwell": 1e-2}


def wait_for_metric(page, metric):
    """Waits for the numbers of a metric on the page, and returns them."""
    script = "return document.getElementById('held')?.dataset[arguments[0]] ?? ''"
    page.wait_until(lambda: page.driver.execute_script(script, metric), f"no {metric}")
    return [float(text) for text in page.driver.execute_script(script, metric).split()]


def max_differences(page, data):
    """Returns the greatest difference of growth (1/s) and relative difference of deviations."""
    greatest = {"growth": 0.0, "dwell": 0.0}
    for row in data.rows:
        page.compute({axis: row[axis] for axis in data.axes})
        button = "return Boolean(document.querySelector('#held button'))"
        page.wait_until(lambda: page.driver.execute_script(button), "no button")
        page.driver.execute_script("document.querySelector('#held button').click()")
        growth, = wait_for_metric(page, "growth")
        greatest["growth"] = max(greatest["growth"], abs(growth - row["growth_per_s"]))
        names = [channel["name"] for channel in page.live["channels"]]
        for name, deviation in zip(names, wait_for_metric(page, "dwell"), strict=True):
            file_value = row.get(f"dwell_{name}", math.nan)
            greatest["dwell"] = max(greatest["dwell"], abs(deviation / file_value - 1))
    return greatest


def main():
    """Compares both maps and prints the differences."""
    parser = argparse.ArgumentParser(description="Compare constant speeds of live pages with rows.")
    parser.add_argument("sweep")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        shutil.copy(ROOT / "docs/examples/friction.toml", folder / "friction.toml")
        for machine in ("paper", "friction.toml"):
            plan, result, html = (folder / f"held.{end}" for end in ("toml", "parquet", "html"))
            plan.write_text(GRID.replace("MACHINE", machine))
            run_options = {"check": True, "capture_output": True}
            command = [arguments.sweep, "run", plan, "--out", result, "--fresh"]
            subprocess.run(command, **run_options)
            subprocess.run([arguments.sweep, "plot", result, "--live", "-o", html], **run_options)
            page = Live(html, arguments.screenshots)
            try:
                page.driver.set_script_timeout(LIMIT_OF_CHECK_S)
                check_module(page)
                greatest = max_differences(page, Map(result))
                page.save_screenshot(f"live-held-{machine}")
                panel_text = page.text("held")
            finally:
                page.close()
            for metric, bound in BOUNDS.items():
                check(greatest[metric] <= bound,
                      f"{machine}: {metric} is off by {greatest[metric]:.1e}")
            print(f"{machine}: growth within {greatest['growth']:.0e}/s, "
                  "deviations of dwells within "
                  f"{greatest['dwell']:.0e}: {panel_text}")


if __name__ == "__main__":
    main()
