"""Runs the `python` blocks of the package's README and docs/python.md, then the recipes of
docs/python, and holds what these print against their pages.

    python scripts/checks/python_recipes.py [--write]

The blocks of a document are one program, in a folder with `sweeps/` and `crates/`. The first `text`
block of a page holds what its script prints. --write renews these blocks and the pictures beside
them.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PAGES = sorted((ROOT / "docs/python").glob("*.md"))
DOCUMENTS = [ROOT / "crates/washer-sweep/README.md", ROOT / "docs/python.md"]
BLOCK = re.compile(r"(?<=\n```python\n).*?(?=```\n)", re.DOTALL)
OUTPUT = re.compile(r"(?<=\n```text\n).*?(?=```\n)", re.DOTALL)


def run_blocks(document):
    """What goes wrong in the blocks of a document, if anything does."""
    program = "".join(BLOCK.findall(document.read_text()))
    if not program:
        return [f"{document.name} has no `python` block"]
    with tempfile.TemporaryDirectory() as folder:
        for name in ["sweeps", "crates"]:
            pathlib.Path(folder, name).symlink_to(ROOT / name)
        told = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True,
                              text=True, check=False)
    return [f"{document.name} fails:\n{told.stderr}"] if told.returncode != 0 else []


def main():
    """Run all; exit with 1 if a page differs."""
    write = "--write" in sys.argv
    wrong = []
    for document in DOCUMENTS:
        began = time.perf_counter()
        wrong += run_blocks(document)
        print(f"{document.name}: {time.perf_counter() - began:.1f} s")
    scripts = {page.with_suffix(".py") for page in PAGES}
    wrong += [f"{script} has no page" for script in set(ROOT.glob("docs/python/*.py")) - scripts]
    for page in PAGES:
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder, "picture.svg")
            words = [sys.executable, page.with_suffix(".py"), picture]
            told = subprocess.run(words, capture_output=True, text=True, check=False)
            if told.returncode != 0:
                wrong.append(f"{page.stem} fails:\n{told.stderr}")
                continue
            if write:
                page.with_suffix(".svg").write_bytes(picture.read_bytes())
            elif not picture.stat().st_size or not page.with_suffix(".svg").exists():
                wrong.append(f"{page.stem} has drawn nothing, or its page has no picture")
        text = page.read_text()
        shown = OUTPUT.search(text)
        if shown is None or f"({page.stem}.svg)" not in text:
            wrong.append(f"{page.name} shows no output or no picture")
        elif write:
            page.write_text(OUTPUT.sub(lambda _: told.stdout, text, count=1))
        elif shown[0] != told.stdout:
            wrong.append(f"{page.name} shows\n{shown[0]}and the script prints\n{told.stdout}")
        print(f"{page.stem}: {time.perf_counter() - began:.1f} s")
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
