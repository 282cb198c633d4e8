#!/bin/sh
# Prints sweeps/quick.toml as a grid of 9 points and 4 s by a method:
#
#   scripts/tools/short_grid.sh fast|rk4|dopri5|additive
set -eu
case $1 in
    fast) method='method = "rk4-mass-scaled"\naccuracy = 1e-3' ;;
    rk4) method='method = "rk4"\nstep_s = 2e-4' ;;
    dopri5) method='method = "dopri5"\nrtol = 1e-6\natol = 1e-9' ;;
    additive) method='method = "additive"\nrtol = 1e-4\natol = 1e-7' ;;
    *) echo "no method $1: expected fast, rk4, dopri5 or additive" >&2 && exit 2 ;;
esac
cd "$(dirname "$0")/../.."
exec sed -e '
    s/^end_s = .*/end_s = 4.0/; s/^window_s = .*/window_s = [3.0, 4.0]/
    s/^ramp_s = .*/ramp_s = 4.0/; s/^peak_rpm = .*/peak_rpm = 100.0/
    s/count = 9 }/count = 3, spacing = "log" }/; s/^accuracy = .*//
    s/^ratio_limit = .*/ratio_limit = 1.05/' -e "s/^method = .*/$method/" sweeps/quick.toml
