"""Compares the page of a trace in headless Chromium with its Parquet file.

    python check_chart.py TRACE.parquet PAGE.html [--screenshots FOLDER]

Input events of the browser move the pointer over the chart. The values on the page are compared
with the file's row at the same instant. Exits with 1 at the first mistake.
"""

import argparse
import bisect
import itertools

import pyarrow.parquet as pq
from check_page import CONTROL_KEY, Page, check, check_self_contained, is_same, parse_number
from selenium.webdriver.common.by import By

# The channels and their names on the page, with the factors and the units of their values.
CHANNELS = {
    ("tub_front_y", "Tub front, vertical"): (1e3, "mm"),
    ("tub_front_z", "Tub front, horizontal"): (1e3, "mm"),
    ("tub_yaw", "Tub yaw"): (1e3, "mrad"),
    ("tub_pitch", "Tub pitch"): (1e3, "mrad"),
}


class Chart(Page):
    """A page of curves."""

    def figure(self):
        return self.driver.find_element(By.CSS_SELECTOR, "#main .figure")

    def is_drawn(self):
        return self.driver.find_elements(By.CSS_SELECTOR, "#main .figure canvas")

    def bounds(self):
        """Returns the rectangle of the chart in the window."""
        script = "return arguments[0].getBoundingClientRect().toJSON()"
        return self.driver.execute_script(script, self.figure())

    def legend(self):
        """Returns the texts of the legend."""
        items = self.driver.find_elements(By.CSS_SELECTOR, "#main .legend li")
        return {item.text for item in items}

    def tip(self):
        """Returns the x value of the tip, and its values and units by name."""
        tip = self.driver.find_element(By.CSS_SELECTOR, "#main .figure .tip")
        if not tip.is_displayed():
            return None, {}
        cells = {}
        for row in tip.find_elements(By.CSS_SELECTOR, "tr"):
            *values, unit = row.find_elements(By.CSS_SELECTOR, "td")
            cells |= {value.get_attribute("data-name"): (value.text, unit.text) for value in values}
        return float(tip.get_attribute("data-x")), cells

    def tip_bounds(self):
        """Returns the rectangle of the tip in the window."""
        script = "return document.querySelector('#main .tip').getBoundingClientRect().toJSON()"
        return self.driver.execute_script(script)

    def picture_hash(self):
        """Returns a hash of the picture."""
        self.wait_for_frame()
        script = "return document.querySelector('#main canvas').toDataURL()"
        return hash(self.driver.execute_script(script))


def check_hovering(page, rows):
    """Checks the values and units in the tip over the whole width."""
    times = rows["time_s"]
    value_count = 0
    for part in range(1, 12):
        bounds = page.bounds()
        x = bounds["left"] + 100 + (bounds["width"] - 130) * part / 12
        before = page.tip()[0]
        page.send_mouse_event("mouseMoved", x, bounds["top"] + 150)
        page.wait(lambda: page.tip()[0] not in (None, before), "hovering never showed a time")
        instant, tip_values = page.tip()
        row = bisect.bisect_left(times, instant - 1e-6 * times[-1])
        check(abs(times[row] - instant) < 1e-5 * times[-1], f"no instant {instant} in the file")
        for (channel, words), (factor, unit) in CHANNELS.items():
            for model in ("nonlinear", "linear"):
                file_value = factor * rows[f"{model}_{channel}"][row]
                name = f"{words}, {model} model"
                value, tip_unit = tip_values.get(name, ("", ""))
                message = f"{name} at {instant} s: {value} {tip_unit} for {file_value}"
                check(is_same(parse_number(value), file_value) and tip_unit == unit, message)
                value_count += 1
    return f"{value_count} values at 11 instants"


def check_tip_position(page):
    """Checks that the tip is in the window wherever a high figure is scrolled."""
    height = page.driver.execute_script("return innerHeight")
    page.driver.execute_script("scrollTo(0, 0)")
    position_count = 0
    for offset in (0, 200, 400):
        page.driver.execute_script(f"scrollTo(0, {offset})")
        page.wait_for_frame()
        bounds = page.bounds()
        for y in (60, height / 2, height - 40):
            if not bounds["top"] < y < bounds["top"] + bounds["height"]:
                continue
            page.send_mouse_event("mouseMoved", bounds["left"] + 300 + y / 10, y)
            page.wait(lambda: page.tip()[0] is not None, "no values at the pointer")
            tip = page.tip_bounds()
            is_inside = tip["top"] >= -1 and tip["bottom"] <= max(height, tip["height"]) + 1
            check(is_inside, f"scrolled by {offset}, pointer at {y}: the values are at {tip}")
            position_count += 1
    page.driver.execute_script("scrollTo(0, 0)")
    return f"{position_count} positions"


def check_legend(page):
    """Checks that the legend explains dashed lines and the mixed colour."""
    page.send_mouse_event("mouseMoved", 5, 5)
    expected_texts = {
        "nonlinear model", "linear model", "both, one over the other", "resonance speed passed",
    }
    page.wait(lambda: expected_texts <= page.legend(),
              f"the legend does not say {expected_texts}")
    return ", ".join(sorted(expected_texts))


def check_box_names(page):
    """Checks that the box of a panel has the name of its axis."""
    labels = page.driver.find_elements(By.CSS_SELECTOR, "#main .controls label")
    names = [label.text for label in labels]
    for _, words in CHANNELS:
        check(words in names, f"no box is named {words}: {names}")
    return f"{len(names)} boxes"


def check_wheel(page):
    """Checks that the wheel without Ctrl scrolls the page over the figure."""
    page.driver.execute_script("scrollTo(0, 0)")
    bounds = page.bounds()
    position = (bounds["left"] + bounds["width"] / 2, bounds["top"] + 150)
    offset = lambda: page.driver.execute_script("return scrollY")  # noqa: E731
    page.send_mouse_event("mouseWheel", *position, deltaX=0, deltaY=200)
    page.wait(lambda: offset() > 0, "the wheel over the figure does not scroll the page")
    check(page.figure().get_attribute("data-view") is None, "the wheel alone zooms")
    touch = page.driver.execute_script("return getComputedStyle(arguments[0]).touchAction",
                                       page.figure())
    check("pan-y" in touch, f"a finger cannot scroll the page: touch-action {touch}")
    page.driver.execute_script("scrollTo(0, 0)")
    return "scrolls"


def check_boxes_and_zoom(page):
    """Checks that each channel's box changes the picture, that wheel and buttons zoom, and that a
    double click resets the view."""
    boxes = page.driver.find_elements(By.CSS_SELECTOR, "#main .controls input")
    before = page.picture_hash()
    for box in boxes:
        page.driver.execute_script("arguments[0].click()", box)
        after = page.picture_hash()
        check(after != before, "a channel's box does not redraw")
        before = after
    for box in boxes:
        page.driver.execute_script("arguments[0].click()", box)
    initial_picture = page.picture_hash()
    bounds = page.bounds()
    position = (bounds["left"] + bounds["width"] / 2, bounds["top"] + 150)
    page.send_mouse_event("mouseWheel", *position, deltaX=0, deltaY=-600, modifiers=CONTROL_KEY)
    page.wait(lambda: page.picture_hash() != initial_picture, "Ctrl and the wheel do not zoom")
    page.save_screenshot("chart-zoomed")
    for count in (1, 2):
        page.send_mouse_event("mousePressed", *position, button="left", clickCount=count)
        page.send_mouse_event("mouseReleased", *position, button="left", clickCount=count)
    page.send_mouse_event("mouseMoved", 5, 5)
    page.wait(lambda: page.picture_hash() == initial_picture, "a double click does not reset")
    button = page.driver.find_element(By.CSS_SELECTOR, "#main .zoom button")
    page.driver.execute_script("arguments[0].click()", button)
    page.wait(lambda: page.picture_hash() != initial_picture, "the button does not zoom")
    reset = page.driver.find_elements(By.CSS_SELECTOR, "#main .zoom button")[-1]
    page.driver.execute_script("arguments[0].click()", reset)
    page.wait(lambda: page.picture_hash() == initial_picture, "the button does not reset")
    return f"{len(boxes)} boxes, Ctrl and wheel, buttons, double click"


def check_widths_and_schemes(page):
    """Checks that nothing is wider than the window, and that the colour scheme is followed."""
    pictures = {}
    for width, scheme in itertools.product((400, 1400), ("light", "dark")):
        page.set_window(width, scheme)
        pictures[width, scheme] = page.picture_hash()
        page_width = page.driver.execute_script("return document.documentElement.scrollWidth")
        check(page_width <= width, f"at {width} px the page is {page_width} px wide")
        page.save_screenshot(f"chart-{width}-{scheme}")
    check(len(set(pictures.values())) == 4, "widths or schemes look alike")
    return "400 and 1400 px, light and dark"


def main():
    """Runs all checks on a page."""
    parser = argparse.ArgumentParser(
        description="Check a trace's page in headless Chromium against its Parquet file."
    )
    parser.add_argument("trace")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    rows = pq.read_table(arguments.trace).to_pydict()
    page = Chart(arguments.page, arguments.screenshots)
    page.run([
        ("alone", lambda: check_self_contained(page)),
        ("hover", lambda: check_hovering(page, rows)),
        ("in sight", lambda: check_tip_position(page)),
        ("legend", lambda: check_legend(page)),
        ("names", lambda: check_box_names(page)),
        ("wheel", lambda: check_wheel(page)),
        ("switch", lambda: check_boxes_and_zoom(page)),
        ("widths", lambda: check_widths_and_schemes(page)),
    ])


if __name__ == "__main__":
    main()
