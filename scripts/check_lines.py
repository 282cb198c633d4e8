#!/usr/bin/env python3
"""Checks that no line of the repository is longer than 100 columns.

    python scripts/check_lines.py [--write]

It looks at code, scripts, configuration and documents by the endings below. It excepts, because
a line break would change what they are:

- rows of Markdown tables, and what `text` blocks of Markdown quote of the program's output,
- a line that is too long only by an address (https://...) in it,
- pages that the program makes ("Made by" in a comment at their top),
- the tests' inputs (`testdata/`, `fuzz/corpus/`).

scripts/long_lines.txt lists files that are still over. It only shrinks: a file that is listed and
has become short enough must leave it, which --write does. Python's own library is all it needs.
"""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ALLOWED = ROOT / "scripts/long_lines.txt"
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
    over = {name: found for name in checked_files() if (found := list(long_lines(name)))}
    allowed = set(ALLOWED.read_text().split()) if ALLOWED.exists() else set()
    fits = sorted(allowed - over.keys())
    if fits and "--write" in sys.argv[1:]:
        ALLOWED.write_text("".join(f"{name}\n" for name in sorted(allowed & over.keys())))
        print(f"scripts/long_lines.txt: {len(fits)} files left it", file=sys.stderr)
        fits = []
    wrong = [f"{name}:{number}: longer than {COLUMNS} columns"
             for name in sorted(over.keys() - allowed) for number in over[name]]
    wrong += [f"scripts/long_lines.txt lists {name}, which fits: scripts/check_lines.py --write"
              for name in fits]
    for line in wrong:
        print(line, file=sys.stderr)
    late = sum(len(over[name]) for name in over.keys() & allowed)
    print(f"lines: {len(wrong)} mistakes; {late} long lines in {len(over.keys() & allowed)} files "
          "that scripts/long_lines.txt still allows", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
