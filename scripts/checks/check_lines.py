#!/usr/bin/env python3
"""Checks that no line is longer than 100 columns, and the rules of language.

    python scripts/checks/check_lines.py [--language [CRATE ...]]

--language counts by crate what does not follow the rules of language, and fails nothing; with names
of crates it lists the places in these. Without it, what crates that are clean have of this is a
mistake (`language.py`).

It looks for long lines in code, scripts, configuration and documents by the endings below. It
excepts, because a line break would change what they are:

- rows of Markdown tables, and what `text` blocks of Markdown quote of the program's output,
- a line that is too long only by an address (https://...) in it,
- pages that the program makes ("Made by" in a comment at their top),
- the tests' inputs (`testdata/`, `fuzz/corpus/`).

Python's own library is all it needs.
"""

import pathlib
import re
import subprocess
import sys

import language

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
COLUMNS = 100
ENDINGS = set("rs md py sh toml yml yaml js css html c h cpp".split())
WITHOUT_ENDING = {".ci/run", "justfile"}
INPUTS = re.compile(r"(^|/)testdata/|^fuzz/corpus/")


def checked_files():
    """Paths of the files that the rule is for."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.split("\0")
    for name in sorted(set(listed)):
        wanted = name.rpartition(".")[2] in ENDINGS or name in WITHOUT_ENDING
        if wanted and not INPUTS.search(name) and (ROOT / name).is_file():
            yield name


def long_lines(name):
    """Numbers of the lines that are too long."""
    lines = (ROOT / name).read_text().splitlines()
    markdown = name.endswith(".md")
    if markdown and any("<!-- Made by" in line for line in lines[:5]):
        return
    fence = None
    for number, line in enumerate(lines, 1):
        if markdown and line.startswith("```"):
            fence = None if fence is not None else line.removeprefix("```").strip()
        quoted = markdown and (line.startswith("|") or fence == "text")
        if not quoted and len(re.sub(r"https?://\S+", "", line)) > COLUMNS:
            yield number


def main():
    """Check everything; exit with 1 if anything is wrong."""
    if sys.argv[1:2] == ["--language"]:
        print("\n".join(language.report(sys.argv[2:])))
        return 0
    wrong = [(name, number) for name in checked_files() for number in long_lines(name)]
    for name, number in wrong:
        print(f"{name}:{number}: longer than {COLUMNS} columns", file=sys.stderr)
    unlike = list(language.mistakes())
    for mistake in unlike:
        print(mistake, file=sys.stderr)
    print(f"lines: {len(wrong) + len(unlike)} mistakes", file=sys.stderr)
    return 1 if wrong or unlike else 0


if __name__ == "__main__":
    sys.exit(main())
