"""Checks a page of dots in headless Chromium: dots at the ends of the x axis must not be clipped.

    python check_dots.py PAGE.html [--screenshots FOLDER]

The script reads the canvas on both sides of the panels' left and right edges, in a narrow and in a
wide window. Exits with 1 at the first mistake.
"""

import argparse

from check_chart import Chart
from check_page import check, check_self_contained

# Counts the coloured pixels of the canvas 2 px outside and inside of the panels' left and right
# edges. Lines, ticks and texts are grey, and shaded regions are pale.
COLOURED_PIXELS = """
    const canvas = document.querySelector("#main .figure canvas");
    const { width, height } = canvas;
    const copy = new OffscreenCanvas(width, height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, width, height);
    const column = (x) => {
        let hued = 0;
        for (let k = 4 * x; k < data.length; k += 4 * width) {
            const rgb = data.slice(k, k + 3);
            hued += data[k + 3] > 127 && Math.max(...rgb) - Math.min(...rgb) > 60;
        }
        return hued;
    };
    const [left, right] = [CHART_MARGINS.left, width - CHART_MARGINS.right];
    return [left - 2, left + 1, right + 1, right - 2].map(column);
"""


def check_dots(page):
    """Checks that half of each dot at an end of the axis lies outside of the panel."""
    counts_by_width = []
    for width in (400, 1200):
        page.set_window(width, "light")
        counts = page.driver.execute_script(COLOURED_PIXELS)
        counts_by_width.append(f"{counts} pixels at {width} px")
        check(min(counts) > 3,
              f"dots are clipped: {counts_by_width[-1]} outside and inside of the edges")
        page.save_screenshot(f"dots-{width}")
    return ", ".join(counts_by_width)


def main():
    """Runs all checks on a page."""
    parser = argparse.ArgumentParser(description="Check a page of dots in headless Chromium.")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    page = Chart(arguments.page, arguments.screenshots)
    page.run([
        ("alone", lambda: check_self_contained(page)),
        ("dots", lambda: check_dots(page)),
    ])


if __name__ == "__main__":
    main()
