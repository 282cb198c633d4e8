#!/bin/sh
# Checks the pages of a map, a trace, a design, dwells and a report, and live pages, in a browser:
# tests/browser/run.sh MAP.parquet [TRACES_FOLDER]
#
# MAP.parquet is the result of sweeps/quick.toml, or of another grid over the same axes.
#
# Requires chromium and chromedriver on the PATH; on Debian the script installs missing ones. SWEEP
# names the binary, by default that of the release build; SHOTS names a folder for screenshots.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
sweep=${SWEEP:-$root/target/release/sweep}
map=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

command -v chromium > /dev/null && command -v chromedriver > /dev/null \
    || "$root/scripts/tools/packages.sh" chromium chromium-driver
venv=$("$root/scripts/tools/venv.sh" "$here/requirements.txt")

if [ $# -gt 1 ]; then
    "$sweep" plot "$map" --traces "$2" -o "$folder/page.html"
else
    "$sweep" plot "$map" -o "$folder/page.html"
fi
"$venv/bin/python" "$here/check_page.py" "$map" "$folder/page.html" ${SHOTS:+--screenshots "$SHOTS"}

# Checks the page of a trace, with curves and marks of resonance passages.
"$sweep" modes --speed 0:400:50 --out "$folder/modes.parquet" > /dev/null 2>&1
"$sweep" trace "$root/sweeps/fig11.toml" --every 0.02 --out "$folder/trace.parquet"
"$sweep" plot "$folder/trace.parquet" --modes "$folder/modes.parquet" -o "$folder/trace.html"
"$venv/bin/python" "$here/check_chart.py" "$folder/trace.parquet" "$folder/trace.html" \
    ${SHOTS:+--screenshots "$SHOTS"}

# Checks a live page by the map and by the trace of a point between the points of the map.
"$sweep" plot "$map" --live -o "$folder/live.html"
"$sweep" trace "$root/sweeps/quick.toml" --at unbalance_mass_kg=0.12 --at damping_n_s_per_m=222 \
    --out "$folder/between.parquet"
"$sweep" stability "$root/sweeps/quick.toml" --speed 210:250:20 --out "$folder/stability.parquet" \
    --progress none
"$venv/bin/python" "$here/check_live.py" "$map" "$folder/between.parquet" \
    "$folder/stability.parquet" "$folder/live.html" ${SHOTS:+--screenshots "$SHOTS"}

# Checks live pages of random machines, with a logarithmic axis.
"$venv/bin/python" "$here/random_points.py" "$sweep" --maps 2

# Checks growth and dwells at constant speeds, for machines without and with friction.
"$venv/bin/python" "$here/check_held.py" "$sweep" ${SHOTS:+--screenshots "$SHOTS"}

# Checks the page of a design: the scatter matrix, the histogram and the influences.
cat > "$folder/design.toml" << 'END'
name = "design"
spin = { profile = "triangular", peak_rpm = 350, ramp_s = 50 }
time = { end_s = 50, window_s = [30, 50] }
design = { method = "latin_hypercube", points = 60 }
[[axis]]
parameter = "unbalance_mass_kg"
range = { from = 0.1, to = 1.0 }
[[axis]]
parameter = "damping_n_s_per_m"
range = { from = 60, to = 300 }
END
"$sweep" run "$folder/design.toml" --out "$folder/design.parquet" --progress none
"$sweep" plot "$folder/design.parquet" -o "$folder/design.html"
"$venv/bin/python" "$here/check_design.py" "$folder/design.parquet" "$folder/design.html" \
    ${SHOTS:+--screenshots "$SHOTS"}

# Checks the page of dwells, whose dots are also at the least and the greatest speed.
"$sweep" dwell "$root/sweeps/quick.toml" --at unbalance_mass_kg=0.4 --at damping_n_s_per_m=130 \
    --speed 200:300:25 --starts 4 --out "$folder/dwell.parquet" --progress none
"$sweep" plot "$folder/dwell.parquet" -o "$folder/dwell.html"
"$venv/bin/python" "$here/check_dots.py" "$folder/dwell.html" ${SHOTS:+--screenshots "$SHOTS"}

# Checks a report with several figures, which must fit a printed page.
"$sweep" trace "$root/sweeps/quick.toml" --point 40 --out "$folder/point.parquet"
"$sweep" report "$map" "$folder/modes.parquet" "$folder/point.parquet" -o "$folder/report.html"
"$venv/bin/python" "$here/check_report.py" "$folder/report.html" ${SHOTS:+--screenshots "$SHOTS"}
