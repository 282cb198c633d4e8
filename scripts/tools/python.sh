#!/bin/sh
# Runs a Python script of this repository with the packages of scripts/tools/requirements.txt:
# scripts/tools/python.sh SCRIPT [ARGUMENT ...]
set -eu
here=$(dirname "$0")
venv=$("$here/venv.sh" "$here/requirements.txt")
exec "$venv/bin/python" "$@"
