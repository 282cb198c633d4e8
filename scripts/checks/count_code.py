#!/usr/bin/env python3
"""Counts the lines of code of each crate and of each top-level file or folder of its source.

    python3 scripts/checks/count_code.py [--all] [FOLDER]

Tests, benchmarks, examples, comments and blank lines do not count. Without --all, files and folders
of less than a hundred lines are summed up in one line. JavaScript is that of pages. FOLDER is the
project, by default this one. Requires only the standard library.
"""

import pathlib
import re
import sys

THIS_PROJECT = pathlib.Path(__file__).resolve().parent.parent.parent
TEST_FILE = re.compile(r"(^|_)(tests?|plain)(_\w+)?$")
ROOTS = ["lib", "main", "mod"]
TEST_MODULE = re.compile(
    r"#\[cfg\(test\)\]\s*(pub(\(crate\))? )?mod (?P<name>\w+)\s*(?P<kind>[;{])"
)
COMMENT = re.compile(r"^\s*(//|/\*|\*)")
MIN_LISTED_LINES = 100


def is_test(file, root):
    """Returns whether a file has only tests, by a name in its path or as the module of a test."""
    parent = file.parent.with_suffix(".rs")
    parent_files = [parent] if parent.exists() else [file.parent / f"{name}.rs" for name in ROOTS]
    texts = [
        parent_file.read_text()
        for parent_file in parent_files
        if parent_file.exists() and parent_file != file
    ]
    modules = [match for text in texts for match in TEST_MODULE.finditer(text)]
    if any(match["name"] == file.stem and match["kind"] == ";" for match in modules):
        return True
    return any(TEST_FILE.search(part.removesuffix(".rs")) for part in file.relative_to(root).parts)


def without_test_modules(text):
    """Returns the text of a Rust file without the module of tests at its end."""
    matches = [match for match in TEST_MODULE.finditer(text) if match["kind"] == "{"]
    return text[: matches[0].start()] if matches else text


def count_lines(text):
    """Returns the number of lines of code."""
    return sum(1 for line in text.splitlines() if line.strip() and not COMMENT.match(line))


def main(arguments):
    folders = [argument for argument in arguments if not argument.startswith("-")]
    root = pathlib.Path(folders[0] if folders else THIS_PROJECT)
    total = 0
    for crate in sorted((root / "crates").iterdir()):
        concerns = {}
        source = crate / "src"
        for file in sorted(source.rglob("*.rs")):
            if not is_test(file, source):
                room = file.relative_to(source).parts[0].removesuffix(".rs")
                count = count_lines(without_test_modules(file.read_text()))
                concerns[room] = concerns.get(room, 0) + count
        of_crate = sum(concerns.values())
        total += of_crate
        print(f"{of_crate:7}  {crate.name}")
        small = 0
        for room, count in sorted(concerns.items(), key=lambda item: -item[1]):
            if count >= MIN_LISTED_LINES or "--all" in arguments:
                print(f"{count:15}  {room}")
            else:
                small += count
        if small:
            print(f"{small:15}  in rooms below {MIN_LISTED_LINES}")
    print(f"{total:7}  lines of Rust")
    scripts = [count_lines(file.read_text()) for file in (root / "crates").rglob("*.js")]
    print(f"{sum(scripts):7}  lines of JavaScript in {len(scripts)} files")


if __name__ == "__main__":
    main(sys.argv[1:])
