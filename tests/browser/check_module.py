"""Compares the results of two builds of the module of live pages, in headless Chromium, by bits.

    python check_module.py PAGE.html MODULE.wasm.gz

PAGE.html has one module and the setup; MODULE.wasm.gz is the other module. Both modules compute the
same points: previews, checked results, time histories and motions at constant speeds. All bits must
be the same. The operations of WebAssembly are rounded correctly, so that results depend on the
source and not on the compiler. Exits with 1 at the first difference.
"""

import argparse
import base64
import pathlib
import sys

from check_page import CheckError, Page, check

# Positions of points between the ends of the axes, from 0 to 1.
POSITIONS = [(0.1, 0.9), (0.4, 0.5), (0.9, 0.1)]

SCRIPT = """
const [other, positions, done] = arguments;
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
  const bits = [];
  for (const [x, y] of positions) {
    const values = live.sliders.map(({ from, to, value, axis }, k) => (axis
      ? from + (to - from) * (k === 0 ? x : y) : value));
    write(values); bits.push(...read(api.quick(values.length)));
    write(values); bits.push(...read(api.checked()));
    for (const model of [0, 1]) {
      write(values); bits.push(...read(api.history(model, 255, live.everyS)));
    }
    write(values); bits.push(...read(api.speeds(live.everyS)));
    write([...values, 200, 240]); bits.push(...read(api.growth(values.length)));
    write([...values, 240]); bits.push(...read(api.dwell(values.length)));
  }
  return bits;
};
Promise.all([live.module, other].map((packed) => unpackGzip(packed).then(run))).then(([a, b]) => {
  const differentIndex = a.findIndex((value, k) => value !== b[k]);
  done([a.length, b.length, differentIndex]);
}, (error) => done(String(error)));
"""


def main():
    """Compares both modules."""
    parser = argparse.ArgumentParser(description="Compare two builds of the module by their bits.")
    parser.add_argument("page")
    parser.add_argument("module")
    arguments = parser.parse_args()
    other_module = pathlib.Path(arguments.module).read_bytes()
    page = Page(arguments.page, None)
    page.driver.set_script_timeout(300)
    try:
        page_module = base64.b64decode(page.data()["live"]["module"])
        size_note = "the same bytes"
        if page_module != other_module:
            size_note = f"{len(page_module)} and {len(other_module)} bytes"
        text = base64.b64encode(other_module).decode()
        result = page.driver.execute_async_script(SCRIPT, text, POSITIONS)
        check(isinstance(result, list), f"a module does not run: {result}")
        count, other_count, different_index = result
        check(count == other_count and count > 10000, f"{count} and {other_count} numbers")
        check(different_index < 0,
              f"number {different_index} of {count} differs: the committed module "
                         "is of another source; scripts/release/build_live.sh builds it")
    except CheckError as error:
        sys.exit(f"{arguments.module}: {error}")
    finally:
        page.close()
    print(f"{size_note}; {count} numbers, the same bits")


if __name__ == "__main__":
    main()
