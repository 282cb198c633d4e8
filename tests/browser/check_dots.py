"""A page of dots in headless Chromium: those at the ends of the x axis are whole.

    python check_dots.py PAGE.html [--screenshots FOLDER]

Looks at the canvas on both sides of the panels' left and right edges, in a narrow window and in a
wide one. Exits with 1 at the first thing that is wrong.
"""

import argparse

from check_chart import Chart
from check_page import check, stands_alone

# Pixels of the canvas that have a hue, 2 px without and within the panels' left and right edges.
# Lines, ticks and words are grey; shades are pale.
HUED = """
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
    const [left, right] = [CHART.left, width - CHART.right];
    return [left - 2, left + 1, right + 1, right - 2].map(column);
"""


def dots_are_whole(page):
    """Half of each dot at an end of the axis lies without the panel."""
    seen = []
    for width in (400, 1200):
        page.window(width, "light")
        counts = page.driver.execute_script(HUED)
        seen.append(f"{counts} pixels at {width} px")
        check(min(counts) > 3, f"dots are cut: {seen[-1]} beside the edges, without and within")
        page.shot(f"dots-{width}")
    return ", ".join(seen)


def main():
    """Run every check on one page."""
    parser = argparse.ArgumentParser(description="Check a page of dots in headless Chromium.")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    page = Chart(arguments.page, arguments.screenshots)
    page.run([
        ("alone", lambda: stands_alone(page)),
        ("dots", lambda: dots_are_whole(page)),
    ])


if __name__ == "__main__":
    main()
