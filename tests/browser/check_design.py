"""A design's page in headless Chromium, held against the Parquet file it was made from.

    python check_design.py DESIGN.parquet PAGE.html [--screenshots FOLDER]

The pointer is moved over the scatter matrix with the browser's own input events; what the page then
says is compared with the file's row of the point that it names. Exits with 1 at the first thing
that is wrong.
"""

import argparse

import pyarrow.parquet as pq
from check_page import Page, check, number_in, same, stands_alone
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

# Names on the page, and the columns that they are of.
SHOWN = {
    "Unbalance mass": "unbalance_mass_kg",
    "Damping": "damping_n_s_per_m",
    "Greatest ratio": "ratio_max",
}


class Design(Page):
    """The page of a scatter matrix."""

    def figure(self):
        return self.driver.find_element(By.CSS_SELECTOR, "#scatter .figure")

    def drawn(self):
        return self.driver.find_elements(By.CSS_SELECTOR, "#scatter svg")

    def tip(self):
        """The point that the tip is for, its verdict, and its values by name."""
        tip = self.driver.find_element(By.CSS_SELECTOR, "#scatter .tip")
        if not tip.is_displayed():
            return None, "", {}
        rows = tip.find_elements(By.CSS_SELECTOR, "tr")
        values = {
            row.find_element(By.TAG_NAME, "th").text: row.find_element(By.TAG_NAME, "td").text
            for row in rows
        }
        verdict = tip.find_element(By.TAG_NAME, "p").text
        return int(tip.get_attribute("data-point")), verdict, values


def as_in_the_file(page, rows):
    """What the tip says is the point's row. The point."""
    point, verdict, values = page.tip()
    check(values.keys() == SHOWN.keys(), f"the tip has {sorted(values)}")
    for words, column in SHOWN.items():
        said, true = number_in(values[words]), rows[column][point]
        check(same(said, true), f"point {point}: {words} {said} for {true}")
    expected = "reliable" if rows["reliable"][point] else "unreliable"
    check(f": {expected}:" in verdict, f"point {point} is said to be {verdict}")
    return point


def hovering_shows_the_file(page, rows):
    """Across a panel, what the pointer finds is as in the file."""
    script = "return arguments[0].getBoundingClientRect().toJSON()"
    bounds = page.driver.execute_script(script, page.figure())
    found = set()
    for x in range(100, int(bounds["width"] * 0.45), 10):
        for y in (80, 160, 240):
            page.mouse("mouseMoved", bounds["left"] + x, bounds["top"] + y)
            page.frame()
            if page.tip()[0] is not None:
                found.add(as_in_the_file(page, rows))
    check(len(found) >= 5, f"the pointer found {len(found)} points")
    return f"{len(found)} points"


def keys_go_from_point_to_point(page, rows):
    """The arrow keys read points too, and Escape lets go."""
    figure = page.figure()
    page.driver.execute_script("arguments[0].focus()", figure)
    found = set()
    for _ in range(5):
        figure.send_keys(Keys.ARROW_RIGHT)
        found.add(as_in_the_file(page, rows))
    figure.send_keys(Keys.ESCAPE)
    check(len(found) == 5 and page.tip()[0] is None, f"the keys found {found}")
    return "5 points"


def counts_are_the_files(page, rows):
    """The legend counts every point, and the influences are of every parameter."""
    items = page.driver.find_elements(By.CSS_SELECTOR, "#scatter svg text")
    text = " ".join(item.text for item in items)
    for verdict, value in [("reliable: below", True), ("unreliable: ratio", False)]:
        count = rows["reliable"].count(value)
        check(count == 0 or f"({count})" in text and verdict in text, f"{count} {verdict}: {text}")
    names = page.driver.find_elements(By.CSS_SELECTOR, "#influence svg text")
    names = {name.text for name in names}
    check(SHOWN.keys() - {"Greatest ratio"} <= names, f"influence of {names}")
    return text


def main():
    """Run every check on one page."""
    parser = argparse.ArgumentParser(
        description="Check a design's page in headless Chromium against its Parquet file."
    )
    parser.add_argument("design")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for pictures of what was seen")
    arguments = parser.parse_args()
    rows = pq.read_table(arguments.design).to_pydict()
    page = Design(arguments.page, arguments.screenshots)
    page.run([
        ("alone", lambda: stands_alone(page)),
        ("hover", lambda: hovering_shows_the_file(page, rows)),
        ("keys", lambda: keys_go_from_point_to_point(page, rows)),
        ("counts", lambda: counts_are_the_files(page, rows)),
    ])


if __name__ == "__main__":
    main()
