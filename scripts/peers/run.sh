#!/usr/bin/env bash
# One trajectory (trajectory.h) by other programs' integrators and by this project's, through the
# same right-hand side, in one run on one core: error against time. Writes
# results/benchmarks/peers.md, .svg and .jsonl (the raw runs).
#
#     scripts/peers/run.sh [REPEATS | --check]
#
# Medians of so many rounds (3); a run of more than 10 s is done once. --check only sees that all of
# it still runs: one round of a second, written to target/peers.
set -euo pipefail
cd "$(dirname "$0")/../.."
repeats=${1:-3}
if [ "$repeats" = --check ]; then
    repeats=1
    export END_S=1
fi
work=target/peers
mkdir -p "$work"

scripts/tools/packages.sh g++ libsundials-dev libboost-dev
venv=$(scripts/tools/venv.sh scripts/peers/requirements.txt)

# With all crates: alone, one would get other features, and its kernels be compiled once more.
cargo build --release --locked --workspace --lib --bins --example trajectory
flags=(-O3 -march=native -Icrates/washer-capi/include
  -Ltarget/release -Wl,-rpath,"$PWD/target/release")
cc "${flags[@]}" -o "$work/cvode" scripts/peers/cvode.c \
  -lwasher_capi -lsundials_cvode -lsundials_nvecserial -lsundials_sunmatrixdense \
  -lsundials_sunlinsoldense -lm
c++ "${flags[@]}" -o "$work/odeint" scripts/peers/odeint.cpp -lwasher_capi

# The last core that this shell may use; all that follows stays on it.
core=$(taskset -pc $$ | sed 's/.*[,: -]//')
taskset -c "$core" "$venv/bin/python" scripts/peers/compare.py "$repeats"
