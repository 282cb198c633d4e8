#!/bin/sh
# Tests sweeps on a Slurm cluster of two virtual nodes on this host:
# tests/slurm/run.sh [--tasks N] [SCENARIO ...]
#
# Requires root for the daemons, and Debian's packages slurm-wlm and munge, which the script
# installs if they are missing. SWEEP names the binary, by default that of the release build.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)

[ -x /usr/sbin/slurmctld ] && [ -x /usr/sbin/slurmd ] && [ -x /usr/sbin/munged ] \
    || "$root/scripts/tools/packages.sh" slurm-wlm munge
command -v python3 > /dev/null || "$root/scripts/tools/packages.sh" python3
exec python3 "$here/check.py" "${SWEEP:-$root/target/release/sweep}" "$@"
