"""A page that computes, in headless Chromium, held against the map and a trace of the program.

    python check_live.py MAP.parquet TRACE.parquet STABILITY.parquet PAGE.html
        [--screenshots FOLDER]

Points of the map are typed into the page; what it then computes is compared with the file's rows,
its curves with the trace, and the growth of disturbances with the file of `sweep stability`. Exits
with 1 at the first thing that is wrong.
"""

import argparse
import base64
import gzip
import json
import math
import time

import pyarrow.parquet as pq
from check_page import Map, Page, check, number_in, stands_alone
from selenium.webdriver.common.by import By

# Of a peak, at reliable points: WebAssembly has no fused multiply-add.
BOUND = 1e-9
# f64x2.add and f64x2.mul.
OPCODES = (b"\xfd\xf0\x01", b"\xfd\xf2\x01")
# A checked point may climb to plain RK4, s.
LONGEST_CHECK_S = 60
# The most that the page may stand still while it computes, ms; a busy host is slow.
LONGEST_FRAME_MS = 500


class Live(Page):
    """The page with its panel."""

    def panel(self, name):
        """What the panel says of itself."""
        script = "return document.getElementById('live').dataset[arguments[0]]"
        return self.driver.execute_script(script, name)

    def growth(self, name):
        """What is known of the growth of disturbances."""
        script = "return document.getElementById('live-growth').dataset[arguments[0]] ?? ''"
        return [float(text) for text in self.driver.execute_script(script, name).split()]

    def until(self, condition, what, seconds=LONGEST_CHECK_S):
        """Until the condition holds."""
        end = time.monotonic() + seconds
        while not condition():
            check(time.monotonic() < end, f"{what} after {seconds} s: {self.text('live-status')}")
            time.sleep(0.02)

    def type_in(self, values):
        """Values of parameters, as a user types them."""
        script = """for (const [name, value] of Object.entries(arguments[0])) {
            const input = document.querySelector(`[data-number="${name}"]`);
            input.value = value;
            input.dispatchEvent(new Event("change"));
          }"""
        self.driver.execute_script(script, values)

    def computed(self, values, kind="checked"):
        """The records of both models at a point."""
        self.type_in(values)
        sliders = [slider["name"] for slider in self.live["sliders"]]

        def is_there():
            said = self.panel("point")
            here = said and dict(zip(sliders, map(float, said.split())))
            return here and all(here[name] == value for name, value in values.items()) \
                and self.panel("kind") == kind
        self.until(is_there, f"{values} was never {kind}")
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


def opens(page):
    """The module is there, has vectors and needs nothing; workers come up from a file."""
    page.live = page.data()["live"]
    module = gzip.decompress(base64.b64decode(page.live["module"]))
    counts = [module.count(opcode) for opcode in OPCODES]
    check(min(counts) > 1000, f"the module has few vector instructions: {counts}")
    script = """const done = arguments[arguments.length - 1];
        unpackGzip(DATA.live.module).then((bytes) => WebAssembly.compile(bytes))
          .then((module) => done(WebAssembly.Module.imports(module).length));"""
    imports = page.driver.execute_async_script(script)
    check(imports == 0, f"the module wants {imports} things from outside")

    def is_up():
        ready, _, count = (page.panel("ready") or "0 of 0").partition(" of ")
        return int(ready) == int(count) >= 2
    page.until(is_up, "not all workers came up", 10)
    check(page.driver.current_url.startswith("file:"), "not from a file")
    return f"{page.panel('ready')} workers; {counts[0]} vector sums and {counts[1]} products in " \
        f"{len(module)} bytes"


def checked_points_are_rows(page, data):
    """Amplitudes, levels and verdicts of the file, at points all over the map."""
    ok = [row for row in data.shown if row["status"] == "ok"]
    chosen = ok[:: max(1, len(ok) // 24)]
    chosen += [row for row in ok if row["sensitive"] and row not in chosen][:2]
    worst = {True: (0.0, None), False: (0.0, None)}
    for row in chosen:
        where = {axis: row[axis] for axis in data.axes}
        models = page.computed(where)
        for model, record in zip(("nonlinear", "linear"), models):
            check(record["failure"] == 0, f"{where}: the {model} model failed on the page")
            for channel in data.channels:
                true = row[f"{model}_{channel}"]
                apart = abs(record[channel] - true) / abs(true)
                if not row["sensitive"]:
                    reliable = bool(row["reliable"])
                    worst[reliable] = max(worst[reliable], (apart, f"{where} {model} {channel}"))
        said = page.text("live-values")
        verdict = f"Linear model {'' if row['reliable'] else 'un'}reliable"
        check(verdict in said, f"{where}: not '{verdict}': {said}")
        check(f"nonlinear model by {row['method']}," in page.text("live-status"),
              f"{where}: the row is by {row['method']}: {page.text('live-status')}")
        check(said.startswith("Checked"), f"{where}: a checked point says {said[:40]}")
        check(("chaotic" in said) == row["sensitive"],
              f"{where}: sensitive is {row['sensitive']}, the page says: {said}")
    check(worst[True][0] <= BOUND, f"reliable: {worst[True]}")
    chaotic = sum(row["sensitive"] for row in chosen)
    return f"{len(chosen)} points: within {worst[True][0]:.1e} of a peak where the model is " \
        f"reliable, {worst[False][0]:.1e} elsewhere; {chaotic} called chaotic, as in the file"


def previews_say_so(page, data):
    """A quick answer is not passed off as a checked one, and is near it."""
    row = next(row for row in data.shown if row["reliable"])
    where = {axis: row[axis] for axis in data.axes}
    page.type_in({data.axes[0]: data.values[0][-1]})
    page.type_in(where)
    seen = page.driver.execute_async_script("""const done = arguments[arguments.length - 1];
        const wanted = arguments[0];
        const said = []; const look = () => { const panel = document.getElementById('live');
          const at = wanted.every((value) => panel.dataset.point.split(' ').includes(`${value}`));
          const now = document.getElementById('live-values').textContent;
          if (at && said.at(-1)?.[0] !== now) said.push([now, panel.dataset.ms]);
          if (at && panel.dataset.kind === 'checked') done(said); else setTimeout(look, 2); };
        look();""", list(where.values()))
    kinds = [text.split("Linear")[0] for text, _ in seen]
    check(kinds[-1] == "Checked" and kinds[0] == "Preview, not checked", f"the page said {kinds}")
    peaks, *curves = map(float, seen[0][1].split())
    return f"peaks of both models {peaks:.0f} ms, a curve {min(curves):.0f} ms, then checked"


def curves_are_the_traces(page, trace, where):
    """What the chart says at instants, against the trace's rows."""
    page.computed(where)
    rows = pq.read_table(trace).to_pylist()
    every = rows[1]["time_s"] - rows[0]["time_s"]
    figure = page.driver.find_element(By.CSS_SELECTOR, "#live-histories .figure")
    page.driver.execute_script("arguments[0].scrollIntoView({ block: 'center' }); "
                               "arguments[0].focus()", figure)
    seen = 0
    for _ in range(12):
        page.press("ArrowRight")
        tip = page.driver.find_element(By.CSS_SELECTOR, "#live-histories .tip")
        row = rows[round(float(tip.get_attribute("data-x")) / every)]
        for cell in tip.find_elements(By.CSS_SELECTOR, "td[data-name]"):
            name = cell.get_attribute("data-name")
            for words, column in (("Tub yaw", "tub_yaw"), ("Tub pitch", "tub_pitch")):
                for model in ("nonlinear", "linear"):
                    if name != f"{words}, {model} model":
                        continue
                    column_of = f"{model}_{column}"
                    peak = max(abs(row[column_of]) for row in rows)
                    apart = abs(number_in(cell.text) / 1e3 - row[column_of]) / peak
                    check(apart < 2e-3, f"{name} at {row['time_s']} s: {cell.text} mrad for "
                                        f"{row[column_of]} rad")
                    seen += 1
    check(seen >= 12, f"only {seen} values of yaw or pitch were shown")
    return f"{seen} values of curves, as in the trace of plain rk4"


def growth_is_the_programs(page, path):
    """Growth over speed at points of the file, at the speeds that both have."""
    rows = pq.read_table(path).to_pylist()
    sliders = [slider["name"] for slider in page.live["sliders"]]
    axes = [name for name in sliders if name in rows[0]]
    points = sorted({tuple(row[axis] for axis in axes) for row in rows})
    page.driver.execute_script("document.getElementById('live-growth').open = true")
    worst, seen, grows = 0.0, 0, 0
    for point in (points[0], points[len(points) // 2], points[-1]):
        where = dict(zip(axes, point))
        page.computed(where)

        def is_there(where=where):
            here = dict(zip(sliders, page.growth("point")))
            return all(here.get(name) == value for name, value in where.items())
        page.until(is_there, f"no growth at {where}")
        found = dict(zip(page.growth("speeds"), page.growth("growth")))
        for row in rows:
            if all(row[axis] == value for axis, value in where.items()) \
                    and row["speed_rpm"] in found:
                # The page draws it in single precision.
                worst = max(worst, abs(found[row["speed_rpm"]] - row["growth_per_s"]))
                seen += 1
                grows += row["growth_per_s"] > 0
        page.shot(f"live-growth-{'-'.join(map(str, point))}")
    check(seen >= 9 and grows > 0, f"{seen} speeds in common, growth at {grows}")
    check(worst < 1e-6, f"growth is off by {worst:.1e}/s")
    page.driver.execute_script("document.getElementById('live-growth').open = false")
    return f"{seen} speeds, growth at {grows} of them: within {worst:.1e}/s"


def stays_responsive(page, data):
    """While a slider is dragged, frames keep coming and so do answers."""
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
    check(frames[-len(frames) // 20] < LONGEST_FRAME_MS,
          f"one frame in twenty took {frames[-len(frames) // 20]:.0f} ms or more")
    check(len(answers) > 5, f"only {len(answers)} answers while the slider moved")
    times = [sorted(column) for column in zip(*(map(float, ms.split()) for ms in answers[1:]))]
    peaks, nonlinear, linear = (column[len(column) // 2] for column in times)
    middle = frames[len(frames) // 2]
    return f"{len(answers)} previews in {len(frames)} frames (median {middle:.0f}, slowest " \
        f"{frames[-1]:.0f} ms); medians: peaks of both models {peaks:.1f} ms, curves " \
        f"{nonlinear:.1f} and {linear:.1f} ms"


def keys_alone(page):
    """A slider under the keyboard."""
    slider = page.driver.find_element(By.CSS_SELECTOR, "#live input[type=range]")
    first = page.live["sliders"][0]
    page.computed({first["name"]: (first["from"] + first["to"]) / 2})
    page.driver.execute_script("arguments[0].focus()", slider)
    before = page.panel("point")
    page.press("ArrowRight")
    page.until(lambda: page.panel("point") != before, "an arrow key moves nothing", 10)
    return "arrow keys move a slider"


def log_axes_have_log_sliders(page):
    """Half way along a slider lies the middle of its axis: of a logarithmic one, the geometric."""
    found = []
    for slider in (slider for slider in page.live["sliders"] if slider["axis"]):
        low, high = slider["from"], slider["to"]
        middle = math.sqrt(low * high) if slider["log"] else (low + high) / 2
        script = """const range = document.querySelector(`[data-slider="${arguments[0]}"]`);
            range.value = (Number(range.min) + Number(range.max)) / 2;
            range.dispatchEvent(new Event("input"));
            const number = document.querySelector(`[data-number="${arguments[0]}"]`);
            return [Number(number.value), range.getAttribute("aria-valuetext")];"""
        value, said = page.driver.execute_script(script, slider["name"])
        check(abs(value / middle - 1) < 1e-3, f"{slider['name']} half way is {value}")
        # A linear slider says its own value.
        check(float(said) == value if slider["log"] else said is None,
              f"{slider['name']} says {said}")
        found.append("logarithmic" if slider["log"] else "linear")
    return ", ".join(found)


def map_is_refined(page):
    """Finer cells appear on the map, and the legend says what they are."""
    page.driver.execute_script("scrollTo(0, 0)")
    page.frame()
    before = page.pixels()
    started = time.monotonic()
    page.driver.execute_script("document.getElementById('refine').click()")
    page.until(lambda: (page.panel("fine") or "").endswith(" 0"), "the map is not refined", 120)
    took = time.monotonic() - started
    page.frame()
    check(page.pixels() != before, "finer cells are not drawn")
    check("preview, not checked" in page.text("legend"), f"legend: {page.text('legend')}")
    page.shot("live-finer")
    return f"{page.panel('fine').split()[0]} cells in {took:.1f} s"


def further_parameters(page):
    """A machine that the map does not have."""
    names = [slider["name"] for slider in page.live["sliders"] if not slider["axis"]]
    check(names, "no slider beside the axes")
    slider = next(slider for slider in page.live["sliders"] if slider["name"] == names[0])
    nonlinear, linear = page.computed({names[0]: slider["to"]})
    check(nonlinear["failure"] == 0 == linear["failure"], f"{names[0]}: a model failed")
    check(math.isfinite(nonlinear["tub_yaw"]), f"{names[0]}: no amplitude")
    page.driver.execute_script("document.getElementById('live-reset').click()")
    page.until(lambda: str(slider["to"]) not in page.panel("point").split(), "no way back", 10)
    return f"{', '.join(names)}: checked at {names[0]} {slider['to']}"


def narrow_and_dark(page):
    """Nothing is wider than the window."""
    for width, scheme in ((400, "light"), (400, "dark"), (1400, "dark"), (1400, "light")):
        page.window(width, scheme)
        wide = page.driver.execute_script("return document.documentElement.scrollWidth")
        check(wide <= width, f"at {width} px the page is {wide} px wide")
        page.driver.execute_script("document.getElementById('live').scrollIntoView()")
        page.frame()
        page.shot(f"live-{width}-{scheme}")
    return "400 and 1400 px, light and dark"


def main():
    """Run every check on one page."""
    parser = argparse.ArgumentParser(
        description="Check a page that computes against the program's files."
    )
    parser.add_argument("map")
    parser.add_argument("trace", help="of the first point of the map that is reliable")
    parser.add_argument("stability", help="of the map's grid at some speeds")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    data = Map(arguments.map)
    metadata = pq.read_metadata(arguments.trace).metadata
    at = json.loads(metadata[b"sweep.trace"])["at"]
    page = Live(arguments.page, arguments.screenshots)
    page.driver.set_script_timeout(LONGEST_CHECK_S)
    page.run([
        ("opens", lambda: opens(page)),
        ("rows", lambda: checked_points_are_rows(page, data)),
        ("preview", lambda: previews_say_so(page, data)),
        ("curves", lambda: curves_are_the_traces(page, arguments.trace, at)),
        ("growth", lambda: growth_is_the_programs(page, arguments.stability)),
        ("drag", lambda: stays_responsive(page, data)),
        ("keys", lambda: keys_alone(page)),
        ("scales", lambda: log_axes_have_log_sliders(page)),
        ("further", lambda: further_parameters(page)),
        ("refine", lambda: map_is_refined(page)),
        ("alone", lambda: stands_alone(page)),
        ("widths", lambda: narrow_and_dark(page)),
    ])


if __name__ == "__main__":
    main()
