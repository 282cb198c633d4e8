"""What pages compute of constant speeds, in headless Chromium, held against the program's rows.

    python check_held.py SWEEP_BINARY [--screenshots FOLDER]

Two maps have the metrics growth and dwell at two speeds: of the machine of the paper, and of one
with friction. Each point is typed into the map's live page, which then computes both. Exits with 1
if a number is off by more than the rows of one motion are.
"""

import argparse
import math
import pathlib
import shutil
import subprocess
import tempfile

from check_live import LONGEST_CHECK_S, Live, opens
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
# Growth, 1/s; deviations, as a share: two trajectories of one motion (`SAME` in dwell.rs).
BOUNDS = {"growth": 1e-5, "dwell": 1e-2}


def numbers(page, metric):
    """What the page says of a metric, once it is there."""
    script = "return document.getElementById('held')?.dataset[arguments[0]] ?? ''"
    page.until(lambda: page.driver.execute_script(script, metric), f"no {metric}")
    return [float(text) for text in page.driver.execute_script(script, metric).split()]


def differences(page, data):
    """How far growth (1/s) and deviations (a share) are from the rows, at most."""
    worst = {"growth": 0.0, "dwell": 0.0}
    for row in data.rows:
        page.computed({axis: row[axis] for axis in data.axes})
        button = "return Boolean(document.querySelector('#held button'))"
        page.until(lambda: page.driver.execute_script(button), "no button")
        page.driver.execute_script("document.querySelector('#held button').click()")
        growth, = numbers(page, "growth")
        worst["growth"] = max(worst["growth"], abs(growth - row["growth_per_s"]))
        names = [channel["name"] for channel in page.live["channels"]]
        for name, deviation in zip(names, numbers(page, "dwell"), strict=True):
            true = row.get(f"dwell_{name}", math.nan)
            worst["dwell"] = max(worst["dwell"], abs(deviation / true - 1))
    return worst


def main():
    """Compare, and say what was found."""
    parser = argparse.ArgumentParser(description="Hold constant speeds of live pages to rows.")
    parser.add_argument("sweep")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        shutil.copy(ROOT / "docs/examples/friction.toml", folder / "friction.toml")
        for machine in ("paper", "friction.toml"):
            plan, result, html = (folder / f"held.{end}" for end in ("toml", "parquet", "html"))
            plan.write_text(GRID.replace("MACHINE", machine))
            quiet = {"check": True, "capture_output": True}
            subprocess.run([arguments.sweep, "run", plan, "--out", result, "--fresh"], **quiet)
            subprocess.run([arguments.sweep, "plot", result, "--live", "-o", html], **quiet)
            page = Live(html, arguments.screenshots)
            try:
                page.driver.set_script_timeout(LONGEST_CHECK_S)
                opens(page)
                worst = differences(page, Map(result))
                page.shot(f"live-held-{machine}")
                said = page.text("held")
            finally:
                page.close()
            for metric, bound in BOUNDS.items():
                check(worst[metric] <= bound, f"{machine}: {metric} is off by {worst[metric]:.1e}")
            print(f"{machine}: growth within {worst['growth']:.0e}/s, deviations of dwells within "
                  f"{worst['dwell']:.0e}: {said}")


if __name__ == "__main__":
    main()
