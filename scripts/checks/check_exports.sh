#!/bin/sh
# Exports of a result, opened by the programs that people open them with:
# scripts/checks/check_exports.sh MAP.parquet
#
# SWEEP names another binary than the release build.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
venv=$("$root/scripts/tools/venv.sh" "$here/exports_requirements.txt")
"$venv/bin/python" "$here/check_exports.py" "${SWEEP:-$root/target/release/sweep}" "$1"
