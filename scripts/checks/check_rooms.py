#!/usr/bin/env python3
"""Checks that no two files of a crate import each other, directly or by way of others; and that
the crates that know no machine depend on none that does.

    python3 scripts/checks/check_rooms.py [--draw] [SOURCE_FOLDER ...]

A module's file and the files of its folder are one thing: what a file imports from the modules that
it is in does not count. Tests may import what they like. --draw prints who imports whom, lowest
first. Without a folder it checks every crate's source. Python's own library is all it needs.
"""

import pathlib
import re
import sys
import tomllib
from graphlib import CycleError, TopologicalSorter

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
CHECKED = sorted(ROOT.glob("crates/*/src"))
# Crates that know no machine: none of the crates of the washing machine is below them.
GENERIC = {
    "lane-ode",
    "ode-map",
    "sweep-engine",
    "sweep-files",
    "sweep-parameter",
    "sweep-plot",
    "sweep-results",
}
TEST_FILE = re.compile(r"(^|_)tests(_\w+)?$")
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\s*mod \w+ \{")
USE = re.compile(r"^\s*(?:pub(?:\([^)]*\))? )?use ([^;\"]+);", re.MULTILINE)


def modules(source):
    """The files of a crate that hold no tests, by the names that lead to them."""
    found = {}
    for file in sorted(source.rglob("*.rs")):
        names = [part.removesuffix(".rs") for part in file.relative_to(source).parts]
        if not any(TEST_FILE.search(name) for name in names):
            is_root = names in (["lib"], ["main"])
            found[() if is_root else tuple(name for name in names if name != "mod")] = file
    return found


def code(file):
    """A file's text without comments and without its tests, which stand at its end."""
    return TEST_MODULE.split(re.sub(r"//.*", "", file.read_text()))[0]


def paths(tree):
    """The paths of one `use`: a::{b, c::d} is a::b and a::c::d."""
    head, brace, rest = re.sub(r"\s+", " ", tree).partition("{")
    if not brace:
        return [tree.split(" as ")[0].strip()]
    parts, depth = [""], 0
    for letter in rest[: rest.rindex("}")]:
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [path for part in parts if part.strip() for path in paths(head.strip() + part.strip())]


def handed_on(known):
    """The names that each module has from others, with the paths that lead to them."""
    found = {}
    for own, file in known.items():
        # Not those of blocks and modules within it.
        text = re.sub(r"^\s.*?use .*", "", code(file), flags=re.MULTILINE)
        named = [path for tree in USE.findall(text) for path in paths(tree)]
        found[own] = {path.split("::")[-1]: path for path in named}
    return found


def module(own, path, known, handed):
    """The module that a path leads to from a module, through those that hand its name on."""
    names = path.split("::")
    at = own if names[0] in ("self", "super") else ()
    while names and names[0] in ("self", "super", "crate"):
        at = at[:-1] if names.pop(0) == "super" else at
    if at == () and path.split("::")[0] not in ("crate", "super"):
        at = own
    while names and (*at, names[0]) in known:
        at = (*at, names.pop(0))
    further = handed[at].get(names[0]) if names else None
    return module(at, further, known, handed) if further and at != own else at


def imported(own, text, known, handed):
    """The modules that a file's text names, by `use` or where it stands."""
    named = [path for tree in USE.findall(text) for path in paths(tree)]
    named += re.findall(r"\b(?:crate|super|self)(?:::\w+)+", USE.sub("", text))
    return (module(own, path, known, handed) for path in named)


def imports(source):
    """Of each file, the files that it imports; not those of the modules that it is in."""
    known = modules(source)
    handed = handed_on(known)
    graph = {}
    for own, file in known.items():
        others = set(imported(own, code(file), known, handed))
        # A module's file is made of those in its folder.
        related = [it for it in others if own[: len(it)] == it or it[: len(own)] == own]
        graph[own] = others.difference(related)
    return graph


def check(source, draw):
    """Reports a cycle among the files of a source folder; True if there is none."""
    graph = imports(source)
    said, name = "::".join, source.relative_to(ROOT)
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        # Each imports the one before it.
        cycle = " imports ".join(said(file) or "the root" for file in reversed(error.args[1]))
        print(f"{name}: files import each other: {cycle}", file=sys.stderr)
        return False
    if draw:
        for file in order:
            print(f"{said(file)}: {', '.join(sorted(map(said, graph[file]))) or '-'}")
    arrows = sum(map(len, graph.values()))
    print(f"{name}: {len(graph)} files, {arrows} imports between them, no cycle", file=sys.stderr)
    return True


def layers():
    """Reports generic crates that depend on others than generic ones; True if there is none."""
    crates = {file.parent.name for file in ROOT.glob("crates/*/Cargo.toml")}
    sound = True
    for crate in sorted(GENERIC):
        manifest = tomllib.loads((ROOT / "crates" / crate / "Cargo.toml").read_text())
        for other in sorted((manifest.get("dependencies", {}).keys() & crates) - GENERIC):
            print(f"crates/{crate} depends on {other}, which knows a machine", file=sys.stderr)
            sound = False
    return sound


def main():
    """Check every folder; exit with 1 if files import each other, or layers are not kept."""
    arguments = sys.argv[1:]
    sources = [word for word in arguments if word != "--draw"] or CHECKED
    sound = [check((ROOT / source).resolve(), "--draw" in arguments) for source in sources]
    return 0 if all([*sound, layers()]) else 1


if __name__ == "__main__":
    sys.exit(main())
