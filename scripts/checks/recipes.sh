#!/bin/sh
# Runs every reading recipe as a script, and compares the recipes with each other:
# scripts/checks/recipes.sh MAP.parquet
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
python=$root/scripts/tools/python.sh
map=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

for recipe in "$root"/docs/recipes/with_*.py; do
    "$python" "$recipe" "$map" 0.6 "$folder/$(basename "$recipe").png" > "$folder/out" || {
        cat "$folder/out"
        exit 1
    }
    echo "$(basename "$recipe"): $(tail -1 "$folder/out")"
done
# One recipe and plot_map.py draw a picture.
test -s "$folder/with_xarray.py.png"
"$python" "$root/scripts/figures/plot_map.py" "$map" -o "$folder/map.png"
test -s "$folder/map.png"
"$python" "$root/scripts/checks/check_recipes.py" "$map"
