#!/bin/sh
# scripts/crosscheck_exudyn.py with what it needs, in a virtual environment under target/: scripts/crosscheck.sh [OPTION ...]
#
# PYTHON names an interpreter for which Exudyn has wheels; the default is python3.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
venv=$root/target/crosscheck-venv
if [ ! -x "$venv/bin/python" ]; then "${PYTHON:-python3}" -m venv "$venv"; fi
"$venv/bin/pip" install --quiet --disable-pip-version-check -r "$root/scripts/crosscheck_requirements.txt"
exec "$venv/bin/python" "$root/scripts/crosscheck_exudyn.py" "$@"
