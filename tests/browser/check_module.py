"""Two builds of the module of live pages, in headless Chromium: they compute the same bits.

    python check_module.py PAGE.html MODULE.wasm.gz

PAGE.html carries one module and the setup, MODULE.wasm.gz is the other. Both take the setup and
compute the same points, checked, by the quick rung, as time histories and at constant speeds. Every
number must be the same bits: each operation of WebAssembly is rounded correctly, so only another
source computes anything else, whatever the compiler. Exits with 1 at the first difference.
"""

import argparse
import base64
import pathlib
import sys

from check_page import Page, Wrong, check

# Places between the ends of the axes.
PLACES = [(0.1, 0.9), (0.4, 0.5), (0.9, 0.1)]

SCRIPT = """
const [other, places, done] = arguments;
const live = DATA.live;
const run = async (bytes) => {
  const { instance: { exports: api } } = await WebAssembly.instantiate(bytes, {});
  const write = (numbers) => {
    const at = api.input(numbers.length);
    new Float64Array(api.memory.buffer, at, numbers.length).set(numbers);
  };
  const read = (count) => [...new BigUint64Array(api.memory.buffer, api.output(), count)];
  write(decodeDoubles(live.setup));
  if (api.setup() !== 1) throw new Error("the setup is refused");
  const found = [];
  for (const [x, y] of places) {
    const values = live.sliders.map(({ from, to, value, axis }, k) => (axis
      ? from + (to - from) * (k === 0 ? x : y) : value));
    write(values); found.push(...read(api.quick(values.length)));
    write(values); found.push(...read(api.checked()));
    for (const model of [0, 1]) {
      write(values); found.push(...read(api.history(model, 255, live.everyS)));
    }
    write(values); found.push(...read(api.speeds(live.everyS)));
    write([...values, 200, 240]); found.push(...read(api.growth(values.length)));
    write([...values, 240]); found.push(...read(api.dwell(values.length)));
  }
  return found;
};
Promise.all([live.module, other].map((packed) => unpackGzip(packed).then(run))).then(([a, b]) => {
  const apart = a.findIndex((bits, k) => bits !== b[k]);
  done([a.length, b.length, apart]);
}, (error) => done(String(error)));
"""


def main():
    """Compare the two."""
    parser = argparse.ArgumentParser(description="Compare two builds of the module by their bits.")
    parser.add_argument("page")
    parser.add_argument("module")
    arguments = parser.parse_args()
    other = pathlib.Path(arguments.module).read_bytes()
    page = Page(arguments.page, None)
    page.driver.set_script_timeout(300)
    try:
        mine = base64.b64decode(page.data()["live"]["module"])
        bytes_said = "the same bytes" if mine == other else f"{len(mine)} and {len(other)} bytes"
        text = base64.b64encode(other).decode()
        found = page.driver.execute_async_script(SCRIPT, text, PLACES)
        check(isinstance(found, list), f"a module does not run: {found}")
        count, others, apart = found
        check(count == others and count > 10000, f"{count} numbers against {others}")
        check(apart < 0, f"number {apart} of {count} differs: the committed module is of another "
                         "source; scripts/release/build_live.sh builds it")
    except Wrong as wrong:
        sys.exit(f"{arguments.module}: {wrong}")
    finally:
        page.close()
    print(f"{bytes_said}; {count} numbers, the same bits")


if __name__ == "__main__":
    main()
