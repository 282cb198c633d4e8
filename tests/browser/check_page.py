"""Compares the page of a map in headless Chromium with its Parquet file.

    python check_page.py MAP.parquet PAGE.html [--screenshots FOLDER]

Input events of the browser move the pointer. The positions of points on the screen are computed
from the values of the axes and from the rectangle that the page reports. pyarrow reads the values
of the file. The script prints its checks, and exits with 1 at the first mistake.
"""

import argparse
import itertools
import json
import math
import pathlib
import shutil
import sys
import tempfile
import time

import pyarrow as pa
import pyarrow.parquet as pq
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import Select, WebDriverWait

FLAGS = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--window-size=1300,1200",
]


# The modifier of an input event for the control key.
CONTROL_KEY = 2

# The beginnings of the names of columns without a picture.
UNDRAWN_COLUMNS = ("point", "steps_", "rejected_")


class CheckError(Exception):
    """The error of a check that has failed."""


def check(holds, message):
    """Raises an error with this message if a condition does not hold."""
    if not holds:
        raise CheckError(message)


class Map:
    """The rows, axes and channels of a map file."""

    def __init__(self, path):
        table = pq.read_table(path)
        self.rows = table.to_pylist()
        names = table.column_names
        is_amplitude = [name.startswith(("nonlinear_", "linear_")) for name in names]
        self.axes = [name for name in names[:is_amplitude.index(True)] if name != "point"]
        ratios = [name for name in names if name.startswith("ratio_")]
        self.channels = [name.removeprefix("ratio_") for name in ratios
                         if name not in ("ratio_max", "ratio_max_channel")]
        # The factors from the units of columns to those on the page.
        factors = {"m": 1000, "rad": 1000}
        columns = json.loads(table.schema.metadata[b"sweep.columns"])
        self.factors = {
            field.name: factors.get(columns[field.name]["unit"], 1)
            for field in table.schema
            if (pa.types.is_floating(field.type) or pa.types.is_integer(field.type))
            and field.name not in self.axes and not field.name.startswith(UNDRAWN_COLUMNS)}
        self.values = [sorted({row[axis] for row in self.rows}) for axis in self.axes]
        # At first the page shows the first value of every axis after the second.
        fixed_values = list(zip(self.axes[2:], self.values[2:]))
        self.first_cut_rows = [row for row in self.rows
                      if all(row[axis] == values[0] for axis, values in fixed_values)]

    def sample_rows(self):
        """Returns rows from all over the map, if possible with a failed one and one without a
        ratio."""
        sample = self.first_cut_rows[:: max(1, len(self.first_cut_rows) // 12)]
        sample += [row for row in self.first_cut_rows if row["status"] != "ok"][:1]
        ok_rows = [row for row in self.first_cut_rows if row["status"] == "ok"]
        return sample + [row for row in ok_rows if row["ratio_max"] is None][:1]


class Page:
    """A page in a browser."""

    def __init__(self, path, screenshots):
        options = webdriver.ChromeOptions()
        options.binary_location = shutil.which("chromium") or shutil.which("google-chrome") or ""
        self.profile = tempfile.TemporaryDirectory()
        for flag in [*FLAGS, f"--user-data-dir={self.profile.name}"]:
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        service = Service(shutil.which("chromedriver"))
        self.driver = webdriver.Chrome(options=options, service=service)
        self.path, self.screenshots = path, screenshots
        self.driver.get(pathlib.Path(path).resolve().as_uri())
        self.wait(self.is_drawn, "the figure was never drawn")

    def run(self, checks):
        """Runs checks, pairs of a name and a function, and prints their results. Exits with 1 at
        the first mistake, and closes the browser."""
        try:
            for name, check_page in checks:
                result = check_page()
                self.check_console(name)
                self.save_screenshot(f"{type(self).__name__.lower()}-{name}")
                print(f"{name:10} {result}")
        except CheckError as error:
            self.save_screenshot("wrong")
            sys.exit(f"{self.path}: {error}")
        finally:
            self.close()

    def close(self):
        """Closes the browser."""
        self.driver.quit()
        self.profile.cleanup()

    def wait(self, condition, message):
        """Waits until a condition holds, at most five seconds."""
        try:
            WebDriverWait(self.driver, 5, poll_frequency=0.02).until(lambda _: condition())
        except Exception as error:
            raise CheckError(f"{message} ({type(error).__name__})") from error

    def is_drawn(self):
        """Returns a true value if the figure is drawn."""
        return self.figure().get_attribute("data-area")

    def wait_for_frame(self):
        """Waits until the page has drawn pending changes."""
        script = """const done = arguments[0];
            requestAnimationFrame(() => requestAnimationFrame(done));"""
        self.driver.execute_async_script(script)

    def figure(self):
        """Returns the element of the figure."""
        return self.driver.find_element(By.ID, "map")

    def text(self, name):
        """Returns the text of the element with an identifier."""
        return self.driver.find_element(By.ID, name).text

    def data(self):
        """Returns the data in the page."""
        script = "return document.getElementById('data').textContent"
        return json.loads(self.driver.execute_script(script))

    def check_console(self, occasion):
        """Checks that nothing was written to the console."""
        entries = self.driver.get_log("browser")
        check(not entries, f"the console after {occasion}: {entries}")

    def save_screenshot(self, name):
        """Saves a picture of the window, if a folder is given."""
        if self.screenshots:
            folder = pathlib.Path(self.screenshots)
            folder.mkdir(parents=True, exist_ok=True)
            self.driver.save_screenshot(str(folder / f"{name}.png"))

    def picture_hash(self):
        """Returns a hash of the picture."""
        self.wait_for_frame()
        script = "return document.querySelector('#map canvas').toDataURL()"
        return hash(self.driver.execute_script(script))

    def send_mouse_event(self, kind, x, y, **properties):
        """Sends a mouse event at a position in the window."""
        event = {"type": kind, "x": x, "y": y, **properties}
        self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)

    def set_window(self, width, scheme):
        """Sets the width of the window (px) and the colour scheme, light or dark."""
        metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        self.wait_for_frame()
        self.wait_for_frame()

    def press_key(self, key, code=None):
        """Sends the events of a pressed and released key."""
        for kind in ("keyDown", "keyUp"):
            event = {"type": kind, "key": key, "code": code or key}
            if kind == "keyDown" and len(key) == 1:
                event["text"] = key
            self.driver.execute_cdp_cmd("Input.dispatchKeyEvent", event)

    def window_position(self, x, y, is_log):
        """Returns the current position of axis values in the window."""
        rectangle = "return document.querySelector('#map canvas').getBoundingClientRect().toJSON()"
        bounds = self.driver.execute_script(rectangle)
        left, top, width, height = map(float, self.figure().get_attribute("data-area").split())
        x0, x1, y0, y1 = map(float, self.figure().get_attribute("data-view").split())
        x, y = (math.log(value) if by_log else value for value, by_log in zip((x, y), is_log))
        return (
            bounds["left"] + left + width * (x - x0) / (x1 - x0),
            bounds["top"] + top + height * (1 - (y - y0) / (y1 - y0)),
        )


def parse_number(text):
    """Returns the number in a cell; None for a dash."""
    return None if text in ("", "–") else float(text)


def is_same(page_value, file_value):
    """Returns whether two numbers agree to four digits. The last digit may differ by one, because
    the page has 32-bit numbers."""
    if page_value is None or file_value is None:
        return page_value is None and file_value is None
    return abs(page_value - file_value) <= 6e-4 * abs(file_value)


def check_hovering(page, data, is_log, occasion):
    """Checks the page's values at points all over the map."""
    lines = page.driver.execute_script("return DATA.rows")
    kinds = ("ratio_", "nonlinear_", "linear_")
    other_columns = [column for column in data.factors if not column.startswith(kinds)]
    for row in data.sample_rows():
        position = page.window_position(row[data.axes[0]], row[data.axes[1]], is_log)
        page.send_mouse_event("mouseMoved", *position)
        expected = f"Point {row['point']}"
        page.wait(lambda: page.text("readout").startswith(expected),
                  f"{occasion}: hovering never showed {expected}")
        readout = page.text("readout")
        largest_ratio = page.text("ratio").removeprefix("Largest ratio ").split(" ")[0]
        check(is_same(parse_number(largest_ratio), row["ratio_max"]),
              f"{occasion}: {expected}: {largest_ratio} for {row['ratio_max']}")
        for channel in data.channels:
            for kind in ("nonlinear", "linear", "ratio"):
                selector = f'#readout tr[data-channel="{channel}"] td[data-kind="{kind}"]'
                text = page.driver.find_element(By.CSS_SELECTOR, selector).text
                file_value = row[f"{kind}_{channel}"]
                if file_value is not None and kind != "ratio":
                    file_value *= 1000
                check(is_same(parse_number(text), file_value),
                      f"{occasion}: {expected}, {kind} {channel}: {text} for {file_value}")
        names_and_kinds = {column: (line["name"], kind) for line in lines
                for kind, column in zip(("nonlinear", "linear"), line["columns"]) if column}
        for column in other_columns:
            name, kind = names_and_kinds[column]
            selector = f'#readout tr[data-channel="{name}"] td[data-kind="{kind}"]'
            text = page.driver.find_element(By.CSS_SELECTOR, selector).text
            file_value = None if row[column] is None else data.factors[column] * row[column]
            check(is_same(parse_number(text), file_value),
                  f"{occasion}: {expected}, {column}: {text} for {file_value}")
        if row["status"] != "ok":
            check(f"Failed: {row['status'].replace('_', ' ')}" in readout,
                  f"{occasion}: {expected} hides its status: {readout}")
        elif row["reliable"] is not None:
            verdict = "Linear model reliable" if row["reliable"] else "Linear model unreliable"
            check(verdict in readout, f"{occasion}: {expected}: not '{verdict}': {readout}")
    values = 3 * len(data.channels) + len(other_columns)
    return f"{occasion}: {len(data.sample_rows())} points, {values} values each"


def check_switches(page, data, is_log):
    """Checks that each column has its own picture, and that the tip has its value."""
    quantity = Select(page.driver.find_element(By.ID, "quantity"))
    row = next(row for row in data.sample_rows() if row["ratio_max"] is not None)
    pictures = {}
    columns = [option.get_attribute("value") for option in quantity.options]
    missing = set(data.factors) - set(columns)
    check(not missing, f"the page does not offer {missing}")
    for column in columns:
        quantity.select_by_value(column)
        page.send_mouse_event("mouseMoved", 5, 5)
        position = page.window_position(row[data.axes[0]], row[data.axes[1]], is_log)
        page.send_mouse_event("mouseMoved", *position)
        page.wait(lambda: page.text("tip"), f"{column}: no tip at the pointer")
        pictures[column] = (page.picture_hash(), [row[column] for row in data.first_cut_rows])
        if column != "status" and row[column] is not None:
            file_value = row[column] * data.factors[column]
            lines = page.text("tip").split("\n")
            tip_value = next(line for line in lines if ": " in line).rsplit(": ", 1)[1]
            check(is_same(parse_number(tip_value), file_value),
                  f"{column}: the tip says {tip_value} for {file_value}")
        page.save_screenshot(f"quantity-{column}")
    for (first, picture), (second, other) in zip(pictures.items(), list(pictures.items())[1:]):
        # Two metrics that are zero everywhere have the same picture.
        have_same_values = picture[1] == other[1]
        check(have_same_values or picture[0] != other[0],
              f"switching from {first} to {second} did not redraw")
    quantity.select_by_value("ratio_max")
    return f"{len(pictures)} pictures, each redrawn, each with its value at the pointer"


def check_zoom(page, data, is_log):
    """Checks that wheel, drag and double-click change the view, and that values remain correct."""
    view = lambda: page.figure().get_attribute("data-view")  # noqa: E731
    initial_view = view()
    middle = [values[len(values) // 2] for values in data.values[:2]]
    page.driver.execute_script("scrollTo(0, 0)")
    position = page.window_position(*middle, is_log)
    page.send_mouse_event("mouseWheel", *position, deltaX=0, deltaY=-200)
    page.wait_for_frame()
    check(view() == initial_view, "the wheel alone zooms: the page cannot be scrolled over the map")
    page.send_mouse_event("mouseWheel", *position, deltaX=0, deltaY=-600, modifiers=CONTROL_KEY)
    page.wait(lambda: view() != initial_view, "Ctrl and the wheel did not zoom")
    zoomed_position = page.window_position(*middle, is_log)
    # The browser rounds the pointer's position to a pixel; zooming enlarges the error.
    distance_px = math.dist(position, zoomed_position)
    check(distance_px < 3.0,
          f"zooming moved the point under the pointer by {distance_px:.1f} px")
    page.save_screenshot("zoomed")
    row = next(r for r in data.first_cut_rows if [r[data.axes[0]], r[data.axes[1]]] == middle)
    page.send_mouse_event("mouseMoved", position[0] + 1, position[1])
    page.wait(lambda: page.text("readout").startswith(f"Point {row['point']}"),
              "zoomed: hovering is off")
    zoomed = view()
    page.send_mouse_event("mousePressed", *position, button="left", clickCount=1)
    end = (position[0] + 60, position[1] + 40)
    page.send_mouse_event("mouseMoved", *end, button="left", buttons=1)
    page.send_mouse_event("mouseReleased", *end, button="left", clickCount=1)
    page.wait(lambda: view() != zoomed, "dragging did not move the view")
    moved = math.dist(page.window_position(*middle, is_log), (position[0] + 60, position[1] + 40))
    check(moved < 4.0, f"the map did not follow the pointer: {moved:.1f} px apart")
    for count in (1, 2):
        page.send_mouse_event("mousePressed", *position, button="left", clickCount=count)
        page.send_mouse_event("mouseReleased", *position, button="left", clickCount=count)
    page.wait(lambda: view() == initial_view, "double-click did not reset the view")
    touch = "return document.getElementById('map').style.touchAction"
    check(page.driver.execute_script(touch) == "", "a finger cannot scroll the page over the map")
    return "Ctrl and wheel about the pointer, drag, double-click"


def check_keys(page, data):
    """Checks the operation by keys: focus, arrows, Enter, Escape, zoom and reset."""
    page.send_mouse_event("mouseMoved", 5, 5)
    page.press_key("Escape")
    page.driver.execute_script("document.getElementById('map').focus()")
    point = lambda: page.figure().get_attribute("data-point")  # noqa: E731
    page.press_key("ArrowUp")
    page.wait(lambda: page.text("readout").startswith("Point"), "arrows show no point")
    points = [point()]
    for key in ("ArrowUp", "ArrowRight"):
        page.press_key(key)
        page.wait(lambda: point() != points[-1], f"{key} does not move on")
        points.append(point())
    steps = [int(b) - int(a) for a, b in zip(points, points[1:])]
    cuts = math.prod(len(values) for values in data.values[2:])
    check(steps == [cuts, len(data.values[1]) * cuts],
          f"arrows moved by {steps} points in grid order")
    announcement = page.driver.execute_script(
        "return document.getElementById('said').textContent"
    )
    check(announcement.count(";") >= 2, f"a screen reader hears only {announcement!r}")
    initial_view = page.figure().get_attribute("data-view")
    page.press_key("+")
    page.wait(lambda: page.figure().get_attribute("data-view") != initial_view,
              "+ does not zoom")
    page.press_key("0")
    page.wait(lambda: page.figure().get_attribute("data-view") == initial_view,
              "0 does not reset")
    page.save_screenshot("keyboard")
    return "arrows, zoom and reset; what is read is announced"


def check_histories(page, data, is_log):
    """Checks that a click on a point with time histories shows them."""
    traces = page.data()["traces"]
    if traces is None:
        return "no traces beside this map"
    row = next(row for row in data.first_cut_rows if str(row["point"]) in traces)
    page.driver.execute_script("scrollTo(0, 0)")
    position = page.window_position(row[data.axes[0]], row[data.axes[1]], is_log)
    page.send_mouse_event("mouseMoved", *position)
    page.send_mouse_event("mousePressed", *position, button="left", clickCount=1)
    page.send_mouse_event("mouseReleased", *position, button="left", clickCount=1)
    page.wait(lambda: page.driver.find_elements(By.CSS_SELECTOR, "#histories canvas"),
              "no time histories appeared")
    canvas = page.driver.find_element(By.CSS_SELECTOR, "#histories canvas")
    page.driver.execute_script("arguments[0].scrollIntoView({ block: 'center' })", canvas)
    page.wait_for_frame()
    rectangle = "return arguments[0].getBoundingClientRect().toJSON()"
    bounds = page.driver.execute_script(rectangle, canvas)
    page.send_mouse_event("mouseMoved", bounds["left"] + bounds["width"] / 2, bounds["top"] + 60)
    selector = "#histories .tip td[data-name]"
    values = lambda: page.driver.find_elements(By.CSS_SELECTOR, selector)  # noqa: E731
    page.wait(lambda: len(values()) >= 2, "histories show no values")
    shown_values = {value.get_attribute("data-name"): value.text for value in values()}
    page.save_screenshot("histories")
    endings = (", nonlinear model", ", linear model")
    models = [name for name in shown_values if name.endswith(endings)]
    check(len(models) >= 2 and all(shown_values.values()), f"histories say {shown_values}")
    return f"point {row['point']} of {len(traces)} with histories: {shown_values}"


def check_widths_and_schemes(page):
    """Checks that the map fits a window of 400 px, and that the colour scheme is followed."""
    page.driver.execute_script("scrollTo(0, 0)")
    background = "return getComputedStyle(document.body).backgroundColor"
    pictures = {}
    for width, scheme in itertools.product((400, 1400), ("light", "dark")):
        page.set_window(width, scheme)
        page.wait(page.is_drawn, "the map is not drawn")
        pictures[width, scheme] = (page.driver.execute_script(background), page.picture_hash())
        _, _, map_width, _ = map(float, page.figure().get_attribute("data-area").split())
        page_width = page.driver.execute_script("return document.documentElement.scrollWidth")
        check(page_width <= width, f"at {width} px the page is {page_width} px wide")
        check(width > 400 or map_width > 280, f"at {width} px the map is {map_width} px wide")
        page.save_screenshot(f"{width}-{scheme}")
        for k, picture_name in enumerate(("page", "map")):
            other = pictures.get((width, "light"))
            check(scheme == "light" or other[k] != pictures[width, scheme][k],
                  f"the {picture_name} is the same in light and dark at {width} px")
    return "400 and 1400 px, light and dark"


def check_report_and_downloads(page, data):
    """Checks the report, the table of worst points, the downloads and the link to the view."""
    report = page.text("about")
    for words in ("Machine", "Spin", "Method", "Verdict"):
        check(words in report, f"the report has no {words}")
    script = "return document.querySelector('noscript').textContent"
    fallback = page.driver.execute_script(script)
    check("data:image/png;base64,iVBOR" in fallback, "no picture where scripts are switched off")
    worst_row = max((row for row in data.rows if row["ratio_max"] is not None),
                key=lambda row: row["ratio_max"])
    page.driver.execute_script("document.querySelector('#points button').click()")
    page.wait(lambda: page.text("readout").startswith(f"Point {worst_row['point']}"),
              f"the first row of the table is not point {worst_row['point']}")
    folder = pathlib.Path(page.profile.name) / "saved"
    page.driver.execute_cdp_cmd("Browser.setDownloadBehavior",
                                {"behavior": "allow", "downloadPath": str(folder)})
    downloads = {"numbers": f"point-{worst_row['point']}.csv", "picture": "map.png"}
    for button, name in downloads.items():
        page.driver.execute_script(f"document.getElementById('{button}').click()")
        page.wait((folder / name).exists, f"{button} saves no {name}")
    lines = (folder / downloads["numbers"]).read_text().split()
    numbers = dict(line.split(",") for line in lines)
    for name in ("ratio_max", *data.axes, *(f"nonlinear_{channel}" for channel in data.channels)):
        check(is_same(float(numbers[name]), worst_row[name]), f"saved {name}: {numbers[name]}")
    check((folder / "map.png").read_bytes()[:4] == b"\x89PNG", "the picture is no PNG")
    page.press_key("+")
    quantity = Select(page.driver.find_element(By.ID, "quantity"))
    quantity.select_by_value("min_gap_nonlinear_m")
    least = min((row for row in data.rows if row["min_gap_nonlinear_m"] is not None),
                key=lambda row: row["min_gap_nonlinear_m"])
    first = page.driver.execute_script(
        "return document.querySelector('#points tbody tr').innerText")
    gap = f"{1000 * least['min_gap_nonlinear_m']:.4g}"
    check(gap in first, f"the least gap, {gap} mm, is not in the first row: {first}")
    page.driver.execute_script("document.getElementById('link').click()")
    view, address = page.figure().get_attribute("data-view"), page.driver.current_url
    check("#" in address, "the link holds nothing")
    page.driver.get("about:blank")
    page.driver.get(address)
    page.wait(page.is_drawn, "the linked page is not drawn")
    page.wait(lambda: page.figure().get_attribute("data-view") == view, "the view is not back")
    check(page.figure().get_attribute("data-layer") == "min_gap_nonlinear_m",
          "the quantity is not back")
    check(page.text("readout").startswith(f"Point {worst_row['point']}"), "the point is not back")
    page.driver.get(address.partition("#")[0])
    page.wait(page.is_drawn, "the page is not drawn again")
    return f"point {worst_row['point']} first; CSV, PNG; a link with view, quantity and point"


def measure_redraw(page):
    """Measures the median time in which all cells are drawn again."""
    script = """const done = arguments[0]; const times = [];
        const button = document.getElementById('reset');
        const once = () => { const start = performance.now(); button.click();
          requestAnimationFrame(() => setTimeout(() => { times.push(performance.now() - start);
            times.length < 11 ? once() : done(times.sort((a, b) => a - b)[5]); })); }; once();"""
    median = page.driver.execute_async_script(script)
    return f"{median:.0f} ms from a change of view to the next frame (median of 11)"


def check_self_contained(page):
    """Checks that the browser fetched nothing but the page."""
    entries = "performance.getEntriesByType('resource')"
    fetched = page.driver.execute_script(f"return {entries}.map((entry) => entry.name)")
    outside = [name for name in fetched if not name.startswith(("data:", "blob:"))]
    check(not outside, f"the page fetched {outside}")
    return "nothing fetched"


def main():
    """Runs all checks on a page."""
    parser = argparse.ArgumentParser(
        description="Check a map's page in headless Chromium against its Parquet file."
    )
    parser.add_argument("map")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    data = Map(arguments.map)
    start_s = time.monotonic()
    page = Page(arguments.page, arguments.screenshots)
    is_log = [axis["log"] for axis in page.data()["axes"]]
    page.run([
        ("alone", lambda: check_self_contained(page)),
        ("hover", lambda: check_hovering(page, data, is_log, "as opened")),
        ("switch", lambda: check_switches(page, data, is_log)),
        ("zoom", lambda: check_zoom(page, data, is_log)),
        ("keys", lambda: check_keys(page, data)),
        ("histories", lambda: check_histories(page, data, is_log)),
        ("report", lambda: check_report_and_downloads(page, data)),
        ("widths", lambda: check_widths_and_schemes(page)),
        ("speed", lambda: measure_redraw(page)),
    ])
    print(f"{len(data.rows)} points checked in {time.monotonic() - start_s:.0f} s")


if __name__ == "__main__":
    main()
