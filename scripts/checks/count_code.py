#!/usr/bin/env python3
"""Counts lines of code: by crate and by concern, a folder or file of a crate's source.

    python3 scripts/checks/count_code.py [--all] [FOLDER]

Left out are tests, benches, examples, comments and blank lines. Without --all the concerns below a
hundred lines of a crate are one line. JavaScript is that of pages. FOLDER is the project, by
default this one. Python's own library is all it needs.
"""

import pathlib
import re
import sys

HERE = pathlib.Path(__file__).resolve().parent.parent.parent
TEST_FILE = re.compile(r"(^|_)(tests?|plain)(_\w+)?$")
ROOTS = ["lib", "main", "mod"]
TEST_MODULE = re.compile(
    r"#\[cfg\(test\)\]\s*(pub(\(crate\))? )?mod (?P<name>\w+)\s*(?P<kind>[;{])"
)
COMMENT = re.compile(r"^\s*(//|/\*|\*)")
LEAST = 100


def is_test(file, root):
    """Whether a file holds tests alone: by its name or that of a folder, or as a test's module."""
    parent = file.parent.with_suffix(".rs")
    above = [parent] if parent.exists() else [file.parent / f"{name}.rs" for name in ROOTS]
    texts = [one.read_text() for one in above if one.exists() and one != file]
    modules = [match for text in texts for match in TEST_MODULE.finditer(text)]
    if any(match["name"] == file.stem and match["kind"] == ";" for match in modules):
        return True
    return any(TEST_FILE.search(part.removesuffix(".rs")) for part in file.relative_to(root).parts)


def without_test_modules(text):
    """A Rust file without its modules of tests, which stand at its end or in files of their own."""
    found = [match for match in TEST_MODULE.finditer(text) if match["kind"] == "{"]
    return text[: found[0].start()] if found else text


def lines(text):
    """How many lines are code."""
    return sum(1 for line in text.splitlines() if line.strip() and not COMMENT.match(line))


def main(arguments):
    root = pathlib.Path(next((a for a in arguments if not a.startswith("-")), HERE))
    total = 0
    for crate in sorted((root / "crates").iterdir()):
        concerns = {}
        source = crate / "src"
        for file in sorted(source.rglob("*.rs")):
            if not is_test(file, source):
                room = file.relative_to(source).parts[0].removesuffix(".rs")
                count = lines(without_test_modules(file.read_text()))
                concerns[room] = concerns.get(room, 0) + count
        of_crate = sum(concerns.values())
        total += of_crate
        print(f"{of_crate:7}  {crate.name}")
        small = 0
        for room, count in sorted(concerns.items(), key=lambda item: -item[1]):
            if count >= LEAST or "--all" in arguments:
                print(f"{count:15}  {room}")
            else:
                small += count
        if small:
            print(f"{small:15}  in rooms below {LEAST}")
    print(f"{total:7}  lines of Rust")
    scripts = [lines(file.read_text()) for file in (root / "crates").rglob("*.js")]
    print(f"{sum(scripts):7}  lines of JavaScript in {len(scripts)} files")


if __name__ == "__main__":
    main(sys.argv[1:])
