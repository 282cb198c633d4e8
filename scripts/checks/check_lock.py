#!/usr/bin/env python3
"""Checks that a crate outside the workspace is built of the workspace's versions.

    python3 scripts/checks/check_lock.py CRATE_FOLDER

Every package of the workspace's Cargo.lock that the crate's own names too has one of the versions
there. The crate's own version is the workspace's. Python's own library is all it needs.
"""

import pathlib
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def versions(folder):
    """Of each locked package, its versions."""
    found = {}
    for package in tomllib.loads((folder / "Cargo.lock").read_text())["package"]:
        found.setdefault(package["name"], set()).add(package["version"])
    return found


def version(manifest, *path):
    """The version that a manifest states."""
    found = tomllib.loads(manifest.read_text())
    for key in path:
        found = found[key]
    return found["version"]


def main():
    """Compare; exit with 1 if anything differs."""
    crate = (ROOT / sys.argv[1]).resolve()
    theirs, own = versions(ROOT), versions(crate)
    shared = theirs.keys() & own.keys()
    wrong = [f"{name} {', '.join(sorted(own[name] - theirs[name]))}; the workspace has "
             f"{', '.join(sorted(theirs[name]))}"
             for name in sorted(shared) if not own[name] <= theirs[name]]
    expected = version(ROOT / "Cargo.toml", "workspace", "package")
    if (found := version(crate / "Cargo.toml", "package")) != expected:
        wrong.append(f"its own version is {found}, the workspace's {expected}")
    for line in wrong:
        print(f"{crate.name}: {line}", file=sys.stderr)
    if wrong:
        print(f"cp Cargo.lock {sys.argv[1]}/ && cargo fetch --manifest-path "
              f"{sys.argv[1]}/Cargo.toml", file=sys.stderr)
    print(f"lock: {len(shared)} packages shared, {len(wrong)} mistakes", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
