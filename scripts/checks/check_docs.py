#!/usr/bin/env python3
"""Checks the documents against each other and against the code.

    python scripts/checks/check_docs.py

Links must have a target. The table of contents of the guide must list every page, and the indexes
of scripts/ and tests/ must list every file. The model page must have the sections, equations,
tables and figures that the code cites. Paths and names in the recipes of CONTRIBUTING.md must
exist. Requires only the standard library.
"""

import pathlib
import re
import subprocess
import sys
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MODEL_PAGE = ROOT / "docs/equations.md"


def find_files(pattern):
    """Returns the paths of the repository's files that match a pattern."""
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", pattern],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )
    return [ROOT / line for line in listing.stdout.splitlines() if (ROOT / line).is_file()]


def without_code(text):
    """Returns the text without code blocks and code spans."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S))


def find_anchors(path):
    """Returns the anchors of a page's headings, as GitHub and GitLab generate them."""
    text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.+)$", text, flags=re.M)
    anchors = set()
    for heading in headings:
        words = re.sub(r"[`*]|\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        anchors.add(re.sub(r"[^\w\- ]", "", words).replace(" ", "-"))
    return anchors


def link_mistakes():
    """Yields mistakes about links within the repository whose target is missing."""
    for page in find_files("*.md"):
        for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text())):
            if re.match(r"[a-z]+:", target):
                continue
            file, _, anchor = target.partition("#")
            target_path = (page.parent / urllib.parse.unquote(file)).resolve() if file else page
            if not target_path.exists():
                yield f"{page.relative_to(ROOT)}: {target} leads nowhere"
            elif anchor and target_path.suffix == ".md" and anchor not in find_anchors(target_path):
                yield f"{page.relative_to(ROOT)}: {target}: there is no such heading"


def contents_mistakes():
    """Yields mistakes about pages that the guide's table of contents omits."""
    summary = (ROOT / "docs/SUMMARY.md").read_text()
    for page in find_files("docs/*.md"):
        name = page.relative_to(ROOT / "docs").as_posix()
        # The README of a folder describes its files and is not a page of the guide.
        if name not in ("SUMMARY.md",) and page.name != "README.md" and f"]({name})" not in summary:
            yield f"docs/SUMMARY.md does not list {name}"


def index_mistakes():
    """Yields mistakes about files of scripts/ and tests/ that their index omits."""
    for folder in ("scripts", "tests"):
        index = (ROOT / folder / "README.md").read_text()
        for file in find_files(f"{folder}/*"):
            if file.name != "README.md" and not re.search(rf"[`/]{re.escape(file.name)}`", index):
                yield f"{folder}/README.md does not name {file.relative_to(ROOT / folder)}"


def find_numbers(text, word):
    """Returns the numbers after `word` in a text: "Eqs. 33 to 35" gives 33, 34 and 35."""
    numbers = set()
    for enumeration in re.findall(rf"\b{word}s?\.? (\d+(?:(?:, | and | to )\d+)*)", text):
        for part in re.split(r", | and ", enumeration):
            ends = [int(end) for end in part.split(" to ")]
            numbers.update(range(ends[0], ends[-1] + 1))
    return numbers


def citation_mistakes():
    """Yields mistakes about citations in the code of items that the model page does not have."""
    page = MODEL_PAGE.read_text()
    sections = {int(number) for number in re.findall(r"^## (\d+)\.", page, flags=re.M)}
    page_text = " ".join(page.split())
    numbers_of_page = {word: find_numbers(page_text, word) for word in ("Eq", "Table", "Fig")}
    for source in find_files("crates/washer-model/src/*.rs"):
        comments = " ".join(re.findall(r"//[/!]? ?(.*)$", source.read_text(), flags=re.M))
        name = source.relative_to(ROOT)
        citation = r"section (\d+) of the model page|model page, section (\d+)"
        for first, second in re.findall(citation, comments):
            if int(first or second) not in sections:
                yield f"{name} cites section {first or second} of the model page, which has none"
        for word, page_numbers in numbers_of_page.items():
            for number in sorted(find_numbers(comments, word) - page_numbers):
                yield f"{name} cites {word}. {number}, which docs/equations.md does not name"


def recipe_mistakes():
    """Yields mistakes about paths and names in the recipes of CONTRIBUTING.md that do not exist.

    A name is looked for in the files that its item names, and without such in all crates.
    """
    page = (ROOT / "CONTRIBUTING.md").read_text()
    recipes = page[page.index("\n## Recipes"):page.index("\n## Fuzzing")]
    all_sources = "\n".join(path.read_text() for path in find_files("crates/*.rs"))
    for item in re.split(r"\n(?=\d\. |- |\n)", recipes):
        spans = [span.replace("\n", " ") for span in re.findall(r"`([^`]+)`", item)]
        sources = []
        for path in (span for span in spans if span.startswith("crates/") and "NAME" not in span):
            target = ROOT / path
            if target.is_file():
                sources.append(target.read_text())
            elif not target.is_dir():
                yield f"CONTRIBUTING.md: there is no {path}"
        text = "\n".join(sources) if sources else all_sources
        names = (re.fullmatch(r"([A-Za-z_]+(?:::[A-Za-z_]+)*)!?", span) for span in spans)
        for name in (match[1] for match in names if match):
            words = [word for word in name.split("::") if "NAME" not in word]
            for word in words:
                if not re.search(rf"\b{word}\b", text):
                    yield f"CONTRIBUTING.md: no `{word}` where a recipe names it"


def main():
    """Prints all mistakes; returns 1 if there are any."""
    mistakes = [*link_mistakes(), *contents_mistakes(), *index_mistakes(), *citation_mistakes(),
                *recipe_mistakes()]
    for line in mistakes:
        print(line, file=sys.stderr)
    print(f"documents: {len(find_files('*.md'))} pages, {len(mistakes)} mistakes", file=sys.stderr)
    return 1 if mistakes else 0


if __name__ == "__main__":
    sys.exit(main())
