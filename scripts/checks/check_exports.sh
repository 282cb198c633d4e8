#!/bin/sh
# Checks the exports of a result with common programs:
# scripts/checks/check_exports.sh MAP.parquet
#
# SWEEP names the binary; the default is the release build.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
venv=$("$root/scripts/tools/venv.sh" "$here/exports_requirements.txt")
"$venv/bin/python" "$here/check_exports.py" "${SWEEP:-$root/target/release/sweep}" "$1"
