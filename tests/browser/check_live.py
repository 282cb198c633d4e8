"""Compares a live page in headless Chromium with the map and a trace of the program.

    python check_live.py MAP.parquet TRACE.parquet STABILITY.parquet PAGE.html
        [--screenshots FOLDER]

Points of the map are typed into the page. Its amplitudes are compared with the rows of the map, its
curves with the trace, and the growth of disturbances with the file of `sweep stability`. Exits with
1 at the first mistake.
"""

import argparse
import base64
import gzip
import json
import math
import time

import pyarrow.parquet as pq
from check_page import Map, Page, check, check_self_contained, parse_number
from selenium.webdriver.common.by import By

# The bound of the relative difference of peaks at reliable points. WebAssembly has no fused
# multiply-add, so that peaks differ.
MAX_PEAK_DIFFERENCE = 1e-9
# The opcodes of f64x2.add and f64x2.mul.
OPCODES = (b"\xfd\xf0\x01", b"\xfd\xf2\x01")
# The greatest time of a checked point (s), which may need plain RK4.
LIMIT_OF_CHECK_S = 60
# The greatest time between frames while the page computes (ms). A busy host is slow.
MAX_FRAME_MS = 500


class Live(Page):
    """A live page with its panel."""

    def panel(self, name):
        """Returns an attribute of the panel."""
        script = "return document.getElementById('live').dataset[arguments[0]]"
        return self.driver.execute_script(script, name)

    def growth(self, name):
        """Returns numbers of the growth of disturbances."""
        script = "return document.getElementById('live-growth').dataset[arguments[0]] ?? ''"
        return [float(text) for text in self.driver.execute_script(script, name).split()]

    def wait_until(self, condition, message, seconds=LIMIT_OF_CHECK_S):
        """Waits until a condition holds."""
        end = time.monotonic() + seconds
        while not condition():
            check(time.monotonic() < end,
                  f"{message} after {seconds} s: {self.text('live-status')}")
            time.sleep(0.02)

    def type_in(self, values):
        """Sets values of parameters in the same way as a user who types them."""
        script = """for (const [name, value] of Object.entries(arguments[0])) {
            const input = document.querySelector(`[data-number="${name}"]`);
            input.value = value;
            input.dispatchEvent(new Event("change"));
          }"""
        self.driver.execute_script(script, values)

    def compute(self, values, kind="checked"):
        """Types a point into the page and returns the records of both models."""
        self.type_in(values)
        sliders = [slider["name"] for slider in self.live["sliders"]]

        def is_there():
            text = self.panel("point")
            point = text and dict(zip(sliders, map(float, text.split())))
            return point and all(point[name] == value for name, value in values.items()) \
                and self.panel("kind") == kind
        self.wait_until(is_there, f"{values} was never {kind}")
        numbers = [float(number) for number in self.panel("records").split()]
        width = len(numbers) // 2
        names = [channel["name"] for channel in self.live["channels"]]
        keys = ["failure", "fail_time_s", "steps", "gap_m", *names]
        models = [dict(zip(keys, numbers[k * width:(k + 1) * width])) for k in range(2)]
        for k, model in enumerate(models):
            metrics = numbers[k * width + len(keys):(k + 1) * width]
            model["metrics"] = {
                metric["columns"][k]: value for metric, value in zip(self.live["metrics"], metrics)
            }
        return models


def check_module(page):
    """Checks that the module has vector instructions and no imports, and that all workers start
    from a file."""
    page.live = page.data()["live"]
    module = gzip.decompress(base64.b64decode(page.live["module"]))
    counts = [module.count(opcode) for opcode in OPCODES]
    check(min(counts) > 1000, f"the module has few vector instructions: {counts}")
    script = """const done = arguments[arguments.length - 1];
        unpackGzip(DATA.live.module).then((bytes) => WebAssembly.compile(bytes))
          .then((module) => done(WebAssembly.Module.imports(module).length));"""
    imports = page.driver.execute_async_script(script)
    check(imports == 0, f"the module has {imports} imports")

    def is_up():
        ready, _, count = (page.panel("ready") or "0 of 0").partition(" of ")
        return int(ready) == int(count) >= 2
    page.wait_until(is_up, "not all workers came up", 10)
    check(page.driver.current_url.startswith("file:"), "not from a file")
    return f"{page.panel('ready')} workers; {counts[0]} vector sums and {counts[1]} products in " \
        f"{len(module)} bytes"


def check_rows(page, data):
    """Checks amplitudes, levels and verdicts at points all over the map."""
    ok_rows = [row for row in data.first_cut_rows if row["status"] == "ok"]
    sample = ok_rows[:: max(1, len(ok_rows) // 24)]
    sample += [row for row in ok_rows if row["sensitive"] and row not in sample][:2]
    max_differences = {True: (0.0, None), False: (0.0, None)}
    for row in sample:
        where = {axis: row[axis] for axis in data.axes}
        models = page.compute(where)
        for model, record in zip(("nonlinear", "linear"), models):
            check(record["failure"] == 0, f"{where}: the {model} model failed on the page")
            for channel in data.channels:
                file_value = row[f"{model}_{channel}"]
                difference = abs(record[channel] - file_value) / abs(file_value)
                if not row["sensitive"]:
                    reliable = bool(row["reliable"])
                    entry = (difference, f"{where} {model} {channel}")
                    max_differences[reliable] = max(max_differences[reliable], entry)
        values_text = page.text("live-values")
        verdict = f"Linear model {'' if row['reliable'] else 'un'}reliable"
        check(verdict in values_text, f"{where}: not '{verdict}': {values_text}")
        check(f"nonlinear model by {row['method']}," in page.text("live-status"),
              f"{where}: the row is by {row['method']}: {page.text('live-status')}")
        check(values_text.startswith("Checked"),
              f"{where}: a checked point says {values_text[:40]}")
        check(("chaotic" in values_text) == row["sensitive"],
              f"{where}: sensitive is {row['sensitive']}, the page says: {values_text}")
    check(max_differences[True][0] <= MAX_PEAK_DIFFERENCE, f"reliable: {max_differences[True]}")
    chaotic = sum(row["sensitive"] for row in sample)
    return (f"{len(sample)} points: within {max_differences[True][0]:.1e} of a peak where the "
            f"model is reliable, {max_differences[False][0]:.1e} elsewhere; {chaotic} called "
            "chaotic, as in the file")


def check_previews(page, data):
    """Checks that the page marks a preview as not checked, and then shows the checked result."""
    row = next(row for row in data.first_cut_rows if row["reliable"])
    where = {axis: row[axis] for axis in data.axes}
    page.type_in({data.axes[0]: data.values[0][-1]})
    page.type_in(where)
    texts = page.driver.execute_async_script("""const done = arguments[arguments.length - 1];
        const wanted = arguments[0];
        const said = []; const look = () => { const panel = document.getElementById('live');
          const at = wanted.every((value) => panel.dataset.point.split(' ').includes(`${value}`));
          const now = document.getElementById('live-values').textContent;
          if (at && said.at(-1)?.[0] !== now) said.push([now, panel.dataset.ms]);
          if (at && panel.dataset.kind === 'checked') done(said); else setTimeout(look, 2); };
        look();""", list(where.values()))
    kinds = [text.split("Linear")[0] for text, _ in texts]
    check(kinds[-1] == "Checked" and kinds[0] == "Preview, not checked", f"the page said {kinds}")
    peaks, *curves = map(float, texts[0][1].split())
    return f"peaks of both models {peaks:.0f} ms, a curve {min(curves):.0f} ms, then checked"


def check_curves(page, trace, where):
    """Checks the chart's values at instants by the rows of the trace."""
    page.compute(where)
    rows = pq.read_table(trace).to_pylist()
    interval_s = rows[1]["time_s"] - rows[0]["time_s"]
    figure = page.driver.find_element(By.CSS_SELECTOR, "#live-histories .figure")
    page.driver.execute_script("arguments[0].scrollIntoView({ block: 'center' }); "
                               "arguments[0].focus()", figure)
    value_count = 0
    for _ in range(12):
        page.press_key("ArrowRight")
        tip = page.driver.find_element(By.CSS_SELECTOR, "#live-histories .tip")
        row = rows[round(float(tip.get_attribute("data-x")) / interval_s)]
        for cell in tip.find_elements(By.CSS_SELECTOR, "td[data-name]"):
            name = cell.get_attribute("data-name")
            for words, column in (("Tub yaw", "tub_yaw"), ("Tub pitch", "tub_pitch")):
                for model in ("nonlinear", "linear"):
                    if name != f"{words}, {model} model":
                        continue
                    model_column = f"{model}_{column}"
                    peak = max(abs(row[model_column]) for row in rows)
                    error = abs(parse_number(cell.text) / 1e3 - row[model_column]) / peak
                    check(error < 2e-3, f"{name} at {row['time_s']} s: {cell.text} mrad for "
                                        f"{row[model_column]} rad")
                    value_count += 1
    check(value_count >= 12, f"only {value_count} values of yaw or pitch were shown")
    return f"{value_count} values of curves, as in the trace of plain rk4"


def check_growth(page, path):
    """Checks the growth at points of the file, at the common speeds."""
    rows = pq.read_table(path).to_pylist()
    sliders = [slider["name"] for slider in page.live["sliders"]]
    axes = [name for name in sliders if name in rows[0]]
    points = sorted({tuple(row[axis] for axis in axes) for row in rows})
    page.driver.execute_script("document.getElementById('live-growth').open = true")
    max_error_per_s, speed_count, growing_count = 0.0, 0, 0
    for point in (points[0], points[len(points) // 2], points[-1]):
        where = dict(zip(axes, point))
        page.compute(where)

        def is_there(where=where):
            point = dict(zip(sliders, page.growth("point")))
            return all(point.get(name) == value for name, value in where.items())
        page.wait_until(is_there, f"no growth at {where}")
        growth_by_speed = dict(zip(page.growth("speeds"), page.growth("growth")))
        for row in rows:
            if all(row[axis] == value for axis, value in where.items()) \
                    and row["speed_rpm"] in growth_by_speed:
                # The page stores the growth in single precision.
                error_per_s = abs(growth_by_speed[row["speed_rpm"]] - row["growth_per_s"])
                max_error_per_s = max(max_error_per_s, error_per_s)
                speed_count += 1
                growing_count += row["growth_per_s"] > 0
        page.save_screenshot(f"live-growth-{'-'.join(map(str, point))}")
    check(speed_count >= 9 and growing_count > 0,
          f"{speed_count} speeds in common, growth at {growing_count}")
    check(max_error_per_s < 1e-6, f"growth is off by {max_error_per_s:.1e}/s")
    page.driver.execute_script("document.getElementById('live-growth').open = false")
    return (f"{speed_count} speeds, growth at {growing_count} of them: "
            f"within {max_error_per_s:.1e}/s")


def check_dragging(page, data):
    """Checks the times between frames and between previews while a slider is dragged."""
    script = """const done = arguments[arguments.length - 1];
        const range = document.querySelector(`[data-slider="${arguments[0]}"]`);
        const panel = document.getElementById('live');
        const [low, high] = [Number(range.min), Number(range.max)];
        const frames = []; const seen = new Map(); let last = performance.now();
        const step = () => { const now = performance.now(); frames.push(now - last); last = now;
          seen.set(panel.dataset.point, panel.dataset.ms);
          range.value = low + (high - low) * (0.5 + 0.4 * Math.sin(frames.length / 20));
          range.dispatchEvent(new Event('input'));
          if (frames.length < 150) requestAnimationFrame(step);
          else done([frames.slice(2), [...seen.values()]]); };
        requestAnimationFrame(step);"""
    frames, answers = page.driver.execute_async_script(script, data.axes[1])
    frames.sort()
    check(frames[-len(frames) // 20] < MAX_FRAME_MS,
          f"one frame in twenty took {frames[-len(frames) // 20]:.0f} ms or more")
    check(len(answers) > 5, f"only {len(answers)} answers while the slider moved")
    times = [sorted(column) for column in zip(*(map(float, ms.split()) for ms in answers[1:]))]
    peaks, nonlinear, linear = (column[len(column) // 2] for column in times)
    middle = frames[len(frames) // 2]
    return f"{len(answers)} previews in {len(frames)} frames (median {middle:.0f}, slowest " \
        f"{frames[-1]:.0f} ms); medians: peaks of both models {peaks:.1f} ms, curves " \
        f"{nonlinear:.1f} and {linear:.1f} ms"


def check_slider_keys(page):
    """Checks that an arrow key moves a slider."""
    slider = page.driver.find_element(By.CSS_SELECTOR, "#live input[type=range]")
    first = page.live["sliders"][0]
    page.compute({first["name"]: (first["from"] + first["to"]) / 2})
    page.driver.execute_script("arguments[0].focus()", slider)
    before = page.panel("point")
    page.press_key("ArrowRight")
    page.wait_until(lambda: page.panel("point") != before, "an arrow key moves nothing", 10)
    return "arrow keys move a slider"


def check_slider_scales(page):
    """Checks that the middle of a slider is the middle of its axis, the geometric one of a
    logarithmic axis."""
    scales = []
    for slider in (slider for slider in page.live["sliders"] if slider["axis"]):
        low, high = slider["from"], slider["to"]
        middle = math.sqrt(low * high) if slider["log"] else (low + high) / 2
        script = """const range = document.querySelector(`[data-slider="${arguments[0]}"]`);
            range.value = (Number(range.min) + Number(range.max)) / 2;
            range.dispatchEvent(new Event("input"));
            const number = document.querySelector(`[data-number="${arguments[0]}"]`);
            return [Number(number.value), range.getAttribute("aria-valuetext")];"""
        value, label = page.driver.execute_script(script, slider["name"])
        check(abs(value / middle - 1) < 1e-3, f"{slider['name']} half way is {value}")
        # A linear slider needs no label, because its value is that of the parameter.
        check(float(label) == value if slider["log"] else label is None,
              f"{slider['name']} says {label}")
        scales.append("logarithmic" if slider["log"] else "linear")
    return ", ".join(scales)


def check_refinement(page):
    """Checks that finer cells appear on the map, and that the legend explains them."""
    page.driver.execute_script("scrollTo(0, 0)")
    page.wait_for_frame()
    before = page.picture_hash()
    start_s = time.monotonic()
    page.driver.execute_script("document.getElementById('refine').click()")
    page.wait_until(lambda: (page.panel("fine") or "").endswith(" 0"),
                    "the map is not refined", 120)
    elapsed_s = time.monotonic() - start_s
    page.wait_for_frame()
    check(page.picture_hash() != before, "finer cells are not drawn")
    check("preview, not checked" in page.text("legend"), f"legend: {page.text('legend')}")
    page.save_screenshot("live-finer")
    return f"{page.panel('fine').split()[0]} cells in {elapsed_s:.1f} s"


def check_further_parameters(page):
    """Checks a machine that differs from the map's in a parameter that is no axis."""
    names = [slider["name"] for slider in page.live["sliders"] if not slider["axis"]]
    check(names, "no slider beside the axes")
    slider = next(slider for slider in page.live["sliders"] if slider["name"] == names[0])
    nonlinear, linear = page.compute({names[0]: slider["to"]})
    check(nonlinear["failure"] == 0 == linear["failure"], f"{names[0]}: a model failed")
    check(math.isfinite(nonlinear["tub_yaw"]), f"{names[0]}: no amplitude")
    page.driver.execute_script("document.getElementById('live-reset').click()")
    page.wait_until(lambda: str(slider["to"]) not in page.panel("point").split(), "no way back", 10)
    return f"{', '.join(names)}: checked at {names[0]} {slider['to']}"


def check_widths_and_schemes(page):
    """Checks that nothing is wider than the window."""
    for width, scheme in ((400, "light"), (400, "dark"), (1400, "dark"), (1400, "light")):
        page.set_window(width, scheme)
        page_width = page.driver.execute_script("return document.documentElement.scrollWidth")
        check(page_width <= width, f"at {width} px the page is {page_width} px wide")
        page.driver.execute_script("document.getElementById('live').scrollIntoView()")
        page.wait_for_frame()
        page.save_screenshot(f"live-{width}-{scheme}")
    return "400 and 1400 px, light and dark"


def main():
    """Runs all checks on a page."""
    parser = argparse.ArgumentParser(
        description="Compare a live page with the program's files."
    )
    parser.add_argument("map")
    parser.add_argument("trace", help="trace file of a point")
    parser.add_argument("stability", help="stability file of the map's grid")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    data = Map(arguments.map)
    metadata = pq.read_metadata(arguments.trace).metadata
    at = json.loads(metadata[b"sweep.trace"])["at"]
    page = Live(arguments.page, arguments.screenshots)
    page.driver.set_script_timeout(LIMIT_OF_CHECK_S)
    page.run([
        ("opens", lambda: check_module(page)),
        ("rows", lambda: check_rows(page, data)),
        ("preview", lambda: check_previews(page, data)),
        ("curves", lambda: check_curves(page, arguments.trace, at)),
        ("growth", lambda: check_growth(page, arguments.stability)),
        ("drag", lambda: check_dragging(page, data)),
        ("keys", lambda: check_slider_keys(page)),
        ("scales", lambda: check_slider_scales(page)),
        ("further", lambda: check_further_parameters(page)),
        ("refine", lambda: check_refinement(page)),
        ("alone", lambda: check_self_contained(page)),
        ("widths", lambda: check_widths_and_schemes(page)),
    ])


if __name__ == "__main__":
    main()
