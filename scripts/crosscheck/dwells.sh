#!/bin/sh
# scripts/crosscheck/dwells.py with what it needs: scripts/crosscheck/dwells.sh [OPTION ...]
#
# As scripts/crosscheck/run.sh.
set -eu
here=$(dirname "$0")
venv=$("$here/../tools/venv.sh" "$here/requirements.txt")
exec "$venv/bin/python" "$here/dwells.py" "$@"
