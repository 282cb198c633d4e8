#!/usr/bin/env python3
"""Checks that no two rooms of a crate import each other, directly or by way of others; and that
the engine has no word of the machine that it sweeps.

    python3 scripts/checks/check_rooms.py [--draw] [SOURCE_FOLDER ...]

A room is a top-level module with all that is below it. Tests may import what they like. --draw
prints who imports whom, lowest rooms first, each with the number of files that import it. Without
a folder it checks every crate's source. Python's own library is all it needs.
"""

import pathlib
import re
import sys
from graphlib import CycleError, TopologicalSorter

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
CHECKED = sorted(ROOT.glob("crates/*/src"))
# The crate's root and the program, which may import every room.
ROOTS = {"lib", "main"}
# Crates that know no machine, and words that would say otherwise.
ENGINE = ["sweep-engine", "ode-map"]
MACHINE = re.compile(r"(?<![a-z])(washer|drum|tub|rpm)s?(?![a-z])", re.IGNORECASE)
TEST_FILE = re.compile(r"(^|_)tests(_\w+)?\.rs$")
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\s*mod \w+ \{")


def room_of(file, source):
    """The top-level module that a file belongs to."""
    return file.relative_to(source).parts[0].removesuffix(".rs")


def code(file):
    """A file's text without comments and without its tests, which stand at its end."""
    return TEST_MODULE.split(re.sub(r"//.*", "", file.read_text()))[0]


def imported(text):
    """Names right behind `crate::`, alone or in a list."""
    for alone, listed in re.findall(r"\bcrate::(?:(\w+)|\{([^;]*)\})", text):
        if alone:
            yield alone
        # Of a::{b, c} only a is a room.
        yield from re.findall(r"(?:^|,)\s*(\w+)", re.sub(r"\{[^{}]*\}", "", listed))


def imports(source):
    """Of each room, the rooms that it imports, with the files that do."""
    files = [file for file in sorted(source.rglob("*.rs")) if not TEST_FILE.search(file.name)]
    rooms = {room_of(file, source) for file in files} - ROOTS
    graph = {room: {} for room in sorted(rooms)}
    for file in files:
        room = room_of(file, source)
        for other in imported(code(file)) if room in rooms else ():
            if other in rooms - {room}:
                graph[room].setdefault(other, set()).add(file.relative_to(source))
    return graph


def check(source, draw):
    """Reports a cycle among the rooms of a source folder; True if there is none."""
    graph = imports(source)
    arrows = sum(map(len, graph.values()))
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        # Each imports the one before it.
        cycle = list(reversed(error.args[1]))
        print(f"{source.relative_to(ROOT)}: rooms import each other:", file=sys.stderr)
        for room, other in zip(cycle, cycle[1:]):
            files = ", ".join(str(file) for file in sorted(graph[room][other]))
            print(f"  {room} imports {other} in {files}", file=sys.stderr)
        return False
    if draw:
        for room in order:
            listed = (f"{other} ({len(graph[room][other])})" for other in sorted(graph[room]))
            print(f"{room}: {', '.join(listed) or '-'}")
    name = source.relative_to(ROOT)
    print(f"{name}: {len(graph)} rooms, {arrows} imports between them, no cycle", file=sys.stderr)
    return True


def words():
    """Reports words of a machine in the crates that know none; True if there is none."""
    sound = True
    for file in sorted(file for name in ENGINE for file in (ROOT / "crates" / name).rglob("*.rs")):
        for number, line in enumerate(file.read_text().splitlines(), 1):
            if found := MACHINE.search(line):
                print(f"{file.relative_to(ROOT)}:{number}: {found[0]}", file=sys.stderr)
                sound = False
    return sound


def main():
    """Check every folder; exit with 1 if rooms of any import each other, or know a machine."""
    arguments = sys.argv[1:]
    sources = [word for word in arguments if word != "--draw"] or CHECKED
    sound = [check((ROOT / source).resolve(), "--draw" in arguments) for source in sources]
    return 0 if all([*sound, words()]) else 1


if __name__ == "__main__":
    sys.exit(main())
