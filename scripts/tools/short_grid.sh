#!/bin/sh
# Prints sweeps/quick.toml as a grid of 9 points and 4 s by another method:
#
#   scripts/tools/short_grid.sh 'method = "rk4"\nstep_s = 2e-4'
set -eu
cd "$(dirname "$0")/../.."
exec sed -e '
    s/^end_s = .*/end_s = 4.0/; s/^window_s = .*/window_s = [3.0, 4.0]/
    s/^ramp_s = .*/ramp_s = 4.0/; s/^peak_rpm = .*/peak_rpm = 100.0/
    s/count = 9 }/count = 3, spacing = "log" }/; s/^accuracy = .*//
    s/^ratio_limit = .*/ratio_limit = 1.05/' -e "s/^method = .*/$1/" sweeps/quick.toml
