"""Compares the page of a design in headless Chromium with its Parquet file.

    python check_design.py DESIGN.parquet PAGE.html [--screenshots FOLDER]

Input events of the browser move the pointer over the scatter matrix. The values on the page are
compared with the file's row of the same point. Exits with 1 at the first mistake.
"""

import argparse

import pyarrow.parquet as pq
from check_page import Page, check, check_self_contained, is_same, parse_number
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

# The columns by their names on the page.
COLUMNS = {
    "Unbalance mass": "unbalance_mass_kg",
    "Damping": "damping_n_s_per_m",
    "Greatest ratio": "ratio_max",
}


class Design(Page):
    """A page of a scatter matrix."""

    def figure(self):
        return self.driver.find_element(By.CSS_SELECTOR, "#scatter .figure")

    def is_drawn(self):
        return self.driver.find_elements(By.CSS_SELECTOR, "#scatter svg")

    def tip(self):
        """Returns the point of the tip, the verdict, and the values by name."""
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


def check_tip(page, rows):
    """Checks the tip's values and verdict; returns its point."""
    point, verdict, values = page.tip()
    check(values.keys() == COLUMNS.keys(), f"the tip has {sorted(values)}")
    for words, column in COLUMNS.items():
        page_value, file_value = parse_number(values[words]), rows[column][point]
        check(is_same(page_value, file_value),
              f"point {point}: {words} {page_value} for {file_value}")
    expected = "reliable" if rows["reliable"][point] else "unreliable"
    check(f": {expected}:" in verdict, f"point {point} is said to be {verdict}")
    return point


def check_hovering(page, rows):
    """Checks the points that the pointer finds in a panel."""
    script = "return arguments[0].getBoundingClientRect().toJSON()"
    bounds = page.driver.execute_script(script, page.figure())
    found_points = set()
    for x in range(100, int(bounds["width"] * 0.45), 10):
        for y in (80, 160, 240):
            page.send_mouse_event("mouseMoved", bounds["left"] + x, bounds["top"] + y)
            page.wait_for_frame()
            if page.tip()[0] is not None:
                found_points.add(check_tip(page, rows))
    check(len(found_points) >= 5, f"the pointer found {len(found_points)} points")
    return f"{len(found_points)} points"


def check_keys(page, rows):
    """Checks that arrow keys select points, and that Escape hides the tip."""
    figure = page.figure()
    page.driver.execute_script("arguments[0].focus()", figure)
    found_points = set()
    for _ in range(5):
        figure.send_keys(Keys.ARROW_RIGHT)
        found_points.add(check_tip(page, rows))
    figure.send_keys(Keys.ESCAPE)
    check(len(found_points) == 5 and page.tip()[0] is None, f"the keys found {found_points}")
    return "5 points"


def check_counts(page, rows):
    """Checks the counts in the legend and the parameters of the influences."""
    items = page.driver.find_elements(By.CSS_SELECTOR, "#scatter svg text")
    text = " ".join(item.text for item in items)
    for verdict, value in [("reliable: below", True), ("unreliable: ratio", False)]:
        count = rows["reliable"].count(value)
        check(count == 0 or f"({count})" in text and verdict in text, f"{count} {verdict}: {text}")
    names = page.driver.find_elements(By.CSS_SELECTOR, "#influence svg text")
    names = {name.text for name in names}
    check(COLUMNS.keys() - {"Greatest ratio"} <= names, f"influence of {names}")
    return text


def main():
    """Runs all checks on a page."""
    parser = argparse.ArgumentParser(
        description="Check a design's page in headless Chromium against its Parquet file."
    )
    parser.add_argument("design")
    parser.add_argument("page")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    rows = pq.read_table(arguments.design).to_pydict()
    page = Design(arguments.page, arguments.screenshots)
    page.run([
        ("alone", lambda: check_self_contained(page)),
        ("hover", lambda: check_hovering(page, rows)),
        ("keys", lambda: check_keys(page, rows)),
        ("counts", lambda: check_counts(page, rows)),
    ])


if __name__ == "__main__":
    main()
