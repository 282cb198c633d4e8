#!/usr/bin/env python3
"""Checks the documents against each other and the code.

    python scripts/checks/check_docs.py

Links must lead somewhere; the guide must list every page, and the indexes of scripts/ and tests/
every file; sections, equations and tables that the code cites must stand on the model page.
Python's own library is all it needs.
"""

import pathlib
import re
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MODEL_PAGE = ROOT / "docs/equations.md"


def tracked(pattern):
    """Files of the repository."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", pattern],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )
    return [ROOT / line for line in listed.stdout.splitlines() if (ROOT / line).is_file()]


def without_code(text):
    """The text without code blocks and code spans."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S))


def anchors(path):
    """Anchors that a forge makes of a page's headings."""
    text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.M)
    found = set()
    for heading in headings:
        words = re.sub(r"[`*]|\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        found.add(re.sub(r"[^\w\- ]", "", words).replace(" ", "-"))
    return found


def links():
    """Links within the repository that lead nowhere."""
    for page in tracked("*.md"):
        for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text())):
            if re.match(r"[a-z]+:", target):
                continue
            file, _, anchor = target.partition("#")
            there = (page.parent / urllib.parse.unquote(file)).resolve() if file else page
            if not there.exists():
                yield f"{page.relative_to(ROOT)}: {target} leads nowhere"
            elif anchor and there.suffix == ".md" and anchor not in anchors(there):
                yield f"{page.relative_to(ROOT)}: {target}: there is no such heading"


def unlisted():
    """Pages of the guide that its table of contents leaves out."""
    summary = (ROOT / "docs/SUMMARY.md").read_text()
    for page in tracked("docs/*.md"):
        name = page.relative_to(ROOT / "docs").as_posix()
        # A folder's own README explains files beside it to whoever is there.
        if name not in ("SUMMARY.md",) and page.name != "README.md" and f"]({name})" not in summary:
            yield f"docs/SUMMARY.md does not list {name}"


def unindexed():
    """Files of scripts/ and tests/ that the index there does not name."""
    for folder in ("scripts", "tests"):
        index = (ROOT / folder / "README.md").read_text()
        for file in tracked(f"{folder}/*"):
            if file.name != "README.md" and not re.search(rf"[`/]{re.escape(file.name)}`", index):
                yield f"{folder}/README.md does not name {file.relative_to(ROOT / folder)}"


def numbers(text, word):
    """Numbers behind `word`: "Eqs. 33 to 35" and "Eqs. 8, 9 and 10" are three each."""
    found = set()
    for listed in re.findall(rf"\b{word}s?\.? (\d+(?:(?:, | and | to )\d+)*)", text):
        for part in re.split(r", | and ", listed):
            ends = [int(end) for end in part.split(" to ")]
            found.update(range(ends[0], ends[-1] + 1))
    return found


def citations():
    """What the code cites and the model page lacks."""
    page = MODEL_PAGE.read_text()
    sections = {int(number) for number in re.findall(r"^## (\d+)\.", page, flags=re.M)}
    flowing = " ".join(page.split())
    known = {word: numbers(flowing, word) for word in ("Eq", "Table", "Fig")}
    for source in tracked("crates/washer-model/src/*.rs"):
        comments = " ".join(re.findall(r"//[/!]? ?(.*)$", source.read_text(), flags=re.M))
        name = source.relative_to(ROOT)
        cited = r"section (\d+) of the model page|model page, section (\d+)"
        for before, after in re.findall(cited, comments):
            if int(before or after) not in sections:
                yield f"{name} cites section {before or after} of the model page, which has none"
        for word, there in known.items():
            for number in sorted(numbers(comments, word) - there):
                yield f"{name} cites {word}. {number}, which docs/equations.md does not name"


def main():
    """Check everything; exit with 1 if anything is wrong."""
    wrong = [*links(), *unlisted(), *unindexed(), *citations()]
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"documents: {len(tracked('*.md'))} pages, {len(wrong)} mistakes", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
