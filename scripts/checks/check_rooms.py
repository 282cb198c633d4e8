#!/usr/bin/env python3
"""Checks that the files of a crate have no cyclic imports, and that the crates that are independent
of the washing machine do not depend on its crates.

    python3 scripts/checks/check_rooms.py [--draw] [SOURCE_FOLDER ...]

The files of a module and of its folder count as one unit, so that imports within a unit do not
count. Tests may import any file. With --draw the script prints the imports of each file; imported
files come first. Without a folder it checks the sources of all crates. Requires only the standard
library.
"""

import pathlib
import re
import sys
import tomllib
from graphlib import CycleError, TopologicalSorter

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
SOURCE_FOLDERS = sorted(ROOT.glob("crates/*/src"))
# Crates that must not depend on the crates of the washing machine.
GENERIC_CRATES = {
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


def find_modules(source):
    """Returns the files of a crate without tests, by the names of their module paths."""
    file_by_module = {}
    for file in sorted(source.rglob("*.rs")):
        names = [part.removesuffix(".rs") for part in file.relative_to(source).parts]
        if not any(TEST_FILE.search(name) for name in names):
            is_root = names in (["lib"], ["main"])
            file_by_module[() if is_root else tuple(name for name in names if name != "mod")] = file
    return file_by_module


def read_code(file):
    """Returns a file's text without comments and without the tests at its end."""
    return TEST_MODULE.split(re.sub(r"//.*", "", file.read_text()))[0]


def split_paths(use_tree):
    """Returns the paths of a `use`: a::{b, c::d} gives a::b and a::c::d."""
    prefix, brace, group = re.sub(r"\s+", " ", use_tree).partition("{")
    if not brace:
        return [use_tree.split(" as ")[0].strip()]
    parts, depth = [""], 0
    for letter in group[: group.rindex("}")]:
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [
        path
        for part in parts
        if part.strip()
        for path in split_paths(prefix.strip() + part.strip())
    ]


def find_top_level_imports(file_by_module):
    """Returns by module the names that it imports at its top level, with their paths."""
    imports_of_modules = {}
    for own_module, file in file_by_module.items():
        # Imports within blocks and inner modules are indented, and are removed.
        text = re.sub(r"^\s.*?use .*", "", read_code(file), flags=re.MULTILINE)
        used_paths = [path for use_tree in USE.findall(text) for path in split_paths(use_tree)]
        imports_of_modules[own_module] = {path.split("::")[-1]: path for path in used_paths}
    return imports_of_modules


def resolve_module(own_module, path, file_by_module, imports_of_modules):
    """Returns the module that a path in a module refers to, through re-exports of its name."""
    names = path.split("::")
    module = own_module if names[0] in ("self", "super") else ()
    while names and names[0] in ("self", "super", "crate"):
        module = module[:-1] if names.pop(0) == "super" else module
    if module == () and path.split("::")[0] not in ("crate", "super"):
        module = own_module
    while names and (*module, names[0]) in file_by_module:
        module = (*module, names.pop(0))
    imported_path = imports_of_modules[module].get(names[0]) if names else None
    if imported_path and module != own_module:
        return resolve_module(module, imported_path, file_by_module, imports_of_modules)
    return module


def imported_modules(own_module, text, file_by_module, imports_of_modules):
    """Yields the modules of all paths in a file's text."""
    used_paths = [path for use_tree in USE.findall(text) for path in split_paths(use_tree)]
    used_paths += re.findall(r"\b(?:crate|super|self)(?:::\w+)+", USE.sub("", text))
    return (
        resolve_module(own_module, path, file_by_module, imports_of_modules) for path in used_paths
    )


def find_imports(source):
    """Returns by file the files that it imports from other units."""
    file_by_module = find_modules(source)
    imports_of_modules = find_top_level_imports(file_by_module)
    graph = {}
    for own_module, file in file_by_module.items():
        text = read_code(file)
        imported = set(imported_modules(own_module, text, file_by_module, imports_of_modules))
        # A module's file and the files of its folder are one unit.
        related = [
            other
            for other in imported
            if own_module[: len(other)] == other or other[: len(own_module)] == own_module
        ]
        graph[own_module] = imported.difference(related)
    return graph


def check_cycles(source, must_draw):
    """Prints a cycle among the files of a source folder; returns whether there is none."""
    graph = find_imports(source)
    join_names, name = "::".join, source.relative_to(ROOT)
    try:
        order = list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        # Each file imports the file before it.
        cycle = " imports ".join(join_names(file) or "the root" for file in reversed(error.args[1]))
        print(f"{name}: files import each other: {cycle}", file=sys.stderr)
        return False
    if must_draw:
        for file in order:
            print(f"{join_names(file)}: {', '.join(sorted(map(join_names, graph[file]))) or '-'}")
    import_count = sum(map(len, graph.values()))
    summary = f"{name}: {len(graph)} files, {import_count} imports between them, no cycle"
    print(summary, file=sys.stderr)
    return True


def check_dependencies():
    """Prints dependencies of generic crates on other crates; returns whether there are none."""
    crates = {file.parent.name for file in ROOT.glob("crates/*/Cargo.toml")}
    is_generic = True
    for crate in sorted(GENERIC_CRATES):
        manifest = tomllib.loads((ROOT / "crates" / crate / "Cargo.toml").read_text())
        for other in sorted((manifest.get("dependencies", {}).keys() & crates) - GENERIC_CRATES):
            print(f"crates/{crate} depends on {other}, which is not generic", file=sys.stderr)
            is_generic = False
    return is_generic


def main():
    """Checks all folders and dependencies; returns 1 if there are mistakes."""
    arguments = sys.argv[1:]
    sources = [word for word in arguments if word != "--draw"] or SOURCE_FOLDERS
    must_draw = "--draw" in arguments
    is_acyclic = [check_cycles((ROOT / source).resolve(), must_draw) for source in sources]
    return 0 if all([*is_acyclic, check_dependencies()]) else 1


if __name__ == "__main__":
    sys.exit(main())
