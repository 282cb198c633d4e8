#!/bin/sh
# Installs the missing tools of .ci/run, except for the Rust toolchain. Each script that needs a
# tool also installs it.
#
# Requires root or sudo if a tool is missing. The names of packages are those of Debian.
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
# Ignored tests of `cargo test`, which inject faults into system calls or fill a disk.
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
# scripts/peers/run.sh: libraries without a program by which they could be found.
packages="$packages libsundials-dev libboost-dev"
# shellcheck disable=SC2086 # A list of words.
"$(dirname "$0")/packages.sh" $packages
