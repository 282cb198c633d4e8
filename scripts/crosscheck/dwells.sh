#!/bin/sh
# Runs scripts/crosscheck/dwells.py with its packages: scripts/crosscheck/dwells.sh [OPTION ...]
#
# The requirements are those of scripts/crosscheck/run.sh.
set -eu
here=$(dirname "$0")
venv=$("$here/../tools/venv.sh" "$here/requirements.txt")
exec "$venv/bin/python" "$here/dwells.py" "$@"
