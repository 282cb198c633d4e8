"""A trace's page in headless Chromium, held against the Parquet file it was made from.

    python check_chart.py TRACE.parquet PAGE.html [--screenshots FOLDER]

The pointer is moved over the chart with the browser's own input events; what the page then says is compared with the file's row
at the instant that it names. Exits with 1 at the first thing that is wrong.
"""

import argparse
import bisect
import sys

import pyarrow.parquet as pq
from check_page import Page, Wrong, check, number_in, same, stands_alone
from selenium.webdriver.common.by import By

# Channels and the unit in which the page shows them, as parts of the file's.
SHOWN = {"tub_front_y": 1e3, "tub_front_z": 1e3, "tub_yaw": 1e3, "tub_pitch": 1e3}


class Chart(Page):
    """The page of curves."""

    def figure(self):
        return self.driver.find_element(By.CSS_SELECTOR, "#main .figure")

    def drawn(self):
        return self.driver.find_elements(By.CSS_SELECTOR, "#main .figure canvas")

    def bounds(self):
        """Where the chart lies in the window."""
        return self.driver.execute_script("return arguments[0].getBoundingClientRect().toJSON()", self.figure())

    def legend(self):
        """What the legend says: entries by name, each with its value if it has one."""
        entries = [item.text for item in self.driver.find_elements(By.CSS_SELECTOR, "#main .legend li")]
        return dict(entry.rpartition(": ")[::2] if ": " in entry else (entry, "") for entry in entries)

    def picture(self):
        """A number that changes with the picture."""
        self.frame()
        return hash(self.driver.execute_script("return document.querySelector('#main canvas').toDataURL()"))


def hovering_shows_the_file(page, rows):
    """Over the whole width, every value said is the file's at that instant."""
    times = rows["time_s"]
    read = 0
    for part in range(1, 12):
        bounds = page.bounds()
        x = bounds["left"] + 100 + (bounds["width"] - 130) * part / 12
        page.mouse("mouseMoved", x, bounds["top"] + 150)
        page.wait(lambda: "Time (s)" in page.legend(), "hovering never showed a time")
        item = page.driver.find_element(By.CSS_SELECTOR, "#main .legend li[data-x]")
        instant = float(item.get_attribute("data-x"))
        row = bisect.bisect_left(times, instant - 1e-6 * times[-1])
        check(abs(times[row] - instant) < 1e-5 * times[-1], f"no instant {instant} in the file")
        said = page.legend()
        for channel, factor in SHOWN.items():
            for model in ("nonlinear", "linear"):
                name = f"{channel.replace('_', ' ')}, {model} model"
                true = factor * rows[f"{model}_{channel}"][row]
                check(same(number_in(said.get(name, "")), true), f"{name} at {instant} s: {said.get(name)} for {true}")
                read += 1
    return f"{read} values at 11 instants"


def marks_are_explained(page):
    """The legend says what dashed lines and the mixed colour are."""
    page.mouse("mouseMoved", 5, 5)
    wanted = {"nonlinear model", "linear model", "both, one over the other", "resonance speed passed"}
    page.wait(lambda: wanted <= set(page.legend()), f"the legend does not say {wanted}")
    return ", ".join(sorted(wanted))


def switches_and_zoom_redraw(page):
    """Each channel's box changes the picture; wheel zooms and a double click resets."""
    boxes = page.driver.find_elements(By.CSS_SELECTOR, "#main .controls input")
    before = page.picture()
    for box in boxes:
        page.driver.execute_script("arguments[0].click()", box)
        after = page.picture()
        check(after != before, "a channel's box does not redraw")
        before = after
    for box in boxes:
        page.driver.execute_script("arguments[0].click()", box)
    whole = page.picture()
    bounds = page.bounds()
    at = (bounds["left"] + bounds["width"] / 2, bounds["top"] + 150)
    page.mouse("mouseWheel", *at, deltaX=0, deltaY=-600)
    page.wait(lambda: page.picture() != whole, "the wheel does not zoom")
    page.shot("chart-zoomed")
    for count in (1, 2):
        page.mouse("mousePressed", *at, button="left", clickCount=count)
        page.mouse("mouseReleased", *at, button="left", clickCount=count)
    page.mouse("mouseMoved", 5, 5)
    page.wait(lambda: page.picture() == whole, "a double click does not reset")
    return f"{len(boxes)} boxes, wheel, double click"


def main():
    """Run every check on one page."""
    parser = argparse.ArgumentParser(description="Check a trace's page in headless Chromium against its Parquet file.")
    parser.add_argument("trace")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    rows = pq.read_table(arguments.trace).to_pydict()
    page = Chart(arguments.page, arguments.screenshots)
    try:
        for name, run in [
            ("alone", lambda: stands_alone(page)),
            ("hover", lambda: hovering_shows_the_file(page, rows)),
            ("legend", lambda: marks_are_explained(page)),
            ("switch", lambda: switches_and_zoom_redraw(page)),
        ]:
            result = run()
            page.quiet(name)
            page.shot(f"chart-{name}")
            print(f"{name:10} {result}")
    except Wrong as wrong:
        page.shot("wrong")
        sys.exit(f"{arguments.page}: {wrong}")
    finally:
        page.close()


if __name__ == "__main__":
    main()
