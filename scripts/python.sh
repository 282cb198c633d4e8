#!/bin/sh
# Runs a Python script of this repository with the packages of scripts/requirements.txt: scripts/python.sh SCRIPT [ARGUMENT ...]
#
# Needs Python 3.11 or newer with venv. The packages go into a virtual environment under target/, once.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
venv=$root/target/venv
wanted=$(cat "$root/scripts/requirements.txt" "$root/docs/recipes/requirements.txt")
if [ "$(cat "$venv/installed" 2> /dev/null)" != "$wanted" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$root/scripts/requirements.txt"
    printf '%s\n' "$wanted" > "$venv/installed"
fi
exec "$venv/bin/python" "$@"
