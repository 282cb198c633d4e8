#!/bin/sh
# Runs scripts/crosscheck/against_exudyn.py with its packages:
# scripts/crosscheck/run.sh [OPTION ...]
#
# Exudyn is available as wheels for CPython 3.11 to 3.14 on Linux (x86-64), macOS and Windows. The
# script requires the release binary (cargo build --release), or --sweep BINARY.
set -eu
here=$(dirname "$0")
venv=$("$here/../tools/venv.sh" "$here/requirements.txt")
exec "$venv/bin/python" "$here/against_exudyn.py" "$@"
