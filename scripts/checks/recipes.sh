#!/bin/sh
# Every reading recipe, as a reader runs it, and all held against each other:
# scripts/checks/recipes.sh MAP.parquet
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
python=$root/scripts/tools/python.sh
map=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for recipe in "$root"/docs/recipes/with_*.py; do
    "$python" "$recipe" "$map" 0.6 "$work/$(basename "$recipe").png" > "$work/out" || {
        cat "$work/out"
        exit 1
    }
    echo "$(basename "$recipe"): $(tail -1 "$work/out")"
done
# The one that draws has drawn, and so has the script that stands beside the recipes.
test -s "$work/with_xarray.py.png"
"$python" "$root/scripts/figures/plot_map.py" "$map" -o "$work/map.png"
test -s "$work/map.png"
"$python" "$root/scripts/checks/check_recipes.py" "$map"
