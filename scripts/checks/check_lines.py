#!/usr/bin/env python3
"""Checks that no line is longer than 100 columns, and the rules of language.

    python scripts/checks/check_lines.py [--language [CRATE ...]]

With --language the script only counts the deviations from the rules of language by crate; with
names of crates it lists them. Without --language, a deviation in one of the crates that are free of
deviations is a mistake (`language.py`).

Long lines are searched in code, scripts, configuration and documents with the endings below.
Exceptions are lines that a line break would damage:

- rows of Markdown tables, and program output in `text` blocks of Markdown,
- a line that is too long only because of a web address,
- pages that the program generates ("Made by" in a comment at the top),
- inputs of tests (`testdata/`, `fuzz/corpus/`).

Requires only the standard library.
"""

import pathlib
import re
import subprocess
import sys

import language

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MAX_COLUMNS = 100
ENDINGS = set("rs md py sh toml yml yaml js css html c h cpp".split())
FILES_WITHOUT_ENDING = {".ci/run", "justfile"}
TEST_INPUTS = re.compile(r"(^|/)testdata/|^fuzz/corpus/")


def checked_files():
    """Yields the paths of the checked files."""
    listed_paths = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.split("\0")
    for name in sorted(set(listed_paths)):
        is_checked = name.rpartition(".")[2] in ENDINGS or name in FILES_WITHOUT_ENDING
        if is_checked and not TEST_INPUTS.search(name) and (ROOT / name).is_file():
            yield name


def long_lines(name):
    """Yields the numbers of the lines that are too long."""
    lines = (ROOT / name).read_text().splitlines()
    is_markdown = name.endswith(".md")
    if is_markdown and any("<!-- Made by" in line for line in lines[:5]):
        return
    fence = None
    for number, line in enumerate(lines, 1):
        if is_markdown and line.startswith("```"):
            fence = None if fence is not None else line.removeprefix("```").strip()
        is_exempt = is_markdown and (line.startswith("|") or fence == "text")
        if not is_exempt and len(re.sub(r"https?://\S+", "", line)) > MAX_COLUMNS:
            yield number


def main():
    """Prints all mistakes; returns 1 if there are any."""
    if sys.argv[1:2] == ["--language"]:
        print("\n".join(language.report(sys.argv[2:])))
        return 0
    too_long = [(name, number) for name in checked_files() for number in long_lines(name)]
    for name, number in too_long:
        print(f"{name}:{number}: longer than {MAX_COLUMNS} columns", file=sys.stderr)
    deviations = list(language.mistakes())
    for mistake in deviations:
        print(mistake, file=sys.stderr)
    print(f"lines: {len(too_long) + len(deviations)} mistakes", file=sys.stderr)
    return 1 if too_long or deviations else 0


if __name__ == "__main__":
    sys.exit(main())
