#!/bin/sh
# Installs all that .ci/run needs besides a Rust toolchain, in one go; what is there already stays.
# Each script that needs a tool also installs it for itself.
#
# Needs root or sudo where something is missing; packages are Debian's.
set -eu
packages=
needs() { # PROGRAM PACKAGE ...
    program=$1
    shift
    command -v "$program" > /dev/null || packages="$packages $*"
}
PATH=$PATH:/usr/sbin:/sbin
needs git git
needs c++ g++ libc6-dev
needs nm binutils
# The ignored tests of `cargo test`: faults injected into system calls, disks that fill up.
needs strace strace
needs unshare util-linux
needs mount mount
# scripts/tools/venv.sh
needs python3 python3 python3-venv
# tests/browser
needs chromium chromium
needs chromedriver chromium-driver
# tests/slurm
needs slurmctld slurm-wlm
needs munged munge
# scripts/benchmarks/instructions.sh
needs valgrind valgrind
# scripts/checks/check_arm.sh
needs aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu libc6-dev-arm64-cross
needs qemu-aarch64 qemu-user
# scripts/peers/run.sh; libraries, of which no program tells.
packages="$packages libsundials-dev libboost-dev"
# shellcheck disable=SC2086 # A list of words.
"$(dirname "$0")/packages.sh" $packages
