#!/bin/sh
# Every reading recipe, as a reader runs it, and all held against each other: scripts/recipes.sh MAP.parquet
#
# Needs Python 3.11 or newer with venv; what else it needs goes into a virtual environment under target/.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
venv=$root/target/recipes-venv
map=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

if [ ! -x "$venv/bin/python" ]; then python3 -m venv "$venv"; fi
"$venv/bin/pip" install --quiet --disable-pip-version-check -r "$root/docs/recipes/requirements.txt"

for recipe in "$root"/docs/recipes/with_*.py; do
    "$venv/bin/python" "$recipe" "$map" 0.6 "$work/$(basename "$recipe").png" > "$work/out" || {
        cat "$work/out"
        exit 1
    }
    echo "$(basename "$recipe"): $(tail -1 "$work/out")"
done
# The one that draws has drawn, and so has the script that stands beside the recipes.
test -s "$work/with_xarray.py.png"
"$venv/bin/python" "$root/scripts/plot_map.py" "$map" -o "$work/map.png"
test -s "$work/map.png"
"$venv/bin/python" "$root/scripts/check_recipes.py" "$map"
