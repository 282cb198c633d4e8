"""A map's page in headless Chromium, held against the Parquet file it was made from.

    python check_page.py MAP.parquet PAGE.html [--screenshots FOLDER]

The pointer is moved with the browser's own input events; where a point lies on the screen is worked
out here, from the file's axis values and the rectangle that the page says it draws in. Values are
read from the file with pyarrow. Prints what was checked; exits with 1 at the first thing that is
wrong.
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


# The modifier of an input event.
CTRL = 2

# Columns that are on no picture.
UNSHOWN = ("point", "steps_", "rejected_")


class Wrong(Exception):
    """The page does not do what it should."""


def check(holds, what):
    """Fail with `what` unless it holds."""
    if not holds:
        raise Wrong(what)


class Map:
    """The file: its rows, and where its points lie."""

    def __init__(self, path):
        table = pq.read_table(path)
        self.rows = table.to_pylist()
        names = table.column_names
        of_model = [name.startswith(("nonlinear_", "linear_")) for name in names]
        self.axes = [name for name in names[:of_model.index(True)] if name != "point"]
        ratios = [name for name in names if name.startswith("ratio_")]
        self.channels = [name.removeprefix("ratio_") for name in ratios
                         if name not in ("ratio_max", "ratio_max_channel")]
        # What a page shows of every column of numbers, as a part of the file's unit.
        shown = {"m": 1000, "rad": 1000}
        told = json.loads(table.schema.metadata[b"sweep.columns"])
        self.factors = {
            field.name: shown.get(told[field.name]["unit"], 1)
            for field in table.schema
            if (pa.types.is_floating(field.type) or pa.types.is_integer(field.type))
            and field.name not in self.axes and not field.name.startswith(UNSHOWN)}
        self.values = [sorted({row[axis] for row in self.rows}) for axis in self.axes]
        # The page opens with every axis after the second at its first value.
        cuts = list(zip(self.axes[2:], self.values[2:]))
        self.shown = [row for row in self.rows
                      if all(row[axis] == values[0] for axis, values in cuts)]

    def some(self):
        """Rows spread over the map, with one that failed and one without a ratio if any did."""
        chosen = self.shown[:: max(1, len(self.shown) // 12)]
        chosen += [row for row in self.shown if row["status"] != "ok"][:1]
        ok = [row for row in self.shown if row["status"] == "ok"]
        return chosen + [row for row in ok if row["ratio_max"] is None][:1]


class Page:
    """The page in a browser."""

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
        self.wait(self.drawn, "the figure was never drawn")

    def run(self, checks):
        """Run checks, each a name and a function, and print what it returns; end with exit code 1
        at the first that is wrong. Then end the browser."""
        try:
            for name, holds in checks:
                result = holds()
                self.quiet(name)
                self.shot(f"{type(self).__name__.lower()}-{name}")
                print(f"{name:10} {result}")
        except Wrong as wrong:
            self.shot("wrong")
            sys.exit(f"{self.path}: {wrong}")
        finally:
            self.close()

    def close(self):
        """End the browser."""
        self.driver.quit()
        self.profile.cleanup()

    def wait(self, condition, what):
        """Until the condition holds, at most five seconds."""
        try:
            WebDriverWait(self.driver, 5, poll_frequency=0.02).until(lambda _: condition())
        except Exception as error:
            raise Wrong(f"{what} ({type(error).__name__})") from error

    def drawn(self):
        """Whether the figure is there."""
        return self.figure().get_attribute("data-area")

    def frame(self):
        """Let the page draw what is due."""
        script = """const done = arguments[0];
            requestAnimationFrame(() => requestAnimationFrame(done));"""
        self.driver.execute_async_script(script)

    def figure(self):
        """The map."""
        return self.driver.find_element(By.ID, "map")

    def text(self, name):
        """What an element says."""
        return self.driver.find_element(By.ID, name).text

    def data(self):
        """What the page carries."""
        script = "return document.getElementById('data').textContent"
        return json.loads(self.driver.execute_script(script))

    def quiet(self, when):
        """Nothing was written to the console."""
        entries = self.driver.get_log("browser")
        check(not entries, f"the console after {when}: {entries}")

    def shot(self, name):
        """Keep a picture of the window."""
        if self.screenshots:
            folder = pathlib.Path(self.screenshots)
            folder.mkdir(parents=True, exist_ok=True)
            self.driver.save_screenshot(str(folder / f"{name}.png"))

    def pixels(self):
        """A number that changes with the picture."""
        self.frame()
        script = "return document.querySelector('#map canvas').toDataURL()"
        return hash(self.driver.execute_script(script))

    def mouse(self, kind, x, y, **more):
        """An input event at a place in the window."""
        event = {"type": kind, "x": x, "y": y, **more}
        self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)

    def window(self, width, scheme):
        """A window of this width, px, for a reader of light or dark pages."""
        metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        self.frame()
        self.frame()

    def press(self, key, code=None):
        """A key, down and up."""
        for kind in ("keyDown", "keyUp"):
            event = {"type": kind, "key": key, "code": code or key}
            if kind == "keyDown" and len(key) == 1:
                event["text"] = key
            self.driver.execute_cdp_cmd("Input.dispatchKeyEvent", event)

    def place(self, x, y, log):
        """Where axis values lie in the window now."""
        rectangle = "return document.querySelector('#map canvas').getBoundingClientRect().toJSON()"
        bounds = self.driver.execute_script(rectangle)
        left, top, width, height = map(float, self.figure().get_attribute("data-area").split())
        x0, x1, y0, y1 = map(float, self.figure().get_attribute("data-view").split())
        x, y = (math.log(value) if by_log else value for value, by_log in zip((x, y), log))
        return (
            bounds["left"] + left + width * (x - x0) / (x1 - x0),
            bounds["top"] + top + height * (1 - (y - y0) / (y1 - y0)),
        )


def number_in(text):
    """The number that a cell shows; None for a dash."""
    return None if text in ("", "–") else float(text)


def same(shown, true):
    """To four digits; the page carries 32 bit floats, which can turn the last one over."""
    if shown is None or true is None:
        return shown is None and true is None
    return abs(shown - true) <= 6e-4 * abs(true)


def hovering_shows_the_file(page, data, log, when):
    """At points all over the map, everything the page says is in the file."""
    lines = page.driver.execute_script("return DATA.rows")
    kinds = ("ratio_", "nonlinear_", "linear_")
    others = [column for column in data.factors if not column.startswith(kinds)]
    for row in data.some():
        page.mouse("mouseMoved", *page.place(row[data.axes[0]], row[data.axes[1]], log))
        expected = f"Point {row['point']}"
        page.wait(lambda: page.text("readout").startswith(expected),
                  f"{when}: hovering never showed {expected}")
        said = page.text("readout")
        largest = page.text("ratio").removeprefix("Largest ratio ").split(" ")[0]
        check(same(number_in(largest), row["ratio_max"]),
              f"{when}: {expected}: {largest} for {row['ratio_max']}")
        for channel in data.channels:
            for kind in ("nonlinear", "linear", "ratio"):
                selector = f'#readout tr[data-channel="{channel}"] td[data-kind="{kind}"]'
                text = page.driver.find_element(By.CSS_SELECTOR, selector).text
                true = row[f"{kind}_{channel}"]
                true = true * 1000 if true is not None and kind != "ratio" else true
                check(same(number_in(text), true),
                      f"{when}: {expected}, {kind} {channel}: {text} for {true}")
        told = {column: (line["name"], kind) for line in lines
                for kind, column in zip(("nonlinear", "linear"), line["columns"]) if column}
        for column in others:
            name, kind = told[column]
            selector = f'#readout tr[data-channel="{name}"] td[data-kind="{kind}"]'
            text = page.driver.find_element(By.CSS_SELECTOR, selector).text
            true = None if row[column] is None else data.factors[column] * row[column]
            check(same(number_in(text), true), f"{when}: {expected}, {column}: {text} for {true}")
        if row["status"] != "ok":
            check(f"Failed: {row['status'].replace('_', ' ')}" in said,
                  f"{when}: {expected} hides its status: {said}")
        elif row["reliable"] is not None:
            verdict = "Linear model reliable" if row["reliable"] else "Linear model unreliable"
            check(verdict in said, f"{when}: {expected}: not '{verdict}': {said}")
    values = 3 * len(data.channels) + len(others)
    return f"{when}: {len(data.some())} points, {values} values each"


def switches_redraw(page, data, log):
    """Each column has its own picture, and the tip shows its value."""
    quantity = Select(page.driver.find_element(By.ID, "quantity"))
    row = next(row for row in data.some() if row["ratio_max"] is not None)
    pictures = {}
    columns = [option.get_attribute("value") for option in quantity.options]
    missing = set(data.factors) - set(columns)
    check(not missing, f"the page does not offer {missing}")
    for column in columns:
        quantity.select_by_value(column)
        page.mouse("mouseMoved", 5, 5)
        page.mouse("mouseMoved", *page.place(row[data.axes[0]], row[data.axes[1]], log))
        page.wait(lambda: page.text("tip"), f"{column}: no tip at the pointer")
        pictures[column] = (page.pixels(), [row[column] for row in data.shown])
        if column != "status" and row[column] is not None:
            true = row[column] * data.factors[column]
            lines = page.text("tip").split("\n")
            shown = next(line for line in lines if ": " in line).rsplit(": ", 1)[1]
            check(same(number_in(shown), true), f"{column}: the tip says {shown} for {true}")
        page.shot(f"quantity-{column}")
    for (first, picture), (second, other) in zip(pictures.items(), list(pictures.items())[1:]):
        # Two metrics that are zero everywhere look alike.
        alike = picture[1] == other[1]
        check(alike or picture[0] != other[0], f"switching from {first} to {second} did not redraw")
    quantity.select_by_value("ratio_max")
    return f"{len(pictures)} pictures, each redrawn, each with its value at the pointer"


def zoom_moves_and_returns(page, data, log):
    """Wheel, drag and double-click change the view; values stay right in it."""
    view = lambda: page.figure().get_attribute("data-view")  # noqa: E731
    whole = view()
    middle = [values[len(values) // 2] for values in data.values[:2]]
    page.driver.execute_script("scrollTo(0, 0)")
    at = page.place(*middle, log)
    page.mouse("mouseWheel", *at, deltaX=0, deltaY=-200)
    page.frame()
    check(view() == whole, "the wheel alone zooms: the page cannot be scrolled over the map")
    page.mouse("mouseWheel", *at, deltaX=0, deltaY=-600, modifiers=CTRL)
    page.wait(lambda: view() != whole, "Ctrl and the wheel did not zoom")
    near = page.place(*middle, log)
    # The browser rounds the pointer's place to a pixel, which the zoom enlarges.
    apart = math.dist(at, near)
    check(apart < 3.0, f"zooming moved the point under the pointer by {apart:.1f} px")
    page.shot("zoomed")
    row = next(r for r in data.shown if [r[data.axes[0]], r[data.axes[1]]] == middle)
    page.mouse("mouseMoved", at[0] + 1, at[1])
    page.wait(lambda: page.text("readout").startswith(f"Point {row['point']}"),
              "zoomed: hovering is off")
    zoomed = view()
    page.mouse("mousePressed", *at, button="left", clickCount=1)
    page.mouse("mouseMoved", at[0] + 60, at[1] + 40, button="left", buttons=1)
    page.mouse("mouseReleased", at[0] + 60, at[1] + 40, button="left", clickCount=1)
    page.wait(lambda: view() != zoomed, "dragging did not move the view")
    moved = math.dist(page.place(*middle, log), (at[0] + 60, at[1] + 40))
    check(moved < 4.0, f"the map did not follow the pointer: {moved:.1f} px apart")
    for count in (1, 2):
        page.mouse("mousePressed", *at, button="left", clickCount=count)
        page.mouse("mouseReleased", *at, button="left", clickCount=count)
    page.wait(lambda: view() == whole, "double-click did not reset the view")
    touch = "return document.getElementById('map').style.touchAction"
    check(page.driver.execute_script(touch) == "", "a finger cannot scroll the page over the map")
    return "Ctrl and wheel about the pointer, drag, double-click"


def keys_do_all_of_it(page, data):
    """Without a pointer: focus, arrows, Enter, Escape, zoom and reset."""
    page.mouse("mouseMoved", 5, 5)
    page.press("Escape")
    page.driver.execute_script("document.getElementById('map').focus()")
    point = lambda: page.figure().get_attribute("data-point")  # noqa: E731
    page.press("ArrowUp")
    page.wait(lambda: page.text("readout").startswith("Point"), "arrows show no point")
    seen = [point()]
    for key in ("ArrowUp", "ArrowRight"):
        page.press(key)
        page.wait(lambda: point() != seen[-1], f"{key} does not move on")
        seen.append(point())
    steps = [int(b) - int(a) for a, b in zip(seen, seen[1:])]
    cuts = math.prod(len(values) for values in data.values[2:])
    check(steps == [cuts, len(data.values[1]) * cuts],
          f"arrows moved by {steps} points in grid order")
    said = page.driver.execute_script("return document.getElementById('said').textContent")
    check(said.count(";") >= 2, f"a screen reader hears only {said!r}")
    whole = page.figure().get_attribute("data-view")
    page.press("+")
    page.wait(lambda: page.figure().get_attribute("data-view") != whole, "+ does not zoom")
    page.press("0")
    page.wait(lambda: page.figure().get_attribute("data-view") == whole, "0 does not reset")
    page.shot("keyboard")
    return "arrows, zoom and reset; what is read is announced"


def clicking_shows_histories(page, data, log):
    """A point with time histories shows them; another shows none."""
    carried = page.data()["traces"]
    if carried is None:
        return "no traces beside this map"
    row = next(row for row in data.shown if str(row["point"]) in carried)
    page.driver.execute_script("scrollTo(0, 0)")
    at = page.place(row[data.axes[0]], row[data.axes[1]], log)
    page.mouse("mouseMoved", *at)
    page.mouse("mousePressed", *at, button="left", clickCount=1)
    page.mouse("mouseReleased", *at, button="left", clickCount=1)
    page.wait(lambda: page.driver.find_elements(By.CSS_SELECTOR, "#histories canvas"),
              "no time histories appeared")
    canvas = page.driver.find_element(By.CSS_SELECTOR, "#histories canvas")
    page.driver.execute_script("arguments[0].scrollIntoView({ block: 'center' })", canvas)
    page.frame()
    rectangle = "return arguments[0].getBoundingClientRect().toJSON()"
    bounds = page.driver.execute_script(rectangle, canvas)
    page.mouse("mouseMoved", bounds["left"] + bounds["width"] / 2, bounds["top"] + 60)
    selector = "#histories .tip td[data-name]"
    values = lambda: page.driver.find_elements(By.CSS_SELECTOR, selector)  # noqa: E731
    page.wait(lambda: len(values()) >= 2, "histories show no values")
    said = {value.get_attribute("data-name"): value.text for value in values()}
    page.shot("histories")
    models = [name for name in said if name.endswith((", nonlinear model", ", linear model"))]
    check(len(models) >= 2 and all(said.values()), f"histories say {said}")
    return f"point {row['point']} of {len(carried)} with histories: {said}"


def widths_and_schemes(page):
    """At 400 px the map takes the window's width; map and page follow the colour scheme."""
    page.driver.execute_script("scrollTo(0, 0)")
    background = "return getComputedStyle(document.body).backgroundColor"
    seen = {}
    for width, scheme in itertools.product((400, 1400), ("light", "dark")):
        page.window(width, scheme)
        page.wait(page.drawn, "the map is not drawn")
        seen[width, scheme] = (page.driver.execute_script(background), page.pixels())
        _, _, across, _ = map(float, page.figure().get_attribute("data-area").split())
        wide = page.driver.execute_script("return document.documentElement.scrollWidth")
        check(wide <= width, f"at {width} px the page is {wide} px wide")
        check(width > 400 or across > 280, f"at {width} px the map is {across} px wide")
        page.shot(f"{width}-{scheme}")
        for k, what in enumerate(("page", "map")):
            other = seen.get((width, "light"))
            check(scheme == "light" or other[k] != seen[width, scheme][k],
                  f"the {what} is the same in light and dark at {width} px")
    return "400 and 1400 px, light and dark"


def report_and_downloads(page, data):
    """The run in words, the worst point, what can be saved, a link that brings the view back."""
    said = page.text("about")
    for words in ("Machine", "Spin", "Method", "Verdict"):
        check(words in said, f"the report has no {words}")
    script = "return document.querySelector('noscript').textContent"
    still = page.driver.execute_script(script)
    check("data:image/png;base64,iVBOR" in still, "no picture where scripts are switched off")
    worst = max((row for row in data.rows if row["ratio_max"] is not None),
                key=lambda row: row["ratio_max"])
    page.driver.execute_script("document.querySelector('#points button').click()")
    page.wait(lambda: page.text("readout").startswith(f"Point {worst['point']}"),
              f"the first row of the table is not point {worst['point']}")
    folder = pathlib.Path(page.profile.name) / "saved"
    page.driver.execute_cdp_cmd("Browser.setDownloadBehavior",
                                {"behavior": "allow", "downloadPath": str(folder)})
    saved = {"numbers": f"point-{worst['point']}.csv", "picture": "map.png"}
    for button, name in saved.items():
        page.driver.execute_script(f"document.getElementById('{button}').click()")
        page.wait((folder / name).exists, f"{button} saves no {name}")
    lines = (folder / saved["numbers"]).read_text().split()
    numbers = dict(line.split(",") for line in lines)
    for name in ("ratio_max", *data.axes, *(f"nonlinear_{of}" for of in data.channels)):
        check(same(float(numbers[name]), worst[name]), f"saved {name}: {numbers[name]}")
    check((folder / "map.png").read_bytes()[:4] == b"\x89PNG", "the picture is no PNG")
    page.press("+")
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
    page.wait(page.drawn, "the linked page is not drawn")
    page.wait(lambda: page.figure().get_attribute("data-view") == view, "the view is not back")
    check(page.figure().get_attribute("data-layer") == "min_gap_nonlinear_m",
          "the quantity is not back")
    check(page.text("readout").startswith(f"Point {worst['point']}"), "the point is not back")
    page.driver.get(address.partition("#")[0])
    page.wait(page.drawn, "the page is not drawn again")
    return f"point {worst['point']} first; CSV, PNG; a link with view, quantity and point"


def redraw_time(page):
    """Median milliseconds of drawing all cells once more."""
    script = """const done = arguments[0]; const times = [];
        const button = document.getElementById('reset');
        const once = () => { const start = performance.now(); button.click();
          requestAnimationFrame(() => setTimeout(() => { times.push(performance.now() - start);
            times.length < 11 ? once() : done(times.sort((a, b) => a - b)[5]); })); }; once();"""
    median = page.driver.execute_async_script(script)
    return f"{median:.0f} ms from a change of view to the next frame (median of 11)"


def stands_alone(page):
    """Nothing was fetched but the page."""
    entries = "performance.getEntriesByType('resource')"
    fetched = page.driver.execute_script(f"return {entries}.map((entry) => entry.name)")
    outside = [name for name in fetched if not name.startswith(("data:", "blob:"))]
    check(not outside, f"the page fetched {outside}")
    return "nothing fetched"


def main():
    """Run every check on one page."""
    parser = argparse.ArgumentParser(
        description="Check a map's page in headless Chromium against its Parquet file."
    )
    parser.add_argument("map")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    data = Map(arguments.map)
    started = time.monotonic()
    page = Page(arguments.page, arguments.screenshots)
    log = [axis["log"] for axis in page.data()["axes"]]
    page.run([
        ("alone", lambda: stands_alone(page)),
        ("hover", lambda: hovering_shows_the_file(page, data, log, "as opened")),
        ("switch", lambda: switches_redraw(page, data, log)),
        ("zoom", lambda: zoom_moves_and_returns(page, data, log)),
        ("keys", lambda: keys_do_all_of_it(page, data)),
        ("histories", lambda: clicking_shows_histories(page, data, log)),
        ("report", lambda: report_and_downloads(page, data)),
        ("widths", lambda: widths_and_schemes(page)),
        ("speed", lambda: redraw_time(page)),
    ])
    print(f"{len(data.rows)} points checked in {time.monotonic() - started:.0f} s")


if __name__ == "__main__":
    main()
