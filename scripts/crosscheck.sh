#!/bin/sh
# scripts/crosscheck_exudyn.py with what it needs, in a virtual environment under target/: scripts/crosscheck.sh [OPTION ...]
#
# Exudyn comes as wheels for CPython 3.11 to 3.14 on Linux (x86-64), macOS and Windows. The first interpreter that takes them is
# used; PYTHON names one. Needs the release binary (cargo build --release), or --sweep BINARY.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
venv=$root/target/crosscheck-venv
requirements=$root/scripts/crosscheck_requirements.txt
if ! cmp -s "$requirements" "$venv/installed"; then
    for python in ${PYTHON:-python3 python3.14 python3.13 python3.12 python3.11}; do
        command -v "$python" > /dev/null || continue
        rm -rf "$venv"
        if "$python" -m venv "$venv" \
            && "$venv/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: -r "$requirements"; then
            cp "$requirements" "$venv/installed"
            break
        fi
        echo "crosscheck: $python ($("$python" --version 2>&1)) does not take Exudyn's wheels" >&2
    done
fi
if [ ! -f "$venv/installed" ]; then
    echo "crosscheck: no interpreter takes the wheels of $requirements: give a CPython 3.11 to 3.14 as PYTHON" >&2
    exit 1
fi
exec "$venv/bin/python" "$root/scripts/crosscheck_exudyn.py" "$@"
