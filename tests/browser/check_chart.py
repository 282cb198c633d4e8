"""A trace's page in headless Chromium, held against the Parquet file it was made from.

    python check_chart.py TRACE.parquet PAGE.html [--screenshots FOLDER]

The pointer is moved over the chart with the browser's own input events; what the page then says is
compared with the file's row at the instant that it names. Exits with 1 at the first thing that is
wrong.
"""

import argparse
import bisect
import itertools

import pyarrow.parquet as pq
from check_page import CTRL, Page, check, number_in, same, stands_alone
from selenium.webdriver.common.by import By

# Channels, their names on the page, and the unit in which it shows them, as parts of the file's.
SHOWN = {
    ("tub_front_y", "Tub front, vertical"): (1e3, "mm"),
    ("tub_front_z", "Tub front, horizontal"): (1e3, "mm"),
    ("tub_yaw", "Tub yaw"): (1e3, "mrad"),
    ("tub_pitch", "Tub pitch"): (1e3, "mrad"),
}


class Chart(Page):
    """The page of curves."""

    def figure(self):
        return self.driver.find_element(By.CSS_SELECTOR, "#main .figure")

    def drawn(self):
        return self.driver.find_elements(By.CSS_SELECTOR, "#main .figure canvas")

    def bounds(self):
        """Where the chart lies in the window."""
        script = "return arguments[0].getBoundingClientRect().toJSON()"
        return self.driver.execute_script(script, self.figure())

    def legend(self):
        """What the legend says lines and marks are."""
        items = self.driver.find_elements(By.CSS_SELECTOR, "#main .legend li")
        return {item.text for item in items}

    def tip(self):
        """The place that the tip is for, and what it says: names to value and unit."""
        tip = self.driver.find_element(By.CSS_SELECTOR, "#main .figure .tip")
        if not tip.is_displayed():
            return None, {}
        cells = {}
        for row in tip.find_elements(By.CSS_SELECTOR, "tr"):
            *values, unit = row.find_elements(By.CSS_SELECTOR, "td")
            cells |= {value.get_attribute("data-name"): (value.text, unit.text) for value in values}
        return float(tip.get_attribute("data-x")), cells

    def tip_bounds(self):
        """Where the tip lies in the window."""
        script = "return document.querySelector('#main .tip').getBoundingClientRect().toJSON()"
        return self.driver.execute_script(script)

    def picture(self):
        """A number that changes with the picture."""
        self.frame()
        script = "return document.querySelector('#main canvas').toDataURL()"
        return hash(self.driver.execute_script(script))


def hovering_shows_the_file(page, rows):
    """Over the whole width, every value said is the file's at that instant, with its unit."""
    times = rows["time_s"]
    read = 0
    for part in range(1, 12):
        bounds = page.bounds()
        x = bounds["left"] + 100 + (bounds["width"] - 130) * part / 12
        before = page.tip()[0]
        page.mouse("mouseMoved", x, bounds["top"] + 150)
        page.wait(lambda: page.tip()[0] not in (None, before), "hovering never showed a time")
        instant, said = page.tip()
        row = bisect.bisect_left(times, instant - 1e-6 * times[-1])
        check(abs(times[row] - instant) < 1e-5 * times[-1], f"no instant {instant} in the file")
        for (channel, words), (factor, unit) in SHOWN.items():
            for model in ("nonlinear", "linear"):
                true = factor * rows[f"{model}_{channel}"][row]
                name = f"{words}, {model} model"
                value, its_unit = said.get(name, ("", ""))
                what = f"{name} at {instant} s: {value} {its_unit} for {true}"
                check(same(number_in(value), true) and its_unit == unit, what)
                read += 1
    return f"{read} values at 11 instants"


def values_are_in_sight(page):
    """However far a high figure is scrolled, the values are in the window, by the pointer."""
    height = page.driver.execute_script("return innerHeight")
    page.driver.execute_script("scrollTo(0, 0)")
    seen = 0
    for down in (0, 200, 400):
        page.driver.execute_script(f"scrollTo(0, {down})")
        page.frame()
        bounds = page.bounds()
        for y in (60, height / 2, height - 40):
            if not bounds["top"] < y < bounds["top"] + bounds["height"]:
                continue
            page.mouse("mouseMoved", bounds["left"] + 300 + y / 10, y)
            page.wait(lambda: page.tip()[0] is not None, "no values at the pointer")
            tip = page.tip_bounds()
            inside = tip["top"] >= -1 and tip["bottom"] <= max(height, tip["height"]) + 1
            check(inside, f"scrolled by {down}, pointer at {y}: the values are at {tip}")
            seen += 1
    page.driver.execute_script("scrollTo(0, 0)")
    return f"{seen} places"


def marks_are_explained(page):
    """The legend says what dashed lines and the mixed colour are."""
    page.mouse("mouseMoved", 5, 5)
    wanted = {
        "nonlinear model", "linear model", "both, one over the other", "resonance speed passed",
    }
    page.wait(lambda: wanted <= page.legend(), f"the legend does not say {wanted}")
    return ", ".join(sorted(wanted))


def boxes_are_named_as_axes(page):
    """A panel's box has the words of its axis."""
    labels = page.driver.find_elements(By.CSS_SELECTOR, "#main .controls label")
    said = [label.text for label in labels]
    for _, words in SHOWN:
        check(words in said, f"no box is named {words}: {said}")
    return f"{len(said)} boxes"


def the_wheel_scrolls(page):
    """The wheel alone scrolls the page, over the figure too; with Ctrl it zooms."""
    page.driver.execute_script("scrollTo(0, 0)")
    bounds = page.bounds()
    at = (bounds["left"] + bounds["width"] / 2, bounds["top"] + 150)
    offset = lambda: page.driver.execute_script("return scrollY")  # noqa: E731
    page.mouse("mouseWheel", *at, deltaX=0, deltaY=200)
    page.wait(lambda: offset() > 0, "the wheel over the figure does not scroll the page")
    check(page.figure().get_attribute("data-view") is None, "the wheel alone zooms")
    touch = page.driver.execute_script("return getComputedStyle(arguments[0]).touchAction",
                                       page.figure())
    check("pan-y" in touch, f"a finger cannot scroll the page: touch-action {touch}")
    page.driver.execute_script("scrollTo(0, 0)")
    return "scrolls"


def switches_and_zoom_redraw(page):
    """Each channel's box changes the picture; wheel and buttons zoom, a double click resets."""
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
    page.mouse("mouseWheel", *at, deltaX=0, deltaY=-600, modifiers=CTRL)
    page.wait(lambda: page.picture() != whole, "Ctrl and the wheel do not zoom")
    page.shot("chart-zoomed")
    for count in (1, 2):
        page.mouse("mousePressed", *at, button="left", clickCount=count)
        page.mouse("mouseReleased", *at, button="left", clickCount=count)
    page.mouse("mouseMoved", 5, 5)
    page.wait(lambda: page.picture() == whole, "a double click does not reset")
    button = page.driver.find_element(By.CSS_SELECTOR, "#main .zoom button")
    page.driver.execute_script("arguments[0].click()", button)
    page.wait(lambda: page.picture() != whole, "the button does not zoom")
    reset = page.driver.find_elements(By.CSS_SELECTOR, "#main .zoom button")[-1]
    page.driver.execute_script("arguments[0].click()", reset)
    page.wait(lambda: page.picture() == whole, "the button does not reset")
    return f"{len(boxes)} boxes, Ctrl and wheel, buttons, double click"


def narrow_and_dark(page):
    """At 400 px nothing is wider than the window; the picture follows the colour scheme."""
    pictures = {}
    for width, scheme in itertools.product((400, 1400), ("light", "dark")):
        page.window(width, scheme)
        pictures[width, scheme] = page.picture()
        wide = page.driver.execute_script("return document.documentElement.scrollWidth")
        check(wide <= width, f"at {width} px the page is {wide} px wide")
        page.shot(f"chart-{width}-{scheme}")
    check(len(set(pictures.values())) == 4, "widths or schemes look alike")
    return "400 and 1400 px, light and dark"


def main():
    """Run every check on one page."""
    parser = argparse.ArgumentParser(
        description="Check a trace's page in headless Chromium against its Parquet file."
    )
    parser.add_argument("trace")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    rows = pq.read_table(arguments.trace).to_pydict()
    page = Chart(arguments.page, arguments.screenshots)
    page.run([
        ("alone", lambda: stands_alone(page)),
        ("hover", lambda: hovering_shows_the_file(page, rows)),
        ("in sight", lambda: values_are_in_sight(page)),
        ("legend", lambda: marks_are_explained(page)),
        ("names", lambda: boxes_are_named_as_axes(page)),
        ("wheel", lambda: the_wheel_scrolls(page)),
        ("switch", lambda: switches_and_zoom_redraw(page)),
        ("widths", lambda: narrow_and_dark(page)),
    ])


if __name__ == "__main__":
    main()
