"""Checks a report in headless Chromium: it fits a sheet of paper and a small screen.

    python check_report.py REPORT.html

Exits with 1 at the first mistake.
"""

import argparse
import base64
import re

from check_page import Page, check
from selenium.webdriver.common.by import By

PAPERS_CM = {"A4": (21.0, 29.7), "letter": (21.59, 27.94)}


class Report(Page):
    """A report, which is a page without scripts."""

    def is_drawn(self):
        return self.driver.find_elements(By.CSS_SELECTOR, "figure img")

    def check_paper(self):
        """Checks that the report fits a sheet of each size."""
        for paper, (width, height) in PAPERS_CM.items():
            options = {"paperWidth": width / 2.54, "paperHeight": height / 2.54}
            pdf = base64.b64decode(self.driver.execute_cdp_cmd("Page.printToPDF", options)["data"])
            pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
            check(pages == 1, f"{pages} pages of {paper}")
        return " and ".join(PAPERS_CM)

    def check_small_screen(self):
        """Checks that nothing is outside of a screen of 400 px."""
        size = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": True}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        outside = self.driver.execute_script(
            "return [...document.querySelectorAll('body *')]"
            ".filter((one) => one.getBoundingClientRect().right > 400.5)"
            ".map((one) => one.outerHTML.slice(0, 80))"
        )
        check(not outside, f"beyond 400 px: {outside[:3]}")
        return "within 400 px"

    def check_fold(self):
        """Checks that digests are hidden in a closed fold."""
        fold = self.driver.find_element(By.TAG_NAME, "details")
        check(fold.get_attribute("open") is None, "the fold of digests is open")
        check("sweep.digest" not in self.driver.find_element(By.TAG_NAME, "body").text, "digests")
        return "digests"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report")
    parser.add_argument("--screenshots", help="folder for screenshots")
    arguments = parser.parse_args()
    page = Report(arguments.report, arguments.screenshots)
    page.run([
        ("printed", page.check_paper),
        ("small", page.check_small_screen),
        ("folded", page.check_fold),
    ])


if __name__ == "__main__":
    main()
