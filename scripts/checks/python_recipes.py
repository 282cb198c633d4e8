"""Runs the `python` blocks of the package's README and of docs/python.md, then the recipes of
docs/python, and compares the output of the recipes with their pages.

    python scripts/checks/python_recipes.py [--write]

The blocks of a document are run as one program, in a folder with `sweeps/` and `crates/`. The first
`text` block of a page has the output of its script. With --write the script updates these blocks
and the pictures of the pages.
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
    """Runs the blocks of a document; returns a list of its mistakes."""
    program = "".join(BLOCK.findall(document.read_text()))
    if not program:
        return [f"{document.name} has no `python` block"]
    with tempfile.TemporaryDirectory() as folder:
        for name in ["sweeps", "crates"]:
            pathlib.Path(folder, name).symlink_to(ROOT / name)
        completed = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True,
                              text=True, check=False)
    return [f"{document.name} fails:\n{completed.stderr}"] if completed.returncode != 0 else []


def main():
    """Runs all blocks and recipes; returns 1 if there are mistakes."""
    must_write = "--write" in sys.argv
    mistakes = []
    for document in DOCUMENTS:
        start_s = time.perf_counter()
        mistakes += run_blocks(document)
        print(f"{document.name}: {time.perf_counter() - start_s:.1f} s")
    scripts = {page.with_suffix(".py") for page in PAGES}
    mistakes += [f"{script} has no page" for script in set(ROOT.glob("docs/python/*.py")) - scripts]
    for page in PAGES:
        start_s = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder, "picture.svg")
            words = [sys.executable, page.with_suffix(".py"), picture]
            completed = subprocess.run(words, capture_output=True, text=True, check=False)
            if completed.returncode != 0:
                mistakes.append(f"{page.stem} fails:\n{completed.stderr}")
                continue
            if must_write:
                page.with_suffix(".svg").write_bytes(picture.read_bytes())
            elif not picture.stat().st_size or not page.with_suffix(".svg").exists():
                mistakes.append(f"{page.stem} has drawn nothing, or its page has no picture")
        text = page.read_text()
        output_block = OUTPUT.search(text)
        if output_block is None or f"({page.stem}.svg)" not in text:
            mistakes.append(f"{page.name} shows no output or no picture")
        elif must_write:
            page.write_text(OUTPUT.sub(lambda _: completed.stdout, text, count=1))
        elif output_block[0] != completed.stdout:
            mistakes.append(f"{page.name} shows\n{output_block[0]}"
                            f"and the script prints\n{completed.stdout}")
        print(f"{page.stem}: {time.perf_counter() - start_s:.1f} s")
    for line in mistakes:
        print(line, file=sys.stderr)
    return 1 if mistakes else 0


if __name__ == "__main__":
    sys.exit(main())
