#!/bin/sh
# A sweep on a real Slurm cluster of two virtual nodes on this host:
# tests/slurm/run.sh [--tasks N] [SCENARIO ...]
#
# Debian's slurm-wlm and munge, without systemd; installed here where they are missing. The daemons
# need root. SWEEP names another binary than the release build.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)

[ -x /usr/sbin/slurmctld ] && [ -x /usr/sbin/slurmd ] && [ -x /usr/sbin/munged ] \
    || "$root/scripts/tools/packages.sh" slurm-wlm munge
command -v python3 > /dev/null || "$root/scripts/tools/packages.sh" python3
exec python3 "$here/check.py" "${SWEEP:-$root/target/release/sweep}" "$@"
