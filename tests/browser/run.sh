#!/bin/sh
# The pages of a map, of a trace, of a design, of dwells and of a report, and one that computes, in
# a browser:
# tests/browser/run.sh MAP.parquet [TRACES_FOLDER]
#
# MAP.parquet is the result of sweeps/quick.toml, or of another grid over the same axes.
#
# Needs chromium and chromedriver on the PATH, and on Debian installs them if they are not there.
# SWEEP names another binary than the release build, SHOTS a folder for screenshots.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
sweep=${SWEEP:-$root/target/release/sweep}
map=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

command -v chromium > /dev/null && command -v chromedriver > /dev/null \
    || "$root/scripts/tools/packages.sh" chromium chromium-driver
venv=$("$root/scripts/tools/venv.sh" "$here/requirements.txt")

if [ $# -gt 1 ]; then
    "$sweep" plot "$map" --traces "$2" -o "$work/page.html"
else
    "$sweep" plot "$map" -o "$work/page.html"
fi
"$venv/bin/python" "$here/check_page.py" "$map" "$work/page.html" ${SHOTS:+--screenshots "$SHOTS"}

# The page of a trace: curves, with resonance passages marked.
"$sweep" modes --speed 0:400:50 --out "$work/modes.parquet" > /dev/null 2>&1
"$sweep" trace "$root/sweeps/fig11.toml" --every 0.02 --out "$work/trace.parquet"
"$sweep" plot "$work/trace.parquet" --modes "$work/modes.parquet" -o "$work/trace.html"
"$venv/bin/python" "$here/check_chart.py" "$work/trace.parquet" "$work/trace.html" \
    ${SHOTS:+--screenshots "$SHOTS"}

# A page that computes, against the map and the trace of a point between its own.
"$sweep" plot "$map" --live -o "$work/live.html"
"$sweep" trace "$root/sweeps/quick.toml" --at unbalance_mass_kg=0.12 --at damping_n_s_per_m=222 \
    --out "$work/between.parquet"
"$sweep" stability "$root/sweeps/quick.toml" --speed 210:250:20 --out "$work/stability.parquet" \
    --progress none
"$venv/bin/python" "$here/check_live.py" "$map" "$work/between.parquet" \
    "$work/stability.parquet" "$work/live.html" ${SHOTS:+--screenshots "$SHOTS"}

# The same of random machines, along an axis that is logarithmic.
"$venv/bin/python" "$here/random_points.py" "$sweep" --maps 2

# Growth and dwells at constant speeds, of machines without and with friction.
"$venv/bin/python" "$here/check_held.py" "$sweep" ${SHOTS:+--screenshots "$SHOTS"}

# The page of a design: points by pairs of parameters, the histogram, the influences.
cat > "$work/design.toml" << 'END'
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
"$sweep" run "$work/design.toml" --out "$work/design.parquet" --progress none
"$sweep" plot "$work/design.parquet" -o "$work/design.html"
"$venv/bin/python" "$here/check_design.py" "$work/design.parquet" "$work/design.html" \
    ${SHOTS:+--screenshots "$SHOTS"}

# The page of dwells: dots over the speed, at its least and greatest too.
"$sweep" dwell "$root/sweeps/quick.toml" --at unbalance_mass_kg=0.4 --at damping_n_s_per_m=130 \
    --speed 200:300:25 --starts 4 --out "$work/dwell.parquet" --progress none
"$sweep" plot "$work/dwell.parquet" -o "$work/dwell.html"
"$venv/bin/python" "$here/check_dots.py" "$work/dwell.html" ${SHOTS:+--screenshots "$SHOTS"}

# A report with figures beside the map's: one page to print.
"$sweep" trace "$root/sweeps/quick.toml" --point 40 --out "$work/point.parquet"
"$sweep" report "$map" "$work/modes.parquet" "$work/point.parquet" -o "$work/report.html"
"$venv/bin/python" "$here/check_report.py" "$work/report.html" ${SHOTS:+--screenshots "$SHOTS"}
