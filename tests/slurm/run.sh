#!/bin/sh
# A sweep on a real Slurm cluster of two virtual nodes on this host: tests/slurm/run.sh [SCENARIO ...]
#
# Debian's slurm-wlm and munge, without systemd; installed here where they are missing, which needs root, as the daemons do.
# SWEEP names another binary than the release build.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
sweep=${SWEEP:-$here/../../target/release/sweep}

if ! [ -x /usr/sbin/slurmctld ] || ! [ -x /usr/sbin/slurmd ] || ! [ -x /usr/sbin/munged ] || ! command -v python3 >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurm-wlm munge python3 >/dev/null
fi
exec python3 "$here/check.py" "$sweep" "$@"
